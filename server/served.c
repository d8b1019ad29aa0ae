#include "server/served.h"
#include "core/composite.h"
#include "server/clock.h"
#include "server/keeper.h"
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// /proc/meminfo's MemAvailable: what may be had without swapping. SIZE_MAX where it is not told.
static size_t memory_available(void)
{
    unsigned long long kib = 0;
    char line[128];
    FILE *file = fopen("/proc/meminfo", "r");
    while (file && !kib && fgets(line, sizeof line, file)) sscanf(line, "MemAvailable: %llu kB", &kib);
    if (file) fclose(file);
    return kib ? (size_t)kib * 1024 : SIZE_MAX;
}

// Linux grants what it does not have and kills whoever touches it; a locked state is touched at once.
static bool check_memory(size_t bytes, const char *what, const char *path, char *error, size_t error_size)
{
    size_t available = memory_available();
    if (bytes <= available) return true;
    snprintf(error, error_size, "%s: %s needs %zu MiB and %zu MiB of memory are free, expected fewer nodes", path, what,
             (bytes >> 20) + 1, available >> 20);
    return false;
}

// A node has at least its mass in the model, and position and velocity in the state.
static size_t least_bytes(const kn_model_def *def)
{
    size_t nodes = def->mesh ? (size_t)def->mesh->node_count
                             : (size_t)def->nodes[0] * (size_t)def->nodes[1] * (size_t)def->nodes[2];
    if (kn_composite_is(def)) nodes = (size_t)kn_composite_nodes(def);
    return nodes * (sizeof(double) + 6 * sizeof(float));
}

// The file as the options say; and if the newest snapshot is of an object over which more was set, with that.
static bool load_scene(kn_served *s, const kn_served_def *def, char *error, size_t error_size)
{
    char room[KN_SETS_BYTES], why[400];
    const char *list[KN_SETS_MAX];
    s->base = kn_scene_load(def->scene_path, def->sets, def->set_count, error, error_size);
    if (!s->base) return false;
    s->sets.base_hash = s->base->text_hash;
    if (def->state_dir) kn_store_sets(def->state_dir, s->base, &s->sets);
    int count = kn_sets_list(&s->sets, room, list);
    s->scene = s->base;
    if (count == 0) return true;
    s->scene = kn_scene_parse_beside(def->scene_path, s->base->name, s->base->text, strlen(s->base->text), list, count,
                                     why, sizeof why);
    if (s->scene && !kn_safety_raised(&s->scene->limits, &s->base->limits)) return true;
    fprintf(stderr, "kneadd: what was set before the last end is not any more: %s\n", s->scene ? "limits" : why);
    if (s->scene) kn_scene_destroy(s->scene);
    s->sets = (kn_sets){.base_hash = s->base->text_hash};
    s->scene = s->base;
    return true;
}

static bool build(kn_served *s, const kn_served_def *def, char *error, size_t error_size)
{
    if (!load_scene(s, def, error, error_size)) return false;
    if (kn_backend_steps(s->scene->model.solver.dt_s) == 0) {
        snprintf(error, error_size, "%s:%d:%d: solver.dt is %g s, expected the 1 ms tick divided by a whole number",
                 def->scene_path, s->scene->solver_line, s->scene->solver_col, s->scene->model.solver.dt_s);
        return false;
    }
    if (!check_memory(least_bytes(&s->scene->model), "the object", def->scene_path, error, error_size)) return false;
    char why[256];
    s->model = kn_model_build(&s->scene->model, why, sizeof why);
    if (!s->model) {
        snprintf(error, error_size, "%s:%d:%d: %s", def->scene_path, s->scene->solver_line, s->scene->solver_col, why);
        return false;
    }
    size_t bytes = s->model->state_bytes + kn_state_kept(s->model) + kn_keeper_bytes(s->model, def->state_dir);
    if (!check_memory(bytes, "the object's state and its copies", def->scene_path, error, error_size)) return false;
    if (!kn_backend_cpu(&s->backend, s->model)) {
        snprintf(error, error_size, "%s: not enough memory for the object's %zu bytes", def->scene_path,
                 s->model->state_bytes);
        return false;
    }
    s->audit = kn_audit_create(s->model);
    if (!s->audit && s->scene->model.solver.kind == KN_SOLVER_IMPLICIT) {
        snprintf(error, error_size, "%s: not enough memory for the object's audit", def->scene_path);
        return false;
    }
    const kn_device_def *device = &s->scene->device;
    kn_coupling coupling = {device->coupling_n_m, device->coupling_n_s_m};
    if (def->local_model && s->scene->model.solver.kind != KN_SOLVER_IMPLICIT) {
        snprintf(error, error_size, "%s: --local-model: expected solver.kind implicit", def->scene_path);
        return false;
    }
    if (def->local_model && !kn_backend_cpu_identify(&s->backend, coupling)) {
        snprintf(error, error_size, "%s: --local-model: not enough memory", def->scene_path);
        return false;
    }
    return true;
}

bool kn_served_load(kn_served *served, const kn_served_def *def, char *error, size_t error_size)
{
    *served = (kn_served){0};
    if (build(served, def, error, error_size)) return true;
    kn_served_free(served);
    return false;
}

void kn_served_free(kn_served *served)
{
    kn_served *s = served;
    kn_audit_destroy(s->audit);
    if (s->backend.destroy) s->backend.destroy(s->backend.self);
    kn_model_destroy(s->model);
    if (s->scene != s->base) kn_scene_destroy(s->scene);
    kn_scene_destroy(s->base);
    *s = (kn_served){0};
}
