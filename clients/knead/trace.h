#ifndef KN_CLIENTS_TRACE_H
#define KN_CLIENTS_TRACE_H
// What one replay of a log leaves behind to compare with another: the force of every tick, the shape at the end, and
// what it cost. The ticks are those from the first pose on; two replays of one log have the same ones.
//
// As a file it is this machine's own bytes, written under another name and renamed when whole: whoever is killed leaves
// no half a trace. A file that is none, or is another program's, is told from one that is missing.
#include "server/replay.h"
#include <signal.h>

typedef struct kn_trace {
    int64_t ticks, probes;
    double (*force_n)[3];   // [ticks * probes] contact force, before any device limit; 0 of a probe without a session
    int64_t nodes, grid[3]; // nodes along x, y, z, 0: a mesh
    double spacing_m;
    double (*shape_m)[3]; // [nodes] displacement after the last tick
    int64_t faults;       // latched: poses that stopped are in the log, a jump of the force is the computation's
    int64_t diverged;
    kn_replay_tally tally;    // of the replay, at its end
    float *us;                // [ticks] of this thread's processor time; 0: no tool touched the object
    double median_us, p90_us; // of those in which one did
    int64_t sitting; // which sweep's serial pass these times are of, 0: others ran beside it, they mean nothing
} kn_trace;

// Replays. False and one line in error; a log that holds no tick, or *stop becoming true, is also one.
bool kn_trace_play(kn_trace *t, const kn_replay_def *def, const volatile sig_atomic_t *stop, char *error,
                   size_t error_size);
void kn_trace_free(kn_trace *t); // a zeroed one is fine

// Takes the lesser of two times of every tick: a tick is the same work in both, and what disturbed the one hardly ever
// disturbed the other. (The p90 of a whole play on a busy machine is a third too large.)
bool kn_trace_calm(kn_trace *t, const kn_trace *other); // false: out of memory

typedef enum kn_trace_found { KN_TRACE_FOUND, KN_TRACE_MISSING, KN_TRACE_DAMAGED, KN_TRACE_FOREIGN } kn_trace_found;

// program: hash of the one that played; FOREIGN: it was another.
bool kn_trace_save(const kn_trace *t, const char *path, uint64_t program);
kn_trace_found kn_trace_load(kn_trace *t, const char *path, uint64_t program);
kn_trace_found kn_trace_peek(const char *path, uint64_t program); // the same without keeping it

// Hash of a file's bytes; false when it cannot be read.
bool kn_trace_hash(const char *path, uint64_t *hash);

#endif
