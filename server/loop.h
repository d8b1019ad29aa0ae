#ifndef KN_SERVER_LOOP_H
#define KN_SERVER_LOOP_H
// The servo thread: kn_servo_tick on a real clock, with incoming poses and outgoing forces.
//
//     main thread --- kn_loop_post ---> mailbox per probe --+
//     one operator -- kn_loop_order --> flags --------------+
//     anyone -------- stop -----------> flag ---------------+
//                                                           v
//                                   wait . read . step . guard . publish . account
//                                                           |
//     main thread <-- records (every tick, in order) -------+-------> skin (latest surface) --> mesh thread
//                                                           |
//                                  in the rest of the tick: local contact models, audit, a copy of the lattice
//                                  for the keeper
//
// Between start and stop the thread allocates nothing and takes no lock. It calls the kernel only to sleep and to
// notify.
#include "core/touch.h"
#include "server/account.h"
#include "server/change.h"
#include "server/mailbox.h"
#include "server/phase.h"
#include "server/ring.h"
#include "server/servo.h"
#include "server/skin.h"
#include "server/snapshot.h"

#define KN_LOOP_ORDERS 64      // number of latest orders for which kn_loop_obeyed can return the tick
#define KN_LOOP_STOP_TICKS 100 // a stop ends the loop after this many ticks at the latest; forces fade within 20

typedef struct kn_record { // result and times of one tick, for the publisher
    kn_wake wake;
    int64_t utime;                    // us since 1970, when the forces were ready
    int64_t execution_ns;             // time from the start of the tick until the forces were ready, ns
    int64_t guarded_ns;               // time at which the servo had computed the tick's result (CLOCK_MONOTONIC, ns)
    int64_t posted_ns[KN_PROBES_MAX]; // time at which the pose that the tick used arrived, for each probe
    // Result of the tick; must be the last member, because its contacts at the end are queued only if out.local is
    // true.
    kn_tick_out out;
} kn_record;

#define KN_LOOP_TOUCH_TICKS 4 // number of ticks from one touch patch to the next: 250 Hz

typedef struct kn_touched { // touch patch of one probe with a session
    int64_t utime, session, pose_seq;
    int probe;
    kn_touch touch;
} kn_touched;

typedef struct kn_posted { // content of a pose mailbox
    kn_pose pose;
    int64_t posted_ns, before_ns; // arrival time of this pose, and of the pose before this one
} kn_posted;

typedef enum kn_order { // an operator's order to the next tick; several orders of one kind before a tick count as one
    KN_ORDER_RESET,     // restore the object to its initial state
    // Change to another quality of the scene (kn_point.live); if there are several such orders, the last one counts.
    KN_ORDER_QUALITY,
    // Clear latched faults, and an ESTOP order that no tick has taken yet; each tool must be lifted to engage again.
    KN_ORDER_RECOVER,
    KN_ORDER_ESTOP,   // emergency stop: forces fade and stay 0 until KN_ORDER_RECOVER
    KN_ORDER_RESTORE, // replace the object by loop->restore
    KN_ORDER_UNDO,    // return the object to its state before it was last kneaded, reset or restored
    KN_ORDER_CHANGE   // continue the object in the model of loop->change
} kn_order;

typedef struct kn_loop {
    kn_servo servo;
    kn_clock clock;
    kn_phase phase;
    bool free;                // true: the tick grid does not follow the poses (phase.h); set before the start
    _Atomic int64_t start_ns; // time of tick 0 on the clock's grid, for threads that follow the grid, ns
    kn_account account;
    kn_ring records; // queue of kn_record; read by the main thread
    kn_ring touches; // queue of kn_touched; read by the main thread; capacity 0: touch patches are not computed
    kn_skin *skin;
    kn_audit *audit;
    struct kn_keeper *keeper; // keeper of snapshots and undo points; NULL: none
    kn_mailbox pose[KN_PROBES_MAX];
    kn_posted pose_slots[KN_PROBES_MAX][3];
    int64_t posted_ns[KN_PROBES_MAX]; // arrival time of the latest pose of each probe; used by the main thread only
    void (*notify)(void *arg);        // called after each tick to wake the main thread; must be real-time safe
    void *notify_arg;
    atomic_bool stop; // set by any thread: forces ramp to zero, then the thread ends
    // Upper bits: number of orders given, << 8; lower 8 bits: bit (1 << kn_order) for each order that waits for the
    // next tick.
    _Atomic int64_t orders;
    atomic_int quality;      // quality that the latest KN_ORDER_QUALITY requests
    const kn_saved *restore; // argument of KN_ORDER_RESTORE; must stay valid until a tick has taken the order
    // Argument of KN_ORDER_CHANGE. The change must stay valid until a tick has taken a later change and no thread uses
    // the earlier change any more.
    struct kn_change *change;
    _Atomic(struct kn_change *) changed; // latest change of the scene that a tick has applied; NULL: none
    // State hash of the object after the latest restore or undo; 0: there was nothing to undo.
    _Atomic uint64_t restored;
    _Atomic int64_t obeyed;                      // number of orders that ticks have taken
    _Atomic int64_t obeyed_tick[KN_LOOP_ORDERS]; // tick that took order number n, stored at index n % KN_LOOP_ORDERS
    atomic_bool done;                            // true when the loop has ended and its last record is in `records`
    int64_t execution_ns;                        // duration of the last tick, ns
    // Number of units of work (core/step_effort.h) that a step may take from the first tick on; 0: no
    // deadline; set before the start.
    int64_t deadline;
    // Deadline measured for the present model, at the start or when a change was built, units of work.
    int64_t priced;
    // Numbers of consecutive long steps; `dear`: with ticks above KN_LOOP_DEAR_SHARE of the budget; `cheap`: with ticks
    // below KN_LOOP_CHEAP_SHARE of the budget.
    int dear, cheap;
    double dear_share;    // smallest fraction of the time budget that one of the `dear` ticks took
    kn_busy busy;         // times at which the servo thread was busy in its latest ticks; the sentinel reads them
    int64_t running_tick; // last tick before the stop was requested
} kn_loop;

// Initialise the loop. Borrows all arguments; `skin` and `audit` may be NULL. Return false when memory is short.
bool kn_loop_init(kn_loop *loop, const kn_scene *scene, const kn_model *model, kn_backend *backend, kn_skin *skin,
                  kn_audit *audit);
void kn_loop_free(kn_loop *loop);

// Make the loop compute touch patches from the contacts and queue them in loop->touches. Call before the start. Return
// false when memory is short.
bool kn_loop_touch(kn_loop *loop);

// Put tick 0 at start_ns. Call before kn_loop_run, and before any thread reads loop->start_ns.
void kn_loop_start(kn_loop *loop, int64_t start_ns);

// The deadline, in units of work, follows the speed of the processor. The processor may become slower after the
// deadline was measured, and the same units then take longer. Only long steps are judged, that is, steps that took at
// least half of the deadline's units. After KN_LOOP_DEAR long steps in a row, whose ticks took more than
// KN_LOOP_DEAR_SHARE of the time budget, the deadline is reduced, at most to half. After KN_LOOP_CHEAP long steps in a
// row below KN_LOOP_CHEAP_SHARE the deadline is raised by an eighth, up to its measured value (loop->priced). A step
// that uses the measured deadline takes KN_SERVED_SHARE of the budget. A step that uses an eighth less takes less than
// KN_LOOP_CHEAP_SHARE, so the deadline can return to its measured value. Each change is an event in the log, so that a
// replay gives the same bits.
#define KN_LOOP_DEAR 3
#define KN_LOOP_DEAR_SHARE 0.85
#define KN_LOOP_CHEAP 1000
#define KN_LOOP_CHEAP_SHARE 0.65

// Post the latest pose of a probe, or NULL when the probe's session has ended. Called by the main thread.
void kn_loop_post(kn_loop *loop, int probe, const kn_pose *pose);

// Give an order to the next tick, and return the order's number. Any thread may call this, but KN_ORDER_QUALITY must
// always come from the same thread.
int64_t kn_loop_order(kn_loop *loop, kn_order order, kn_quality quality);
// Return whether a tick has taken the order with this number, and put that tick in *tick. Any thread may call this. The
// answer is valid until ticks have taken KN_LOOP_ORDERS later orders.
bool kn_loop_obeyed(const kn_loop *loop, int64_t number, int64_t *tick);
// Return whether an emergency stop is in force or ordered. Call after all threads have ended.
bool kn_loop_estopped(const kn_loop *loop);

// Body of the servo thread: wait and tick until the loop ends.
void *kn_loop_run(void *loop);
// One turn of the thread. kn_loop_wait waits until the next tick is due, and then briefly for a late pose (phase.h).
// kn_loop_tick runs the tick, and returns false when the loop may end.
kn_wake kn_loop_wait(kn_loop *loop);
bool kn_loop_tick(kn_loop *loop, const kn_wake *wake);

#endif
