#include "core/scene/draft.h"
#include "core/algebra/algebra.h"
#include "core/scene/mesh_file.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#define EDGE_MIN_M 1e-5 // smallest mean length of a mesh's edges; a block's spacing has the same limit

typedef char path_text[2 * KN_PATH_MAX];

// Return the number of characters of a path up to and including the last slash, 0 if there is no slash.
static size_t folder_of(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash ? (size_t)(slash + 1 - path) : 0;
}

// Return the text in the draft that holds the path of a mesh file.
static char *path_of(kn_draft *draft, const kn_draft_file *file)
{
    return kn_draft_field(draft, file->slot, file->path);
}

static kn_mark mark_of(const kn_draft *draft, const kn_draft_file *file) { return draft->at[file->slot][file->path]; }

// Compute the path of a mesh file from the path in the scene. A path in the scene's file is relative to the folder of
// that file. A path in a --set is relative to the working directory.
static void as_written(kn_draft *draft, const kn_draft_file *file, path_text path)
{
    const char *name = path_of(draft, file);
    bool from_folder = *name != '/' && mark_of(draft, file).source == KN_SOURCE_FILE;
    size_t folder = from_folder ? folder_of(draft->file) : 0;
    snprintf(path, sizeof(path_text), "%.*s%s", (int)(folder < KN_PATH_MAX ? folder : 0), draft->file, name);
}

// Compute the path that a mesh file has if it lies in the folder of draft->beside. A log may have been moved together
// with its mesh, so that the path in the log's scene is no longer right.
static void as_moved(kn_draft *draft, const kn_draft_file *file, path_text path)
{
    const char *name = path_of(draft, file);
    size_t folder = draft->beside ? folder_of(draft->beside) : 0;
    snprintf(path, sizeof(path_text), "%.*s%s", (int)(folder < KN_PATH_MAX ? folder : 0),
             draft->beside ? draft->beside : "", name + folder_of(name));
}

// Return NULL if the path leads to a regular file, else the reason why not. A pipe is refused, because reading from a
// pipe might wait forever.
static const char *no_file(const char *path)
{
    struct stat what;
    if (stat(path, &what) != 0) return strerror(errno);
    return S_ISREG(what.st_mode) ? NULL : "not a regular file";
}

// Return true if the file must have the hash in the text. A hash in the text is ignored if a later --set names another
// file.
static bool hash_counts(const kn_draft *draft, const kn_draft_file *file)
{
    kn_mark hash = draft->at[file->slot][file->hash];
    return hash.source != KN_SOURCE_DEFAULT && hash.source >= mark_of(draft, file).source;
}

// Load a mesh file and compare its hash with the hash in the text.
static bool load(kn_draft *draft, const kn_draft_file *file, const char *path)
{
    char name[KN_LINE_MAX];
    uint64_t hash, *said = kn_draft_field(draft, file->slot, file->hash);
    if (!file->load(draft, file->slot, path, &hash)) return false;
    if (hash_counts(draft, file) && hash != *said)
        return kn_draft_complain(
            draft, draft->at[file->slot][file->hash],
            "%s is %016" PRIx64 ", but the mesh has %016" PRIx64
            ": the file has changed since the hash was written, expected the old file (at its path, or beside "
            "this file)",
            kn_draft_path(draft, file->slot, file->hash, name), *said, hash);
    *said = hash;
    // mark the hash as given, so that the canonical text contains it
    draft->at[file->slot][file->hash] = mark_of(draft, file);
    return true;
}

// Replace the path of a mesh file in the draft by its absolute path. With the absolute path in the canonical text, a
// program finds the file from any working directory.
static bool make_absolute(kn_draft *draft, const kn_draft_file *file, const char *path)
{
    char *absolute = realpath(path, NULL), name[KN_LINE_MAX];
    bool fits = absolute && strlen(absolute) < KN_PATH_MAX && kn_key_quotable(absolute);
    if (fits) memcpy(path_of(draft, file), absolute, strlen(absolute) + 1);
    free(absolute);
    return fits ||
           kn_draft_complain(draft, mark_of(draft, file), "%s: its full path is not UTF-8 text of less than %d bytes",
                             kn_draft_path(draft, file->slot, file->path, name), KN_PATH_MAX);
}

bool kn_draft_read(kn_draft *draft, const kn_draft_file *file)
{
    path_text path, moved;
    char name[KN_LINE_MAX];
    // use the path in the scene if it leads to a regular file, else look in the folder of draft->beside
    as_written(draft, file, path);
    as_moved(draft, file, moved);
    const char *why = no_file(path), *used = why ? moved : path;
    if (why && no_file(moved))
        return kn_draft_complain(draft, mark_of(draft, file), "%s: %s, expected %s",
                                 kn_draft_path(draft, file->slot, file->path, name), why, file->kind);
    if (!load(draft, file, used)) {
        // the file has another hash: look for the original in the folder of draft->beside; if that fails, too, report
        // the first error
        char first[512];
        snprintf(first, sizeof first, "%s", draft->error);
        bool other =
            !why && hash_counts(draft, file) && strcmp(path, moved) != 0 && !no_file(moved) && load(draft, file, moved);
        if (!other) return snprintf(draft->error, draft->error_size, "%s", first), false;
        used = moved;
    }
    return make_absolute(draft, file, used);
}

const double kn_draft_units_per_m[4] = {1, 1e2, 1e3, 1e6};

// Load the mesh of the object into the scene. A callback kn_draft_file.load.
static bool load_mesh(kn_draft *draft, int slot, const char *path, uint64_t *hash)
{
    kn_msh_facts facts;
    double units_per_m = kn_draft_units_per_m[draft->mesh_unit];
    (void)slot;
    kn_simplices_destroy(draft->scene.mesh);
    draft->scene.mesh = kn_msh_load(path, units_per_m, &facts, draft->error, draft->error_size);
    if (draft->scene.mesh) *hash = facts.hash;
    return draft->scene.mesh != NULL;
}

// Check by the mean length of its edges that the mesh has the right unit. Then make the mesh the object of the model.
static bool take_measures(kn_draft *draft)
{
    kn_scene *scene = &draft->scene;
    kn_simplices_measures m;
    kn_mark at = draft->at[0][KN_KEY_MESH_UNIT];
    if (!kn_simplices_measure(scene->mesh, &m)) return kn_draft_complain(draft, at, "not enough memory for the mesh");
    if (m.edge_mean_m < EDGE_MIN_M)
        return kn_draft_complain(draft, at,
                                 "object.mesh has edges of %.3g m on average, expected at least %g m: is "
                                 "its unit right?",
                                 m.edge_mean_m, EDGE_MIN_M);
    kn_simplices_place(scene->mesh);
    scene->model.mesh = scene->mesh;
    scene->model.spacing_m = m.edge_mean_m;
    memset(scene->model.nodes, 0, sizeof scene->model.nodes);
    return true;
}

static int by_height(const void *a, const void *b)
{
    const double *p = a, *q = b;
    return (p[2] > q[2]) - (p[2] < q[2]);
}

// Return the length of the cross product of p - o and q - o.
static double across(const double o[3], const double p[3], const double q[3])
{
    double u[3], v[3];
    for (int k = 0; k < 3; k++) u[k] = p[k] - o[k], v[k] = q[k] - o[k];
    return sqrt(fmax(0, kn_dot(u, u) * kn_dot(v, v) - kn_dot(u, v) * kn_dot(u, v)));
}

// Refuse a bonded support whose nodes lie on one line (in a flat mesh: at one point), because the object could turn.
static bool check_support(kn_draft *draft)
{
    const kn_simplices *s = draft->scene.mesh;
    const size_t count = (size_t)s->node_count;
    double(*x)[3] = malloc(count * sizeof *x);
    if (!x) return kn_draft_complain(draft, draft->at[0][KN_KEY_MESH], "not enough memory for the mesh");
    memcpy(x, s->x_m, count * sizeof *x);
    qsort(x, count, sizeof *x, by_height);
    const double high_m = x[count - 1][2] - x[0][2], near_m = 1e-3 * high_m;
    // go up until a node is apart from the lowest one, then until one is off the line through both
    size_t second = 0, third;
    while (second + 1 < count &&
           fabs(x[second][0] - x[0][0]) + fabs(x[second][1] - x[0][1]) + fabs(x[second][2] - x[0][2]) < near_m)
        second++;
    for (third = second; s->dimension == 3 && third + 1 < count; third++)
        if (across(x[0], x[second], x[third]) >= near_m * near_m) break;
    const double least_m = x[third][2] - x[0][2];
    free(x);
    return least_m <= fmax(draft->scene.model.support_depth_m, 1e-6 * high_m) ||
           kn_draft_complain(draft, draft->at[0][KN_KEY_SUPPORT],
                             "support: bonded holds only nodes on one line, about which the object turns, expected "
                             "support_depth of %.3g mm or more",
                             1010 * least_m);
}

bool kn_draft_mesh(kn_draft *draft)
{
    static const kn_draft_file file = {0, KN_KEY_MESH, KN_KEY_MESH_HASH, "a Gmsh mesh", load_mesh};
    return kn_draft_read(draft, &file) && take_measures(draft) &&
           (draft->scene.model.support != KN_SUPPORT_BONDED || check_support(draft));
}
