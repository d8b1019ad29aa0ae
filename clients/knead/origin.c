#include "clients/knead/origin.h"
#include "clients/knead/graft.h"
#include "core/hash.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Hash a canonical scene text without its lines about small cells (accuracy, margin, reach) and about mesh paths.
static uint64_t hash_lines(const char *text)
{
    static const char *const left_out[] = {"  accuracy: ", "  margin: ", "    reach: ", "  mesh: "};
    uint64_t hash = KN_HASH_SEED;
    for (const char *line = text; *line;) {
        size_t size = strcspn(line, "\n") + (strchr(line, '\n') != NULL);
        bool out = false;
        for (int i = 0; i < 4; i++) out |= strncmp(line, left_out[i], strlen(left_out[i])) == 0;
        if (!out) hash = kn_hash_bytes(hash, line, size);
        line += size;
    }
    return hash;
}

// Hash a scene text without its blocks `quality`, `solver` and `mesh` (rate and measures of mesh messages). The text is
// parsed again first, so texts written by different versions of the program compare equal. `beside`: relative paths in
// the text start from the folder of this file. Return false if the text cannot be parsed.
static bool hash_of(const char *beside, const char *name, const char *text, uint64_t *hash)
{
    static const char *const block[] = {"quality", "solver", "mesh"};
    char error[512], *rest = strdup(text);
    // Remove the top-level blocks `quality`, `solver` and `mesh` from the text, one after the other.
    for (int i = 0; i < 3 && rest; i++) {
        char *whole = rest;
        rest = kn_graft(whole, block[i], "", error, sizeof error);
        free(whole);
    }
    // Parse what is left of the text, which gives its canonical form.
    kn_scene *scene =
        rest ? kn_scene_parse_beside(beside, name, rest, strlen(rest), NULL, 0, error, sizeof error) : NULL;
    if (scene) *hash = hash_lines(scene->text);
    free(rest);
    kn_scene_destroy(scene);
    return scene;
}

// Return true if scene is not NULL and its hash equals `logged`.
static bool is_of(const char *path, const kn_scene *scene, uint64_t logged)
{
    uint64_t hash;
    return scene && hash_of(path, path, scene->text, &hash) && hash == logged;
}

// Compare the scene of the log with the scene under test: first with the user's sets (`key=value` texts), then without
// them.
static bool same_scene(const kn_replay *r, const kn_replay_def *def, const char *path, const kn_scene *scene)
{
    char error[512];
    uint64_t logged;
    // A log without a scene cannot be compared and is accepted.
    if (!r->logged_text) return true;
    if (!hash_of(def->log_path, r->logged_name, r->logged_text, &logged)) return false;
    if (is_of(path, scene, logged)) return true;
    // The user's sets may be the only difference between the scenes, so load the scene file once more without the sets.
    kn_scene *file = kn_scene_load(path, NULL, 0, error, sizeof error);
    bool same = is_of(path, file, logged);
    kn_scene_destroy(file);
    return same;
}

bool kn_origin_check(const kn_replay_def *def, const char *path, const kn_scene *scene, char *error, size_t size)
{
    const char *log = def->log_path;
    kn_replay *r = kn_replay_create(def, error, size);
    // Each reason for a refusal has a message of its own. If the replay cannot be created, error is already set.
    bool fit = r && !r->damage[0] && r->tally.malformed == 0 && same_scene(r, def, path, scene);
    if (r && r->damage[0]) snprintf(error, size, "%s: %s, expected a whole log of one run", log, r->damage);
    else if (r && r->tally.malformed > 0)
        snprintf(error, size, "%s: %lld malformed records, expected a whole log", log, (long long)r->tally.malformed);
    else if (r && !fit)
        snprintf(error, size, "%s: was recorded with another scene, '%s', expected one of %s", log, r->logged_name,
                 scene->name);
    kn_replay_destroy(r);
    return fit;
}
