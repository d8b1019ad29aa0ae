#ifndef KN_CLIENTS_DEVICE_SESSION_H
#define KN_CLIENTS_DEVICE_SESSION_H
// Session between a real device and kneadd. The session numbers the device's poses. It has one watchdog over these
// poses, and a second one over kneadd's forces. The module is pure: the caller passes the time, so a test can play both
// the device and kneadd.
//
//     HELD --no force for 20 ms; no pose for 20 ms; a trip of an impulse guard, here or in kneadd; -------> SILENT
//       ^    or a link that was too slow for forces and is fast enough again                                 |
//       '------------------------------------------- 1.2 s --------------------------------------------------'
//
// A killed server cannot fade its force, and a device with a broken cable receives nothing. So if no pose or no force
// arrives, the force fades from 3 ms on, is zero by 20 ms and stays zero (latched). If the local model is rendered and
// kneadd is silent, the force is zero only by 300 ms, because the force of the local model decays by itself.
// A new session starts from zero force, with the tool clear of the object.
#include "clients/hand/haptic_render.h"
#include "proto/knead_contact_force_t.h"

// HELD: poses and forces flow. SILENT: no pose is sent and no force is given, until the session has ended.
typedef enum kn_device_session_mode { KN_SESSION_HELD, KN_SESSION_SILENT } kn_device_session_mode;

typedef struct kn_device_session { // link between one device and kneadd; read-only for the caller
    kn_device_session_mode mode;
    // session: number of the present session. seq: number of the last pose sent in this session.
    int64_t session, seq;
    double position_m[3], velocity_m_s[3]; // newest position and velocity of the device, in the device's axes
    // Output stage. render.given_n: force that the motors must give now, in the device's axes.
    kn_haptic_render render;
    int32_t flags, fault; // flags and fault of the newest force message
    int silent_ms;        // in mode SILENT, time until the silence ends
    // Length of the tick in which the mode last became SILENT, ms. If it is far above 1 ms, this process itself did not
    // run for that time.
    int stalled_ms;
    kn_watchdog forces, poses;
    bool fresh_force, fresh_pose; // true: a force, or a pose, has arrived since the last tick
    bool given;                   // true: kn_device_session_give has run since the last tick
    double given_s;               // time of the last kn_device_session_give, s
    int64_t answered;             // number of the newest pose of this session that a force has answered
    int64_t tick;                 // kneadd's tick of the newest force of this session; -1: no force yet
    // sent: number of poses sent; heard: number of forces accepted; both in all sessions of this device
    int64_t sent, heard;
    // Number of forces that belong to a session of another client. While this number grows, that client holds the tool.
    int64_t foreign;
    // Number of forces whose tick is not newer than that of the last accepted force: repeated messages, or messages
    // that a newer one has overtaken. Such a force does not reset the watchdog.
    int64_t late;
    int64_t refused; // number of poses and forces that contain a number that is not finite
    int64_t faults;  // number of sessions that ended because kneadd's impulse guard tripped
} kn_device_session;

// Start a session with the given number, in mode HELD, with no force yet.
void kn_device_session_init(kn_device_session *link, int64_t session, const kn_haptic_render_def *render);

// Take a new pose of the device, in the device's own frame. Return true if the caller must send the pose, with the
// number link->seq. While the mode is SILENT, return false. If the pose is not finite, ignore it and return false; an
// ignored pose does not reset the watchdog.
bool kn_device_session_pose(kn_device_session *link, const double position_m[3], const double velocity_m_s[3]);

// Take a force message. age_s: time since the pose that this force answers was sent. Return true if the force belongs
// to this session and has a newer tick. Only accepted forces reset the watchdog over kneadd's forces.
bool kn_device_session_take(kn_device_session *link, const knead_contact_force_t *force, double age_s);

// Compute render.given_n. now_s: present time of any steady clock, s. Call this function after every force; with the
// local model, call it after every pose instead.
void kn_device_session_give(kn_device_session *link, double now_s);

// Advance both watchdogs and the mode by elapsed_ms. Call this function every ms. It also computes render.given_n; with
// the local model only if kn_device_session_give has not done so since the last tick, or if the session ends.
void kn_device_session_tick(kn_device_session *link, double now_s, int elapsed_ms);

// Return true if the session allows a force. Only then may the caller enable the motors.
bool kn_device_session_live(const kn_device_session *link);

#endif
