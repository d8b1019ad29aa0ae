#ifndef KN_SERVER_TRACE_H
#define KN_SERVER_TRACE_H
// The trace of `kneadd --trace FILE`: a CSV file with the times at which each tick's pose passed the stages of the
// server. There is a row per tick and probe with a session. Times are CLOCK_MONOTONIC, ns. A sender on this machine can
// join its own times by session and seq.
//
//     arrived_ns   the pose was put in its mailbox, after it was received and judged
//     woke_ns      the tick that used the pose began
//     stepped_ns   the backend had answered with the step of the lattice
//     guarded_ns   the output stage had the force ready; the main thread publishes it next
//     due_ns       deadline until which the thread slept: the tick's own, or that of the first missed cycle
//     asked_ns     the previous tick had ended with all its work; if this is after due_ns, it took too long
//     late_ns      delay by the machine: from the later of due_ns and asked_ns to the wake, without holds
//
// Rows go through a ring from the main thread to a thread that may wait for a disk. A full ring loses rows and counts
// them. Without --trace, taking the time stamps is the only cost.
#include "server/loop.h"
#include <stdio.h>

typedef struct kn_trace {
    FILE *file; // the open trace file; NULL: no trace
    kn_ring rows;
    int64_t lost; // number of rows lost because the ring was full
    bool failed;  // true if a write to the file has failed
} kn_trace;

// Create a trace file, or append to it if `append` is true. `path` NULL: no trace. On failure return false and put one
// line in error.
bool kn_trace_open(kn_trace *trace, const char *path, bool append, char *error, size_t error_size);
// Add the rows of a tick to the ring; real-time safe.
void kn_trace_record(kn_trace *trace, const kn_record *record, const kn_model_def *def);
void kn_trace_drain(kn_trace *trace); // write the rows in the ring to the file; one thread only
// Write the rows in the ring and close the file; return false if a write failed; a zeroed trace is allowed.
bool kn_trace_close(kn_trace *trace);

#endif
