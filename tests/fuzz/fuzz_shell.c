// libFuzzer target: any bytes as OBJ or STL give either one line of error or a closed surface.
#include "core/scene/mesh_file.h"
#include "tests/fuzz/fuzz.h"
#include <stdint.h>
#include <string.h>

static void judge(const char *name, const uint8_t *data, size_t size)
{
    char error[512] = "";
    kn_shell *s = kn_shell_read(name, data, size, error, sizeof error);
    if (!s) {
        require(strncmp(error, name, strlen(name)) == 0 && error[strlen(name)] == ':');
        for (const char *c = error; *c; c++) require(*c >= ' ' && *c <= '~');
        return;
    }
    // parity over the vertices at the ends of all edges: a closed surface has three edges for two triangles
    int odd = 0;
    for (int t = 0; t < s->triangle_count; t++)
        for (int k = 0; k < 3; k++) {
            require(s->triangle[t][k] >= 0 && s->triangle[t][k] < s->vertex_count);
            odd ^= s->triangle[t][k] ^ s->triangle[t][(k + 1) % 3];
        }
    require(odd == 0 && s->triangle_count % 2 == 0 && s->vertex_count >= 3);
    kn_shell_destroy(s);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    judge("f.obj", data, size);
    judge("f.stl", data, size);
    return 0;
}
