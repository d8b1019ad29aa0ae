#include "server/scene_change.h"
#include "core/snapshot.h"
#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// --- settings ---

int kn_settings_list(const kn_settings *settings, char room[KN_SETTINGS_BYTES], const char *list[KN_SETTINGS_MAX])
{
    int count = 0;
    // cut the copy of the text into strings at its newlines
    memcpy(room, settings->text, KN_SETTINGS_BYTES);
    room[KN_SETTINGS_BYTES - 1] = '\0';
    for (char *line = room, *end; count < KN_SETTINGS_MAX && (end = strchr(line, '\n')); line = end + 1) {
        *end = '\0';
        list[count++] = line;
    }
    return count;
}

// Return whether a text is KEY=VALUE without control characters, which would break the lines.
static bool is_set(const char *set)
{
    const char *equals = strchr(set, '=');
    if (!equals || equals == set) return false;
    for (const char *c = set; *c; c++)
        if (iscntrl((unsigned char)*c)) return false;
    return true;
}

bool kn_settings_add(kn_settings *settings, const char *set, char *error, int error_size)
{
    char room[KN_SETTINGS_BYTES];
    const char *list[KN_SETTINGS_MAX];
    kn_settings more = {0};
    size_t key = strcspn(set, "=") + 1, at = 0;
    if (!is_set(set)) {
        snprintf(error, (size_t)error_size, "set '%.100s': expected KEY=VALUE", set);
        return false;
    }
    // copy the settings of all other keys, then append the new setting
    int count = kn_settings_list(settings, room, list), kept = 0;
    for (int i = 0; i < count; i++) {
        if (strncmp(list[i], set, key) == 0) continue;
        // the kept lines fit, because they come from a text of the same size
        at += (size_t)sprintf(more.text + at, "%s\n", list[i]);
        kept++;
    }
    if (kept == KN_SETTINGS_MAX || at + strlen(set) + 2 > sizeof more.text) {
        snprintf(error, (size_t)error_size, "set '%.100s': expected at most %d settings of %d bytes in all", set,
                 KN_SETTINGS_MAX, KN_SETTINGS_BYTES);
        return false;
    }
    sprintf(more.text + at, "%s\n", set);
    *settings = more;
    return true;
}

kn_scene *kn_settings_parse(const kn_settings *settings, const kn_scene *base, const char *path, char *error,
                            size_t error_size)
{
    char room[KN_SETTINGS_BYTES];
    const char *list[KN_SETTINGS_MAX];
    int count = kn_settings_list(settings, room, list);
    return kn_scene_parse_beside(path, base->name, base->text, strlen(base->text), list, count, error, error_size);
}

// --- the change ---

// Compare those parts of the new scene and of the scene being served that threads other than the servo keep using.
// Return the difference, or NULL if the parts are equal.
static const char *misfit(const kn_scene *scene, const kn_scene *now)
{
    const kn_model_def *d = &scene->model, *e = &now->model;
    bool same = !d->mesh == !e->mesh &&
                (d->mesh || (memcmp(d->nodes, e->nodes, sizeof d->nodes) == 0 && d->spacing_m == e->spacing_m));
    if (!same) return "another lattice"; // refuse another lattice early, before anything is built
    bool points = scene->quality == now->quality;
    for (int q = 0; q < KN_QUALITIES; q++) points &= scene->point[q].live == now->point[q].live;
    if (!points) return "other quality points";
    if ((scene->threads == 2) != (now->threads == 2)) return "another solver.threads";
    if (scene->mesh_hz != now->mesh_hz) return "another mesh.rate";
    if (scene->mesh_measures != now->mesh_measures) return "other mesh.measures";
    return d->solver.dt_s != e->solver.dt_s ? "another solver.dt" : NULL;
}

// Build the model, the backend and the audit of the change. Return NULL on success; otherwise return the reason of the
// failure.
static const char *build(kn_scene_change *c, const kn_scene *now, const kn_model *model, bool identify, char *why,
                         size_t why_size)
{
    const char *wrong = misfit(c->scene, now);
    if (wrong) return wrong;
    c->model = kn_model_build(&c->scene->model, why, why_size);
    if (!c->model) return why;
    // Check that the state can be carried over to the new model.
    wrong = kn_carry_misfit(model, c->model);
    if (wrong) return wrong;
    kn_coupling coupling = {c->scene->device.coupling_n_m, c->scene->device.coupling_n_s_m};
    // Allocate everything that the servo will need, because a tick must not allocate.
    bool fits = kn_backend_cpu(&c->backend, c->model) && (c->carried = kn_state_create(c->model)) &&
                (!identify || kn_backend_cpu_identify(&c->backend, coupling));
    // Only the implicit solver has an energy audit.
    bool audits = c->scene->model.solver.kind == KN_SOLVER_IMPLICIT;
    if (fits && audits) c->audit = kn_audit_create(c->model);
    return fits && (c->audit || !audits) ? NULL : "not enough memory";
}

kn_state *kn_scene_settle(const kn_model *model)
{
    kn_backend b = {0};
    kn_state *state = NULL;
    const kn_input nobody = {0};
    kn_output output;
    const bool settles = model->def.gravity_m_s2 > 0 && model->def.support != KN_SUPPORT_NONE;
    if (settles && kn_backend_cpu(&b, model)) state = kn_state_create(model);
    for (int i = 0; state && i < KN_SETTLE_TICKS; i++) {
        b.submit(b.self, &nobody);
        b.wait(b.self, 0, &output);
    }
    if (state) kn_state_copy(model, state, b.state(b.self));
    if (state && state->bad) kn_state_destroy(state), state = NULL; // the physics diverged: begin undeformed
    if (b.destroy) b.destroy(b.self);
    return state;
}

const char *kn_scene_sinks(const kn_model *model, const kn_state *settled)
{
    double extent_m[3];
    if (!(model->def.gravity_m_s2 > 0) || model->def.support == KN_SUPPORT_NONE) return NULL;
    kn_model_def_extent(&model->def, extent_m);
    kn_state *undeformed = settled ? kn_state_create(model) : NULL;
    const bool sinks = undeformed && kn_state_moved(model, settled, undeformed, 0.25 * extent_m[2]);
    kn_state_destroy(undeformed);
    return !settled ? "under its weight the object comes apart within a second: is it held?"
           : sinks
               ? "under its weight the object moves by more than a quarter of its height within a second: is it held? "
                 "A larger support_depth holds more nodes"
               : NULL;
}

kn_scene_change *kn_scene_change_create(kn_scene *scene, const kn_scene *now, const kn_model *model, bool identify,
                                        char *error, size_t error_size)
{
    char why[200];
    kn_scene_change *c = calloc(1, sizeof *c);
    const char *wrong = "not enough memory";
    if (c) {
        c->scene = scene;
        wrong = build(c, now, model, identify, why, sizeof why);
        if (!wrong) return c->settled = kn_scene_settle(c->model), c;
        kn_scene_change_destroy(c);
    } else {
        kn_scene_destroy(scene);
    }
    snprintf(error, error_size,
             "%s: expected a change that keeps the object's state; a restart of kneadd allows any change", wrong);
    return NULL;
}

void kn_scene_change_destroy(kn_scene_change *change)
{
    if (!change) return;
    kn_audit_destroy(change->audit);
    kn_state_destroy(change->carried);
    kn_state_destroy(change->settled);
    if (change->backend.destroy) change->backend.destroy(change->backend.self);
    kn_model_destroy(change->model);
    kn_scene_destroy(change->scene);
    free(change);
}
