#ifndef KN_CLIENTS_REPLAY_TRACE_H
#define KN_CLIENTS_REPLAY_TRACE_H
// Trace: the results of one replay of a log, for comparison with other replays. A trace holds the force of every tick,
// the shape at the end and the processor time of every tick. Its ticks are counted from the first pose on, so two
// replays of one log have the same ticks.
//
// A trace file has the byte order and layout of this machine. The file is written under another name and renamed when
// it is complete, so an interrupted program leaves no partial trace.
#include "server/log_replay.h"

typedef struct kn_replay_trace {
    int64_t ticks, probes;
    // Contact force before any force limit, an array of ticks * probes forces; 0 for a probe without a session.
    double (*force_n)[3];
    // nodes: number of nodes of the lattice. grid: number of nodes along x, y, z; 0: the object is a mesh.
    int64_t nodes, grid[3];
    double spacing_m;
    double (*shape_m)[3]; // displacement of each node after the last tick
    // Number of latched faults in the replay. A fault for missing poses is caused by the log; a fault for a jump of the
    // force is caused by the computation.
    int64_t faults;
    int64_t diverged;         // number of ticks in which the solver gave numbers that are not finite
    kn_replay_tally tally;    // counters of the replay at its end
    float *us;                // processor time [us] of each tick in the replaying thread; 0: no tool touched the object
    double median_us, p90_us; // median and 90th percentile of those times in `us` that are not 0
    // Identifier of the sweep's serial pass in which the times were measured. 0: other processes ran at the same time,
    // so the times mean nothing.
    int64_t sitting;
} kn_replay_trace;

// Replay a log and record the trace. Return false and one line in `error` on failure. It is a failure if no hand holds
// a tool in the log, or if kn_interrupted (command.h) is set meanwhile.
bool kn_replay_trace_play(kn_replay_trace *t, const kn_replay_def *def, char *error, size_t error_size);
// Free a trace. A zeroed struct is allowed.
void kn_replay_trace_free(kn_replay_trace *t);

// Set the time of every tick in `t` to the smaller of the times in `t` and `other`. Both must be replays of the same
// run. The work of a tick is the same in both replays, and a disturbance by other processes rarely hits the same tick
// in both. On a busy machine the p90 of a single replay is a third too large. Return false when memory is short.
bool kn_replay_trace_calm(kn_replay_trace *t, const kn_replay_trace *other);

// Save or load a trace file. Return false on failure; a file that is missing or damaged cannot be loaded.
bool kn_replay_trace_save(const kn_replay_trace *t, const char *path);
bool kn_replay_trace_load(kn_replay_trace *t, const char *path);

// Write to `hash` a hash of the bytes of a file. Return false if the file cannot be read.
bool kn_replay_trace_hash(const char *path, uint64_t *hash);

// Check that a log can be used for a sweep (many replays): the log must be undamaged and must belong to the scene under
// test.
//
// `knead replay` replays a damaged log up to the damage and reports the damage. A sweep refuses a damaged log, because
// hours of work on the first half would say nothing about the second half. A log may contain no scene, for example if
// lcm-logger was started after the server. Such a log is accepted as if it had been recorded with the scene under test.

// Check the log of `def` against `scene`. Return false and one line in `error` if the log cannot be used.
// def: the replay that will be run. It needs at least one set (a `key=value` that overrides the scene). A replay
// without sets refuses a log of another scene by itself, before this function can compare the two scenes.
// scene: the scene at `scene_path` with the user's sets. `scene` may differ from the scene of the log in these keys
// only: solver, quality, mesh (contents of mesh messages), and the places of small cells (object.accuracy,
// object.margin, the probes' reach). The two scenes are compared with the user's sets and, if they differ, once more
// without the sets.
bool kn_replay_log_check(const kn_replay_def *def, const char *scene_path, const kn_scene *scene, char *error,
                         size_t error_size);

// Differences between two replays of a log: numerical differences, and differences that a hand would notice.

// Return the relative difference |a - b| / |b| between the tool forces of two replays. | | is the Euclidean norm over
// all ticks and tools. Return NAN if `b` has no force at all.
double kn_contact_force_error(const kn_replay_trace *a, const kn_replay_trace *b);

// Return the factor with which the forces of `a` come nearest to those of `b`. *left: the error that is left then.
double kn_contact_force_factor(const kn_replay_trace *a, const kn_replay_trace *b, double *left);

// Return the relative difference |a - b| / |b| between the node displacements of two replays after the last tick.
// Blocks with different lattices are compared at the nodes of `a`. The displacement of `b` at these nodes is
// interpolated in the cells of `b`. Return NAN if the two replays have different meshes, or if `b` is not deformed.
double kn_contact_shape_error(const kn_replay_trace *a, const kn_replay_trace *b);

double kn_contact_force_peak(const kn_replay_trace *t); // largest force on a tool, N
// Largest change of the force on a tool from one tick to the next, N per ms.
double kn_contact_force_jump(const kn_replay_trace *t);
// Total variation of the forces on all tools over time, N; twice the peak force in a press without oscillation.
double kn_contact_force_variation(const kn_replay_trace *t);
double kn_contact_depth(const kn_replay_trace *t); // largest downward displacement of a node after the last tick, m

// Return the delay of the force of `a` against the force of `b` at 10 Hz, s. Human hands tremble and stroke at about
// this frequency. The delay is the phase of the cross spectrum, summed over 8 to 12 Hz and all tools, divided by the
// mean angular frequency in that band. The same recorded motion drives the tools of both replays, so a signal common to
// both forces comes from the hand. Return NAN if the force has less than 1e-6 of its sum of squares in that band.
//
//     S = sum over f of A(f) B*(f)        A(f) = sum over ticks of force exp(-2 pi i f t)        lag = -arg S/(2 pi f)
double kn_contact_force_lag(const kn_replay_trace *a, const kn_replay_trace *b);

#endif
