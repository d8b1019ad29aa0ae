#include "core/scene/mesh_file.h"
#include "tests/check.h"

#include <dirent.h>

#define HERE KN_SOURCE_DIR "/tests/core/"
static char error[512];

static const char *const cubes[] = {HERE "meshes/cube-22.msh", HERE "meshes/cube-41.msh",
                                    HERE "meshes/cube-22-binary.msh", HERE "meshes/cube-41-binary.msh"};

static kn_simplices *read_text(const char *text, kn_msh_facts *facts)
{
    snprintf(error, sizeof error, "%s", "");
    return kn_msh_read("t.msh", text, strlen(text), 1, facts, error, sizeof error);
}

static int same(const kn_simplices *a, const kn_simplices *b)
{
    return a && b && a->dimension == b->dimension && a->node_count == b->node_count &&
           a->element_count == b->element_count &&
           memcmp(a->x_m, b->x_m, sizeof *a->x_m * (size_t)a->node_count) == 0 &&
           memcmp(a->element, b->element, sizeof *a->element * (size_t)a->element_count) == 0 &&
           memcmp(a->tag, b->tag, sizeof *a->tag * (size_t)a->element_count) == 0;
}

TEST("both versions of a mesh file, as text or binary, give the same mesh to the bit")
{
    static const char *const format[] = {"2.2 ASCII", "4.1 ASCII", "2.2 binary", "4.1 binary"};
    kn_msh_facts facts;
    OWN(kn_simplices) *first = kn_msh_load(cubes[0], 1000, &facts, error, sizeof error);
    CHECK(first && first->dimension == 3 && first->node_count == 8 && first->element_count == 6);
    for (int i = 0; i < 4; i++) {
        OWN(kn_simplices) *s = kn_msh_load(cubes[i], 1000, &facts, error, sizeof error);
        CHECK(same(first, s));
        CHECK_STR(facts.format, format[i]);
        CHECK(facts.left_out == 0 && facts.loose == 0);
    }
}

TEST("every example mesh can be read and has good elements and the expected volume and height")
{
    static const struct {
        const char *file;
        int dimension;
        double volume, height_m;
    } example[] = {{"block.msh", 3, 75e-6, 0.03}, {"bun.msh", 3, 45.2e-6, 0.024}, {"disc.msh", 2, 18.6e-4, 0.045}};
    for (int i = 0; i < COUNT(example); i++) {
        char path[256];
        kn_simplices_measures m;
        kn_msh_facts facts;
        snprintf(path, sizeof path, KN_SOURCE_DIR "/core/scenes/meshes/%s", example[i].file);
        OWN(kn_simplices) *s = kn_msh_load(path, 1000, &facts, error, sizeof error);
        if (!s) KN_TEST_FAIL("%s", error);
        if (!s) continue;
        CHECK(kn_simplices_measure(s, &m));
        CHECK(s->dimension == example[i].dimension && facts.loose == 0);
        CHECK_NEAR(m.volume / example[i].volume, 1, 0.03); // facets cut off a little of a round body
        CHECK_NEAR(m.high_m[2] - m.low_m[2], example[i].height_m, 1e-4);
        CHECK(m.quality_min > 0.4 && m.quality_mean > 0.75);
    }
}

TEST("every broken mesh gives its own error line, with the place in the file and the number of the element")
{
    char line[512], path[512];
    int lines = 0, files = 0;
    FILE *list = fopen(HERE "meshes_bad/expected", "r");
    CHECK(list != NULL);
    while (list && fgets(line, sizeof line, list)) {
        line[strcspn(line, "\n")] = '\0';
        snprintf(path, sizeof path, HERE "meshes_bad/%.*s", (int)strcspn(line, ":"), line);
        snprintf(error, sizeof error, "%s", "it was read");
        kn_simplices_destroy(kn_msh_load(path, 1000, NULL, error, sizeof error));
        if (strncmp(error, HERE "meshes_bad/", strlen(HERE "meshes_bad/")) != 0) KN_TEST_FAIL("%s: %s", path, error);
        else CHECK_STR(error + strlen(HERE "meshes_bad/"), line);
        lines++;
    }
    if (list) fclose(list);
    DIR *folder = opendir(HERE "meshes_bad");
    for (struct dirent *entry; folder && (entry = readdir(folder));) files += strstr(entry->d_name, ".msh") != NULL;
    if (folder) closedir(folder);
    CHECK(lines >= 70 && lines == files);
}

TEST("a file truncated anywhere gives one error line and no mesh")
{
    for (int i = 0; i < 4; i++) {
        char bytes[8192];
        FILE *in = fopen(cubes[i], "rb");
        size_t size = in ? fread(bytes, 1, sizeof bytes, in) : 0;
        if (in) fclose(in);
        CHECK(size > 200 && size < sizeof bytes);
        for (size_t cut = 0; cut + 1 < size; cut++) {
            // allocated with exactly that size, so that a sanitizer sees a read beyond the end
            char *part = malloc(cut + 1);
            memcpy(part, bytes, cut);
            error[0] = '\0';
            OWN(kn_simplices) *s = kn_msh_read("t.msh", part, cut, 1000, NULL, error, sizeof error);
            CHECK(!s && strncmp(error, "t.msh:", 6) == 0 && !strchr(error, '\n'));
            free(part);
        }
    }
}

#define HEAD "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n"
#define NODES                                                                                                          \
    "$Nodes\n5\n7 0 0 0\n90 1 0 0\n4000000000 0 1 0\n5 0 0 1\n1 9 9 9\n$EndNodes\n" // numbers with gaps, one loose node

TEST("points, lines and surface triangles beside tetrahedra are left out, and so are nodes without an element")
{
    kn_msh_facts facts = {.loose = -1};
    OWN(kn_simplices) *s = read_text(HEAD "$PhysicalNames\n1\n3 1 \"$Nodes\"\n$EndPhysicalNames\n" NODES
                                          "$Elements\n4\n1 15 0 1\n2 1 1 3 7 90\n3 2 2 1 1 7 4000000000 90\n"
                                          "12 4 3 1 2 3 7 90 4000000000 5\n$EndElements\n$NodeData\n1\n$EndNodeData\n",
                                     &facts);
    CHECK_STR(error, "");
    CHECK(s && s->dimension == 3 && s->element_count == 1 && s->node_count == 4 && s->tag[0] == 12);
    CHECK(facts.left_out == 3 && facts.loose == 1);
    CHECK(s && s->element[0][0] == 0 && s->element[0][3] == 3 && s->x_m[2][1] == 1); // in the order of the file
}

TEST("parameters after the coordinates of a node are skipped")
{
    OWN(kn_simplices) *s = read_text("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n2 4 1 4\n2 1 1 3\n1\n2\n3\n"
                                     "0 0 0 0.5 0.5\n1 0 0 0.5 0.5\n0 1 0 0.5 0.5\n3 1 0 1\n4\n0 0 1\n$EndNodes\n"
                                     "$Elements\n1 1 1 1\n3 1 4 1\n1 1 2 3 4\n$EndElements\n",
                                     NULL);
    CHECK_STR(error, "");
    CHECK(s && s->node_count == 4 && s->x_m[3][2] == 1);
}

TEST("triangles are moved upright from their drawing plane, and triangles seen from behind are turned round")
{
    // drawn in the plane x-y; in x-z
    static const char *const nodes[] = {"1 0 0 3\n2 2 0 3\n3 0 1 3\n", "1 0 4 0\n2 2 4 0\n3 0 4 1\n"};
    static const char *const element[] = {"1 2 3", "3 2 1"};
    for (int i = 0; i < 4; i++) {
        char text[512];
        snprintf(text, sizeof text, HEAD "$Nodes\n3\n%s$EndNodes\n$Elements\n1\n1 2 2 1 1 %s\n$EndElements\n",
                 nodes[i / 2], element[i % 2]);
        OWN(kn_simplices) *s = read_text(text, NULL);
        kn_simplices_measures m = {.volume = 0};
        CHECK_STR(error, "");
        CHECK(s && s->dimension == 2 && s->element[0][3] == -1 && s->x_m[0][1] == 0 && s->x_m[2][2] == 1);
        CHECK(s && kn_simplices_measure(s, &m) && m.volume == 1);
    }
}

TEST("5 mm, 0.5 cm and 0.005 m give the same bits")
{
    static const char *const edge[] = {"5", "0.5", "0.005"};
    static const double per_m[] = {1000, 100, 1};
    for (int i = 0; i < 3; i++) {
        char text[512];
        const char *e = edge[i];
        snprintf(text, sizeof text,
                 HEAD "$Nodes\n4\n1 0 0 0\n2 %s 0 0\n3 0 %s 0\n4 0 0 %s\n$EndNodes\n$Elements\n1\n1 4 0 1 2 3 4\n"
                      "$EndElements\n",
                 e, e, e);
        OWN(kn_simplices) *s = kn_msh_read("t.msh", text, strlen(text), per_m[i], NULL, error, sizeof error);
        CHECK(s && s->x_m[1][0] == 0.005);
    }
}

TEST("a file that cannot be read gives one error line")
{
    CHECK(!kn_msh_load("/nowhere/x.msh", 1, NULL, error, sizeof error));
    CHECK_STR(error, "/nowhere/x.msh:1:1: No such file or directory, expected a file of at most 256 MiB");
    CHECK(!kn_msh_load("/", 1, NULL, error, sizeof error));
    CHECK_STR(error, "/:1:1: Is a directory, expected a file of at most 256 MiB");
}
