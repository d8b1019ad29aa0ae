#include "core/scene/scene.h"
#include "tests/check.h"
#include "tests/core/folder.h"

#include <sys/stat.h>
#include <unistd.h>

#define CUBE KN_SOURCE_DIR "/tests/core/meshes/cube-41.msh"
#define TEXT_CUBE KN_SOURCE_DIR "/tests/core/meshes/cube-22.msh"

static const char body[] = "material: { k1: 470 gf/cm^3, c1: 2500 gf s/cm^3, damper: none, specimen_height: 1 cm }\n"
                           "density: 1.2 g/cm^3\nsupport: bonded\ndevice: bench\n";
static char error[1024];

static void copy(const char *from, const char *to)
{
    char bytes[4096];
    FILE *in = fopen(from, "rb"), *out = fopen(to, "wb");
    size_t size = in ? fread(bytes, 1, sizeof bytes, in) : 0;
    CHECK(out && fwrite(bytes, 1, size, out) == size && size > 0 && size < sizeof bytes);
    if (in) fclose(in);
    if (out) fclose(out);
}

// Parse a scene in the folder with that object.
static kn_scene *parse(const char *object, const char *const *sets, int count)
{
    char text[2048];
    snprintf(text, sizeof text, "version: 1\nobject: { %s }\n%s", object, body);
    error[0] = '\0';
    return kn_scene_parse(in_folder("scene.yaml"), text, strlen(text), sets, count, error, sizeof error);
}

static int same(const kn_scene *a, const kn_scene *b)
{
    return a && b && a->text_hash == b->text_hash && a->mesh->node_count == b->mesh->node_count &&
           memcmp(a->mesh->x_m, b->mesh->x_m, sizeof *a->mesh->x_m * (size_t)a->mesh->node_count) == 0;
}

TEST("the mesh is centred on the table, and its mean edge length becomes the scene's spacing")
{
    copy(CUBE, in_folder("cube.msh"));
    OWN(kn_scene) *scene = parse("mesh: cube.msh, mesh_unit: cm", NULL, 0);
    CHECK_STR(error, "");
    CHECK(scene && scene->model.mesh == scene->mesh && scene->mesh->node_count == 8 && scene->model.nodes[0] == 0);
    CHECK(scene && scene->mesh->x_m[0][0] == -0.05 && scene->mesh->x_m[0][2] == 0 && scene->mesh->x_m[7][2] == 0.1);
    CHECK(scene && scene->model.spacing_m > 0.1 && scene->model.spacing_m < 0.13);
}

TEST("the text of a scene with a mesh gives the same scene from any folder and with any file name")
{
    static const char *const name[] = {"cube.msh", "a cube: it's #1.msh", "pâte à pain.msh"};
    for (int i = 0; i < 3; i++) {
        char object[256];
        copy(CUBE, in_folder(name[i]));
        snprintf(object, sizeof object, "mesh: \"%s\", mesh_unit: mm", name[i]);
        OWN(kn_scene) *scene = parse(object, NULL, 0), *again = NULL;
        CHECK_STR(error, "");
        if (scene) again = kn_scene_parse("nowhere/x", scene->text, strlen(scene->text), NULL, 0, error, sizeof error);
        CHECK(same(scene, again) && strcmp(scene->text, again->text) == 0);
        unlink(in_folder(name[i]));
    }
}

TEST("a scene text whose mesh has moved finds the mesh beside the log and gives the same scene")
{
    copy(CUBE, in_folder("cube.msh"));
    OWN(kn_scene) *scene = parse("mesh: cube.msh, mesh_unit: mm", NULL, 0);
    mkdir(in_folder("moved"), 0700);
    rename(in_folder("cube.msh"), in_folder("moved/cube.msh"));
    size_t size = strlen(scene->text);
    CHECK(!kn_scene_parse("scene.yaml", scene->text, size, NULL, 0, error, sizeof error));
    CHECK_STR(error, "scene.yaml:3:9: object.mesh: No such file or directory, expected a Gmsh mesh");
    OWN(kn_scene) *moved =
        kn_scene_parse_beside(in_folder("moved/log"), "scene.yaml", scene->text, size, NULL, 0, error, sizeof error);
    CHECK(same(scene, moved) && strcmp(scene->text, moved->text) != 0); // the text names the new place

    // Another mesh now stands in the old place. That mesh is refused, and the mesh beside the log is still the right
    // one.
    copy(TEXT_CUBE, in_folder("cube.msh"));
    CHECK(!kn_scene_parse("scene.yaml", scene->text, size, NULL, 0, error, sizeof error));
    CHECK(strncmp(error, "scene.yaml:5:14: object.mesh_hash is 050304b91b7c46d9, but the mesh has ", 72) == 0);
    OWN(kn_scene) *beside =
        kn_scene_parse_beside(in_folder("moved/log"), "scene.yaml", scene->text, size, NULL, 0, error, sizeof error);
    CHECK(same(scene, beside));
    unlink(in_folder("moved/cube.msh"));
    rmdir(in_folder("moved"));
    unlink(in_folder("cube.msh"));
}

TEST("--set replaces a block or a mesh by another mesh without checking the old hash")
{
    static const char *const set[] = {"object.mesh=" CUBE, "object.mesh_unit=mm"};
    OWN(kn_scene) *scene = parse("size: [1 cm, 1 cm, 1 cm], spacing: 5 mm", set, 2);
    CHECK(scene && scene->mesh && scene->mesh->element_count == 6);
    const char *other = "object.mesh=" TEXT_CUBE;
    OWN(kn_scene) *third = kn_scene_parse("x", scene->text, strlen(scene->text), &other, 1, error, sizeof error);
    CHECK(third && third->text_hash != scene->text_hash); // the same mesh in other bytes
    CHECK(!parse("mesh: " CUBE ", mesh_unit: mm", (const char *[]){"object.spacing=1 mm"}, 1));
    CHECK_STR(error, "--set object.spacing: object.spacing means nothing with object.mesh, expected it left out");
}

TEST("a pipe or a folder as mesh is refused without waiting")
{
    CHECK(mkfifo(in_folder("pipe.msh"), 0600) == 0 && mkdir(in_folder("folder.msh"), 0700) == 0);
    const char *const what[] = {"mesh: pipe.msh, mesh_unit: mm", "mesh: folder.msh, mesh_unit: mm"};
    for (int i = 0; i < 2; i++) {
        CHECK(!parse(what[i], NULL, 0));
        CHECK(strstr(error, "scene.yaml:2:17: object.mesh: not a regular file, expected a Gmsh mesh"));
    }
    unlink(in_folder("pipe.msh"));
    rmdir(in_folder("folder.msh"));
}

TEST("an error in a mesh names the mesh file and the element, not the scene")
{
    char text[512];
    CHECK(!parse("mesh: " KN_SOURCE_DIR "/tests/core/meshes_bad/inverted.msh, mesh_unit: mm", NULL, 0));
    snprintf(text, sizeof text, "%s", KN_SOURCE_DIR "/tests/core/meshes_bad/inverted.msh:30:1: element 14 is inverted");
    CHECK(strncmp(error, text, strlen(text)) == 0);
    rmdir(folder);
}

TESTS_MAIN
