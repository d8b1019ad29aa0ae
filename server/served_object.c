#include "server/served_object.h"
#include "server/scene_change.h"
#include "server/backend/fpga.h"
#include "core/lattice/lattice.h"
#include "core/solve/step_effort.h"
#include "server/clock.h"
#include "server/keeper.h"
#include "server/rt.h"
#include "server/console.h"
#include "server/skin.h"
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Return the memory available without swapping (MemAvailable of /proc/meminfo), bytes. Return SIZE_MAX if it is
// unknown.
static size_t memory_available(void)
{
    unsigned long long kib = 0;
    char line[128];
    FILE *file = fopen("/proc/meminfo", "r");
    while (file && !kib && fgets(line, sizeof line, file)) sscanf(line, "MemAvailable: %llu kB", &kib);
    if (file) fclose(file);
    return kib ? (size_t)kib * 1024 : SIZE_MAX;
}

// Refuse an object that does not fit into memory. Linux grants more memory than the machine has, and later kills a
// process that uses so much. If kneadd locks its memory, it uses all of it at once.
static bool check_memory(size_t bytes, const char *what, const char *path, char *error, size_t error_size)
{
    size_t available = memory_available();
    if (bytes <= available) return true;
    return kn_refuse(error, error_size,
                     "%s: %s needs %zu MiB, but only %zu MiB of memory are free; expected fewer nodes", path, what,
                     (bytes >> 20) + 1, available >> 20);
}

// Return a lower bound of the object's bytes before the model is built: each node has a mass in the model, and position
// and velocity in the state.
static size_t least_bytes(const kn_model_def *def)
{
    size_t nodes = def->mesh ? (size_t)def->mesh->node_count
                             : (size_t)def->nodes[0] * (size_t)def->nodes[1] * (size_t)def->nodes[2];
    if (kn_composite_is(def)) nodes = (size_t)kn_composite_nodes(def);
    return nodes * (sizeof(double) + 6 * sizeof(float));
}

// Parse the scene with the restored settings. Return NULL and put the reason in `why` if the settings do not fit the
// scene any more, or if a safety limit of the hand would exceed the scene's.
static kn_scene *with_settings(const kn_served_object *s, const kn_served_object_def *def, char *why, size_t why_size)
{
    kn_scene *scene = kn_settings_parse(&s->settings, s->base, def->scene_path, why, why_size);
    const char *raised = scene ? kn_safety_raised(&scene->limits, &s->base->limits) : NULL;
    if (!raised) return scene;
    snprintf(why, why_size, "%s relaxes a safety limit of the hand beyond the scene's value", raised);
    kn_scene_destroy(scene);
    return NULL;
}

// Remove all settings whose key begins with "device" from the list.
static void without_device(kn_settings *settings)
{
    char room[KN_SETTINGS_BYTES], error[200];
    const char *list[KN_SETTINGS_MAX];
    int count = kn_settings_list(settings, room, list);
    *settings = (kn_settings){0};
    for (int i = 0; i < count; i++)
        if (strncmp(list[i], "device", 6) != 0) kn_settings_add(settings, list[i], error, (int)sizeof error);
}

// Load the scene of the file and the options. If the newest snapshot of this scene has settings, apply the settings as
// well. If the scene no longer allows the settings, drop those of the device. If the scene does not allow the remaining
// settings either, drop all settings.
static bool load_scene(kn_served_object *s, const kn_served_object_def *def, char *error, size_t error_size)
{
    char why[400];
    s->base = def->text ? kn_scene_parse_beside(def->scene_path, def->name, def->text, strlen(def->text), NULL, 0,
                                                error, error_size)
                        : kn_scene_load(def->scene_path, def->sets, def->set_count, error, error_size);
    s->scene = s->base;
    if (!s->base) return false;
    if (def->state_dir) kn_store_settings(def->state_dir, s->base, &s->settings);
    for (int try = 0; *s->settings.text; try++) {
        s->scene = with_settings(s, def, why, sizeof why);
        if (s->scene) break;
        kn_console_err("kneadd: %s of the last run are left out: %s",
                       try == 0 ? "the device's settings" : "all settings", why);
        if (try == 0) without_device(&s->settings);
        else s->settings = (kn_settings){0};
        s->scene = s->base;
    }
    return true;
}

// Create the backend: a circuit or this processor. Return exit code 3 if the circuit cannot be used.
static bool place(kn_served_object *s, const kn_served_object_def *def, size_t room, int *code, char *error,
                  size_t error_size)
{
    char why[KN_LINK_WHY];
    bool device = false;
    if (kn_backend_place(&s->backend, s->model, def->device, false, room, why, &device)) return true;
    if (device) *code = 3;
    return kn_refuse(error, error_size, "%s%s%s", device ? "" : def->scene_path, device ? "" : ": ", why);
}

// Build scene, model, backend and audit. Before the model and the backend are built, check that they fit into memory.
static bool build(kn_served_object *s, const kn_served_object_def *def, int *code, char *error, size_t error_size)
{
    if (!load_scene(s, def, error, error_size)) return false;
    if (kn_backend_steps(s->scene->model.solver.dt_s) == 0)
        return kn_refuse(error, error_size,
                         "%s:%d:%d: solver.dt is %g s, expected the 1 ms tick divided by a whole number",
                         def->scene_path, s->scene->solver_line, s->scene->solver_col, s->scene->model.solver.dt_s);
    if (!check_memory(least_bytes(&s->scene->model), "the object", def->scene_path, error, error_size)) return false;
    // build the model, and report a failure at the solver's line of the scene
    char why[256];
    s->model = kn_model_build(&s->scene->model, why, sizeof why);
    if (!s->model)
        return kn_refuse(error, error_size, "%s:%d:%d: %s", def->scene_path, s->scene->solver_line,
                         s->scene->solver_col, why);
    // check that the state, and its copies for undo, snapshots and mesh, fit into memory
    size_t bytes = 2 * kn_state_size(s->model) + kn_scratch_size(s->model) + kn_keeper_bytes(s->model, def->state_dir) +
                   kn_skin_bytes(s->scene, s->model);
    if (!check_memory(bytes, "the object's state and its copies", def->scene_path, error, error_size)) return false;
    // a circuit's queue of ticks may use the rest of the memory
    const size_t free_bytes = memory_available();
    if (!place(s, def, free_bytes > bytes ? free_bytes - bytes : 0, code, error, error_size)) return false;
    s->settled = kn_scene_settle(s->model);
    const char *sinks = kn_scene_sinks(s->model, s->settled);
    if (sinks) kn_console_err("kneadd: %s: %s", def->scene_path, sinks);
    // build the energy audit, and prepare local contact models; only the implicit solver supports both
    s->audit = kn_audit_create(s->model);
    if (!s->audit && s->scene->model.solver.kind == KN_SOLVER_IMPLICIT)
        return kn_refuse(error, error_size, "%s: not enough memory for the object's audit", def->scene_path);
    const kn_device_def *device = &s->scene->device;
    kn_coupling coupling = {device->coupling_n_m, device->coupling_n_s_m};
    if (def->local_model && s->scene->model.solver.kind != KN_SOLVER_IMPLICIT)
        return kn_refuse(error, error_size, "%s: --local-model: expected solver.kind implicit", def->scene_path);
    if (def->local_model && !kn_backend_cpu_identify(&s->backend, coupling))
        return kn_refuse(error, error_size, "%s: --local-model: not enough memory", def->scene_path);
    return true;
}

// Fill in the input of one tick of a simulated impact: all tools move into the top of the object at 5 cm/s. `tick`:
// number of the tick since the impact began.
static void strike(const kn_model *model, int tick, kn_input *input)
{
    double extent[3];
    kn_model_def_extent(&model->def, extent);
    for (int p = 0; p < model->def.probe_count; p++) {
        double height_m = extent[2] + model->def.probe[p].radius_m - 1e-3 - 5e-5 * tick;
        input->probe[p] = (kn_probe_input){true, {0, 0, height_m}, {0, 0, -0.05}, {1, 0, 0, 0}, false};
    }
}

// Run one tick of the backend, and return its time by the given clock, ns.
static int64_t step(kn_backend *b, kn_helper *helper, clockid_t clock, const kn_input *input, kn_output *output)
{
    int64_t from_ns = kn_rt_clock_ns(clock);
    kn_helper_wake(helper);
    b->submit(b->self, input);
    b->wait(b->self, 0, output);
    kn_helper_rest(helper);
    return kn_rt_clock_ns(clock) - from_ns;
}

// Measure a few ticks and take the shortest, because other processes can only lengthen a tick. Stop after 20 ms.
int64_t kn_served_object_measure(kn_backend *b, const kn_model *pressed)
{
    // measure a circuit by elapsed time, not by processor time, because the circuit works while this thread waits
    kn_fpga_counts circuit;
    const clockid_t clock = kn_backend_fpga_counts(b, &circuit) ? CLOCK_MONOTONIC : CLOCK_THREAD_CPUTIME_ID;
    // a circuit whose object was replaced takes it up first, or its ticks are not measured
    for (int i = 0; i < 1000 && circuit.there && !circuit.in_step; i++) {
        b->afterwards(b->self);
        kn_clock_sleep(kn_now_ns() + KN_PERIOD_NS);
        kn_backend_fpga_counts(b, &circuit);
    }
    int64_t start_ns = kn_rt_clock_ns(clock), best_ns = INT64_MAX;
    for (int i = 0; i < 10 && kn_rt_clock_ns(clock) - start_ns < 20 * KN_PERIOD_NS; i++) {
        kn_input input = {0};
        kn_output output;
        if (pressed) strike(pressed, i, &input);
        int64_t took_ns = step(b, NULL, clock, &input, &output);
        if (took_ns < best_ns) best_ns = took_ns;
    }
    b->reset(b->self);
    return best_ns;
}

// Simulated impact (all tools hit the object). STRIKES: number of its ticks; STRIKE_ROUNDS: number of its repetitions;
// STRIKE_UNITS: largest number of units of work (core/solve/step_effort.h) per step while the deadline is measured.
enum { STRIKES = 12, STRIKE_ROUNDS = 12, STRIKE_UNITS = 600000 };

// Measure the time and the units of work of each tick of a simulated impact. Repeat the impact, and keep the shortest
// time of each tick. Stop after 0.1 s of processor time.
static void strike_all(kn_backend *b, kn_helper *helper, const kn_model *model, int64_t deadline,
                       int64_t took_ns[STRIKES], int64_t units[STRIKES])
{
    const clockid_t clock = CLOCK_THREAD_CPUTIME_ID;
    const int64_t start_ns = kn_rt_clock_ns(clock);
    if (helper) kn_rt_move(KN_RT_CPU_SERVO); // else the two threads could share a processor
    kn_helper_join(helper, b, model);
    for (int round = 0; round < STRIKE_ROUNDS && kn_rt_clock_ns(clock) - start_ns < 100 * KN_PERIOD_NS; round++) {
        b->reset(b->self);
        for (int i = 0; i < STRIKES; i++) {
            kn_input input = {.deadline = deadline};
            kn_output output;
            strike(model, i, &input);
            int64_t ns = step(b, helper, clock, &input, &output);
            if (round == 0 || ns < took_ns[i]) took_ns[i] = ns;
            units[i] = output.units;
        }
    }
    if (helper) kn_rt_move(KN_RT_CPU_ANY);
    b->reset(b->self);
}

int64_t kn_served_object_deadline(kn_backend *b, kn_helper *helper, const kn_model *model, double budget_s)
{
    const int64_t least = kn_deadline_least(model);
    int64_t took_ns[STRIKES], units[STRIKES];
    int64_t sum_ns = 0, sum = 0, longest = 0;
    if (model->def.solver.kind != KN_SOLVER_IMPLICIT) return 0;
    strike_all(b, helper, model, least > STRIKE_UNITS ? least : STRIKE_UNITS, took_ns, units);
    // use only the long steps, because a short step mostly consists of work that a deadline does not shorten
    for (int i = 0; i < STRIKES; i++) longest = units[i] > longest ? units[i] : longest;
    for (int i = 0; i < STRIKES; i++)
        if (4 * units[i] >= 3 * longest) sum_ns += took_ns[i], sum += units[i];
    // number of units of work that fit into KN_STEP_SHARE of the time budget
    const int64_t most = (int64_t)(1e9 * KN_STEP_SHARE * budget_s * (double)sum / fmax((double)sum_ns, 1));
    return most > least ? most : least;
}

int64_t kn_served_object_worst(kn_backend *b, kn_helper *helper, const kn_model *model, int64_t deadline)
{
    int64_t took_ns[STRIKES], units[STRIKES], worst_ns = 0;
    strike_all(b, helper, model, deadline, took_ns, units);
    for (int i = 0; i < STRIKES; i++) worst_ns = took_ns[i] > worst_ns ? took_ns[i] : worst_ns;
    return worst_ns;
}

int kn_served_object_load(kn_served_object *served, const kn_served_object_def *def, char *error, size_t error_size)
{
    int code = 2;
    *served = (kn_served_object){0};
    if (build(served, def, &code, error, error_size)) return 0;
    kn_served_object_free(served);
    return code;
}

void kn_served_object_help(kn_served_object *served)
{
    kn_served_object *s = served;
    if (s->scene->threads < 2) return;
    s->helper = kn_helper_create(s->alone, sizeof s->alone);
    if (!s->helper) return;
    const bool implicit = s->model->def.solver.kind == KN_SOLVER_IMPLICIT;
    snprintf(s->alone, sizeof s->alone, "%s", implicit ? "the object is too small" : "expected solver.kind implicit");
    if (kn_helper_join(s->helper, &s->backend, s->model)) {
        // the second processor may be half of one core, or busy
        const int64_t two_ns = kn_served_object_worst(&s->backend, s->helper, s->model, 0),
                      one_ns = kn_served_object_worst(&s->backend, NULL, s->model, 0);
        *s->alone = '\0';
        if (two_ns < one_ns) return;
        snprintf(s->alone, sizeof s->alone, "a strike took %.2g ms with two, %.2g ms with one", 1e-6 * (double)two_ns,
                 1e-6 * (double)one_ns);
    }
    kn_helper_destroy(s->helper);
    s->helper = NULL;
}

void kn_served_object_free(kn_served_object *served)
{
    kn_served_object *s = served;
    kn_helper_destroy(s->helper);
    kn_audit_destroy(s->audit);
    kn_state_destroy(s->settled);
    if (s->backend.destroy) s->backend.destroy(s->backend.self);
    kn_model_destroy(s->model);
    if (s->scene != s->base) kn_scene_destroy(s->scene);
    kn_scene_destroy(s->base);
    *s = (kn_served_object){0};
}
