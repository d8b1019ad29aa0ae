#ifndef KN_SERVER_LOOP_H
#define KN_SERVER_LOOP_H
// The servo thread: kn_servo_tick on a real clock, with the poses that came in and the answers going out.
//
//     main thread --- kn_loop_post ---> mailbox per probe --+
//     one operator -- kn_loop_order --> flags --------------+
//     anyone -------- stop -----------> flag ---------------+
//                                                           v
//                                   wait . read . step . guard . publish . account
//                                                           |
//     main thread <-- records (every tick, in order) -------+-------> skin (latest surface) --> mesh thread
//                                                           |
//                                  in what is left of the tick: local models, the audit of the lattice, a copy of it
//                                  for the keeper
//
// Between start and stop the thread allocates nothing, takes no lock and calls the kernel only to sleep and to notify.
#include "core/touch.h"
#include "server/account.h"
#include "server/change.h"
#include "server/mailbox.h"
#include "server/phase.h"
#include "server/ring.h"
#include "server/servo.h"
#include "server/skin.h"
#include "server/snapshot.h"

#define KN_LOOP_ORDERS 64      // whose ticks are remembered
#define KN_LOOP_STOP_TICKS 100 // ms. Forces come down within 20; longer than this nobody waits

typedef struct kn_record { // one tick, for whoever publishes it
    kn_wake wake;
    int64_t utime;                    // us since 1970, when the tick had its answer
    int64_t execution_ns;             // read to publish
    int64_t guarded_ns;               // when the servo was done
    int64_t posted_ns[KN_PROBES_MAX]; // when the poses that it used came
    kn_tick_out out;                  // last: its contacts are in the ring only where out.local
} kn_record;

#define KN_LOOP_TOUCH_TICKS 4 // 250 Hz

typedef struct kn_touched { // what a probe with a session touches
    int64_t utime, session, pose_seq;
    int probe;
    kn_touch touch;
} kn_touched;

typedef struct kn_posted { // what lies in a mailbox
    kn_pose pose;
    int64_t posted_ns, before_ns; // when; the one before it
} kn_posted;

typedef enum kn_order { // of an operator; several of the same kind before a tick are one
    KN_ORDER_RESET,     // the object is as new
    KN_ORDER_QUALITY,   // a live point of the scene's; of several the last
    KN_ORDER_RECOVER,   // latched faults are forgotten, an ESTOP that waits for a tick, too; tools engage once lifted
    KN_ORDER_ESTOP,     // forces fade and stay 0 until recover
    KN_ORDER_RESTORE,   // the object is as in loop->restore
    KN_ORDER_UNDO,      // the object is as before it was kneaded last
    KN_ORDER_CHANGE     // the object goes on in loop->change
} kn_order;

typedef struct kn_loop {
    kn_servo servo;
    kn_clock clock;
    kn_phase phase;
    bool free;                // the clock's grid stands still instead of following the poses; before the start
    _Atomic int64_t start_ns; // of the clock, for whoever keeps beside its ticks
    kn_account account;
    kn_ring records; // of kn_record; the other end is the main thread's
    kn_ring touches; // of kn_touched, as the above; no capacity: nobody asked
    kn_skin *skin;
    kn_audit *audit;
    struct kn_keeper *keeper; // NULL: nobody
    kn_mailbox pose[KN_PROBES_MAX];
    kn_posted pose_slots[KN_PROBES_MAX][3];
    int64_t posted_ns[KN_PROBES_MAX]; // the latest of each probe; the main thread's
    void (*notify)(void *arg);        // called after each tick: wakes the main thread. Must be real-time safe
    void *notify_arg;
    atomic_bool stop;        // set by anyone: forces ramp to zero, then the thread ends
    _Atomic int64_t orders;  // how many were given << 8, and bit kn_order of those that the next tick takes
    atomic_int quality;      // of KN_ORDER_QUALITY
    const kn_saved *restore; // of KN_ORDER_RESTORE, to stay until that is obeyed
    struct kn_change
        *change; // of KN_ORDER_CHANGE, to stay until another one is taken, and whoever uses it has gone over
    _Atomic(struct kn_change *) changed; // the latest that was taken, NULL: none
    _Atomic uint64_t restored; // state hash of what the latest order to restore or undo put there; 0: nothing to undo
    _Atomic int64_t obeyed;    // how many were taken
    _Atomic int64_t obeyed_tick[KN_LOOP_ORDERS]; // the tick that took order n, at n modulo that
    atomic_bool done;                            // its last record is in the ring
    int64_t execution_ns;                        // of the last tick
    int64_t deadline;     // units that a step may take, from the first tick on; 0: none. Before the start
    int64_t priced;       // what it was at the start, or at the latest change that priced it anew
    int dear, cheap;      // long steps in a row: above KN_LOOP_DEAR_SHARE, below KN_LOOP_CHEAP_SHARE
    double dear_share;    // least share of the budget among the dear ones
    kn_busy busy;         // all of the latest ones, for the sentinel
    int64_t running_tick; // last one before stop was asked
} kn_loop;

// Borrows all; skin and audit may be NULL. False when memory is short.
bool kn_loop_init(kn_loop *loop, const kn_scene *scene, const kn_model *model, kn_backend *backend, kn_skin *skin,
                  kn_audit *audit);
void kn_loop_free(kn_loop *loop);

// Has touch patches made of the contacts, into touches. Before the start; false when memory is short.
bool kn_loop_touch(kn_loop *loop);

// Tick 0 is at start_ns. Before kn_loop_run, and before anyone reads loop->start_ns.
void kn_loop_start(kn_loop *loop, int64_t start_ns);

// The deadline follows the processor, which may become slower after the deadline was measured: the same units then take
// longer. A step is long when it took half of the deadline's units or more; the others tell nothing. KN_LOOP_DEAR long
// steps in a row whose ticks took more than KN_LOOP_DEAR_SHARE of the budget make the deadline smaller, by half at most.
// KN_LOOP_CHEAP in a row below KN_LOOP_CHEAP_SHARE make it larger by an eighth, up to what it was priced at. A step that
// takes just what it was priced at (KN_SERVED_SHARE) had CHEAP_SHARE before the last eighth, so it gets there. Each
// change is an event in the log, so the log replays to the bit.
#define KN_LOOP_DEAR 3
#define KN_LOOP_DEAR_SHARE 0.85
#define KN_LOOP_CHEAP 1000
#define KN_LOOP_CHEAP_SHARE 0.65

// Main thread: the latest pose of a probe, NULL when its session has ended.
void kn_loop_post(kn_loop *loop, int probe, const kn_pose *pose);

// The next tick takes the order. Returns its number. Any thread; QUALITY from one only.
int64_t kn_loop_order(kn_loop *loop, kn_order order, kn_quality quality);
// Whether a tick has taken it, and which. Any thread, before KN_LOOP_ORDERS others have been taken.
bool kn_loop_obeyed(const kn_loop *loop, int64_t number, int64_t *tick);
// After every thread: whether an emergency stop stands, one that no tick took any more, too.
bool kn_loop_estopped(const kn_loop *loop);

void *kn_loop_run(void *loop); // thread body
// One turn of it: the wait for the next tick and for a pose that is on its way, then the tick. False when the loop may
// end.
kn_wake kn_loop_wait(kn_loop *loop);
bool kn_loop_tick(kn_loop *loop, const kn_wake *wake);

#endif
