#ifndef KN_CLIENTS_HAPTIC_RENDER_H
#define KN_CLIENTS_HAPTIC_RENDER_H
// Output stage of a client that drives a device, simulated (closed_loop_hand.h) or real (clients/tactile). It computes
// the final force of the motors from the device's own poses and kneadd's messages. Pure functions without allocation.
//
//     KNEAD_FORCE ----> the newest one ----.
//     KNEAD_CONTACT --> local model,  -----+--> passivity --> impulse guard --> clamp --> gain, share --> motors
//     own poses ------> replayed           '        ^                                                |
//                                                   '---------------- held until the next -----------'
//
// Either KNEAD_FORCE or the local model is the input. The field def.local chooses the input once. The input never
// changes later, because the forces of the two inputs differ by the delay of the link and the force would jump.
//
//     stop      reason                                                      effect
//     REFLEX    impulse guard: one jump above 8 N in a ms, or three above   the last good force fades in 17 ms and
//               4 N in 20 ms, or two in opposite directions                 stays 0 until kn_haptic_render_begin
//     FAR       KNEAD_FORCE answers poses more than 5 ms old. Forces that   as REFLEX; round_trip_s is still measured,
//               old make a hand bounce off anything elastic                 so that the end of the delay is visible
//
// The round trip is measured from the first answer to each pose and smoothed over 100 answers. A single stall of 20 ms
// does not stop the rendering. A link with a round trip of 6 ms is detected within 400 ms. Before these 400 ms have
// passed, kneadd does not let a new tool touch anything.
//
// Poses and given forces are in the device's axes and in metres and newtons. Contacts and kneadd's forces are in the
// scene's axes.
#include "core/contact_model.h"
#include "core/device.h"
#include "core/passivity.h"
#include "core/safety.h"

#define KN_HAPTIC_RENDER_FAR_S 5e-3 // longest smoothed round trip [s] at which kneadd's forces are given to the motors
// If the smoothed round trip [s] falls below this value, a link that was stopped because of a long round trip (FAR)
// counts as fast again.
#define KN_HAPTIC_RENDER_NEAR_S 4e-3
// Times of the watchdog with the local model, ms since kneadd's last message. The force is kept until HOLD, then it
// fades, and from ZERO on it is zero. The watchdog may wait this long, because the force of the local model decays by
// itself when messages are missing.
#define KN_HAPTIC_RENDER_LOCAL_HOLD_MS 250
#define KN_HAPTIC_RENDER_LOCAL_ZERO_MS 300

typedef enum kn_haptic_render_stop {
    KN_HAPTIC_RENDER_RUNS,
    KN_HAPTIC_RENDER_REFLEX,
    KN_HAPTIC_RENDER_FAR
} kn_haptic_render_stop;

typedef struct kn_haptic_render_def { // a field of 0 selects its default, if it has one
    // Properties and mounting of the device. force_limit_n must be > 0. If mass_kg is 0, no passivity controller runs.
    kn_device_def device;
    // Virtual coupling (stiffness, damping) of the tool in the scene; default: that of the device.
    double coupling_n_m, coupling_n_s_m;
    double radius_m;       // radius of the tool, used by the local model
    bool level;            // true: the tool never rotates, as a plate
    double guard_n_per_ms; // largest change of the force per ms that the impulse guard passes; default 4
    double velocity_hz;    // cut-off frequency of the velocity filter of the passivity controller, default 100
    bool local;            // true: compute the force from KNEAD_CONTACT; false: from KNEAD_FORCE
    // True: use KNEAD_FORCE even if the round trip is too long (no stop FAR). This is unsafe and for demonstrations
    // only.
    bool held;
} kn_haptic_render_def;

typedef struct kn_haptic_render { // state of the output stage; read-only for the caller
    kn_haptic_render_def def;
    int64_t session;
    kn_haptic_render_stop stop;
    double gain; // factor on the force: 1 in operation; falls to 0 after a stop
    // Smoothed time from a pose to the first force that answers it; 0 before the first answer.
    double round_trip_s;
    double given_n[3]; // force that the motors must give now, in the device's axes
    double largest_n;  // largest magnitude of given_n so far
    // Number of new forces above force_limit_n; the local model makes one new force per ms.
    int64_t clamped;
    // guards: number of forces that the impulse guard limited. reflexes, refusals: numbers of stops with the reasons
    // REFLEX and FAR.
    int64_t guards, reflexes, refusals;
    kn_passivity passivity;
    kn_contact_model model;
    // The fields below are used by haptic_render.c only.
    kn_guard guard;
    // heard_n: newest force received; guarded_n: last force that passed the impulse guard.
    double heard_n[3], guarded_n[3];
    bool news; // true: heard_n has not been used for the motors yet
    // gap_s: time since the last new force. tick_s: elapsed time below 1 ms that the impulse guard has not counted yet.
    double gap_s, tick_s;
    double allowed_n; // largest change of guarded_n that is allowed at present
} kn_haptic_render;

// Initialise the output stage `r`, without a session.
void kn_haptic_render_init(kn_haptic_render *r, const kn_haptic_render_def *def);
// Begin a new session. The force starts at zero, and the rendering runs again if it was stopped.
void kn_haptic_render_begin(kn_haptic_render *r, int64_t session);

// Set the orientation of the device, in the scene's axes. Call this before kn_haptic_render_pose of the same pose. Only
// the local model uses the orientation.
void kn_haptic_render_turn(kn_haptic_render *r, const double orientation_wxyz[4]);
// Record a pose that is being sent to kneadd as number `seq`. Call this right before kn_haptic_render_give for the same
// pose.
void kn_haptic_render_pose(kn_haptic_render *r, int64_t seq, const double position_m[3], const double velocity_m_s[3]);
// Take a KNEAD_FORCE of this session. age_s: if the force is the first answer to its pose, time since that pose was
// sent; otherwise any value below 0. If the force is not finite, ignore it and return false.
bool kn_haptic_render_force(kn_haptic_render *r, const double scene_n[3], double age_s);
// Take a KNEAD_CONTACT message of any session. The result says whether the local model uses the message and, if not,
// why.
kn_contact_take kn_haptic_render_contact(kn_haptic_render *r, const kn_contact_unit *unit);

// Compute r->given_n, the force for the motors, at this position and velocity of the device. dt_s: time since the last
// call. share: factor by which the watchdogs reduce the force, 0 .. 1.
void kn_haptic_render_give(kn_haptic_render *r, double dt_s, const double position_m[3], const double velocity_m_s[3],
                           double share);

// Return a text that explains why the rendering stopped, or NULL for KN_HAPTIC_RENDER_RUNS.
const char *kn_haptic_render_why(kn_haptic_render_stop stop);

#endif
