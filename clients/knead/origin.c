#include "clients/knead/origin.h"
#include "clients/knead/graft.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Hash of a canonical text but for its solver and quality, read anew: what an older version wrote, and where a mesh
// lies, makes no difference.
static bool hash_of(const char *beside, const char *name, const char *text, uint64_t *hash)
{
    char error[512];
    char *half = kn_graft(text, "quality", "", error, sizeof error);
    char *rest = half ? kn_graft(half, "solver", "", error, sizeof error) : NULL;
    kn_scene *scene =
        rest ? kn_scene_parse_beside(beside, name, rest, strlen(rest), NULL, 0, error, sizeof error) : NULL;
    if (scene) *hash = scene->text_hash;
    free(half);
    free(rest);
    kn_scene_destroy(scene);
    return scene;
}

static bool is_of(const kn_plan *plan, const char *text, uint64_t logged)
{
    uint64_t hash;
    return hash_of(plan->scene_path, plan->scene_path, text, &hash) && hash == logged;
}

static bool same_scene(const kn_replay *r, const kn_plan *plan)
{
    char error[512];
    uint64_t logged;
    if (!r->logged_text) return true;
    if (!hash_of(plan->log_path, r->logged_name, r->logged_text, &logged)) return false;
    if (is_of(plan, plan->text, logged)) return true;
    kn_scene *file = kn_scene_load(plan->scene_path, NULL, 0, error, sizeof error);
    bool same = file && is_of(plan, file->text, logged);
    kn_scene_destroy(file);
    return same;
}

bool kn_origin_check(const kn_replay *r, const kn_plan *plan, char *error, size_t error_size)
{
    if (r->damage[0]) {
        snprintf(error, error_size, "%s: %s, expected a whole log of one run", plan->log_path, r->damage);
        return false;
    }
    if (r->tally.malformed > 0) {
        snprintf(error, error_size, "%s: %lld malformed records, expected a whole log", plan->log_path,
                 (long long)r->tally.malformed);
        return false;
    }
    if (same_scene(r, plan)) return true;
    snprintf(error, error_size, "%s: was recorded with another scene, '%s', expected one of %s", plan->log_path,
             r->logged_name, plan->scene->name);
    return false;
}
