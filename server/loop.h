#ifndef KN_SERVER_LOOP_H
#define KN_SERVER_LOOP_H
// The servo thread: kn_servo_tick on a real clock, with the poses that came in and the answers going out.
//
//     main thread --- kn_loop_post ---> mailbox per probe --+
//     anyone -------- reset, stop ----> flags --------------+
//                                                           v
//                                   wait . read . step . guard . publish . account
//                                                           |
//     main thread <-- records (every tick, in order) -------+-------> skin (latest surface) --> mesh thread
//
// Between start and stop the thread allocates nothing, takes no lock and calls the kernel only to sleep and to notify.
#include "server/account.h"
#include "server/mailbox.h"
#include "server/ring.h"
#include "server/servo.h"
#include "server/skin.h"

#define KN_LOOP_STOP_TICKS 100 // ms. Forces come down within 20; longer than this nobody waits

typedef struct kn_record { // one tick, for whoever publishes it
    kn_tick_out out;
    kn_wake wake;
    int64_t utime;        // us since 1970, when the tick had its answer
    int64_t execution_ns; // read to publish
} kn_record;

typedef struct kn_loop {
    kn_servo servo;
    kn_clock clock; // started by the caller
    kn_account account;
    kn_ring records; // of kn_record; the other end is the main thread's
    kn_skin *skin;
    kn_mailbox pose[KN_PROBES_MAX];
    kn_pose pose_slots[KN_PROBES_MAX][3];
    void (*notify)(void *arg); // called after each tick: wakes the main thread. Must be real-time safe
    void *notify_arg;
    atomic_bool stop;     // set by anyone: forces ramp to zero, then the thread ends
    atomic_bool reset;    // set by anyone, taken by the next tick: the object is as new. Several before it are one
    atomic_int quality;   // set by anyone, taken by the next tick: a live point of the scene's; -1: none asked for
    atomic_bool done;     // its last record is in the ring
    int64_t execution_ns; // of the last tick
    int64_t running_tick; // last one before stop was asked
} kn_loop;

// Borrows all; skin may be NULL. False when memory is short.
bool kn_loop_init(kn_loop *loop, const kn_scene *scene, const kn_model *model, kn_backend *backend, kn_skin *skin);
void kn_loop_free(kn_loop *loop);

// Main thread: the latest pose of a probe, NULL when its session has ended.
void kn_loop_post(kn_loop *loop, int probe, const kn_pose *pose);

void *kn_loop_run(void *loop); // thread body
// One turn of it, after the wait. False when the loop may end.
bool kn_loop_tick(kn_loop *loop, const kn_wake *wake);

#endif
