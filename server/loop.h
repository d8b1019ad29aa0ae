#ifndef KN_SERVER_LOOP_H
#define KN_SERVER_LOOP_H
// The servo thread: kn_servo_tick on a real clock, with incoming poses and outgoing forces.
//
//     main thread --- kn_loop_post ---> mailbox per probe --+
//     one operator -- kn_orders_give -> orders -------------+
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
#include "server/mailbox.h"
#include "server/ring.h"
#include "server/operator_orders.h"
#include "server/skin.h"
#include "server/tick_timing.h"

#define KN_LOOP_STOP_TICKS 100 // largest number of ticks from a stop to the end of the loop; forces fade within 20

typedef struct kn_tick_record { // result and times of one tick, for the publisher
    kn_wake wake;
    int64_t utime;                    // us since 1970, when the forces were ready
    int64_t execution_ns;             // time from the start of the tick until the forces were ready, ns
    int64_t guarded_ns;               // time at which the servo had computed the tick's result (CLOCK_MONOTONIC, ns)
    int64_t posted_ns[KN_PROBES_MAX]; // for each probe: arrival time of the pose that the tick used
    // Result of the tick; must be the last member, because its contacts at the end are queued only if out.local is
    // true.
    kn_tick_out out;
} kn_tick_record;

#define KN_LOOP_UNTOLD_TICKS 16 // most ticks whose records, without a force or an event, wait for the main thread
#define KN_LOOP_TOUCH_TICKS 4   // number of ticks from one touch patch to the next: 250 Hz

typedef struct kn_touch_patch { // touch patch of one probe with a session
    int64_t utime, session, pose_seq;
    int probe;
    kn_touch touch;
} kn_touch_patch;

typedef struct kn_posted_pose { // content of a pose mailbox
    kn_pose pose;
    int64_t posted_ns; // arrival time of this pose
    int64_t before_ns; // arrival time of the probe's previous pose
} kn_posted_pose;

typedef struct kn_loop {
    kn_servo servo;
    kn_clock clock;
    kn_phase phase;
    bool free;                // true: the tick grid does not follow the poses (tick_timing.h); set before the start
    _Atomic int64_t start_ns; // time of tick 0 on the servo's grid, for threads that follow the grid (sentinel), ns
    kn_account account;
    kn_ring records; // queue of kn_tick_record; read by the main thread
    kn_ring touches; // queue of kn_touch_patch; read by the main thread; capacity 0: touch patches are not computed
    kn_skin *skin;
    kn_audit *audit;
    struct kn_keeper *keeper; // keeper of snapshots and undo points; NULL: none
    kn_mailbox pose[KN_PROBES_MAX];
    kn_posted_pose pose_slots[KN_PROBES_MAX][3];
    int64_t posted_ns[KN_PROBES_MAX]; // arrival time of the latest pose of each probe; used by the main thread only
    // Called to wake the main thread; must be real-time safe. Called at once for a force, an event, a touch patch, the
    // last tick, or while `paused`; otherwise every KN_LOOP_UNTOLD_TICKS ticks.
    void (*notify)(void *arg);
    void *notify_arg;
    int untold;                         // number of ticks since the main thread was woken
    atomic_bool paused;                 // true: the main thread reads no datagrams until it is woken
    atomic_bool stop;                   // true: forces ramp to zero, then the thread ends; set by any thread
    kn_orders orders;                   // an operator's orders for the next tick
    _Atomic(kn_scene_change *) changed; // latest change of the scene that a tick has applied; NULL: none
    atomic_bool done;                   // true when the loop has ended and its last record is in `records`
    int64_t execution_ns;               // duration of the last tick, ns
    // Number of units of work (core/solve/step_effort.h) that a step may take from the first tick on; 0: no deadline;
    // set before the start.
    int64_t deadline;
    // Deadline measured for the present model, at the start or when a change was built, units of work.
    int64_t measured_deadline;
    // Numbers of long steps in a row (see KN_LOOP_SLOW_STEPS). `slow_steps`: steps whose tick took more than
    // KN_LOOP_SLOW_SHARE of the time budget; `fast_steps`: steps whose tick took less than KN_LOOP_FAST_SHARE.
    int slow_steps, fast_steps;
    double slow_share;    // smallest fraction of the time budget that one of the `slow_steps` ticks took
    kn_busy busy;         // times at which the servo thread was busy in its latest ticks; the sentinel reads them
    int64_t running_tick; // last tick before the stop was requested
} kn_loop;

// Initialise the loop. Borrows all arguments; `skin` and `audit` may be NULL. Return false when memory is short.
bool kn_loop_init(kn_loop *loop, const kn_scene *scene, const kn_model *model, kn_backend *backend, kn_skin *skin,
                  kn_audit *audit);
void kn_loop_free(kn_loop *loop);

// Make the loop compute touch patches from the contacts and queue them in loop->touches. Call this function before the
// loop starts. Return false when memory is short.
bool kn_loop_touch(kn_loop *loop);

// Set the time of tick 0 to start_ns (CLOCK_MONOTONIC, ns). Call this function before kn_loop_run, and before any
// thread reads loop->start_ns.
void kn_loop_start(kn_loop *loop, int64_t start_ns);

// The deadline, in units of work, follows the speed of the processor. The processor may become slower after the
// deadline was measured, and the same units then take longer. Only long steps are judged, that is, steps that took at
// least half of the deadline's units. The deadline is reduced, at most to half, after KN_LOOP_SLOW_STEPS long steps in
// a row whose ticks took more than KN_LOOP_SLOW_SHARE of the time budget. The deadline is raised by an eighth, up to
// its measured value (loop->measured_deadline), after KN_LOOP_FAST_STEPS long steps in a row whose ticks took less than
// KN_LOOP_FAST_SHARE. A step that uses the measured deadline takes KN_STEP_SHARE of the budget. A step with an eighth
// fewer units takes less than KN_LOOP_FAST_SHARE, so a reduced deadline can rise to its measured value again. Each
// change is an event in the log, so that a replay gives the same bits.
#define KN_LOOP_SLOW_STEPS 3
#define KN_LOOP_SLOW_SHARE 0.85
#define KN_LOOP_FAST_STEPS 1000
#define KN_LOOP_FAST_SHARE 0.65

// Post the latest pose of a probe, or NULL when the probe's session has ended. Called by the main thread.
void kn_loop_post(kn_loop *loop, int probe, const kn_pose *pose);

// Return whether an emergency stop is in force or ordered. Call this function after all threads have ended.
bool kn_loop_estopped(const kn_loop *loop);

// Body of the servo thread: wait and tick until the loop ends.
void *kn_loop_run(void *loop);
// One turn of the servo thread. kn_loop_wait waits until the next tick is due, and then briefly for a late pose
// (tick_timing.h). kn_loop_tick runs the tick, and returns false when the loop may end.
kn_wake kn_loop_wait(kn_loop *loop);
bool kn_loop_tick(kn_loop *loop, const kn_wake *wake);

#endif
