#ifndef KN_CLIENTS_TETHER_H
#define KN_CLIENTS_TETHER_H
// What ties a real device to kneadd: the session its poses belong to, and the watch over both ends of it. Pure: time
// comes in as milliseconds, so that a test plays device and kneadd.
//
//     device --pose-->  [ watchdog of poses ] --seq--> kneadd
//            <-given--  [ output stage, render.h; watchdogs ] <--force, contact--
//
//     HELD --no force for 20 ms, no pose for 20 ms, a reflex or a fault that only a new session clears,--> SILENT
//       ^    a link that was too slow for forces and is not any more                                         |
//       '------------------------------------------- 1.2 s --------------------------------------------------'
//
// A killed server ramps nothing down and a device whose cable is out hears nothing: either end's silence fades the
// force from 3 ms on and has it at zero by 20 ms, latched; kneadd's by 300 ms where the local model is rendered, which
// leaks away by itself. The way back is kneadd's own: silence until the session has ended, then a new one, which starts
// from zero force with the tool clear of the object.
#include "clients/knead/render.h"

typedef enum kn_tether_mode { KN_TETHER_HELD, KN_TETHER_SILENT } kn_tether_mode;

typedef struct kn_tether { // read only for the caller
    kn_tether_mode mode;
    int64_t session, seq;                  // of the poses that are sent now
    double position_m[3], velocity_m_s[3]; // newest of the device
    kn_render render;                      // .given_n: what the motors are to give now, in the device's frame
    int32_t flags, fault;                  // of the newest force
    int silent_ms;                         // SILENT: until it ends
    int stalled_ms; // of the tick that tripped: much more than 1, and it was this process that did not run
    kn_watchdog forces, poses;
    bool fresh_force, fresh_pose; // since the last tick
    bool given;                   // since the last tick
    double given_s;               // when
    int64_t answered;             // newest pose of the session that a force has answered
    int64_t tick;                 // of its newest force, -1: none has come
    int64_t sent, heard;          // poses, forces of this device's sessions
    int64_t foreign;              // forces of somebody else's session: that one has the tool
    int64_t late;                 // forces of no newer tick than one before: repeated or overtaken, and no sign of life
    int64_t refused;              // numbers that are none, either way
    int64_t faults;               // sessions given up because of one
} kn_tether;

void kn_tether_init(kn_tether *tether, int64_t session, const kn_render_def *render);

// The device has said where it is, in its own frame. True: send that as the pose session, seq of the tether. Not sent:
// while SILENT, and what is not finite, which does not count as a sign of life either.
bool kn_tether_pose(kn_tether *tether, const double position_m[3], const double velocity_m_s[3]);

typedef struct kn_tether_force { // of contact_force_t
    int64_t session, seq, tick;
    double force_n[3], age_s; // in the scene; since its pose was sent
    int32_t flags, fault;
} kn_tether_force;

// A force has come. True: it is this session's, and of a newer tick. Only such a one feeds the watchdog.
bool kn_tether_take(kn_tether *tether, const kn_tether_force *force);

// Renews given_n at now_s, of any steady clock: after a force, or, of the local model, after a pose.
void kn_tether_give(kn_tether *tether, double now_s);

// Every ms, elapsed_ms of them: watchdogs, mode. Renews given_n, that of the local model unless it has been since.
void kn_tether_tick(kn_tether *tether, double now_s, int elapsed_ms);

// Whether anything may be given: the motors' enable.
bool kn_tether_live(const kn_tether *tether);

#endif
