#ifndef KN_SERVER_REPLAY_H
#define KN_SERVER_REPLAY_H
// A log, tick by tick, through the very servo that the daemon runs, under a virtual clock.
//
//     kn_replay_def def = {.log_path = "press.lcmlog"};
//     kn_replay *r = kn_replay_create(&def, error, sizeof error);
//     while (kn_replay_step(r)) use(r->tick.out.force[0], kn_replay_state(r));
//     kn_replay_destroy(r);
//
// With forces in the log, a tick used exactly the poses that its force records echo (session, seq), fresh or stale as
// FLAG_STALE says, after the missed_cycles they tell; resets, stops, points of quality and the ends of sessions come
// from the events, never from how long a tick takes here. That
// is all a tick depends on, so the replay gives the same bits. A tick that must have run and has no record is a gap: it
// is counted, and replayed with the next pose in sequence. Without forces, poses are judged and assigned to 1 ms ticks
// by log time, as the receiver would have done it.
//
// What was set is set here, by the scene's text, which the log holds again; what was undone is undone here by the same
// rule; what a server restored comes from its snapshots, by the state's hash. A log that begins on a kneaded object
// goes on from a snapshot of that run, taken at a tick that is in it, and so does any other that restores none, from
// the first such.
//
// Reads the log twice and keeps only the last poses in memory, so a log may be larger. Allocates in create, and where a
// snapshot is restored.
#include "proto/knead_contact_force_t.h"
#include "server/servo.h"

#define KN_REPLAY_HALF_TICK_S 0.0005 // times that are apart by less are one tick's

typedef struct kn_replay_def { // what it points at is borrowed as long as the replay lives
    const char *log_path;
    const char *scene_path;  // NULL: the scene that the log holds. Another scene than the log's is refused without sets
    const char *const *sets; // "key=value" over the scene, as --set gives them; 0: the computation of the log
    int set_count;
    bool afresh; // only the hand's poses count: the log's states and points of quality are not this run's to reproduce
    const char *snapshot_path; // a snapshot, or a directory of them as kneadd --state-dir keeps; NULL: none
    const char *device;        // URI of a circuit that steps the lattice, waited for as long as it takes; NULL: none
    bool *device_failed;       // NULL, or out: it is the circuit that kn_replay_create gave up for
} kn_replay_def;

typedef struct kn_replay_tick { // what the last step did
    kn_tick_in in;
    kn_tick_out out;
    kn_pose pose[KN_PROBES_MAX];                        // in.pose points here
    const knead_contact_force_t *logged[KN_PROBES_MAX]; // the log's force of this tick, NULL: none
    int64_t utime;                                      // log time of this tick, us
    double time_s;                                      // since the first tick with a session (negative before)
    int64_t execution_ns, cpu_ns; // of the servo, here and now, by the clock and of this thread; nothing depends on it
} kn_replay_tick;

typedef struct kn_replay_tally { // honest about what could not be used
    int64_t ticks;               // executed so far
    int64_t ticks_total;         // in the log, for a progress bar; an estimate without forces
    int64_t forces;              // force records used
    int64_t gaps;                // ticks that ran live and have no force record, or whose pose is missing
    int64_t first_gap;           // tick number, -1: none
    int64_t malformed;           // records of our channels that are not what their channel says
    int64_t refused;             // poses that the receiver's rules refuse (only without forces)
    int64_t checkpoints;         // state hashes of the log that the replay met
    int64_t mismatches;          // ... and did not reproduce
    int64_t first_mismatch;      // tick number, -1: none
    int64_t outside;             // ticks in which a tool pressed on a block of two resolutions outside of its reach
    double outside_m;            // how far at most
    int outside_probe;           // which tool
} kn_replay_tally;

typedef struct kn_replay {
    kn_scene *scene;
    kn_model *model; // of the log's beginning; kn_replay_model is the one in force
    int changes;     // of the model in force: counts up with each, an address may come back
    kn_backend backend;
    kn_servo servo;
    kn_replay_tick tick;
    kn_replay_tally tally;
    bool forces_logged;   // the log holds forces: exact
    bool same;            // scene and computation are the log's own, so its numbers can be demanded back
    int64_t resumed_tick; // of the snapshot that it goes on from, -1: from the log's beginning
    const char *logged_name, *logged_text; // the scene that the log holds, NULL: none
    char damage[160];                      // "" or what is wrong with the file; what stands before it is used
    struct kn_replay_private *private;
} kn_replay;

// NULL and one line in error: no such log, no scene in it, another scene, an object kneaded before the log began, or
// a snapshot that it needs and is not there.
kn_replay *kn_replay_create(const kn_replay_def *def, char *error, size_t error_size);

// Runs one tick; false at the end of the log, where tick.out, .pose and .time_s remain those of the last one.
bool kn_replay_step(kn_replay *replay);

// The object now and what it is made of now: both are another's once a step has gone over to what was set.
const kn_state *kn_replay_state(kn_replay *replay);
const kn_model *kn_replay_model(const kn_replay *replay);
// tick.time_s of the last tick that the log tells of, tally.ticks_total of them being run at most.
double kn_replay_end_s(const kn_replay *replay);
void kn_replay_destroy(kn_replay *replay); // NULL is fine

#endif
