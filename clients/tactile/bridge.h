#ifndef KN_CLIENTS_BRIDGE_H
#define KN_CLIENTS_BRIDGE_H
// Between a real device and kneadd: a real-time thread that sleeps until either end has news and hands it on at once.
// Nothing waits for a tick of its own: a pose goes out when the device has it, its force when kneadd has it; that of the
// local model at once.
//
//                 moved()                 KNEAD_POSE_<probe>
//     device  -------------->  bridge  ---------------------->  kneadd
//             <--------------          <----------------------
//                 give()      tether     KNEAD_FORCE_<probe>, KNEAD_CONTACT_<probe>
//                                |
//                                +-- 1 ms timer: watchdogs, a device that is to be opened again, the faded force
//
// The thread neither prints nor waits: what it has to tell lies in news, for another thread to look at.
#include "clients/knead/join.h"
#include "clients/tactile/tether.h"
#include "proto/knead_contact_force_t.h"
#include "proto/knead_probe_pose_t.h"
#include "server/mailbox.h"
#include <ev.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>

typedef struct kn_bridge kn_bridge;

typedef struct kn_tactile_pose { // in the device's own frame and metres
    double position_m[3], velocity_m_s[3], orientation_wxyz[4];
    int32_t buttons;
} kn_tactile_pose;

// A device's own watchdog, which takes its force away when this program stands still.
typedef enum kn_own_watchdog {
    KN_OWN_TRUSTED,  // seen to act, not asked for (--no-watchdog), or not needed: no motors
    KN_OWN_UNPROVED, // the device has been opened, and gives no force before it has shown its watchdog
    KN_OWN_MISSING   // it did not act
} kn_own_watchdog;

// One kind of device. Its own struct begins with this one. All calls come from the bridge's thread.
typedef struct kn_tactile {
    const char *name; // "paddle"
    // Reaches for the device, watchers go to bridge->ev. False and one line in error. A device that answers later says
    // kn_bridge_lost when it does not.
    bool (*open)(struct kn_tactile *device, kn_bridge *bridge, char *error, size_t error_size);
    void (*close)(struct kn_tactile *device);   // after a loss, too; not before open
    void (*destroy)(struct kn_tactile *device); // once, at the end, while bridge->ev still is; NULL: nothing to do
    void (*tick)(struct kn_tactile *device, int elapsed_ms); // every ms while open; NULL: not needed
    // What the motors are to give, N in the device's frame; not live: enable off. After every force (of the local model
    // after every pose), and every ms without one. NULL: a device without motors.
    void (*give)(struct kn_tactile *device, const double force_n[3], bool live);
    bool answers; // says where it is only when it is given something: at a pose it is not, or the two would chase
    kn_own_watchdog watchdog; // the driver's, from each opening on
    // what the driver counts
    int64_t messages;  // that said where the device is
    int64_t bad, lost; // refused as malformed; told by numbers, never came
    char why[96];      // of the last bad one
    char state[96];    // what the device says of itself; "": nothing worth telling
} kn_tactile;

typedef struct kn_bridge_news {
    kn_tether tether;
    bool there; // the device has said where it is since it was opened last
    int64_t arrivals, losses;
    char why[160];                     // of the last loss
    int64_t messages, bad, lost, late; // of the device; late: ms in which this thread did not run
    char bad_why[96], state[96];
    kn_own_watchdog watchdog;
    double position_m[3]; // the tool's, in the scene
    int32_t buttons;
} kn_bridge_news;

struct kn_bridge {
    struct ev_loop *ev;
    bool lost; // kn_bridge_lost was called: the device will be closed within the ms
    // private
    kn_tactile *device;
    const char *url;
    char pose_channel[64], force_channel[64], contact_channel[64], *error;
    size_t error_size;
    kn_device_def mount;
    kn_bridge_news now, slots[3];
    kn_mailbox news;
    kn_join *bus;
    knead_probe_pose_t last; // that was sent; session 0: none
    ev_io forces, timer;
    ev_async stop;
    int timer_fd, retry_ms;
    bool open;     // and maybe not there yet
    bool heard;    // a force of ours has come, and was not handed on yet
    bool answered; // the device has been given a force since the last tick
    int priority_error;
    sem_t ready;
    atomic_bool up;
    pthread_t thread;
};

typedef struct kn_bridge_def {
    const char *url; // as kn_join_open takes it
    const char *probe;
    kn_render_def render; // the device, how it stands, what is rendered
    int64_t session;      // random, not 0
} kn_bridge_def;

// Joins the bus, opens the device, starts. False and one line in error. bridge: zeroed, and stays where it is.
bool kn_bridge_start(kn_bridge *bridge, const kn_bridge_def *def, kn_tactile *device, char *error, size_t error_size);
const kn_bridge_news *kn_bridge_latest(kn_bridge *bridge); // valid until the next call
int kn_bridge_priority_error(const kn_bridge *bridge);     // 0, or why there is no SCHED_FIFO (errno)
void kn_bridge_stop(kn_bridge *bridge);                    // zero force, closes the device

// The same without a thread and a timer of its own: the caller calls tick every ms, elapsed_ms after the last one, and
// hear as soon as bridge->bus has messages. A driver that watches bridge->ev cannot be opened so.
bool kn_bridge_open(kn_bridge *bridge, const kn_bridge_def *def, kn_tactile *device, char *error, size_t error_size);
void kn_bridge_hear(kn_bridge *bridge);
void kn_bridge_tick(kn_bridge *bridge, int elapsed_ms);
void kn_bridge_close(kn_bridge *bridge);

// For drivers, from within their callbacks.
void kn_bridge_moved(kn_bridge *bridge, const kn_tactile_pose *pose);
// It is gone: it will be closed within the ms and tried again every 500 ms.
__attribute__((format(printf, 2, 3))) void kn_bridge_lost(kn_bridge *bridge, const char *format, ...);
__attribute__((format(printf, 2, 3))) void kn_tactile_bad(kn_tactile *device, const char *format, ...);

#endif
