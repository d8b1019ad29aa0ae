// A tool given by a file: read with its scene, identified by its content, refused with one line of error.
#include "core/shape.h"
#include "tests/core/folder.h"
#include "tests/core/surface_of.h"

// Write a box as STL, in millimetres.
static void write_box(const char *path, double z)
{
    surface_of s = surface_box((double[]){20, 15, z}, 0, 2);
    FILE *file = fopen(path, "w");
    if (!file) exit(70);
    fprintf(file, "solid box\n");
    for (int t = 0; t < s.triangles; t++) {
        fprintf(file, "facet normal 0 0 0\nouter loop\n");
        for (int c = 0; c < 3; c++) {
            const double *v = s.x_m[s.triangle[t][c]];
            fprintf(file, "vertex %.9g %.9g %.9g\n", v[0], v[1], v[2]);
        }
        fprintf(file, "endloop\nendfacet\n");
    }
    fprintf(file, "endsolid box\n");
    fclose(file);
    free(s.x_m);
    free(s.triangle);
}

static const char *text_of(const char *keys) // of a scene whose tool has these keys
{
    static char text[1024];
    snprintf(text, sizeof text,
             "version: 1\nobject: {size: [5 cm, 5 cm, 3 cm], spacing: 5 mm}\nmaterial: dough\n"
             "support: bonded\ndevice: bench\nprobes:\n  - {name: stamp, shape: mesh, %s}\n",
             keys);
    return text;
}

static kn_scene *parse(const char *keys, const char *const *sets)
{
    return scene_of(in_folder("scene.yaml"), text_of(keys), sets);
}

static const char stamp[] = "mesh: stamp.stl, mesh_unit: mm";

TEST("a closed surface from a file is a tool in metres; its cells are an eighth of the spacing or as requested")
{
    write_box(in_folder("stamp.stl"), 12);
    OWN(kn_scene) *scene = parse(stamp, NULL);
    const kn_shape *tool = scene->model.probe[0].parts;
    double way[3];
    CHECK(scene->model.probe[0].shape == KN_PROBE_MESH && tool == scene->tool[0] && tool->part_count == 1);
    CHECK_NEAR(kn_shape_distance(tool, (double[]){0.002, 0.001, -0.003}, way), 0.003, 1e-7);
    CHECK_NEAR(kn_shape_span(tool, 0), 0.02, 1e-12);
    CHECK_NEAR(tool->part[0].field->cell_m, 0.005 / 8, 1e-15);
    OWN(kn_scene) *asked = parse("mesh: stamp.stl, mesh_unit: mm, mesh_cell: 1 mm", NULL);
    CHECK(asked->tool[0]->part[0].field->cell_m == 0.001 && has(asked, "mesh_cell: 0.001 m\n"));
    OWN(kn_scene) *ball = parse(stamp, SETS("probes.stamp.shape=sphere", "probes.stamp.radius=1 cm"));
    CHECK(!ball->tool[0] && !has(ball, "stl"));
}

static void write_other(const char *path) { write_box(path, 13); }

TEST("the scene text of a tool gives the same scene from any folder, with a moved file too; a changed file is refused")
{
    OWN(kn_scene) *scene = parse(stamp, NULL), *again = read_again(scene);
    CHECK(strcmp(again->text, scene->text) == 0 && again->text_hash == scene->text_hash);
    CHECK(again->tool[0]->part[0].field->hash == scene->tool[0]->part[0].field->hash);
    check_moved(scene, "stamp.stl", write_other,
                "probes.stamp.mesh: No such file or directory, expected a closed surface",
                "the file has changed since");
    OWN(kn_scene) *other = parse(stamp, NULL);
    CHECK(other->text_hash != scene->text_hash);
}

TEST("a tool too thin for the lattice or too large for its grid is refused in one line")
{
    static const struct {
        const char *keys, *set, *why;
    } table[] = {
        {"mesh: stamp.stl, mesh_unit: um", NULL,
         "scene.yaml:7:60: probes.stamp.mesh: every part of a tool must be at least a lattice spacing wide and high "
         "(spacing 0.005 m, half width 0 m): is its unit right?"},
        {"mesh: stamp.stl, mesh_unit: m", NULL,
         "probes.stamp.mesh is 20 x 15 x 13 m: with cells of 0.00167 m it needs"},
        {stamp, "probes.stamp.mesh_cell=0.05 mm",
         "--set probes.stamp.mesh_cell: probes.stamp.mesh is 0.02 x 0.015 x 0.013 m: with cells of 5e-05 m it needs"},
        {stamp, "probes.stamp.mesh_cell=2 mm",
         "--set probes.stamp.mesh_cell: probes.stamp.mesh_cell is 0.002 m, expected at most a third of the spacing, "
         "0.00167 m"},
    };
    for (int t = 0; t < COUNT(table); t++) {
        const char *why = refusal(in_folder("scene.yaml"), text_of(table[t].keys), SETS(table[t].set));
        if (!strstr(why, table[t].why)) KN_TEST_FAIL("%s\n       expected: %s", why, table[t].why);
    }
    unlink(in_folder("stamp.stl"));
    rmdir(folder);
}
