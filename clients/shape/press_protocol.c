#include "clients/shape/press_protocol.h"
#include "clients/hand/tool_height.h"
#include "clients/hand/tool_path.h"
#include "server/backend/backend.h"
#include "server/log_replay.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// duration of the path before the descent [s]; in this time the plate takes hold of the nodes that it touches
static const double lead_s = 0.2;
// a tool less than this distance above its lowest position counts as being at its lowest position
static const double still_m = 1e-4;
static const double shaking_m = 1e-6;
// a tool less than this distance above the top of the object at rest counts as touching the top
static const double near_m = 1e-3;
static const double period_s = 1e-3;
// smallest height that the object may have under the tool in its lowest position, as a share of the height at rest
static const double thinnest = 0.2;

#define LONGEST_TICKS 3600000 // largest number of ticks of a press: an hour, which takes 350 MB of memory for one probe

void kn_press_free(kn_press *p)
{
    free(p->time_s);
    free(p->input);
    free(p->logged_n);
    memset(p, 0, sizeof *p);
}

int64_t kn_press_tick(const kn_press *p, double time_s)
{
    int64_t first = 0, last = p->ticks - 1;
    while (first < last) {
        const int64_t middle = (first + last) / 2;
        if (p->time_s[middle] < time_s - KN_REPLAY_HALF_TICK_S) first = middle + 1;
        else last = middle;
    }
    return first;
}

static const kn_probe_input *tool_at(const kn_press *p, int64_t tick) { return &p->input[tick * p->probes + p->probe]; }

// Find the rise that leads to the tool's position in the given tick. Return the tick in which this rise begins. A tick
// belongs to the rise if the tool moves up in the tick, or if the tool has moved up by more than 1 um in the last 10 ms
// (0.1 mm/s). A tool that only shakes moves up by less than 1 um, so shaking is not taken for a rise.
static int64_t begin_of_rise(const kn_press *p, int64_t tick)
{
    enum { WINDOW = 10 };
    for (; tick > 0 && tool_at(p, tick - 1)->attached; tick--) {
        const double z_m = tool_at(p, tick)->position_m[2];
        const kn_probe_input *early = tool_at(p, tick > WINDOW ? tick - WINDOW : 0);
        const bool rises = z_m > tool_at(p, tick - 1)->position_m[2];
        if (!rises && !(early->attached && z_m - early->position_m[2] > shaking_m)) break;
    }
    return tick;
}

// Find the end of the hold. Begin at the last tick at which the tool is near its lowest position. This tick may come
// about 0.1 s after the tool has begun to leave, when the force has already vanished. So search backwards from this
// tick for the start of the rise.
static void find_hold(kn_press *p)
{
    double lowest_m = INFINITY;
    int64_t last = 0;
    for (int64_t t = 0; t < p->ticks; t++)
        if (tool_at(p, t)->attached) lowest_m = fmin(lowest_m, tool_at(p, t)->position_m[2]);
    for (int64_t t = 0; t < p->ticks; t++)
        if (tool_at(p, t)->attached && tool_at(p, t)->position_m[2] <= lowest_m + still_m) last = t;
    const int64_t rise = begin_of_rise(p, last);
    p->hold_end_s =
        // in the first tick of the rise the tool moves up and the force has vanished, so the hold ends one tick earlier
        p->time_s[rise > 0 ? rise - 1 : 0];
    p->end_s = p->time_s[p->ticks - 1];
}

// ---- press along the path of the first paper

// Return the probe of this name. Without a name, return the first plate; if there is no plate, return the first probe.
// If the scene does not have the probe, write an error to `error` and return -1.
static int choose_probe(const kn_model_def *def, const char *name, char *error, size_t error_size)
{
    for (int i = 0; i < def->probe_count; i++)
        if (name ? !strcmp(def->probe[i].name, name) : def->probe[i].shape == KN_PROBE_PLATE) return i;
    if (!name && def->probe_count > 0) return 0;
    snprintf(error, error_size,
             name ? "--probe %s: the scene has no probe of that name"
                  : "the scene has no probe%s, expected one to press with",
             name ? name : "");
    return -1;
}

// Fill the inputs of the path. At the start of each tick the tool is at the position that the path had one tick
// earlier. The velocity moves the tool so that it reaches the path's present position at the end of the tick.
static void follow(kn_press *p, const kn_tool_path *path, double from_s)
{
    for (int64_t t = 0; t < p->ticks; t++) {
        kn_tool_path_point before, now;
        kn_probe_input *in = &p->input[t * p->probes + p->probe];
        const double at_s = from_s + period_s * (double)(t + 1);
        p->time_s[t] = period_s * (double)(t + 1) - lead_s;
        kn_tool_path_at(path, at_s - period_s, &before);
        kn_tool_path_at(path, at_s, &now);
        in->attached = true;
        memcpy(in->position_m, before.position_m, sizeof in->position_m);
        memcpy(in->orientation_wxyz, now.orientation_wxyz, sizeof in->orientation_wxyz);
        for (int k = 0; k < 3; k++) in->velocity_m_s[k] = (now.position_m[k] - before.position_m[k]) / period_s;
    }
}

static double begin_of(const kn_tool_path *path, const char *name)
{
    for (int i = 0; i < path->count; i++)
        if (!strcmp(path->piece[i].name, name)) return path->piece[i].start_s;
    return 0;
}

bool kn_press_path(kn_press *p, const kn_scene *scene, const kn_press_def *def, char *error, size_t error_size)
{
    const kn_model_def *object = &scene->model;
    double extent_m[3];
    kn_model_def_extent(object, extent_m);
    *p = (kn_press){.probes = object->probe_count, .probe = choose_probe(object, def->probe, error, error_size)};
    // Refuse a press that is too deep for the object's height, or a path longer than an hour.
    if (p->probe < 0) return false;
    const double depth_m = def->depth_m > 0 ? def->depth_m : 0.01;
    if (depth_m > (1 - thinnest) * extent_m[2]) {
        snprintf(error, error_size, "a press of %g mm, expected at most %.3g mm (%g of the object's height)",
                 1e3 * depth_m, 1e3 * (1 - thinnest) * extent_m[2], 1 - thinnest);
        return false;
    }
    const kn_tool_path_def shape = {.touch_z_m = extent_m[2] + kn_tool_height_m(&object->probe[p->probe]),
                                    .depth_m = depth_m,
                                    .speed_m_s = def->speed_m_s > 0 ? def->speed_m_s : 0.01,
                                    .hold_s = def->hold_s < 0   ? 0
                                              : def->hold_s > 0 ? def->hold_s
                                                                : 30};
    kn_tool_path *path = kn_tool_path_press(&shape);
    const double from_s = path ? begin_of(path, "press") - lead_s : 0;
    const double ticks = path ? ceil((path->duration_s - from_s) / period_s) : INFINITY;
    if (ticks <= LONGEST_TICKS) p->ticks = (int64_t)ticks;
    if (p->ticks > 0) p->input = calloc((size_t)(p->ticks * p->probes), sizeof *p->input);
    if (p->input) p->time_s = calloc((size_t)p->ticks, sizeof *p->time_s);
    const bool ok = p->time_s;
    if (ok) {
        follow(p, path, from_s);
        find_hold(p);
    } else {
        snprintf(error, error_size, "a press of %.0f s, expected at most an hour", path ? path->duration_s : 0);
        kn_press_free(p);
    }
    kn_tool_path_destroy(path);
    return ok;
}

// ---- press from a log
//
// The servo loop and its safety stage decide which poses of a log reach the lattice. So the servo replays the log, and
// a listener between the servo and the backend records the poses that pass.

typedef struct listener {
    kn_backend own; // original backend of the replay; the listener passes every call on to this backend
    kn_press *press;
    int64_t room;
    bool short_of_memory; // true: memory ran out, or the log is longer than an hour
} listener;

static bool grow(listener *l)
{
    kn_press *p = l->press;
    if (p->ticks < l->room) return true;
    const int64_t room = l->room ? 2 * l->room : 65536;
    kn_probe_input *input = realloc(p->input, (size_t)(room * p->probes) * sizeof *input);
    if (input) p->input = input;
    double *time_s = realloc(p->time_s, (size_t)room * sizeof *time_s);
    if (time_s) p->time_s = time_s;
    double *logged_n = realloc(p->logged_n, (size_t)room * sizeof *logged_n);
    if (logged_n) p->logged_n = logged_n;
    if (!input || !time_s || !logged_n) return false;
    l->room = room;
    return true;
}

// The backend functions of the listener: record the input on submit, and pass every call on.
static void heard(void *self, const kn_input *input)
{
    listener *l = self;
    kn_press *p = l->press;
    if (p->ticks < LONGEST_TICKS && grow(l)) {
        memcpy(&p->input[p->ticks * p->probes], input->probe, (size_t)p->probes * sizeof *p->input);
        p->logged_n[p->ticks++] = (double)NAN;
    } else l->short_of_memory = true;
    l->own.submit(l->own.self, input);
}

static kn_backend_status waited(void *self, int64_t deadline_ns, kn_output *output)
{
    listener *l = self;
    return l->own.wait(l->own.self, deadline_ns, output);
}

static const kn_state *looked(void *self) { return ((listener *)self)->own.state(((listener *)self)->own.self); }
static void as_new(void *self) { ((listener *)self)->own.reset(((listener *)self)->own.self); }
static void given_back(void *self, const kn_state *s)
{
    ((listener *)self)->own.restore(((listener *)self)->own.self, s);
}

// Return the first attached tool that comes down to the object at rest, or -1 if there is none. If `wanted` >= 0, look
// only at the tool `wanted`.
static int first_touching(const kn_press *p, const kn_model_def *object, int wanted)
{
    double extent_m[3];
    kn_model_def_extent(object, extent_m);
    for (int64_t t = 0; t < p->ticks; t++)
        for (int i = 0; i < p->probes; i++) {
            const kn_probe_input *in = &p->input[t * p->probes + i];
            const bool low = in->position_m[2] - kn_tool_height_m(&object->probe[i]) <= extent_m[2] + near_m;
            if (in->attached && low && (wanted < 0 || i == wanted)) return i;
        }
    return -1;
}

// Store the logged force of the tool `wanted`. If `wanted` is -1, store the logged force of the last attached tool.
static void take_force(kn_press *p, const kn_replay_tick *tick, int wanted)
{
    for (int i = 0; i < p->probes; i++) {
        const bool counts = wanted >= 0 ? i == wanted : p->input[(p->ticks - 1) * p->probes + i].attached;
        if (counts && tick->logged[i]) p->logged_n[p->ticks - 1] = tick->logged[i]->contact_force_n[2];
    }
}

// Replay the log to its end. Each tick of the press gets the time of the replay. Some cycles give no tick: cycles that
// the server missed, and cycles that the log omits while the object is untouched and at rest.
static bool listen(kn_replay *r, listener *l)
{
    kn_press *p = l->press;
    const int wanted = p->probe;
    for (int64_t heard_of = 0; kn_replay_step(r) && !l->short_of_memory; heard_of = p->ticks) {
        if (p->ticks == heard_of) continue;
        p->time_s[p->ticks - 1] = r->tick.time_s;
        take_force(p, &r->tick, wanted);
    }
    return !l->short_of_memory;
}

bool kn_press_log(kn_press *p, const kn_scene *scene, const kn_press_def *def, const char *log, char *error,
                  size_t error_size)
{
    // A replay that takes only the poses from the log (`afresh`) needs at least one setting. So pass quality=own, which
    // does not change the poses.
    const char *const set = "quality=own";
    *p = (kn_press){.probes = scene->model.probe_count, .probe = -1};
    if (def->probe && (p->probe = choose_probe(&scene->model, def->probe, error, error_size)) < 0) return false;
    kn_replay *r = kn_replay_create(&(kn_replay_def){.log_path = log, .sets = &set, .set_count = 1, .afresh = true},
                                    error, error_size);
    if (!r) return false;
    // The probes of both scenes must have the same names, since the poses belong to these probes.
    bool good = r->model->def.probe_count == p->probes;
    for (int i = 0; good && i < p->probes; i++) good = !strcmp(r->model->def.probe[i].name, scene->model.probe[i].name);
    if (!good) snprintf(error, error_size, "%s: was recorded with other probes, expected those of the scene", log);
    // Put the listener in the place of the replay's backend.
    listener l = {.own = r->backend, .press = p};
    r->backend.self = &l;
    r->backend.submit = heard;
    r->backend.wait = waited;
    r->backend.state = looked;
    r->backend.reset = as_new;
    r->backend.restore = given_back;
    if (good && !(good = listen(r, &l))) snprintf(error, error_size, "%s: longer than an hour, or out of memory", log);
    r->backend = l.own;
    kn_replay_destroy(r);
    if (good && (p->probe = first_touching(p, &scene->model, p->probe)) < 0) {
        snprintf(error, error_size,
                 def->probe ? "%s: the %s never touches the object in this log, expected a tool that does"
                            : "%s: no tool touches the object in this log, expected a press",
                 log, def->probe);
        good = false;
    }
    if (good) find_hold(p);
    else kn_press_free(p);
    return good;
}

// ---- simulation of the press on a model

void kn_pressed_free(kn_pressed *p)
{
    free(p->force_n);
    for (int i = 0; i < KN_PRESS_MOMENTS; i++) free(p->shape_m[i]);
    memset(p, 0, sizeof *p);
}

// Allocate the results of a press.
static bool make_room(kn_pressed *out, int64_t ticks, const kn_press_play *play)
{
    memset(out, 0, sizeof *out);
    out->vertex_count = play->surface->vertex_count;
    bool ok = (out->force_n = calloc((size_t)ticks + 1, sizeof *out->force_n));
    for (int i = 0; i < play->moments; i++)
        ok &= (out->shape_m[i] = calloc((size_t)out->vertex_count, sizeof *out->shape_m[i])) != NULL;
    return ok;
}

bool kn_press_run(const kn_press *p, const kn_press_play *play, kn_pressed *out)
{
    enum { TELL_EVERY = 1000 };
    const int64_t ticks = kn_press_tick(p, play->until_s) + 1;
    kn_backend b = {0};
    bool ok = make_room(out, ticks, play) && kn_backend_cpu(&b, play->model);
    for (int64_t t = 0; ok && t < ticks; t++) {
        kn_input in = {0};
        kn_output result;
        // Step the model with the recorded input of this tick, and keep force and surface.
        memcpy(in.probe, &p->input[t * p->probes], (size_t)p->probes * sizeof *p->input);
        b.submit(b.self, &in);
        ok = b.wait(b.self, 0, &result) == KN_BACKEND_OK;
        out->force_n[out->ticks++] = result.probe[p->probe].force_n[2];
        for (int i = 0; i < play->moments; i++)
            if (kn_press_tick(p, play->moment_s[i]) == t)
                kn_surface_positions(play->surface, play->model, b.state(b.self), (float *)out->shape_m[i]);
        if (play->told && (t + 1) % TELL_EVERY == 0) play->told(play->of, TELL_EVERY);
    }
    if (b.destroy) b.destroy(b.self);
    if (!ok) kn_pressed_free(out);
    return ok;
}
