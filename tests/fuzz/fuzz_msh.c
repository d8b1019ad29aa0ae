// libFuzzer target: any bytes give either one line of error, or a mesh that a lattice can be built from, no larger
// than the input.
#include "core/scene/mesh_file.h"
#include "tests/fuzz/fuzz.h"
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    char error[512] = "";
    kn_msh_facts facts;
    kn_simplices_measures m;
    kn_simplices *s = kn_msh_read("f.msh", data, size, 1000, &facts, error, sizeof error);
    if (!s) {
        require(strncmp(error, "f.msh:", 6) == 0);
        for (const char *c = error; *c; c++) require(*c >= ' ' && *c <= '~');
        return 0;
    }
    require(kn_simplices_check(s, error, sizeof error));
    require(kn_simplices_measure(s, &m) && m.volume > 0 && m.edge_min_m > 0);
    require(m.quality_min >= KN_SIMPLICES_QUALITY_MIN && m.quality_mean < 1 + 1e-9);
    require((size_t)s->node_count * 8 <= size && (size_t)(s->element_count + facts.left_out) * 4 <= size);
    kn_simplices_destroy(s);
    return 0;
}
