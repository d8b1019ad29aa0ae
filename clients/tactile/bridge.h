#ifndef KN_CLIENTS_BRIDGE_H
#define KN_CLIENTS_BRIDGE_H
// Bridge between a real device and kneadd. Its real-time thread sleeps until a pose or a force arrives, and passes the
// message on at once, without waiting for a timer tick. With the local model, the force goes to the device right after
// each pose. A timer of 1 ms runs the watchdogs, fades the force and opens a lost device again. README.md draws it.
//
// The session (device_session.h) is the part of the bridge that holds the watchdogs and the output stage. The thread
// does not print, and blocks only in the calls of a maker's library (vendor.h). It posts its counters and messages as
// kn_bridge_news for other threads.
#include "clients/hand/bus_client.h"
#include "clients/tactile/device_session.h"
#include "proto/knead_probe_pose_t.h"
#include "server/mailbox.h"
#include <ev.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>

// ---- mounting of a device in the scene: pure functions that core/device.h does not have

// Set a device to default values: axes as in the scene (x to the right, y forward, z up), scales 1, origin at 0.
void kn_mount_init(kn_device_def *device);

// Read a basis such as "XYZ" or "+Y-XZ". The n-th letter names the axis of the device that points along the n-th axis
// of the scene. If the text is malformed, write the reason to `error` and return false.
bool kn_mount_basis(kn_device_def *device, const char *text, char *error, size_t error_size);

// Turn an orientation into the scene's axes: q_scene = A q_device A^-1 with A = kn_device_axes. An unrotated tool stays
// unrotated.
void kn_mount_orientation(const kn_device_def *device, const double device_wxyz[4], double scene_wxyz[4]);

// ---- drivers and bridge

typedef struct kn_bridge kn_bridge;

typedef struct kn_tactile_pose { // pose, velocity and buttons of the tool, in the device's own coordinates
    double position_m[3], velocity_m_s[3], orientation_wxyz[4];
    int32_t buttons;
} kn_tactile_pose;

// State of the watchdog inside a device. This watchdog must switch the force off when this program stops running.
typedef enum kn_own_watchdog {
    // The device may get force for one of three reasons: its watchdog has acted in a test, the user gave --no-watchdog,
    // or the device has no motors.
    KN_OWN_TRUSTED,
    KN_OWN_UNPROVED, // the device is open, but gets no force until its watchdog has acted in a test
    KN_OWN_MISSING   // the test has failed, so the device gets no force
} kn_own_watchdog;

// Interface of a driver. A driver's own struct begins with this struct. The bridge calls all functions from its own
// thread.
typedef struct kn_tactile {
    const char *name; // name of the driver, such as "paddle"
    // Open the device and attach its watchers to bridge->ev. On failure return false and one line in `error`. A driver
    // may return true before its device has answered. If no answer comes, the driver then calls kn_bridge_lost.
    bool (*open)(struct kn_tactile *device, kn_bridge *bridge, char *error, size_t error_size);
    // Close the device. Called at the end and after kn_bridge_lost, but never before open.
    void (*close)(struct kn_tactile *device);
    // Free the driver's resources. Called once at the end, while bridge->ev still exists. NULL: nothing is to be freed.
    void (*destroy)(struct kn_tactile *device);
    // Do the driver's periodic work. Called every ms while the device is open. NULL: the driver has no periodic work.
    void (*tick)(struct kn_tactile *device, int elapsed_ms);
    // Set the force of the motors in the device's frame, N. live false: disable the motors. The bridge calls this
    // function after every force from kneadd; with the local model, after every pose instead. In a ms without such a
    // call, the bridge calls the function at its 1 ms tick. NULL: the device has no motors.
    void (*give)(struct kn_tactile *device, const double force_n[3], bool live);
    // True: the device sends a pose only as an answer to a force. The bridge then never answers a pose with a force at
    // once. Otherwise each pose would cause a force and each force a pose, without a pause.
    bool answers;
    // The driver sets TRUSTED or UNPROVED at each opening. If it sets UNPROVED, the bridge tests the watchdog.
    kn_own_watchdog watchdog;
    bool unwatched;   // --no-watchdog was given: the driver sets TRUSTED
    bool motors;      // the newest message of the device says that its motors are on
    int64_t messages; // number of messages of the device that contain a pose
    // bad: number of malformed messages; lost: number of missing messages, from gaps in the sequence numbers.
    int64_t bad, lost;
    char why[96];   // what was wrong with the last malformed message
    char state[96]; // state of the device in words, for the user; "": nothing to report
} kn_tactile;

// State of the bridge for other threads, posted every ms.
typedef struct kn_bridge_news {
    kn_device_session session;
    bool there; // true: the device has given a pose since it was last opened
    // arrivals: number of openings after which the device has given a pose. losses: number of times that the device was
    // lost after its first pose.
    int64_t arrivals, losses;
    char why[160];         // reason why the device was last lost
    int64_t late;          // number of periods of 1 ms that the timer has missed
    kn_tactile device;     // copy of the driver's counters and states
    const char *untrusted; // reason of KN_OWN_MISSING
    double position_m[3];  // position of the tool, in the scene's coordinates
} kn_bridge_news;

struct kn_bridge {
    struct ev_loop *ev;
    bool lost;          // kn_bridge_lost was called: the device will be closed within 1 ms
    int priority_error; // errno with which the system refused the real-time priority; 0: it did not
    // The fields below are used by bridge.c only.
    kn_tactile *device;
    const char *url;
    char pose_channel[64], force_channel[64], contact_channel[64], *error;
    size_t error_size;
    kn_device_def mount;
    kn_bridge_news now, slots[3];
    kn_mailbox news;
    kn_bus_client *bus;
    knead_probe_pose_t last; // last pose sent to kneadd; session 0: no pose was sent yet
    ev_io forces, timer;
    ev_async stop;
    int timer_fd, retry_ms;
    // Test of the device's own watchdog: time since the test began, tests so far, and the number of messages of the
    // device before the report that decides.
    int proof_ms, tests;
    int64_t proof_messages;
    bool open;     // the device is open, although it may not have given a pose yet
    bool heard;    // true: a force of this session has arrived, but the device has not got it yet
    bool answered; // true: the driver's function `give` was called since the last tick
    sem_t ready;
    atomic_bool up;
    pthread_t thread;
};

// Settings of the link between one device and kneadd.
typedef struct kn_bridge_def {
    const char *url; // URL of the bus, see kn_bus_client_open
    const char *probe;
    // the device, its mounting, and the source of the force: KNEAD_FORCE or the local model
    kn_haptic_render_def render;
    int64_t session; // number of the first session, random, not 0
} kn_bridge_def;

// Join the bus, open the device and start the thread. On failure return false and one line in `error`. *bridge must be
// zeroed, and must not move in memory afterwards.
bool kn_bridge_start(kn_bridge *bridge, const kn_bridge_def *def, kn_tactile *device, char *error, size_t error_size);
// Return the newest state of the bridge. It is valid until the next call of this function.
const kn_bridge_news *kn_bridge_latest(kn_bridge *bridge);
// Set the motors to zero force, close the device and end the thread.
void kn_bridge_stop(kn_bridge *bridge);

// The four functions below run a bridge in the caller's thread, without a timer. The caller calls kn_bridge_tick every
// ms, and kn_bridge_hear as soon as bridge->bus has messages. elapsed_ms: time since the last tick. Here bridge->ev is
// NULL, so kn_bridge_open cannot be used for a driver that needs bridge->ev.
bool kn_bridge_open(kn_bridge *bridge, const kn_bridge_def *def, kn_tactile *device, char *error, size_t error_size);
void kn_bridge_hear(kn_bridge *bridge);
void kn_bridge_tick(kn_bridge *bridge, int elapsed_ms);
void kn_bridge_close(kn_bridge *bridge);

// Functions for drivers, to be called from within their callbacks.

// Report a pose of the device.
void kn_bridge_moved(kn_bridge *bridge, const kn_tactile_pose *pose);
// Report that the device is gone. The bridge closes the device within 1 ms and tries every 500 ms to open it again.
__attribute__((format(printf, 2, 3))) void kn_bridge_lost(kn_bridge *bridge, const char *format, ...);
// Count a malformed message of the device. The text says what was wrong with the message.
__attribute__((format(printf, 2, 3))) void kn_tactile_bad(kn_tactile *device, const char *format, ...);

#endif
