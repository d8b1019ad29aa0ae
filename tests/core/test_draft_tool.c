// A tool given by a file: read with its scene, identified by its content, refused with one line of error.
#include "core/scene/scene.h"
#include "core/shape.h"
#include "tests/check.h"
#include "tests/core/folder.h"
#include "tests/core/surface_of.h"

#include <sys/stat.h>
#include <unistd.h>

static char error[1024];

// Write a box as STL, in millimetres, without its last `missing` triangles.
static void write_box(const char *path, double x, double y, double z, int missing)
{
    surface_of s = surface_box((double[]){x, y, z}, 0, 2);
    FILE *file = fopen(path, "w");
    if (!file) exit(70);
    fprintf(file, "solid box\n");
    for (int t = 0; t < s.triangles - missing; t++) {
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

static kn_scene *parse(const char *keys, const char *const *sets, int count)
{
    char text[1024];
    snprintf(text, sizeof text,
             "version: 1\nobject: {size: [5 cm, 5 cm, 3 cm], spacing: 5 mm}\nmaterial: dough\n"
             "support: bonded\ndevice: bench\nprobes:\n  - {name: stamp, shape: mesh, %s}\n",
             keys);
    error[0] = '\0';
    return kn_scene_parse(in_folder("scene.yaml"), text, strlen(text), sets, count, error, sizeof error);
}

TEST("a closed surface from a file is a tool in metres; its cells are an eighth of the spacing or as requested")
{
    write_box(in_folder("stamp.stl"), 20, 15, 12, 0);
    OWN(kn_scene) *scene = parse("mesh: stamp.stl, mesh_unit: mm", NULL, 0);
    CHECK_STR(error, "");
    if (!scene) return;
    const kn_shape *tool = scene->model.probe[0].parts;
    double way[3];
    CHECK(scene->model.probe[0].shape == KN_PROBE_MESH && tool == scene->tool[0] && tool->part_count == 1);
    CHECK_NEAR(kn_shape_distance(tool, (double[]){0.002, 0.001, -0.003}, way), 0.003, 1e-7);
    CHECK_NEAR(kn_shape_span(tool, 0), 0.02, 1e-12);
    CHECK_NEAR(tool->part[0].field->cell_m, 0.005 / 8, 1e-15);
    OWN(kn_scene) *asked = parse("mesh: stamp.stl, mesh_unit: mm, mesh_cell: 1 mm", NULL, 0);
    CHECK(asked && asked->tool[0]->part[0].field->cell_m == 0.001 && strstr(asked->text, "mesh_cell: 0.001 m\n"));
    OWN(kn_scene) *ball = parse("mesh: stamp.stl, mesh_unit: mm",
                                (const char *[]){"probes.stamp.shape=sphere", "probes.stamp.radius=1 cm"}, 2);
    CHECK(ball && !ball->tool[0] && !strstr(ball->text, "stl"));
}

TEST("the scene text of a tool gives the same scene from any folder, with a moved file too; a changed file is refused")
{
    OWN(kn_scene) *scene = parse("mesh: stamp.stl, mesh_unit: mm", NULL, 0);
    size_t size = strlen(scene->text);
    OWN(kn_scene) *again = kn_scene_parse("nowhere/x", scene->text, size, NULL, 0, error, sizeof error);
    CHECK(again && strcmp(again->text, scene->text) == 0 && again->text_hash == scene->text_hash);
    CHECK(again && again->tool[0]->part[0].field->hash == scene->tool[0]->part[0].field->hash);
    mkdir(in_folder("moved"), 0700);
    rename(in_folder("stamp.stl"), in_folder("moved/stamp.stl"));
    CHECK(!kn_scene_parse("x.yaml", scene->text, size, NULL, 0, error, sizeof error));
    CHECK(strstr(error, "probes.stamp.mesh: No such file or directory, expected a closed surface"));
    write_box(in_folder("stamp.stl"), 20, 15, 13, 0); // another tool in the same place
    CHECK(!kn_scene_parse("x.yaml", scene->text, size, NULL, 0, error, sizeof error));
    CHECK(strstr(error, ": probes.stamp.mesh_hash is ") && strstr(error, "the file has changed since"));
    OWN(kn_scene) *moved =
        kn_scene_parse_beside(in_folder("moved/log"), "x.yaml", scene->text, size, NULL, 0, error, sizeof error);
    CHECK(moved && moved->text_hash == scene->text_hash && strcmp(moved->text, scene->text) != 0);
    OWN(kn_scene) *other = parse("mesh: stamp.stl, mesh_unit: mm", NULL, 0);
    CHECK(other && other->text_hash != scene->text_hash);
    unlink(in_folder("moved/stamp.stl"));
    rmdir(in_folder("moved"));
}

static void refused(const char *keys, const char *const *sets, int count, const char *what)
{
    kn_scene_destroy(parse(keys, sets, count));
    if (!strstr(error, what)) KN_TEST_FAIL("%s\n       expected: %s", error, what);
}

TEST("a tool with a hole, too thin for the lattice or too large for its grid is refused in one line")
{
    write_box(in_folder("open.stl"), 20, 15, 12, 1);
    refused("mesh: open.stl, mesh_unit: mm", NULL, 0,
            "open.stl:212:1: the surface has holes: 3 edges belong to one "
            "triangle only, the first to triangle 31; expected a closed surface");
    refused("mesh: stamp.stl, mesh_unit: um", NULL, 0,
            "scene.yaml:7:60: probes.stamp.mesh: every part of a tool must be "
            "at least a lattice spacing wide and high (spacing 0.005 m, half width 0 m): is its unit right?");
    refused("mesh: stamp.stl, mesh_unit: m", NULL, 0,
            "probes.stamp.mesh is 20 x 15 x 13 m: with cells of 0.00167 m it needs");
    refused(
        "mesh: stamp.stl, mesh_unit: mm", (const char *[]){"probes.stamp.mesh_cell=0.05 mm"}, 1,
        "--set probes.stamp.mesh_cell: probes.stamp.mesh is 0.02 x 0.015 x 0.013 m: with cells of 5e-05 m it needs");
    refused("mesh: stamp.stl, mesh_unit: mm", (const char *[]){"probes.stamp.mesh_cell=2 mm"}, 1,
            "--set probes.stamp.mesh_cell: probes.stamp.mesh_cell is 0.002 m, expected at most a third of the spacing, "
            "0.00167 m");
    unlink(in_folder("stamp.stl"));
    unlink(in_folder("open.stl"));
    rmdir(folder);
}

TESTS_MAIN
