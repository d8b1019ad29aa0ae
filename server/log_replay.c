#include "server/log_replay.h"
#include "server/backend/fpga.h"
#include "proto/knead_event_t.h"
#include "server/console.h"
#include "server/scene_change.h"
#include "server/log.h"
#include "server/operator_orders.h"
#include "server/receiver.h"
#include "server/rt.h"
#include "server/store.h"
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// number of poses remembered per probe, a power of two: up to this many poses may lie between a pose and its force in
// the log
#define POSES 4096

typedef struct kn_replay_private { // internal data of a replay; named `v` in the functions below
    kn_log log;
    kn_log_record record;
    bool held; // true if `record` was read ahead and is not used yet
    kn_receiver receiver;
    kn_pose *poses[KN_PROBES_MAX]; // arrays of POSES remembered poses; the pose number seq is at index seq % POSES

    kn_log_summary found; // summary of the log, made by the first reading
    size_t next_event;    // index in found.events of the next event to apply
    // `change`: latest change that a tick applied; `next`: change that the next tick applies; NULL: none
    kn_scene_change *change, *next;
    kn_replay_def def;

    const char *snapshot_path;
    kn_saved saved; // snapshot that was read last
    kn_undo undo;

    // Forces that the log holds for the tick group_tick:
    knead_contact_force_t force[KN_PROBES_MAX];
    bool has[KN_PROBES_MAX]; // true if the log has a force of probe p for the tick group_tick
    bool grouped;            // true if all forces of the tick group_tick have been read
    int64_t group_tick;

    int64_t tick;   // number of the last tick executed, -1: none
    int64_t untold; // number of ticks without a record that were run so far, or counted in advance by afford()
    bool live[KN_PROBES_MAX];
    // `touched`: a session has begun; `resting`: no session has begun and the object does not move
    bool touched, resting;
    uint64_t rest_hash;
} reading;

// Return the largest number of ticks without a record that a replay runs for this log.
static int64_t most_untold(const reading *v) { return KN_LOG_LOST_MS + KN_LOG_RECORD_MS * v->found.own_records; }

// ---- scene, model and servo of the replay

// First reading: summarise the log.
static bool look_through(kn_replay *r, const kn_replay_def *def, char *error, size_t error_size)
{
    reading *v = r->private;
    bool found = kn_log_summarise(&v->found, def->log_path, error, error_size);
    v->tick = -1;
    r->forces_logged = v->found.forces > 0;
    r->tally.malformed = v->found.malformed;
    memcpy(r->damage, v->found.damage, sizeof r->damage);
    return found;
}

// Parse the scene: the file scene_path, or without scene_path the text in the log. Set r->same if the replay must give
// the log's numbers exactly.
static bool choose_scene(kn_replay *r, const kn_replay_def *def, char *error, size_t error_size)
{
    reading *v = r->private;
    r->logged_name = v->found.scene_name;
    r->logged_text = v->found.scene_text;
    if (def->scene_path) r->scene = kn_scene_load(def->scene_path, def->sets, def->set_count, error, error_size);
    else if (!v->found.scene_text)
        snprintf(error, error_size, "%s: has no KNEAD_SCENE record, expected a scene file in addition", def->log_path);
    else
        r->scene = kn_scene_parse_beside(def->log_path, v->found.scene_name, v->found.scene_text,
                                         strlen(v->found.scene_text), def->sets, def->set_count, error, error_size);
    if (!r->scene) return false;
    r->same = !def->afresh && v->found.scene_text && r->scene->text_hash == v->found.scene_hash;
    // refuse a scene other than the log's, except if settings show that the difference is intended
    if (r->same || !v->found.scene_text || def->set_count > 0) return true;
    if (!def->scene_path)
        return kn_refuse(error, error_size, "%s: this version of knead reads the log's scene '%s' differently",
                         def->log_path, v->found.scene_name);
    return kn_refuse(error, error_size,
                     "%s: the log was recorded with another scene, '%s': leave the scene out, or give the intended "
                     "difference with --set, --quality, --solver, --precision or --dt",
                     def->scene_path, v->found.scene_name);
}

// Build the model, its backend and the servo.
static bool build(kn_replay *r, const kn_replay_def *def, char *error, size_t error_size)
{
    char why[200];
    r->model = kn_model_build(&r->scene->model, why, sizeof why);
    if (!r->model) return kn_refuse(error, error_size, "%s: %s", r->scene->name, why);
    if (kn_backend_steps(r->scene->model.solver.dt_s) == 0)
        return kn_refuse(error, error_size, "%s: solver.dt is %g s, expected 1 ms divided by a whole number",
                         r->scene->name, r->scene->model.solver.dt_s);
    char said[KN_LINK_WHY];
    bool device = false;
    if (!kn_backend_place(&r->backend, r->model, def->device, true, SIZE_MAX, said, &device)) {
        snprintf(error, error_size, "%s%s%s", device ? "" : r->scene->name, device ? "" : ": ", said);
        if (def->device_failed) *def->device_failed = device;
        return false;
    }
    kn_servo_init(&r->servo, r->scene, r->model, &r->backend);
    kn_servo_begin(&r->servo, r->settled = kn_scene_settle(r->model));
    return true;
}

// Return the index of the probe with this name, or -1.
static int probe_of(const kn_replay *r, const char *name)
{
    for (int p = 0; p < r->model->def.probe_count; p++)
        if (strcmp(r->model->def.probe[p].name, name) == 0) return p;
    return -1;
}

// If the scene is not the log's, check that the scene has every probe whose forces the log holds. Otherwise the forces
// of a missing probe would count as malformed records.
static bool check_probes(const kn_replay *r, const kn_replay_def *def, char *error, size_t error_size)
{
    const char *set = NULL;
    for (int i = 0; i < def->set_count; i++)
        if (strstr(def->sets[i], ".name=")) set = def->sets[i];
    for (int i = 0; !r->same && i < KN_PROBES_MAX && *r->private->found.force_probe[i]; i++) {
        if (probe_of(r, r->private->found.force_probe[i]) >= 0) continue;
        return kn_refuse(error, error_size,
                         "%s%s: no probe `%s`, but the log has forces of this probe, expected a probe of that name",
                         set ? "--set " : "", set ? set : r->scene->name, r->private->found.force_probe[i]);
    }
    return true;
}

// ---- snapshots

// Return whether a snapshot was made in the log's run, before the log's last tick. Ticks between the snapshot and the
// first record of the log may be missing.
static bool of_this_run(const kn_replay *r, const kn_saved *saved)
{
    const reading *v = r->private;
    if ((r->same && saved->text_hash != r->scene->text_hash) || saved->tick >= v->found.last_tick) return false;
    // Compare the snapshot's wall clock with the time that the log gives for its tick. Allow a difference, because
    // ticks that follow poses may run 0.2 % fast or slow, and the logger's clock may be set.
    double ran_us = 1e3 * (double)(saved->tick - v->found.first_tick);
    double apart_us = (double)(saved->utime - v->found.origin_utime) - 1e3 * (double)saved->tick;
    return fabs(apart_us) <= 2e6 + 3e-3 * fabs(ran_us);
}

// Return whether the replay may begin at a snapshot: it is of the log's run, and the log misses no tick after it.
static bool of_the_run(void *replay, const kn_saved *saved)
{
    const kn_replay *r = replay;
    return r->same && of_this_run(r, saved) && saved->tick >= r->private->found.before_tick;
}

// Load object, servo and open sessions from the snapshot in v->saved, and continue the replay after the snapshot's
// tick.
static void resume(kn_replay *r)
{
    reading *v = r->private;
    r->backend.restore(r->backend.self, v->saved.state);
    kn_saved_resume(&v->saved, &r->servo);
    r->servo.untouched = r->settled && v->saved.state_hash == kn_state_hash(r->model, r->settled);
    r->resumed_tick = v->tick = v->saved.tick;
    r->tick.in.stop = r->servo.stopping;
    v->touched = true;
    for (int p = 0; p < r->model->def.probe_count; p++) {
        v->live[p] = r->servo.last[p].session != 0;
        r->tick.pose[p] = r->servo.last[p];
    }
}

static bool of_that_hash(void *hash, const kn_saved *saved) { return saved->state_hash == *(const uint64_t *)hash; }

// Read the snapshot with this state hash into v->saved.
static bool find_state(kn_replay *r, uint64_t hash, char *why, size_t why_size)
{
    reading *v = r->private;
    return kn_store_browse(v->snapshot_path, r->servo.scene, r->servo.model, &v->saved, of_that_hash, &hash, why,
                           why_size);
}

// Check that there is a snapshot for every restore in the log, before any tick is run.
static bool check_restores(kn_replay *r, const kn_replay_def *def, char *error, size_t error_size)
{
    reading *v = r->private;
    char why[200] = "no such snapshot";
    for (size_t i = 0; i < v->found.event_count && v->found.restores > 0; i++) {
        const knead_event_t *e = &v->found.events[i];
        // stop at the first change of settings, because later snapshots belong to another model; apply_restore()
        // searches for them when they are needed
        if (e->kind == KNEAD_EVENT_T_KIND_SET) break;
        if (e->kind != KNEAD_EVENT_T_KIND_RESTORE || e->arg[0] == 0) continue;
        if (def->snapshot_path && find_state(r, (uint64_t)e->state_hash, why, sizeof why)) continue;
        if (e->arg[0] < 0)
            return kn_refuse(error, error_size,
                             "%s: at tick %lld the circuit was lost, and the object went back to its state of tick "
                             "%.0f, which the log does not hold: expected a log without such a loss",
                             def->log_path, (long long)e->tick, e->arg[1]);
        return kn_refuse(
            error, error_size,
            "%s: at tick %lld the server restored generation %.0f of its snapshots, state 0x%016llx%s%s%s%s, "
            "expected %s",
            def->log_path, (long long)e->tick, e->arg[0], (unsigned long long)e->state_hash,
            def->snapshot_path ? "; " : "", def->snapshot_path ? def->snapshot_path : "",
            def->snapshot_path ? ": " : "", def->snapshot_path ? why : "",
            def->afresh ? "a log without a restore" : "--snapshot with that file or its directory");
    }
    return true;
}

// Allocate memory for undo points and snapshots.
static bool prepare_snapshots(kn_replay *r, const kn_replay_def *def, char *error, size_t error_size)
{
    reading *v = r->private;
    r->resumed_tick = -1;
    v->snapshot_path = def->snapshot_path;
    v->saved.servo = r->servo;
    bool fits = !v->found.undoes || kn_undo_init(&v->undo, r->model);
    if (v->found.undoes && fits) r->servo.undo = &v->undo;
    if (def->snapshot_path || v->found.object) fits &= (v->saved.state = kn_state_create(r->model)) != NULL;
    if (fits) return check_restores(r, def, error, error_size);
    return kn_refuse(error, error_size, "%s: not enough memory", def->log_path);
}

// Choose where the replay begins. A log that does not begin with the server's start must begin with an untouched
// object, or continue from a snapshot.
static bool begin(kn_replay *r, const kn_replay_def *def, char *error, size_t error_size)
{
    reading *v = r->private;
    char why[200];
    char misfit[200] = ""; // reason why the object that the log holds does not fit
    if (r->forces_logged && v->found.object && !v->found.started) {
        bool fits = kn_saved_decode(r->scene, r->model, v->found.object, v->found.object_size, &v->saved, misfit,
                                    sizeof misfit);
        if (fits && of_this_run(r, &v->saved)) {
            resume(r);
            return true;
        }
        if (fits) snprintf(misfit, sizeof misfit, "of another run");
        // another lattice or material can begin only with an untouched object
        kn_saved head;
        const char *name = v->found.scene_name ? v->found.scene_name : r->scene->name; // that of the object in the log
        bool peeked = kn_saved_peek(name, v->found.object, v->found.object_size, &head);
        if (!r->same && !(peeked && head.state_hash == v->found.initial_hash))
            return kn_refuse(error, error_size,
                             "%s: the log begins on a kneaded object, which does not fit these settings (%s): expected "
                             "the log's own lattice and material, or a log that begins on an untouched object",
                             def->log_path, misfit);
    }
    bool restores = v->found.restores > 0, wanted = def->snapshot_path && !(restores && v->found.started);
    if (wanted && !(r->same && r->forces_logged))
        return kn_refuse(error, error_size,
                         "%s: --snapshot needs a log with forces, replayed with the log's own scene and computation",
                         def->log_path);
    if (wanted && kn_store_browse(def->snapshot_path, r->scene, r->model, &v->saved, of_the_run, r, why, sizeof why)) {
        resume(r);
        return true;
    }
    if (wanted && !restores && !v->found.started)
        return kn_refuse(error, error_size, "%s: %s, expected a snapshot from the run of %s, from tick %lld to %lld",
                         def->snapshot_path, why, def->log_path, (long long)v->found.before_tick,
                         (long long)v->found.last_tick - 1);
    if (!r->same || v->found.started) return true;
    // The first event with a state hash tells whether the object was in its initial state. A reset or restore before
    // the first force makes the past irrelevant.
    for (size_t i = 0; i < v->found.event_count; i++) {
        const knead_event_t *e = &v->found.events[i];
        bool undone = e->kind == KNEAD_EVENT_T_KIND_RESTORE && e->arg[0] == 0;
        bool replaced = e->kind == KNEAD_EVENT_T_KIND_RESET || e->kind == KNEAD_EVENT_T_KIND_RESTORE;
        bool first = v->found.first_force_tick < 0 || e->tick <= v->found.first_force_tick;
        if (replaced && !undone && first) return true;
        if (replaced || e->state_hash == 0) continue;
        if ((uint64_t)e->state_hash == kn_state_hash(r->model, kn_replay_state(r))) return true;
        return kn_refuse(
            error, error_size,
            "%s: the object was already deformed when this log begins%s%s, expected --snapshot with a snapshot of that "
            "run, a log that begins with the server's start, or one recorded with knead probe --control or knead web "
            "--control",
            def->log_path, *misfit ? ", and the object that it holds does not fit: " : "", misfit);
    }
    // without a state hash in the log, nothing shows that the object was untouched
    if (*misfit)
        return kn_refuse(error, error_size, "%s: the object that the log holds does not fit: %s, expected --snapshot",
                         def->log_path, misfit);
    return true;
}

// Take the deadline of steps (largest number of units of work) from an event of the log. A replay that need not give
// the log's numbers (same is false) runs without a deadline.
static void apply_deadline(const kn_replay *r, kn_tick_in *in, const knead_event_t *e)
{
    if (r->same && e->arg[0] >= 1 && e->arg[0] < 0x1p53) in->deadline = (int64_t)e->arg[0];
}

// Set deadline, overload and quality to the values in force where the replay begins: at the beginning of a log that
// begins in mid-run, or at a snapshot.
static void stand(kn_replay *r, const kn_log_summary *found)
{
    const kn_log_initial *initial = &found->initial;
    r->servo.deadline = initial->deadline;
    r->servo.overloaded = initial->overloaded;
    // a snapshot holds neither deadline nor overload, so apply the log's events up to the snapshot's tick
    for (size_t i = 0; i < found->event_count && found->events[i].tick <= r->resumed_tick; i++) {
        const knead_event_t *e = &found->events[i];
        kn_tick_in then = {0};
        if (e->kind == KNEAD_EVENT_T_KIND_DEADLINE) apply_deadline(r, &then, e);
        if (then.deadline > 0) r->servo.deadline = then.deadline;
        if (e->kind == KNEAD_EVENT_T_KIND_OVERLOAD) r->servo.overloaded = e->arg[0] != 0;
    }
    // a snapshot holds the quality, so set the quality only if the replay does not begin at a snapshot
    if (!initial->quality_told || r->resumed_tick >= 0 || !r->scene->point[initial->quality].live) return;
    r->servo.quality = initial->quality;
    r->servo.asked = initial->asked;
}

static bool prepare(kn_replay *r, const kn_replay_def *def, char *error, size_t error_size)
{
    reading *v = r->private;
    v->def = *def;
    if (!look_through(r, def, error, error_size) || !choose_scene(r, def, error, error_size) ||
        !build(r, def, error, error_size) || !check_probes(r, def, error, error_size) ||
        !prepare_snapshots(r, def, error, error_size) || !begin(r, def, error, error_size) ||
        !kn_log_open(&v->log, def->log_path, error, error_size))
        return false;
    kn_receiver_init(&v->receiver, &r->model->def);
    for (int p = 0; p < r->model->def.probe_count; p++) {
        v->poses[p] = calloc(POSES, sizeof *v->poses[p]);
        if (!v->poses[p]) return kn_refuse(error, error_size, "%s: not enough memory", def->log_path);
    }
    if (r->same) stand(r, &v->found);
    r->tally.first_gap = r->tally.first_mismatch = -1;
    // compute or estimate the number of ticks, for a progress bar
    int64_t before = r->resumed_tick >= 0 ? r->resumed_tick : v->found.before_tick;
    r->tally.ticks_total =
        r->forces_logged ? v->found.last_tick - before : (v->found.last_utime - v->found.first_pose_utime) / 1000 + 1;
    if (!r->forces_logged && r->tally.ticks_total > most_untold(v)) r->tally.ticks_total = most_untold(v);
    return true;
}

kn_replay *kn_replay_create(const kn_replay_def *def, char *error, size_t error_size)
{
    kn_replay *r = calloc(1, sizeof *r);
    if (r) r->private = calloc(1, sizeof *r->private);
    if (!r || !r->private) snprintf(error, error_size, "%s: not enough memory", def->log_path);
    else if (prepare(r, def, error, error_size)) return r;
    kn_replay_destroy(r);
    return NULL;
}

void kn_replay_destroy(kn_replay *r)
{
    if (!r) return;
    reading *v = r->private;
    if (v) {
        kn_log_close(&v->log);
        for (int p = 0; p < KN_PROBES_MAX; p++) free(v->poses[p]);
        kn_log_summary_free(&v->found);
        kn_scene_change_destroy(v->next);
        kn_scene_change_destroy(v->change);
        kn_undo_free(&v->undo);
        kn_state_destroy(v->saved.state);
    }
    free(v);
    if (r->backend.destroy) r->backend.destroy(r->backend.self);
    kn_state_destroy(r->settled);
    kn_model_destroy(r->model);
    kn_scene_destroy(r->scene);
    free(r);
}

const kn_state *kn_replay_state(kn_replay *r) { return r->servo.backend->state(r->servo.backend->self); }

double kn_replay_end_s(const kn_replay *r)
{
    const reading *v = r->private;
    int64_t last = r->forces_logged ? v->found.last_tick - v->found.first_force_tick : r->tally.ticks_total - 1;
    return 1e-3 * (double)last;
}

const kn_model *kn_replay_model(const kn_replay *r) { return r->servo.model; }

// ---- second reading: tick by tick

// Read the next record into v->record. If v->record was read ahead and is still unused, keep it. Return false at the
// end of the part that can be replayed.
static bool next_record(reading *v)
{
    if (v->held) return true;
    if (v->log.offset >= v->found.end_offset || kn_log_read(&v->log, &v->record) == KN_LOG_END) return false;
    return v->held = true;
}

// Rebuild the datagram of a record as it was on the bus. Leave the payload out if it is too long for a pose.
static kn_datagram datagram_of(const kn_log_record *record)
{
    kn_datagram d = {.here = true};
    size_t name = strlen(record->channel) + 1, size = 8 + name + record->size;
    // leave the payload out, so that the receiver refuses the datagram for its length
    if (size > sizeof d.bytes) size = 8 + name;
    memcpy(d.bytes, "LC02\0\0\0\0", 8);
    memcpy(d.bytes + 8, record->channel, name);
    memcpy(d.bytes + 8 + name, record->data, size - 8 - name);
    d.size = size;
    return d;
}

// Remember a pose from a log that also holds forces. The recorded server has already judged this pose, so check only
// that the bytes are a pose.
static void remember_pose(kn_replay *r)
{
    reading *v = r->private;
    int p;
    kn_pose pose;
    const kn_datagram d = datagram_of(&v->record);
    kn_pose_verdict verdict = kn_receiver_read(&v->receiver, &d, &p, &pose);
    if (verdict == KN_ACCEPTED) v->poses[p][(uint64_t)pose.seq % POSES] = pose;
    else if (verdict == KN_REJECT_LENGTH || verdict == KN_REJECT_TYPE) r->tally.malformed++;
}

// Return the remembered pose with this session and seq, or NULL.
static const kn_pose *find_pose(const reading *v, int p, int64_t session, int64_t seq)
{
    const kn_pose *pose = &v->poses[p][(uint64_t)seq % POSES];
    return session != 0 && pose->session == session && pose->seq == seq ? pose : NULL;
}

// Read records until all forces of the next tick are collected. The first force of a later tick stays in `record`.
static void gather(kn_replay *r)
{
    reading *v = r->private;
    if (v->grouped) return;
    for (; next_record(v); v->held = false) {
        if (v->record.kind == KN_LOG_POSE) remember_pose(r);
        if (v->record.kind != KN_LOG_FORCE) continue;
        const knead_contact_force_t *f = &v->record.force;
        int p = probe_of(r, v->record.probe);
        if (f->tick <= r->resumed_tick) {
            r->tally.before++;
            continue;
        }
        if (v->grouped && f->tick > v->group_tick) return;
        // tick numbers rise in a log, so a force of an earlier tick, or a second force of one probe, cannot be used
        bool late = f->tick <= v->tick || (v->grouped && f->tick < v->group_tick);
        if (p < 0 || f->session == 0 || late || v->has[p]) {
            r->tally.malformed++;
            continue;
        }
        v->grouped = true;
        v->group_tick = f->tick;
        v->force[p] = *f;
        v->has[p] = true;
    }
}

// Return the number of cycles skipped just before a tick. If the log has forces of the tick, they give this number;
// otherwise the tick's checkpoint gives it.
static int32_t missed_before(const reading *v, int64_t tick)
{
    for (int p = 0; v->grouped && v->group_tick == tick && p < KN_PROBES_MAX; p++)
        if (v->has[p]) return v->force[p].missed_cycles;
    int64_t missed = 0;
    for (size_t i = v->next_event; !missed && i < v->found.event_count && v->found.events[i].tick == tick; i++)
        missed = kn_log_missed(&v->found.events[i]);
    return (int32_t)missed;
}

// Count one tick without a record. `more`: number of further ticks without a record that are certain to follow. Return
// false if the log has too few records for so many ticks; the replay then ends. This check bounds the time that a
// damaged or forged log may take.
static bool afford(kn_replay *r, int64_t tick, int64_t more)
{
    reading *v = r->private;
    if (++v->untold + more <= most_untold(v)) return true;
    snprintf(
        r->damage, sizeof r->damage,
        "%lld ticks without a record up to tick %lld, expected at most 60 000 plus 1 000 for each of the %lld records",
        (long long)(v->untold + more), (long long)(tick + more), (long long)v->found.own_records);
    return false;
}

static bool anyone_live(const reading *v)
{
    bool any = false;
    for (int p = 0; p < KN_PROBES_MAX; p++) any |= v->live[p];
    return any;
}

// Choose the number of the next tick to run, and the cycles missed before it. Return false at the end of the log.
static bool choose_tick(kn_replay *r, kn_tick_in *in)
{
    reading *v = r->private;
    gather(r);
    while (v->next_event < v->found.event_count && v->found.events[v->next_event].tick <= v->tick) v->next_event++;
    // number of the next tick that is known to have run, because the log holds a force or an event of it
    bool event = v->next_event < v->found.event_count;
    if (!v->grouped && !event) return false;
    int64_t known = v->grouped ? v->group_tick : v->found.events[v->next_event].tick;
    if (event && v->found.events[v->next_event].tick < known) known = v->found.events[v->next_event].tick;
    int32_t missed = missed_before(v, known);

    // The ticks between two recorded ticks ran as well, so replay them. Leave them out only while the object is
    // untouched and does not move.
    bool idle = v->tick >= 0 && v->tick + 1 + missed < known && !v->resting;
    in->tick = idle ? v->tick + 1 : known;
    in->missed = idle ? 0 : missed;
    // At the first tick without a record, count all ticks of the gap at once. But if nothing has touched the object, it
    // may come to rest within the gap, so count tick by tick.
    return !idle || afford(r, in->tick, v->touched ? known - missed - in->tick - 1 : 0);
}

static void count_gap(kn_replay *r, int64_t tick)
{
    if (r->tally.gaps++ == 0) r->tally.first_gap = tick;
}

// Guess the pose of a tick without a force record. Most likely the tick used the next pose in sequence.
static void guess_pose(kn_replay *r, int p)
{
    reading *v = r->private;
    kn_pose *pose = &r->tick.pose[p];
    const kn_pose *next = find_pose(v, p, pose->session, (int64_t)((uint64_t)pose->seq + 1));
    count_gap(r, r->tick.in.tick);
    r->tick.in.fresh[p] = next != NULL;
    if (next) *pose = *next;
}

// Use the pose whose session and number the tick's force record echoes.
static void take_pose(kn_replay *r, int p)
{
    reading *v = r->private;
    const knead_contact_force_t *f = r->tick.logged[p] = &v->force[p];
    kn_pose *pose = &r->tick.pose[p];
    r->tally.forces++;
    const kn_pose *found = find_pose(v, p, f->session, f->seq);
    // if the pose is not remembered any more, it may still be the pose that the previous tick used
    bool held = v->live[p] && pose->session == f->session && pose->seq == f->seq;
    r->tick.in.fresh[p] = !(f->flags & KNEAD_CONTACT_FORCE_T_FLAG_STALE);
    r->tick.in.held |= (f->flags & KNEAD_CONTACT_FORCE_T_FLAG_HELD) != 0;
    v->live[p] = v->live[p] || found;
    if (found) *pose = *found;
    else if (!held) guess_pose(r, p);
}

// Repeat a change of the quality. A replay that need not give the log's numbers (same is false) ignores the change.
static void apply_quality(kn_replay *r, kn_tick_in *in, const knead_event_t *e)
{
    double to = e->arg[1];
    if (!r->same) return;
    if (to >= 0 && to < KN_QUALITIES && r->scene->point[(int)to].live) {
        in->take = e->arg[2] != 0 ? KN_QUALITY_CAUSE_COMMAND : KN_QUALITY_CAUSE_BUDGET;
        in->quality = (kn_quality)to;
        return;
    }
    r->same = false;
    snprintf(r->damage, sizeof r->damage, "a quality point that the scene does not have, at tick %lld",
             (long long)e->tick);
}

// Repeat an undo or a restore. kn_replay_create has found the snapshot, but the file may have been removed since then.
static void apply_restore(kn_replay *r, kn_tick_in *in, const knead_event_t *e)
{
    reading *v = r->private;
    char why[200];
    if (e->arg[0] == 0) {
        in->undo = true;
    } else if (v->snapshot_path && find_state(r, (uint64_t)e->state_hash, why, sizeof why)) {
        in->restore = v->saved.state;
        in->restored_generation = (int64_t)e->arg[0];
        in->restored_tick = (int64_t)e->arg[1];
    } else {
        r->same = false;
        snprintf(r->damage, sizeof r->damage, "a snapshot that no longer exists, at tick %lld", (long long)e->tick);
    }
}

// Repeat a change of settings. Find the text of the new scene by its hash, override the text with the settings of this
// replay, and build the change.
static void apply_set(kn_replay *r, kn_tick_in *in, const knead_event_t *e)
{
    reading *v = r->private;
    char why[300] = "its scene is not in the log";
    // the event holds the 64-bit hash in two halves, because a double holds only 53 bits
    double high = e->arg[0], low = e->arg[1];
    bool is_hash = high >= 0 && high <= UINT32_MAX && low >= 0 && low <= UINT32_MAX;
    uint64_t hash = is_hash ? (uint64_t)high << 32 | (uint64_t)low : 0;
    const char *text = hash == v->found.scene_hash ? v->found.scene_text : NULL;
    for (size_t i = 0; i < v->found.other_count && !text; i++)
        if (v->found.others[i].hash == hash) text = v->found.others[i].text;
    const kn_replay_def *def = &v->def;
    kn_scene *scene = text ? kn_scene_parse_beside(def->log_path, v->found.scene_name, text, strlen(text), def->sets,
                                                   def->set_count, why, sizeof why)
                           : NULL;
    if (scene && r->same && scene->text_hash != hash) {
        kn_scene_destroy(scene);
        snprintf(why, sizeof why, "this version reads the scene differently");
        scene = NULL;
    }
    // build the change; it replaces an earlier change that no tick has applied
    kn_scene_change *change =
        scene ? kn_scene_change_create(scene, r->servo.scene, r->servo.model, false, why, sizeof why) : NULL;
    if (change) {
        kn_scene_change_destroy(v->next);
        in->change = v->next = change;
        return;
    }
    r->same = false;
    snprintf(r->damage, sizeof r->damage, "a change at tick %lld: %.100s", (long long)e->tick, why);
}

// Apply the events of this tick to its input. Events that a tick produces (faults, attaching) need no input: the
// replayed tick produces them again.
static void apply_events(kn_replay *r, kn_tick_in *in)
{
    reading *v = r->private;
    for (size_t i = v->next_event; i < v->found.event_count && v->found.events[i].tick == in->tick; i++) {
        const knead_event_t *e = &v->found.events[i];
        switch (e->kind) {
        case KNEAD_EVENT_T_KIND_RESET: in->reset = true; break;
        case KNEAD_EVENT_T_KIND_RECOVER: in->recover = true; break;
        case KNEAD_EVENT_T_KIND_ESTOP: in->estop = true; break;
        case KNEAD_EVENT_T_KIND_STOP: in->stop = true; break;
        case KNEAD_EVENT_T_KIND_QUALITY: apply_quality(r, in, e); break;
        case KNEAD_EVENT_T_KIND_RESTORE: apply_restore(r, in, e); break;
        case KNEAD_EVENT_T_KIND_OVERLOAD:
            if (r->same) in->overload = e->arg[0] != 0 ? 1 : -1;
            break;
        case KNEAD_EVENT_T_KIND_DEADLINE: apply_deadline(r, in, e); break;
        case KNEAD_EVENT_T_KIND_SET: apply_set(r, in, e); break;
        case KNEAD_EVENT_T_KIND_SESSION_END:
            if (e->probe >= 0 && e->probe < KN_PROBES_MAX) v->live[e->probe] = false;
            break;
        default: // this version does not know the event, so it cannot repeat the event's change
            if (e->kind < KNEAD_EVENT_T_KIND_ESTOP) break;
            r->same = false;
            snprintf(r->damage, sizeof r->damage, "an event of unknown kind %d at tick %lld", e->kind,
                     (long long)e->tick);
        }
    }
}

// Compare the state hashes of the log's events with those of the events that this tick produced.
static void check_hashes(kn_replay *r)
{
    reading *v = r->private;
    const kn_tick_out *out = &r->tick.out;
    if (!r->same) return;
    for (size_t i = v->next_event; i < v->found.event_count && v->found.events[i].tick == out->tick; i++) {
        const knead_event_t *e = &v->found.events[i];
        bool met = false;
        for (int k = 0; k < out->event_count && !met; k++)
            met = out->event[k].kind == e->kind && out->event[k].probe == e->probe &&
                  out->event[k].state_hash == (uint64_t)e->state_hash;
        r->tally.checkpoints++;
        if (!met && r->tally.mismatches++ == 0) r->tally.first_mismatch = e->tick;
    }
}

// Run the servo tick, and measure the time it takes.
static void run_tick(kn_replay *r)
{
    int64_t start_ns = kn_rt_clock_ns(CLOCK_MONOTONIC), start_cpu_ns = kn_rt_clock_ns(CLOCK_THREAD_CPUTIME_ID);
    kn_servo_tick(&r->servo, &r->tick.in, &r->tick.out);
    r->tick.cpu_ns = kn_rt_clock_ns(CLOCK_THREAD_CPUTIME_ID) - start_cpu_ns;
    r->tick.execution_ns = kn_rt_clock_ns(CLOCK_MONOTONIC) - start_ns;
    r->private->tick = r->tick.in.tick;
    if (r->tick.out.changed) { // a tick applied a new change, so nothing uses the previous change any more
        kn_scene_change_destroy(r->private->change);
        r->private->change = r->private->next;
        r->private->next = NULL;
        r->changes++;
    }
    if (!r->tick.in.undo || r->tick.out.restored_hash != 0 || !r->same) return;
    // The replay can no longer give the log's numbers: the undo point is from before the log began, and no snapshot
    // holds undo points.
    r->same = false;
    snprintf(r->damage, sizeof r->damage, "an undo to a state before this log begins, at tick %lld",
             (long long)r->private->tick);
}

// Run the next tick of a log with forces.
static bool step_by_forces(kn_replay *r)
{
    reading *v = r->private;
    kn_tick_in *in = &r->tick.in;
    bool stop = in->stop;
    *in = (kn_tick_in){.stop = stop};
    memset(r->tick.logged, 0, sizeof r->tick.logged);
    if (!choose_tick(r, in)) return false;

    // take commands from the events, and poses from the force records
    bool grouped = v->grouped && v->group_tick == in->tick;
    apply_events(r, in);
    for (int p = 0; p < r->model->def.probe_count; p++) {
        if (grouped && v->has[p]) take_pose(r, p);
        else if (v->live[p]) guess_pose(r, p);
        in->pose[p] = v->live[p] ? &r->tick.pose[p] : NULL;
        v->touched |= v->live[p];
    }
    if (grouped) {
        v->grouped = false;
        memset(v->has, 0, sizeof v->has);
    }
    r->tick.utime = v->found.origin_utime + 1000 * in->tick;
    r->tick.time_s = 1e-3 * (double)(in->tick - v->found.first_force_tick);
    run_tick(r);
    check_hashes(r);

    // an untouched object is at rest if a tick has not changed the state hash
    uint64_t hash = v->touched ? 0 : kn_state_hash(r->model, kn_replay_state(r));
    v->resting = !v->touched && !anyone_live(v) && v->rest_hash == hash;
    v->rest_hash = hash;
    return true;
}

// Run the next tick of a log without forces.
static bool step_by_time(kn_replay *r)
{
    reading *v = r->private;
    kn_tick_in *in = &r->tick.in;
    const int64_t utime = v->found.first_pose_utime + 1000 * (v->tick + 1);
    if (utime > v->found.last_utime) return false;
    *in = (kn_tick_in){.tick = v->tick + 1};
    r->tick.utime = utime;
    r->tick.time_s = 1e-3 * (double)in->tick;
    // A tick takes all records up to half a period after its own time. So jitter of less than half a period moves no
    // pose to another tick.
    int64_t until = r->tick.utime + 500;
    // count a tick that has no record in the log
    const int64_t next = next_record(v) ? v->record.utime : v->found.last_utime;
    if (next >= until && !afford(r, in->tick, (next - until) / 1000)) return false;
    for (; next_record(v) && v->record.utime < until; v->held = false) {
        int p;
        kn_pose pose;
        if (v->record.kind == KN_LOG_EVENT) {
            in->reset |= v->record.event.kind == KNEAD_EVENT_T_KIND_RESET;
            in->recover |= v->record.event.kind == KNEAD_EVENT_T_KIND_RECOVER;
            in->estop |= v->record.event.kind == KNEAD_EVENT_T_KIND_ESTOP;
            if (v->record.event.kind == KNEAD_EVENT_T_KIND_QUALITY) apply_quality(r, in, &v->record.event);
            if (v->record.event.kind == KNEAD_EVENT_T_KIND_RESTORE) apply_restore(r, in, &v->record.event);
            if (v->record.event.kind == KNEAD_EVENT_T_KIND_DEADLINE) apply_deadline(r, in, &v->record.event);
            if (v->record.event.kind == KNEAD_EVENT_T_KIND_SET) apply_set(r, in, &v->record.event);
        }
        if (v->record.kind != KN_LOG_POSE) continue;
        const kn_datagram d = datagram_of(&v->record);
        if (kn_receiver_judge(&v->receiver, &d, 1000 * v->record.utime, &p, &pose) != KN_ACCEPTED) {
            r->tally.refused++;
            continue;
        }
        r->tick.pose[p] = pose;
        in->fresh[p] = v->live[p] = true;
    }
    // end the sessions that fell silent, then run
    unsigned ended = kn_receiver_expire(&v->receiver, 1000 * until);
    for (int p = 0; p < r->model->def.probe_count; p++) {
        if (ended >> p & 1) v->live[p] = false;
        in->pose[p] = v->live[p] ? &r->tick.pose[p] : NULL;
    }
    run_tick(r);
    for (int p = 0; p < r->model->def.probe_count; p++)
        if (r->tick.out.force[p].left && kn_receiver_leave(&v->receiver, p, r->tick.out.force[p].session))
            v->live[p] = false;
    return true;
}

// Count the ticks in which a tool presses the object outside the reach that the scene gives the tool's probe. In a
// block of two resolutions, the cells outside the reach are coarse. A tool that touches nothing is not counted.
static void look_outside(kn_replay *r)
{
    double most_m = 1e-6; // ignore distances up to 1 um, which are rounding errors
    int probe = -1;
    for (int p = 0; r->model->composite && p < r->model->def.probe_count; p++) {
        const double *x = r->tick.pose[p].position_m, (*reach)[2] = r->model->def.probe[p].reach_m;
        double off_m[2];
        for (int k = 0; k < 2; k++) off_m[k] = fmax(0, fmax(reach[k][0] - x[k], x[k] - reach[k][1]));
        const kn_force *f = &r->tick.out.force[p];
        if (!f->live || f->contacts == 0 || hypot(off_m[0], off_m[1]) <= most_m) continue;
        most_m = hypot(off_m[0], off_m[1]);
        probe = p;
    }
    r->tally.outside += probe >= 0;
    if (probe < 0 || most_m <= r->tally.outside_m) return;
    r->tally.outside_m = most_m;
    r->tally.outside_probe = probe;
}

bool kn_replay_step(kn_replay *r)
{
    bool more = r->forces_logged ? step_by_forces(r) : step_by_time(r);
    r->tally.ticks += more;
    if (more) look_outside(r);
    return more;
}
