#ifndef KN_SERVER_TRACE_H
#define KN_SERVER_TRACE_H
// When what happened to the pose of each tick, as CSV: `kneadd --trace FILE`, a row per tick and probe that has a
// session. Times are CLOCK_MONOTONIC, ns, so whoever sent the pose on this machine can join its own to them by session
// and seq.
//
//     arrived_ns   the pose lay in its mailbox: received and judged
//     woke_ns      the tick began that used it
//     stepped_ns   the lattice had answered
//     guarded_ns   the force was what the hand is given; next it goes to the main thread, which publishes it
//     due_ns       the deadline that the tick was slept for: its own, or of the first cycle that was missed before it
//     asked_ns     the tick before had ended with all that belongs to it; after due_ns: that one took too long
//     late_ns      awake this long after either, before it waited for its pose: what the machine added
//
// Rows go through a ring from the main thread to one that may wait for a disk; a full ring loses rows and counts them.
// Without --trace nothing of this costs anything but the stamps.
#include "server/loop.h"
#include <stdio.h>

typedef struct kn_trace {
    FILE *file; // NULL: no trace
    kn_ring rows;
    int64_t lost;
    bool failed; // the file took no more
} kn_trace;

// path NULL: no trace. False and one line in error.
bool kn_trace_open(kn_trace *trace, const char *path, bool append, char *error, size_t error_size);
void kn_trace_record(kn_trace *trace, const kn_record *record, const kn_model_def *def); // real-time safe
void kn_trace_drain(kn_trace *trace);                                                    // in one thread
bool kn_trace_close(kn_trace *trace); // drains; false when the file took less than all; a zeroed one is fine

#endif
