#include "tests/core/folder.h"

#include <fcntl.h>
#include <sys/sendfile.h>

#define MESHES KN_SOURCE_DIR "/tests/core/meshes"
#define CUBE MESHES "/cube-41.msh"
#define TEXT_CUBE MESHES "/cube-22.msh"

static void place(const char *mesh, const char *path)
{
    int in = open(mesh, O_RDONLY), out = open(path, O_WRONLY | O_CREAT | O_TRUNC, 0600);
    CHECK(sendfile(out, in, NULL, 1 << 16) > 0);
    close(in), close(out);
}

static void place_other(const char *path) { place(TEXT_CUBE, path); }

static const char *text_of(const char *object) // of a scene with that object
{
    static char text[2048];
    snprintf(text, sizeof text,
             "version: 1\nobject: { %s }\n"
             "material: { k1: 470 gf/cm^3, c1: 2500 gf s/cm^3, damper: none, specimen_height: 1 cm }\n"
             "density: 1.2 g/cm^3\nsupport: bonded\ndevice: bench\n",
             object);
    return text;
}

// Parse a scene in the folder with that object.
static kn_scene *parse(const char *object, const char *const *sets)
{
    return scene_of(in_folder("scene.yaml"), text_of(object), sets);
}

static const char *refused(const char *object, const char *const *sets)
{
    return refusal(in_folder("scene.yaml"), text_of(object), sets);
}

static int same(const kn_scene *a, const kn_scene *b)
{
    return a && b && a->text_hash == b->text_hash && a->mesh->node_count == b->mesh->node_count &&
           memcmp(a->mesh->x_m, b->mesh->x_m, sizeof *a->mesh->x_m * (size_t)a->mesh->node_count) == 0;
}

TEST("the mesh is centred on the table, and its mean edge length becomes the scene's spacing")
{
    place(CUBE, in_folder("cube.msh"));
    OWN(kn_scene) *scene = parse("mesh: cube.msh, mesh_unit: cm", NULL);
    CHECK(scene->model.mesh == scene->mesh && scene->mesh->node_count == 8 && scene->model.nodes[0] == 0);
    CHECK(scene->mesh->x_m[0][0] == -0.05 && scene->mesh->x_m[0][2] == 0 && scene->mesh->x_m[7][2] == 0.1);
    CHECK(scene->model.spacing_m > 0.1 && scene->model.spacing_m < 0.13);
}

TEST("the text of a scene with a mesh gives the same scene from any folder and with any file name")
{
    static const char *const name[] = {"cube.msh", "a cube: it's #1.msh", "pâte à pain.msh"};
    for (int i = 0; i < 3; i++) {
        char object[256];
        if (i) place(CUBE, in_folder(name[i]));
        snprintf(object, sizeof object, "mesh: \"%s\", mesh_unit: mm", name[i]);
        OWN(kn_scene) *scene = parse(object, NULL), *again = read_again(scene);
        CHECK(same(scene, again) && strcmp(scene->text, again->text) == 0);
        if (i) unlink(in_folder(name[i]));
    }
}

TEST("a scene text whose mesh has moved finds the mesh beside the log, and refuses another mesh in the old place")
{
    OWN(kn_scene) *scene = parse("mesh: cube.msh, mesh_unit: mm", NULL);
    check_moved(scene, "cube.msh", place_other,
                "x.yaml:3:9: object.mesh: No such file or directory, expected a Gmsh mesh",
                "x.yaml:5:14: object.mesh_hash is 050304b91b7c46d9, but the mesh has ");
    unlink(in_folder("cube.msh"));
}

TEST("--set replaces a block or a mesh by another mesh without checking the old hash")
{
    OWN(kn_scene) *scene =
        parse("size: [1 cm, 1 cm, 1 cm], spacing: 5 mm", SETS("object.mesh=" CUBE, "object.mesh_unit=mm"));
    CHECK(scene->mesh && scene->mesh->element_count == 6);
    OWN(kn_scene) *third = scene_of("x", scene->text, SETS("object.mesh=" TEXT_CUBE));
    CHECK(third->text_hash != scene->text_hash); // the same mesh in other bytes
    CHECK_STR(refused("mesh: " CUBE ", mesh_unit: mm", SETS("object.spacing=1 mm")),
              "--set object.spacing: object.spacing means nothing with object.mesh, expected it left out");
}

TEST("a pipe or a folder as mesh is refused without waiting")
{
    CHECK(mkfifo(in_folder("pipe.msh"), 0600) == 0 && mkdir(in_folder("folder.msh"), 0700) == 0);
    static const char *const what[] = {"mesh: pipe.msh, mesh_unit: mm", "mesh: folder.msh, mesh_unit: mm"};
    for (int i = 0; i < 2; i++)
        CHECK(strstr(refused(what[i], NULL), "scene.yaml:2:17: object.mesh: not a regular file, expected a Gmsh mesh"));
    unlink(in_folder("pipe.msh"));
    rmdir(in_folder("folder.msh"));
    rmdir(folder);
}
