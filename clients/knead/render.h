#ifndef KN_CLIENTS_RENDER_H
#define KN_CLIENTS_RENDER_H
// What a device's motors are given: from its own poses and from what kneadd says to the final force. One stage for every
// client that drives a device, simulated (grasp.h) or real (clients/tactile). Pure; no allocation.
//
//     KNEAD_FORCE ----> the newest one ----.
//     KNEAD_CONTACT --> local model,  -----+--> passivity --> impulse guard --> clamp --> gain, share --> motors
//     own poses ------> replayed           '        ^                                                |
//                                                   '---------------- held until the next -----------'
//
// Either is chosen for good (def.local), not from one message to the next: the two differ by what the link is late.
//
//     stop      why                                                           from then on
//     REFLEX    the guard: a jump above 8 N in a ms, 3 above 4 N in 20 ms      the last good force fades in 17 ms, and
//               or two that point against each other                          it stays 0 until kn_render_begin
//     FAR       KNEAD_FORCE answers poses more than 5 ms old: held that       the same; round_trip_s goes on being
//               long, a force throws a hand off anything elastic              measured, so that it can be seen to end
//
// The round trip is that of the first answer to each pose, smoothed over 100 of them: one stall of 20 ms is none, and a
// link of 6 ms is found out in the 400 ms before kneadd lets a tool touch anything.
//
// Poses and forces are the device's own, in its axes and metres; contacts and the forces of kneadd's are the scene's.
#include "core/contact_model.h"
#include "core/device.h"
#include "core/passivity.h"
#include "core/safety.h"

#define KN_RENDER_FAR_S 5e-3
#define KN_RENDER_NEAR_S 4e-3 // below it a link that was far is near again
// Of a watchdog over kneadd's messages, where the local model is rendered: it knows itself how long it is good, and has
// leaked away by then.
#define KN_RENDER_LOCAL_HOLD_MS 250
#define KN_RENDER_LOCAL_ZERO_MS 300

typedef enum kn_render_stop { KN_RENDER_RUNS, KN_RENDER_REFLEX, KN_RENDER_FAR } kn_render_stop;

typedef struct kn_render_def { // zero means default where there is one
    kn_device_def device; // its numbers and how it stands; force_limit_n > 0. Without a mass no passivity controller
    double coupling_n_m, coupling_n_s_m; // of the tool in the scene, default the device's
    double radius_m;                     // of the tool, for the local model
    bool level;                          // it does not turn, a plate
    double guard_n_per_ms;               // default 4
    double velocity_hz;                  // cut-off of the velocities, default 100
    bool local;                          // KNEAD_CONTACT is rendered, else KNEAD_FORCE
    bool held;                           // KNEAD_FORCE, however old it is: against the rule, to show why it is one
} kn_render_def;

typedef struct kn_render { // read only for the caller
    kn_render_def def;
    int64_t session;
    kn_render_stop stop;
    double gain;                        // down to 0 after a stop
    double round_trip_s;                // smoothed; 0 at first
    double given_n[3];                  // what the motors are to give
    double largest_n;                   // |given_n|
    int64_t clamped;                    // news above force_limit_n
    int64_t guards, reflexes, refusals; // hits of the guard; stops of either kind
    kn_passivity passivity;
    kn_contact_model model;
    // private
    kn_guard guard;
    double heard_n[3], guarded_n[3]; // newest force; the last one past the guard
    bool news;                       // heard_n is new
    double gap_s, tick_s;            // since the last news; of a ms that is not full yet
    double allowed_n;                // by which guarded_n may change now
} kn_render;

void kn_render_init(kn_render *r, const kn_render_def *def);
void kn_render_begin(kn_render *r, int64_t session); // a new session: from zero force, no stop

// How the device turns the tool, in the scene's axes, before the pose that says so: for the local model.
void kn_render_turn(kn_render *r, const double orientation_wxyz[4]);
// A pose as it is sent, right before it is rendered.
void kn_render_pose(kn_render *r, int64_t seq, const double position_m[3], const double velocity_m_s[3]);
// KNEAD_FORCE of this session. age_s: how long ago the pose was sent that it is the first to answer; below 0: it is not
// the first. False: a number that is none, refused.
bool kn_render_force(kn_render *r, const double scene_n[3], double age_s);
// KNEAD_CONTACT of any session.
kn_contact_take kn_render_contact(kn_render *r, const kn_contact_unit *unit);

// dt_s after the last time: renews given_n for the device at that position and velocity. share: 0 .. 1, the watchdogs'.
void kn_render_give(kn_render *r, double dt_s, const double position_m[3], const double velocity_m_s[3], double share);

const char *kn_render_why(kn_render_stop stop); // for a line that tells it; NULL when it runs

#endif
