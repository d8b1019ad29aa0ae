#include "core/scene/draft.h"
#include "core/scene/msh.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define EDGE_MIN_M 1e-5 // mean; as for the spacing of a block

typedef char path_text[2 * KN_PATH_MAX];

static size_t folder_of(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash ? (size_t)(slash + 1 - path) : 0;
}

// Where the file was written: from the scene's folder, or from the working directory when --set names it.
static void as_written(const kn_draft *draft, path_text path)
{
    bool from_folder = *draft->mesh_path != '/' && draft->at[0][KN_KEY_MESH].source == KN_SOURCE_FILE;
    size_t folder = from_folder ? folder_of(draft->file) : 0;
    snprintf(path, sizeof(path_text), "%.*s%s", (int)(folder < KN_PATH_MAX ? folder : 0), draft->file,
             draft->mesh_path);
}

// Beside the file that holds the text: a log and its mesh are moved together.
static void as_moved(const kn_draft *draft, path_text path)
{
    size_t folder = draft->beside ? folder_of(draft->beside) : 0;
    snprintf(path, sizeof(path_text), "%.*s%s", (int)(folder < KN_PATH_MAX ? folder : 0),
             draft->beside ? draft->beside : "", draft->mesh_path + folder_of(draft->mesh_path));
}

static bool exists(const char *path)
{
    FILE *file = fopen(path, "rb");
    if (file) fclose(file);
    return file != NULL;
}

// The hash that the text holds counts unless --set has named another file since.
static bool hash_counts(const kn_draft *draft)
{
    kn_mark hash = draft->at[0][KN_KEY_MESH_HASH], mesh = draft->at[0][KN_KEY_MESH];
    return hash.source != KN_SOURCE_DEFAULT && hash.source >= mesh.source;
}

// Reads the file at path into the scene.
static bool load(kn_draft *draft, const char *path)
{
    static const double units_per_m[] = {1, 1e2, 1e3, 1e6}; // in the order of the key's words
    kn_msh_facts facts;
    kn_scene *scene = &draft->scene;
    scene->mesh = kn_msh_load(path, units_per_m[draft->mesh_unit], &facts, draft->error, draft->error_size);
    if (!scene->mesh) return false;
    if (hash_counts(draft) && facts.hash != draft->mesh_hash) {
        kn_simplices_destroy(scene->mesh);
        scene->mesh = NULL;
        return kn_draft_complain(draft, draft->at[0][KN_KEY_MESH_HASH],
                                 "object.mesh_hash is %016" PRIx64 ", but the mesh is %016" PRIx64
                                 ": it was changed since, expected it as it was (there, or beside this file)",
                                 draft->mesh_hash, facts.hash);
    }
    draft->mesh_hash = facts.hash;
    draft->at[0][KN_KEY_MESH_HASH] = draft->at[0][KN_KEY_MESH]; // it is part of the canonical text
    return true;
}

// The path in the canonical text, by which any program finds the file from any folder.
static bool make_absolute(kn_draft *draft, const char *path)
{
    char *absolute = realpath(path, NULL);
    bool fits = absolute && strlen(absolute) < KN_PATH_MAX && kn_key_quotable(absolute);
    if (fits) memcpy(draft->mesh_path, absolute, strlen(absolute) + 1);
    free(absolute);
    return fits || kn_draft_complain(draft, draft->at[0][KN_KEY_MESH],
                                     "object.mesh: its whole path is no UTF-8 text of less than %d bytes", KN_PATH_MAX);
}

static bool take_measures(kn_draft *draft)
{
    kn_scene *scene = &draft->scene;
    kn_simplices_measures m;
    kn_mark at = draft->at[0][KN_KEY_MESH_UNIT];
    if (!kn_simplices_measure(scene->mesh, &m)) return kn_draft_complain(draft, at, "not enough memory for the mesh");
    if (m.edge_mean_m < EDGE_MIN_M)
        return kn_draft_complain(draft, at, "object.mesh has edges of %.3g m in the mean, expected at least %g m: is "
                                 "its unit right?", m.edge_mean_m, EDGE_MIN_M);
    kn_simplices_place(scene->mesh);
    scene->model.mesh = scene->mesh;
    scene->model.spacing_m = m.edge_mean_m;
    memset(scene->model.nodes, 0, sizeof scene->model.nodes);
    return true;
}

bool kn_draft_mesh(kn_draft *draft)
{
    path_text path, moved;
    as_written(draft, path);
    as_moved(draft, moved);
    bool found = exists(path);
    const char *why = strerror(errno), *used = found ? path : moved;
    if (!found && !exists(moved))
        return kn_draft_complain(draft, draft->at[0][KN_KEY_MESH], "object.mesh: %s, expected a Gmsh mesh", why);
    if (!load(draft, used)) {
        // the first complaint stands unless the file as it was is beside this one
        char first[512];
        snprintf(first, sizeof first, "%s", draft->error);
        bool other = found && hash_counts(draft) && strcmp(path, moved) != 0 && exists(moved) && load(draft, moved);
        if (!other) return snprintf(draft->error, draft->error_size, "%s", first), false;
        used = moved;
    }
    return make_absolute(draft, used) && take_measures(draft);
}
