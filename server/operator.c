#include "server/operator.h"
#include "server/backend/loss.h"
#include <ctype.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define SECRET 64       // room for the text that replaces a quotation in an error message (keep_secret), bytes
#define PATIENCE_MS 500 // longest wait for a tick or the main thread; a running server answers far sooner

void kn_operator_init(kn_operator *o, const kn_operator_def *on)
{
    *o = (kn_operator){.on = *on, .settings = on->served->settings};
    pthread_mutex_init(&o->setting, NULL);
    kn_mailbox_init(&o->health, o->health_slots, sizeof o->health_slots[0]);
}

void kn_operator_free(kn_operator *o)
{
    kn_scene_change_destroy(o->before);
    kn_scene_change_destroy(o->now);
    o->before = o->now = NULL;
}

// Sleep 0.5 ms between two checks for an answer.
static void rest(void) { kn_clock_sleep(kn_now_ns() + 500000); }

// --- status ---

// List the names of the bits that are set in `bits`.
static json_t *names_of(int32_t bits, const char *const names[], int count)
{
    json_t *array = json_array();
    for (int i = 0; i < count; i++)
        if (bits >> i & 1) json_array_append_new(array, json_string(names[i]));
    return array;
}

// Return the percentiles of a histogram of times. A percentile is given as the upper bound of its bucket, us.
static json_t *histogram(const int64_t count[KN_HISTOGRAM])
{
    static const struct {
        const char *name;
        double share;
    } wanted[] = {{"p50", 0.5}, {"p99", 0.99}, {"p999", 0.999}, {"max", 1.0}};
    json_t *object = json_object();
    int64_t all = 0;
    for (int i = 0; i < KN_HISTOGRAM; i++) all += count[i];
    // add up the buckets until their sum reaches the wanted share of all counts
    for (size_t w = 0; w < sizeof wanted / sizeof *wanted; w++) {
        int64_t least = (int64_t)ceil(wanted[w].share * (double)all), seen = 0;
        int bucket = 0;
        while (bucket < KN_HISTOGRAM - 1 && (seen += count[bucket]) < least) bucket++;
        json_object_set_new(object, wanted[w].name, json_integer((json_int_t)1 << bucket));
    }
    return object;
}

static json_t *counts(const int64_t count[KN_HISTOGRAM])
{
    json_t *array = json_array();
    for (int i = 0; i < KN_HISTOGRAM; i++) json_array_append_new(array, json_integer(count[i]));
    return array;
}

static json_t *spread(const double of[4])
{
    return json_pack("{s:f, s:f, s:f, s:f}", "mean", of[0], "std", of[1], "min", of[2], "max", of[3]);
}

// Report how often probes were latched, by reason, and in how many seconds the object created energy.
static json_t *trips(const knead_health_t *m)
{
    static const struct {
        const char *name;
        int at;
    } names[] = {{"pose_silence", KNEAD_HEALTH_T_TRIP_POSE_SILENCE}, {"impulse", KNEAD_HEALTH_T_TRIP_IMPULSE},
                 {"nonfinite", KNEAD_HEALTH_T_TRIP_NONFINITE},       {"estop", KNEAD_HEALTH_T_TRIP_ESTOP},
                 {"passivity", KNEAD_HEALTH_T_TRIP_PASSIVITY},       {"overload", KNEAD_HEALTH_T_TRIP_OVERLOAD}};
    json_t *object = json_object();
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        json_object_set_new(object, names[i].name, json_integer(m->trips[names[i].at]));
    return object;
}

// Describe the circuit of --backend DEVICE: state, counters, reasons of losses, round-trip times.
static json_t *circuit(const knead_health_t *m)
{
    static const char *const states[] = {"none", "in_step", "behind", "lost"};
    json_t *because = json_object();
    for (int i = 0; i < KN_LOSS_COUNT; i++)
        json_object_set_new(because, kn_loss_word((kn_loss)i), json_integer(m->circuit_because[i]));
    kn_loss last = m->circuit_last < 0 ? KN_LOSS_COUNT : (kn_loss)m->circuit_last;
    return json_pack("{s:s, s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:s, s:o, s:{s:f, s:f, s:f}}", "state",
                     states[m->circuit], "ok", (json_int_t)m->circuit_ok, "timeouts", (json_int_t)m->circuit_timeouts,
                     "crc", (json_int_t)m->circuit_crc, "fallbacks", (json_int_t)m->circuit_fallbacks, "losses",
                     (json_int_t)m->circuit_losses, "different", (json_int_t)m->circuit_different, "loads",
                     (json_int_t)m->circuit_loads, "last_loss", kn_loss_word(last), "because", because, "rtt_us", "p50",
                     m->circuit_rtt_us[0], "p99", m->circuit_rtt_us[1], "max", m->circuit_rtt_us[2]);
}

// Report the link counters of a probe's poses.
static json_t *packets(const knead_health_t *m, int p)
{
    return json_pack("{s:I, s:I, s:I, s:I, s:I, s:I}", "accepted", (json_int_t)m->accepted[p], "lost",
                     (json_int_t)m->lost[p], "late", (json_int_t)m->late[p], "duplicate", (json_int_t)m->duplicate[p],
                     "reordered", (json_int_t)m->reordered[p], "lost_in_a_row_max",
                     (json_int_t)m->lost_in_a_row_max[p]);
}

static json_t *rejections(const knead_status_t *s)
{
    json_t *object = json_object();
    for (int i = 0; i < KN_REJECT_COUNT; i++)
        json_object_set_new(object, kn_pose_verdict_name((kn_pose_verdict)i), json_integer(s->rejected[i]));
    return object;
}

// Describe every probe of the scene: session, force, fault and how to clear it, link counters.
static json_t *probes(const kn_operator *o, const kn_health *h)
{
    json_t *array = json_array();
    for (int p = 0; p < o->on.served->scene->model.probe_count; p++) {
        const kn_force *f = &h->force[p];
        char session[24];
        // write the session number as text, because JSON numbers hold only 53 bits
        snprintf(session, sizeof session, "%" PRId64, f->session);
        kn_fault fault = (kn_fault)f->fault;
        json_t *probe = json_pack(
            "{s:s, s:b, s:s, s:b, s:f, s:[f,f,f], s:s, s:f, s:o}", "name", o->on.served->scene->model.probe[p].name,
            "live", f->live, "session", f->live ? session : "0", "in_contact", f->contacts > 0, "gain", f->gain,
            "force_n", f->force_n[0], f->force_n[1], f->force_n[2], "fault", kn_fault_name(fault),
            "control_command_success_rate", h->more.success_rate[p], "packets", packets(&h->more, p));
        if (fault != KN_FAULT_NONE) json_object_set_new(probe, "way_back", json_string(kn_fault_remedy(fault)));
        json_array_append_new(array, probe);
    }
    return array;
}

// List the settings made at run time. The worker thread changes these settings, so take the lock.
static json_t *settings(kn_operator *o)
{
    char room[KN_SETTINGS_BYTES];
    const char *list[KN_SETTINGS_MAX];
    json_t *array = json_array();
    pthread_mutex_lock(&o->setting);
    int count = kn_settings_list(&o->settings, room, list);
    pthread_mutex_unlock(&o->setting);
    for (int i = 0; i < count; i++) json_array_append_new(array, json_string(list[i]));
    return array;
}

// Return the absolute path of the snapshot directory, or null when nothing is saved.
static json_t *directory(const kn_store *store)
{
    char *whole = store->dir < 0 ? NULL : realpath(store->path, NULL);
    json_t *text = whole ? json_string(whole) : NULL;
    free(whole);
    return text ? text : json_null();
}

// Build the answer to `status` from one health report. Quality and settings are read at the time of the call.
static json_t *status_of(kn_operator *o, const kn_health *h)
{
    static const char *const modes[] = {"IDLE", "RUNNING", "FAULT", "BRAKE", "ESTOP", "STOPPING", "RECOVERING"},
                             *const degraded[] = {"no_fifo", "no_mlock", "no_fma", "reduced", "no_fpga"},
                             *const backends[] = {"cpu", "fixed", "fpga"},
                             *const errors[] = {"comm_lost",      "force_limit",   "force_impulse_limit",
                                                "velocity_limit", "pose_invalid",  "overrun",
                                                "physics",        "offload_fault", "snapshot_error",
                                                "passivity",      "pose_rate",     "pose_clock"};
    const knead_status_t *s = &h->status;
    const knead_health_t *m = &h->more;
    kn_account *a = &o->on.loop->account;
    // identity, time, mode and errors
    json_t *status = json_pack(
        "{s:b, s:s, s:s, s:s, s:I, s:I, s:f, s:I, s:s, s:o, s:o, s:o}", "ok", 1, "version", KN_VERSION, "scene",
        o->on.served->scene->name, "backend", backends[s->backend], "time_us", (json_int_t)s->utime, "monotonic_us",
        (json_int_t)m->monotonic_us, "uptime_s", 1e-3 * (double)s->uptime_ms, "tick", (json_int_t)s->tick, "mode",
        modes[s->mode], "degraded", names_of(s->degraded, degraded, 5), "current_errors",
        names_of(h->error_bits, errors, 12), "last_errors", names_of(s->last_errors, errors, 12));
    // timing of the servo loop
    json_object_set_new(status, "loop",
                        json_pack("{s:o, s:o, s:I, s:I, s:I, s:I, s:o, s:o, s:o, s:o, s:I}", "periodicity_hz",
                                  spread(m->periodicity_hz), "execution_time_us", spread(m->execution_us),
                                  "missed_cycles", (json_int_t)s->missed_cycles, "missed_explained",
                                  (json_int_t)s->missed_explained, "num_overruns", (json_int_t)s->overruns,
                                  "time_last_overrun", (json_int_t)m->time_last_overrun, "wakeup_us_below",
                                  histogram(s->wakeup_hist), "execution_us_below", histogram(s->execution_hist),
                                  "wakeup_latency_hist", counts(s->wakeup_hist), "execution_time_hist",
                                  counts(s->execution_hist), "solver_capped", (json_int_t)s->solver_capped));
    // datagrams in and out
    json_object_set_new(status, "link",
                        json_pack("{s:f, s:I, s:I, s:o, s:I, s:I, s:I}", "control_command_success_rate",
                                  s->success_rate, "received", (json_int_t)s->received, "accepted",
                                  (json_int_t)s->accepted, "rejected", rejections(s), "kernel_drops",
                                  (json_int_t)s->kernel_drops, "published", (json_int_t)s->published, "publish_drops",
                                  (json_int_t)s->publish_drops));
    // forces, and how often each limit acted
    json_object_set_new(status, "force",
                        json_pack("{s:f, s:f, s:I, s:I, s:I, s:I, s:I, s:o}", "force_max_n", s->force_max_n,
                                  "force_step_max_n", s->force_step_max_n, "clamps", (json_int_t)s->clamps, "guards",
                                  (json_int_t)s->guards, "slew_limited", (json_int_t)m->trips[KNEAD_HEALTH_T_TRIP_SLEW],
                                  "brakes", (json_int_t)m->trips[KNEAD_HEALTH_T_TRIP_BRAKE], "faults",
                                  (json_int_t)s->faults, "trips", trips(m)));
    // energy audit; null before the first audited second
    json_object_set_new(
        status, "energy",
        json_pack("{s:o, s:I}", "energy_balance_mj",
                  m->audited_s > 0 && isfinite(m->energy_balance_mj) ? json_real(m->energy_balance_mj) : json_null(),
                  "audited_s", (json_int_t)m->audited_s));
    json_object_set_new(status, "quality",
                        json_pack("{s:s, s:s}", "in_force", kn_quality_name((kn_quality)atomic_load(&a->quality)),
                                  "asked", kn_quality_name((kn_quality)atomic_load(&a->asked))));
    // snapshots on disk
    json_object_set_new(status, "state",
                        json_pack("{s:o, s:I, s:I, s:I, s:f, s:f, s:i}", "directory", directory(&o->on.keeper->store),
                                  "snapshot_age_ms", (json_int_t)s->snapshot_age_ms, "snapshot_gen",
                                  (json_int_t)m->snapshot_gen, "snapshots", (json_int_t)m->snapshots,
                                  "snapshot_ms_last", m->snapshot_ms_last, "snapshot_ms_max", m->snapshot_ms_max,
                                  "snapshot_errors", (int)s->snapshot_errors));
    if (m->circuit != KNEAD_HEALTH_T_CIRCUIT_NONE) json_object_set_new(status, "circuit", circuit(m));
    json_object_set_new(status, "set", settings(o));
    json_object_set_new(status, "probes", probes(o, h));
    return status;
}

static const char ending[] = "the server is stopping: no more ticks run";

// Ask the main thread for a health report, wait for the report, and answer with its content.
static json_t *tell_status(kn_operator *o)
{
    bool fresh = false;
    if (atomic_load(&o->on.loop->done)) return kn_control_error("%s", ending);
    // discard a health report that an earlier request left in the mailbox
    const kn_health *h = kn_mailbox_latest(&o->health, &fresh);
    o->on.ask(o->on.arg);
    for (int i = 0; i < 2 * PATIENCE_MS; i++) {
        h = kn_mailbox_latest(&o->health, &fresh);
        if (fresh) return status_of(o, h);
        rest();
    }
    return kn_control_error("the server's main thread did not answer for %d ms", PATIENCE_MS);
}

// --- changes ---

// Give the servo loop an order, wait until a tick has taken the order, and answer with that tick.
static json_t *order(kn_operator *o, kn_order kind, kn_quality quality)
{
    int64_t tick, number = kn_orders_give(&o->on.loop->orders, kind, quality);
    for (int i = 0; i < 2 * PATIENCE_MS; i++) {
        // read `done` before looking for the tick: if the loop has ended and no tick has taken the order, no tick ever
        // will
        bool done = atomic_load(&o->on.loop->done);
        if (kn_orders_obeyed(&o->on.loop->orders, number, &tick))
            return json_pack("{s:b, s:I}", "ok", 1, "tick", (json_int_t)tick);
        // If the loop ended before a tick took an emergency stop, the stop comes into force at the next start, provided
        // that kneadd starts again by itself or keeps the stop on disk.
        if (done && kind == KN_ORDER_ESTOP && (o->on.goes_on(o->on.arg) || o->on.keeper->store.dir >= 0))
            return json_pack("{s:b}", "ok", 1);
        if (done) return kn_control_error("%s", ending);
        rest();
    }
    return kn_control_error("no tick ran for %d ms", PATIENCE_MS);
}

// Begin or end an emergency stop that also persists over restarts. If a step fails, the safer state remains: a stop
// begins in the loop before it is on disk, and the mark on disk is removed only after a tick has ended the stop.
static json_t *hold(kn_operator *o, bool estopped)
{
    char why[300];
    json_t *answer = order(o, estopped ? KN_ORDER_ESTOP : KN_ORDER_RECOVER, 0);
    const json_t *tick = json_object_get(answer, "tick");
    if (!estopped && !tick) return answer; // no tick ended the emergency stop, so keep the stop's mark on disk
    bool marked = kn_keeper_mark(o->on.keeper, estopped, why, sizeof why);
    if (marked || json_object_get(answer, "error")) return answer;
    // the loop obeyed, but the disk failed: report the present state and the possible state after a restart
    char at[40] = "";
    if (tick) snprintf(at, sizeof at, " since tick %" PRId64, (int64_t)json_integer_value(tick));
    json_decref(answer);
    return estopped
               ? kn_control_error("estop: every force is 0%s, but a restart may end the emergency stop: %s", at, why)
               : kn_control_error("recover: done%s, but a restart may bring the emergency stop back: %s", at, why);
}

// Order a change to another quality, if the servo can make the change without a restart.
static json_t *take_quality(kn_operator *o, const char *name)
{
    for (kn_quality q = 0; q < KN_QUALITIES; q++) {
        if (strcmp(name, kn_quality_name(q)) != 0) continue;
        if (o->on.served->scene->point[q].live) return order(o, KN_ORDER_QUALITY, q);
        if (!o->on.served->scene->point[q].defined)
            return kn_control_error("quality %s: the scene has no such quality point", name);
        return kn_control_error(
            "quality %s: has another lattice or precision, expected kneadd --quality %s at the start", name, name);
    }
    return kn_control_error("quality '%s': expected %s", name, kn_quality_names);
}

// Turn an answer of the keeper into JSON.
static json_t *of_keeper(const kn_answer *a)
{
    char hash[20];
    if (!a->ok) return kn_control_error("%s", a->error);
    snprintf(hash, sizeof hash, "%016" PRIx64, a->state_hash);
    return json_pack("{s:b, s:I, s:I, s:s}", "ok", 1, "tick", (json_int_t)a->tick, "generation",
                     (json_int_t)a->generation, "state", hash);
}

static json_t *reset(kn_operator *o, const json_t *argument) { return (void)argument, order(o, KN_ORDER_RESET, 0); }
static json_t *recover(kn_operator *o, const json_t *argument) { return (void)argument, hold(o, false); }
static json_t *estop(kn_operator *o, const json_t *argument) { return (void)argument, hold(o, true); }
static json_t *status(kn_operator *o, const json_t *argument) { return (void)argument, tell_status(o); }
static json_t *quality(kn_operator *o, const json_t *argument) { return take_quality(o, json_string_value(argument)); }

static json_t *snapshot(kn_operator *o, const json_t *argument)
{
    (void)argument;
    kn_answer a = kn_keeper_snapshot(o->on.keeper);
    return of_keeper(&a);
}

static json_t *copy(kn_operator *o, const json_t *argument)
{
    int fd;
    char text[20];
    (void)argument;
    kn_answer a = kn_keeper_copy(o->on.keeper, &fd);
    json_t *answer = of_keeper(&a);
    if (!a.ok) return answer;
    snprintf(text, sizeof text, "%016" PRIx64, o->on.keeper->outgoing.text_hash);
    json_object_set_new(answer, "scene", json_string(text));
    json_object_set_new(answer, "descriptor", json_integer(fd));
    return answer;
}

static json_t *restore(kn_operator *o, const json_t *argument)
{
    int64_t generation = json_integer_value(argument); // 0 if there is no argument: the newest snapshot
    if (argument && generation < 1)
        return kn_control_error("restore: generation %" PRId64 ": expected 1 or more", generation);
    const kn_scene *scene = o->now ? o->now->scene : o->on.served->scene;
    const kn_model *model = o->now ? o->now->model : o->on.served->model;
    kn_answer a = kn_keeper_restore(o->on.keeper, &o->on.loop->orders, scene, model, generation);
    return of_keeper(&a);
}

static json_t *undo(kn_operator *o, const json_t *argument)
{
    (void)argument;
    kn_answer a = kn_keeper_undo(&o->on.loop->orders);
    return of_keeper(&a);
}

// --- another scene ---

// Parse the scene of the server's start again, overridden by `settings`.
static kn_scene *parse(const kn_operator *o, const kn_settings *settings, char *error, size_t error_size)
{
    char why[400];
    kn_scene *scene = kn_settings_parse(settings, o->on.served->base, o->on.def->scene_path, why, sizeof why);
    // the parser's message names the option --set; name the command `set` instead
    if (!scene) snprintf(error, error_size, "%s", strncmp(why, "--set ", 6) == 0 ? why + 2 : why);
    return scene;
}

// Return why the object from before the latest change may still be in use, or NULL if every thread uses the new object.
static const char *user_of_the_last(kn_operator *o)
{
    int64_t tick;
    if (o->now && !kn_orders_obeyed(&o->on.loop->orders, o->ordered, &tick))
        return "no tick has applied the last change yet";
    if (o->now && atomic_load(&o->told) != o->now) return "the main thread has not reported the last change yet";
    if (o->now && !kn_skin_follows(o->on.skin, o->now->model))
        return "the mesh thread has not published the last change yet";
    bool written = o->before && kn_keeper_writes(o->on.keeper, o->before->model);
    return written ? "the state from before the last change is not on disk yet" : NULL;
}

// Free the second latest change as soon as no thread uses it. Return NULL on success; otherwise return why it may still
// be in use.
static const char *retire(kn_operator *o)
{
    const char *user = user_of_the_last(o);
    for (int i = 0; user && i < 2 * PATIENCE_MS; i++) {
        rest();
        user = user_of_the_last(o);
    }
    if (user) return user;
    kn_scene_change_destroy(o->before);
    o->before = NULL;
    return NULL;
}

// Return true if the settings affect only safety limits of the hand, and nothing in the physics.
static bool only_limits(const kn_operator *o, const json_t *values, const kn_scene_change *change)
{
    const kn_device_def *now = o->now ? &o->now->scene->device : &o->on.served->scene->device,
                        *next = &change->scene->device;
    const json_t *value;
    size_t i;
    // a change of the device's virtual coupling is more than a change of a limit, because the coupling affects the
    // physics
    json_array_foreach(values, i, value) if (strncmp(json_string_value(value), "device", 6) != 0) return false;
    return next->coupling_n_m == now->coupling_n_m && next->coupling_n_s_m == now->coupling_n_s_m;
}

// Return whether ticks of the new model would take longer than 1 ms, and more than twice as long as before. If not,
// measure the deadline of the new model's steps.
static bool too_slow(kn_operator *o, const json_t *values, kn_scene_change *change, char *why, size_t why_size)
{
    if (only_limits(o, values, change)) return false;
    int64_t now_ns = kn_served_object_measure(&change->backend, change->model), was_ns = o->served_ns;
    if (now_ns > KN_PERIOD_NS && now_ns > 2 * was_ns) {
        snprintf(why, why_size, "a tick would take %.2g ms here, expected 1 ms at most", 1e-6 * (double)now_ns);
        return true;
    }
    o->served_ns = now_ns;
    change->deadline = kn_served_object_deadline(&change->backend, NULL, change->model, change->scene->budget_s);
    return false;
}

// Build the change that the settings ask for, without touching the object. On failure return NULL and put one line in
// error.
static kn_scene_change *prepare(kn_operator *o, const json_t *values, char *error, size_t error_size)
{
    kn_settings settings = o->settings;
    const json_t *value;
    size_t i;
    if (o->on.def->device) {
        snprintf(error, error_size,
                 "set: a circuit steps the object, expected kneadd without a circuit, or knead ctl load");
        return NULL;
    }
    // add the new settings to those in force
    json_array_foreach(values, i,
                       value) if (!kn_settings_add(&settings, json_is_string(value) ? json_string_value(value) : "",
                                                   error, (int)error_size)) return NULL;
    kn_scene *scene = parse(o, &settings, error, error_size);
    if (!scene) return NULL;
    // at run time the safety limits of a hand must not exceed those of the start
    const char *raised = kn_safety_raised(&scene->limits, &o->on.served->base->limits);
    if (raised) {
        kn_scene_destroy(scene);
        snprintf(
            error, error_size,
            "set: %s: relaxes a safety limit of the hand beyond the scene's value, expected a stricter value; only a "
            "restart of kneadd can relax it",
            raised);
        return NULL;
    }
    // build the model and its backend, while ticks continue with the old ones
    char why[300];
    kn_scene_change *change =
        kn_scene_change_create(scene, o->now ? o->now->scene : o->on.served->scene,
                               o->now ? o->now->model : o->on.served->model, o->on.def->local_model, why, sizeof why);
    if (change && too_slow(o, values, change, why, sizeof why)) {
        kn_scene_change_destroy(change);
        change = NULL;
    }
    if (change) change->settings = settings;
    else snprintf(error, error_size, "set: %s", why);
    return change;
}

// Add to the answer the energy that the object stored before and after the change. The old lattice can be read here,
// since nothing steps it any more.
static void add_energies(json_t *answer, const kn_model *model, kn_backend *left, const kn_scene_change *change)
{
    kn_energy before, after;
    if (!change->audit || !kn_energy_of(model, left->state(left->self), &before) ||
        !kn_energy_of(change->model, change->carried, &after))
        return;
    json_object_set_new(answer, "stored_before_j", json_real(kn_energy_sum(&before)));
    json_object_set_new(answer, "stored_after_j", json_real(kn_energy_sum(&after)));
}

// Run `set`: build a change, have a tick take it, and answer with the tick and the energies.
static json_t *set(kn_operator *o, const json_t *argument)
{
    char error[400];
    int64_t tick;
    if (json_array_size(argument) == 0) return kn_control_error("set: expected KEY=VALUE");
    // only the two latest changes are kept, so first free the older of them
    const char *busy = retire(o);
    if (busy) return kn_control_error("set: %s, try again", busy);
    kn_scene_change *change = prepare(o, argument, error, sizeof error);
    if (!change) return kn_control_error("%s", error);
    const kn_model *model = o->now ? o->now->model : o->on.served->model;
    kn_backend *left = o->now ? &o->now->backend : &o->on.served->backend;
    // lock the new memory before a tick uses it, then hand the change to the loop
    kn_rt_lock_more(o->on.rt);
    o->before = o->now;
    o->now = o->on.loop->orders.change = change;
    pthread_mutex_lock(&o->setting);
    o->settings = change->settings;
    pthread_mutex_unlock(&o->setting);
    // o->now is this change from here on, even if no tick takes the change within PATIENCE_MS
    o->ordered = kn_orders_give(&o->on.loop->orders, KN_ORDER_CHANGE, 0);
    if (!kn_orders_await(&o->on.loop->orders, o->ordered, PATIENCE_MS, &tick))
        return kn_control_error("set: no tick ran for %d ms; the next tick applies the change", PATIENCE_MS);
    json_t *answer = json_pack("{s:b, s:I}", "ok", 1, "tick", (json_int_t)tick);
    add_energies(answer, model, left, change);
    return answer;
}

// Hide quoted text in an error message, except text that looks like words of a scene. kneadd can read files that the
// peer must not read, and an error message would quote these files. `size`: room that the message had, bytes; the
// buffer is SECRET bytes larger. A message that fills the room may have been cut off within a quotation. Such an
// unfinished quotation is hidden, too.
static void keep_secret(char *why, size_t size, const char *path)
{
    size_t skipped = strncmp(why, path, strlen(path)) == 0 ? strlen(path) : 0, word = 0;
    char *quoted = strchr(why + skipped, '\''), *last = strrchr(why + skipped, '\'');
    // plain words: at most 20 characters, small letters, digits and some punctuation
    bool plain = !quoted || (quoted < last && strlen(why) + 1 < size);
    for (const char *c = quoted; c && c < last; c++) {
        word = strchr(" '", *c) ? 0 : word + 1;
        plain &= word <= 20 && (islower((unsigned char)*c) || isdigit((unsigned char)*c) || strchr(" '_.,;()-", *c) ||
                                (*c == ':' && c[1] == ' '));
    }
    if (!plain) strcpy(quoted, "... (see knead check, if you may read the file)");
}

// Run `load`. First load the scene on trial, as the next start will, so that kneadd does not stop for a scene that it
// cannot serve.
static json_t *load(kn_operator *o, const json_t *argument)
{
    char error[512 + SECRET];
    kn_served_object trial;
    kn_served_object_def def = *o->on.def;
    def.name = def.text = NULL; // clear the checked text, so that the file is read again
    if (argument) def.scene_path = json_string_value(argument);
    def.device = NULL; // load without the circuit, which is busy with the object being served
    if (kn_served_object_load(&trial, &def, error, sizeof error - SECRET) != 0) {
        keep_secret(error, sizeof error - SECRET, def.scene_path);
        return kn_control_error("%s", error);
    }
    const char *raised = kn_safety_raised(&trial.scene->limits, o->on.limits);
    json_t *answer =
        raised ? kn_control_error("%s: %s: relaxes a safety limit of the hand beyond the scene of the start; only a "
                                  "restart of kneadd can relax it",
                                  def.scene_path, raised)
               : json_pack("{s:b, s:s}", "ok", 1, "scene", trial.scene->name);
    if (!raised) o->on.load(o->on.arg, def.scene_path, trial.base);
    kn_served_object_free(&trial);
    return answer;
}

static json_t *stop(kn_operator *o, const json_t *argument)
{
    (void)argument;
    o->on.stop(o->on.arg);
    return json_pack("{s:b}", "ok", 1);
}

static const struct command {
    const char *name;
    json_t *(*run)(kn_operator *o, const json_t *argument); // `argument` is NULL if the request has none
    // name of the command's only argument field; NULL: the command has none
    const char *argument;
    json_type type;
    bool needed; // true: the argument must be given
    bool slow;   // true: the command waits for the disk, a restored state or a model, so it runs on the worker thread
} commands[] = {{"status", status, NULL, JSON_NULL, false, false},
                {"reset", reset, NULL, JSON_NULL, false, false},
                {"quality", quality, "name", JSON_STRING, true, false},
                {"snapshot", snapshot, NULL, JSON_NULL, false, true},
                {"copy", copy, NULL, JSON_NULL, false, true},
                {"restore", restore, "generation", JSON_INTEGER, false, true},
                {"undo", undo, NULL, JSON_NULL, false, true},
                {"recover", recover, NULL, JSON_NULL, false, false},
                {"estop", estop, NULL, JSON_NULL, false, false},
                {"set", set, "values", JSON_ARRAY, true, true},
                {"load", load, "scene", JSON_STRING, false, true},
                {"stop", stop, NULL, JSON_NULL, false, false}};
#define COMMANDS (sizeof commands / sizeof *commands)

static json_t *no_command(const char *name)
{
    char names[256] = "";
    for (size_t c = 0; c < COMMANDS; c++)
        snprintf(names + strlen(names), sizeof names - strlen(names), "%s%s", c ? ", " : "", commands[c].name);
    return kn_control_error("command '%s': expected one of %s", name ? name : "", names);
}

// Return the command of a request, or NULL if there is no such command.
static const struct command *command_of(const json_t *request)
{
    const char *name = json_string_value(json_object_get(request, "command"));
    for (size_t c = 0; name && c < COMMANDS; c++)
        if (strcmp(name, commands[c].name) == 0) return &commands[c];
    return NULL;
}

// Return true for every request but `status`, unknown commands included. Such a request gets an entry on stderr.
static bool audits(void *op, const json_t *request)
{
    (void)op;
    const struct command *c = command_of(request);
    return !c || c->run != status;
}

static bool is_slow(void *op, const json_t *request)
{
    (void)op;
    const struct command *c = command_of(request);
    return c && c->slow;
}

// Return true for an emergency stop, which is carried out before everything else.
static bool is_urgent(void *op, const json_t *request)
{
    (void)op;
    const struct command *c = command_of(request);
    return c && c->run == estop;
}

// Check a request against the table of commands, then run its command.
static json_t *answer(void *op, const json_t *request)
{
    const struct command *c = command_of(request);
    if (!c) return no_command(json_string_value(json_object_get(request, "command")));
    const char *name = c->name;
    const json_t *argument = c->argument ? json_object_get(request, c->argument) : NULL;
    if ((c->needed && !argument) || (argument && json_typeof(argument) != c->type))
        return kn_control_error("%s: expected \"%s\", %s", name, c->argument,
                                c->type == JSON_STRING  ? "a string"
                                : c->type == JSON_ARRAY ? "a list of KEY=VALUE"
                                                        : "a whole number");
    // refuse any other field, so that a typing error does not carry out half a request
    if (json_object_size(request) != (argument ? 2 : 1))
        return c->argument ? kn_control_error("%s: expected nothing but \"%s\"", name, c->argument)
                           : kn_control_error("%s: expected nothing else", name);
    return c->run(op, argument);
}

kn_control_def kn_operator_control(kn_operator *o)
{
    return (kn_control_def){.self = o, .answer = answer, .audits = audits, .slow = is_slow, .urgent = is_urgent};
}
