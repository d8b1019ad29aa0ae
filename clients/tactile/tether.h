#ifndef KN_CLIENTS_TETHER_H
#define KN_CLIENTS_TETHER_H
// Tether between a real device and kneadd: the session of the device's poses, a watchdog over the device's poses and
// one over kneadd's forces. The module is pure: the caller passes the time, so a test can play both the device and
// kneadd.
//
//     device --pose-->  [ watchdog of poses ] --seq--> kneadd
//            <-given--  [ output stage, render.h; watchdogs ] <--force, contact--
//
//     HELD --no force for 20 ms, no pose for 20 ms, a faded reflex, a fault that only a new session -----> SILENT
//       ^    clears, or a link that was too slow for forces and is fast enough again                         |
//       '------------------------------------------- 1.2 s --------------------------------------------------'
//
// A killed server cannot fade its force, and a device with a broken cable receives nothing. So if no pose or no force
// arrives, the force fades from 3 ms on, is zero by 20 ms and stays zero (latched). If the local model is rendered and
// kneadd is silent, the force is zero only by 300 ms, because the force of the local model decays by itself.
//
// To recover, the client follows kneadd's rule: it sends nothing until its session has ended (1.2 s), then it begins a
// new session. The new session starts from zero force, with the tool clear of the object.
#include "clients/knead/render.h"

// HELD: poses and forces flow. SILENT: no pose is sent and no force is given, until the session has ended.
typedef enum kn_tether_mode { KN_TETHER_HELD, KN_TETHER_SILENT } kn_tether_mode;

typedef struct kn_tether { // read only for the caller
    kn_tether_mode mode;
    int64_t session, seq;                  // session, and number of its last pose
    double position_m[3], velocity_m_s[3]; // newest pose of the device, in the device's frame
    kn_render render;                      // render.given_n: force that the motors must give now, in the device's frame
    int32_t flags, fault;                  // flags and fault of the newest force message
    int silent_ms;                         // SILENT: time until the silence ends
    // Length of the tick in which the mode last became SILENT, ms. A value far above 1 means that this process itself
    // did not run for that time.
    int stalled_ms;
    kn_watchdog forces, poses;
    bool fresh_force, fresh_pose; // a force, a pose has arrived since the last tick
    bool given;                   // kn_tether_give has run since the last tick
    double given_s;               // time of the last kn_tether_give, s
    int64_t answered;             // newest pose of the session that a force has answered
    int64_t tick;                 // tick of the newest force of the session; -1: no force yet
    int64_t sent, heard;          // poses sent, forces accepted, over all sessions of this device
    int64_t foreign;              // forces of another client's session: the other client holds the tool
    // Forces whose tick is not newer than that of the last accepted force: repeated or overtaken. They do not feed the
    // watchdog.
    int64_t late;
    int64_t refused; // poses and forces with a number that is not finite
    int64_t faults;  // sessions given up because of a fault of kneadd's impulse guard
} kn_tether;

// Start a tether for the given session, in mode HELD, with no force yet.
void kn_tether_init(kn_tether *tether, int64_t session, const kn_render_def *render);

// Take a new pose of the device, in the device's own frame. Return true if the caller must send the pose, with the
// number tether->seq. While the mode is SILENT, return false. If the pose is not finite, ignore it and return false; it
// then does not feed the watchdog.
bool kn_tether_pose(kn_tether *tether, const double position_m[3], const double velocity_m_s[3]);

typedef struct kn_tether_force { // fields of a contact_force_t message
    int64_t session, seq, tick;
    double force_n[3], age_s; // force in the scene's axes; time since the answered pose was sent
    int32_t flags, fault;
} kn_tether_force;

// Take a force message. Return true if the force belongs to this session and has a newer tick. Only accepted forces
// feed the watchdog.
bool kn_tether_take(kn_tether *tether, const kn_tether_force *force);

// Compute render.given_n. now_s: present time of any steady clock, s. Call this after every force; with the local
// model, call it after every pose instead.
void kn_tether_give(kn_tether *tether, double now_s);

// Advance both watchdogs and the mode by elapsed_ms. Call this every millisecond. The function also computes
// render.given_n. With the local model it leaves given_n as it is if kn_tether_give has run since the last tick, unless
// the mode has just become SILENT.
void kn_tether_tick(kn_tether *tether, double now_s, int elapsed_ms);

// Return true if the motors may be enabled, because a force may be given.
bool kn_tether_live(const kn_tether *tether);

#endif
