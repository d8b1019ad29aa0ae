#ifndef KN_SERVER_EXCHANGE_H
#define KN_SERVER_EXCHANGE_H
// The exchange between the bus and the servo loop: the work of the main thread in every millisecond.
//
//     datagrams --> receiver --> mailboxes --> servo loop
//     bus <-------- publisher <------ records, touches <--'
//     trace file <-- trace <-----------'
//
// The daemon calls the exchange when a socket has datagrams and when the loop has ticked; tests/rig.h does so in
// virtual time. The exchange neither blocks nor sleeps.
#include "proto/knead_health_t.h"
#include "proto/knead_status_t.h"
#include "server/auth.h"
#include "server/loop.h"
#include "server/receiver.h"
#include "server/tick_timing.h"
#include <lcm/lcm.h>
#include <stdio.h>

// --- publisher ---
//
// The publisher sends forces, events, scene, status and health on the bus on which poses arrive. It belongs to one
// thread and has one lcm_t, which only transmits (liblcm must not receive from the bus, see receiver.h). Messages are
// encoded into the publisher's own memory. The X_publish functions of lcm-gen would allocate for each message.

typedef struct kn_publisher {
    lcm_t *lcm;
    const kn_scene *scene;
    const kn_auth *auth; // key that signs every message; NULL: messages are not signed
    int64_t signed_us;   // age stamp of the last signed message: time since the life of kneadd began (auth.h), us
    uint64_t initial_hash;
    char force_channel[KN_PROBES_MAX][64]; // LCM channel of each probe's forces: KNEAD_FORCE_<probe>
    char contact_channel[KN_PROBES_MAX][64];
    char touch_channel[KN_PROBES_MAX][64];
    uint8_t *bytes; // buffer of `room` bytes for the largest message (the scene) and its KN_AUTH_TRAILER bytes
    int room;
    int64_t published; // number of datagrams handed to LCM
    int64_t failed;    // number of messages that could not be encoded, or that LCM refused
} kn_publisher;

// Open the bus at an LCM URL. initial_hash: state hash of the object before anything touched it. Borrows `scene`. On
// failure return false and put one line in error.
bool kn_publisher_open(kn_publisher *p, const char *url, const kn_scene *scene, uint64_t initial_hash, char *error,
                       size_t error_size);
void kn_publisher_close(kn_publisher *p);

void kn_publisher_scene(kn_publisher *p, int64_t utime);
void kn_publisher_status(kn_publisher *p, const knead_status_t *status);
void kn_publisher_health(kn_publisher *p, const knead_health_t *health);

// --- trace ---
//
// The trace of `kneadd --trace FILE`: a CSV file with the times at which each tick's pose passed the stages of the
// server. There is a row per tick and probe with a session. Times are CLOCK_MONOTONIC, ns. A sender on this machine can
// join its own times by session and seq.
//
//     arrived_ns   the pose was put in its mailbox, after it was received and judged
//     woke_ns      the tick that used the pose began
//     stepped_ns   the backend had answered with the step of the lattice
//     guarded_ns   the output stage had the force ready; the main thread publishes it next
//     due_ns       deadline until which the thread slept: the tick's own, or that of the first missed cycle
//     asked_ns     the previous tick had ended with all its work; after due_ns: the previous tick took too long
//     late_ns      delay by the machine: from the later of due_ns and asked_ns to the wake, without holds
//
// Rows go through a ring from the main thread to a thread that may wait for a disk. A full ring loses rows and counts
// them. Without --trace, taking the time stamps is the only cost.

typedef struct kn_tick_trace {
    FILE *file; // the open trace file; NULL: no trace
    kn_ring rows;
    int64_t lost; // number of rows lost because the ring was full
    bool failed;  // true if a write to the file has failed
} kn_tick_trace;

// Create a trace file, or append to it if `append` is true. `path` NULL: no trace. On failure return false and put one
// line in error.
bool kn_tick_trace_open(kn_tick_trace *trace, const char *path, bool append, char *error, size_t error_size);
void kn_tick_trace_drain(kn_tick_trace *trace); // write the rows in the ring to the file; call from one thread only
// Write the rows in the ring and close the file; return false if a write failed; a zeroed trace is allowed.
bool kn_tick_trace_close(kn_tick_trace *trace);

// --- exchange ---

typedef struct kn_exchange {
    kn_receiver receiver; // the caller initialises the receiver and opens the publisher
    kn_publisher publisher;
    kn_loop *loop;         // servo loop; borrowed, as are `trace` and `sentinel`
    kn_tick_trace *trace;  // trace file of the run; NULL: no trace
    kn_sentinel *sentinel; // sentinel thread; NULL: none
    // Latest change of the scene that was published; NULL: the scene of the server's start is published.
    kn_scene_change *told;
    kn_force force[KN_PROBES_MAX]; // answer of the latest tick to each probe
} kn_exchange;

// Judge the datagrams, and post the accepted poses to the servo loop.
void kn_exchange_hear(kn_exchange *exchange, const kn_datagram_batch *batch);

// Publish the records and touch patches of all ticks since the last call, and end the sessions that fell silent. Call
// this function after one tick or more. Return true when the loop has ended and its last record has been published.
bool kn_exchange_ticked(kn_exchange *exchange);

#endif
