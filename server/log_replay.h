#ifndef KN_SERVER_LOG_REPLAY_H
#define KN_SERVER_LOG_REPLAY_H
// A replay runs a log tick by tick through the same servo code as the daemon, under a virtual clock.
//
//     kn_replay_def def = {.log_path = "press.lcmlog"};
//     kn_replay *r = kn_replay_create(&def, error, sizeof error);
//     while (kn_replay_step(r)) use(r->tick.out.force[0], kn_replay_state(r));
//     kn_replay_destroy(r);
//
// A log with forces is replayed exactly. Each force record echoes the pose that its tick used (session, seq), tells
// whether that pose was fresh (FLAG_STALE), and how many cycles were missed before the tick (missed_cycles). Resets,
// stops, changes of quality and the ends of sessions come from the events, never from the time that a tick takes here.
// A tick depends on no other input, so the replay gives the same bits. A tick that must have run but has no record is a
// gap. A gap is counted, and its tick is replayed with the next pose in sequence.
//
// In a log without forces, poses are judged as the receiver would have judged them, and assigned to 1 ms ticks by log
// time.
//
// Settings that an operator made at run time (event KIND_SET) are applied in the replay as well, because the log holds
// the scene's new text. Undos are repeated by the server's own rule. Restored objects come from the server's snapshots,
// found by state hash.
//
// If the object was already kneaded when the log begins, the replay needs a snapshot of the same run, and starts there.
// A recording of `knead probe` holds this snapshot itself (channel KNEAD_SNAPSHOT). Otherwise kn_replay_def gives one
// that was taken at a tick within the log. With --snapshot, the replay of any other log without restores also starts at
// the first snapshot of its run. With another scene or computation than the log's, a replay begins at the object that
// the log holds if that fits, and is refused if it does not, unless that object was untouched.
//
// The log is read twice, and only the last poses are kept in memory, so a log may be larger than memory. Memory is
// allocated in kn_replay_create, when a snapshot is restored, and when a setting is applied.
#include "proto/knead_contact_force_t.h"
#include "server/servo.h"

#define KN_REPLAY_HALF_TICK_S 0.0005 // two times that differ by less than this belong to the same tick, s

typedef struct kn_replay_def { // arguments of kn_replay_create; the data behind all pointers must outlive the replay
    const char *log_path;
    // Scene file; NULL: the scene in the log. Without `sets`, the file must hold the log's scene.
    const char *scene_path;
    // "key=value" settings that override the scene's, as --set does; if there are none, the log's settings apply.
    const char *const *sets;
    int set_count;
    bool afresh; // true: take only the poses from the log, and do not reproduce its state hashes and qualities
    // Path of a snapshot file, or of a directory of snapshots (kneadd --state-dir); NULL: none.
    const char *snapshot_path;
    // URI of a circuit that steps the lattice without a time limit; NULL: the processor steps the lattice.
    const char *device;
    bool *device_failed; // set when kn_replay_create fails: true if the circuit is the reason; may be NULL
} kn_replay_def;

typedef struct kn_replay_tick { // input and result of the last tick that the replay ran
    kn_tick_in in;
    kn_tick_out out;
    kn_pose pose[KN_PROBES_MAX];                        // poses to which in.pose points
    const knead_contact_force_t *logged[KN_PROBES_MAX]; // force of this tick in the log; NULL: none
    int64_t utime;                                      // log time of this tick, us
    // Time of the tick since the first force, s; negative before it. In a log without forces: since the first pose.
    double time_s;
    // Elapsed time and CPU time that this replay took for the tick, ns; for information only.
    int64_t execution_ns, cpu_ns;
} kn_replay_tick;

typedef struct kn_replay_tally { // counts of ticks and records, and of records that the replay could not use
    int64_t ticks;               // number of ticks executed so far
    int64_t ticks_total;         // number of ticks in the log, for a progress bar; an estimate if the log has no forces
    int64_t forces;              // number of force records used
    int64_t before;              // number of force records of ticks up to that of the snapshot, which are not used
    // Number of gaps. A gap is a tick in which a probe has a session, but the log lacks the force of the probe or the
    // pose that the force answers.
    int64_t gaps;
    int64_t first_gap;      // tick number of the first gap, -1: none
    int64_t malformed;      // number of records on Knead's channels with invalid content
    int64_t refused;        // number of poses that the receiver's rules refuse (only in logs without forces)
    int64_t checkpoints;    // number of state hashes in the log that were compared with the replay's
    int64_t mismatches;     // number of state hashes in the log that the replay did not reproduce
    int64_t first_mismatch; // tick number of the first mismatch, -1: none
    // Block of two resolutions: number of ticks in which a tool pressed the object outside the reach that the scene
    // gives its probe.
    int64_t outside;
    double outside_m;  // largest distance of a pressing tool from its probe's reach, m
    int outside_probe; // index of the probe with the distance outside_m
} kn_replay_tally;

typedef struct kn_replay {
    kn_scene *scene;
    kn_model *model;   // model at the log's beginning; kn_replay_model returns the present model
    kn_state *settled; // the object at rest (kn_scene_settle)
    // Number of model changes so far; use this number to detect a change, because a new model may reuse the old
    // address.
    int changes;
    kn_backend backend;
    kn_servo servo;
    kn_replay_tick tick;
    kn_replay_tally tally;
    bool forces_logged; // true if the log holds forces, so that the replay is exact
    // True if scene and settings are the log's own, so that the replay must reproduce the log's numbers.
    bool same;
    int64_t resumed_tick; // tick of the snapshot from which the replay continues; -1: from the log's beginning
    // Name and text of the scene that the log holds; NULL: the log holds no scene.
    const char *logged_name, *logged_text;
    char damage[160]; // damage found in the log file, "" if none; the log is used up to the damage
    struct kn_replay_private *private;
} kn_replay;

// Open a log and prepare its replay. Return NULL and put one line in error if the log does not exist, holds no scene,
// was recorded with a scene other than the given one, or needs a snapshot that is missing.
kn_replay *kn_replay_create(const kn_replay_def *def, char *error, size_t error_size);

// Run one tick. Return false at the end of the log; tick.out, tick.pose and tick.time_s then still hold the last tick.
bool kn_replay_step(kn_replay *replay);

// Return the present state of the object, and its present model. A step that applies a setting may replace both.
const kn_state *kn_replay_state(kn_replay *replay);
const kn_model *kn_replay_model(const kn_replay *replay);
// Return tick.time_s of the last tick in the log. If the log has no forces, the time is an estimate from
// tally.ticks_total.
double kn_replay_end_s(const kn_replay *replay);
void kn_replay_destroy(kn_replay *replay); // `replay` may be NULL

#endif
