#ifndef KN_CORE_CONTACT_MODEL_H
#define KN_CORE_CONTACT_MODEL_H
// The local contact model: a client behind a slow link renders it instead of old forces. A message (KNEAD_CONTACT,
// proto/contact_model_t.lcm) describes the contact under one of the client's own poses. The client rebuilds this
// contact and replays its own poses since that pose. So the client renders the contact under its present pose. This
// file and its source need only libc and libm, C99: copy the two into any client.
//
//     own pose x --k_vc, b_vc-- proxy p | surface --(A, H, k1)--(c2)-- object        along the normal n, and across it
//
//     t: contact force; A: damping, H: force of the spring k1 (back stress), c2: damping of the force-dependent damper
//     t = A w + H       w = w_voigt + w_c2: rate at which the surface goes in          with friction mu t; t >= 0
//     t = c2 w_c2       dH/dt = k1 w_voigt; A = c1 + dt k1: the edge law of the lattice at the scale of the contact
//     Q - G v_p + sum(t_i n_i) = 0,  Q = k_vc (x - p) + b_vc v,  G = b_vc + dt k_vc    no mass; up to 8 units
//     l^2 (k_vc turn of x to p - G w_p) + sum(a_i x t_i n_i) = 0      the same for turns; a_i: arm of unit i
//
// The force on the hand is the sum of the units' forces. The torque is the sum of their torques about the tool's
// position. A unit gives way at its own place, by v_p + w_p x a_i. So a tool that rocks presses with one side and lifts
// the other. If there are several units, each has its own foundation in front of it, of the compliance
// 1/k_vc (message) - 1/k_vc (this device). The foundation of a single unit is in series with the coupling. A rigid tool
// (k_vc 0) turns as the device does.
//
// The dampers A and c2 are in series behind k_vc. So no term in the device's velocity reaches the device through them,
// however large they are. Rejected: holding or extrapolating the force. Both are unstable on elastic material from
// 10-20 ms of round trip. A message has one c2, at its own force, but the c2 of dough falls to 1/300 within 0.4 N. So
// c2 at other forces comes from earlier messages, scaled to match this message at its force.
//
//     age of a message  0 ....... valid_ms          then no message            a new message
//     the contact       rendered as it is           leaks towards the device   in time: taken at once
//                                                   (50 ms, <= 0.016 N/ms)     late: its share of force rises from
//                                                                              the felt force, like a surface that
//                                                                              moves at 20 mm/s
//
// If a pressed contact is no longer within reach in the next message, no hand can have left it so fast: the object was
// replaced, or the server restarted. The contact then fades in 17 ms.
//
// In each tick of the device, 1 to 10 kHz: read x, v; call kn_contact_model_pose if this pose is sent; call
// kn_contact_model_take for every message that has arrived; call kn_contact_model_render for the force. The model has
// no allocation, clock or lock. Use one thread. The cost is bounded: kn_contact_model_render takes one step, and a
// complete message takes at most KN_CONTACT_REPLAY steps. A device still needs its own passivity controller and impulse
// guard behind this model.
#include <stdbool.h>
#include <stdint.h>

#define KN_CONTACT_UNITS 8   // contacts of one tool
#define KN_CONTACT_LAW 40    // number of forces, 0.02 to 17 N, for which c2 is remembered
#define KN_CONTACT_REPLAY 64 // own poses that are remembered, at least 0.5 ms apart; an older message comes too late

typedef struct kn_contact_unit { // contact_model_t; SI, scene frame
    int64_t utime;               // server time; datagrams with one utime belong to one tick; older ones are ignored
    int64_t session;             // the client's own session; a message of another session is refused
    int64_t pose_seq;            // pose that the contact answers; the replay begins with the next pose
    int32_t generation;          // changes when the object is replaced (reset, another scene)
    int32_t flags;               // KN_FLAG_*; the model reads only the flags below
    int32_t contact_index;       // 0 .. contact_count-1
    int32_t contact_count;       // 0: nothing within reach
    double proxy_m[3];           // along normal: the tool's position when the tool is on the surface; across normal:
                                 // the point where the force acts when the tool is at friction_anchor_m
    double normal[3];            // unit, out of the object
    double force_n;              // F0 along normal, >= 0; 0: the unit is a plane ahead of the tool
    double proxy_velocity_m_s;   // velocity of the surface along normal
    double a_n_s_per_m;          // A, clipped to [0.1, 1e4]
    double h_n;                  // H, clipped to the force of k1 at 0.1 m
    double c2_n_s_per_m;         // clipped to [10, 1e5]
    double k1_n_per_m;           // clipped to [0, 2 k_vc]
    double k_vc_n_per_m;         // coupling that force_n came through; 0: rigid. A softer device renders less of H
    double b_vc_n_s_per_m;
    double friction;             // mu, clipped to [0, 3]
    double friction_anchor_m[3]; // across normal: the tool's position if the tool carried no force across; along
                                 // normal: chosen so that proxy_m - friction_anchor_m is the arm to the force
    double valid_ms;             // clipped to [0, 100]
} kn_contact_unit;

enum { // bits of kn_contact_unit.flags; the same numbers as in contact_force_t
    KN_CONTACT_ENGAGED = 1,
    KN_CONTACT_RAMPING = 2, // ENGAGED or RAMPING: the server has the tool in its model
    KN_CONTACT_LATCHED = 4,
    KN_CONTACT_STOPPING = 1024 // LATCHED or STOPPING: zero force within 20 ms
};

typedef struct kn_contact_model_def { // a field of 0 takes its default
    int64_t session;
    double radius_m;        // tool radius r; a message is valid within r/2 across the normal; default and maximum 10 mm
    double stiffness_n_m;   // k_vc of this device, the stiffest that is rendered; default 600, a light desktop device's
    double damping_n_s_m;   // b_vc of this device; default 1.5
    double arm_m;           // l: turns are coupled by k_vc l^2 and b_vc l^2; default 0.03, as in the server
    double force_scale;     // the hand's force / the object's, default 1; couplings are the object's, limits the hand's
    double force_limit_n;   // limit of |force|; default 3.3
    double force_rise_n;    // a message is valid until the force has risen by this; default 2
    double server_period_s; // dt in A; default 1 ms
} kn_contact_model_def;

typedef struct kn_contact_plane { // private: a unit as it is rendered
    double normal[3], level_m;    // the surface is at normal . x + lever . turn = level_m
    double arm_m[3], lever_m[3];  // from the proxy to the point where the force acts; arm x normal
    double c1, k1, c2, mu;        // c2 at the present force
    double give_m_n, t_n;         // compliance of the unit's own foundation; force along the normal
    double thick;                 // factor from the law's c2 to this unit's c2
    double h_n, shear_n[3];       // H along and across the normal
    double force_n[3];            // force on the tool
} kn_contact_plane;

typedef struct kn_contact_body { // private: proxy and planes
    int count;
    bool rigid; // the proxy turns as the device does, whatever the torque
    double k, b, arm_m, proxy_m[3], force_n[3];
    double from_wxyz[4];            // the device's orientation in the message's pose
    double turn[3];                 // rotation of the proxy since that pose, a rotation vector
    double torque_n_m[3];           // about the proxy
    double law_m_s[KN_CONTACT_LAW]; // flow of c2, at forces a quarter of an octave apart
    kn_contact_plane plane[KN_CONTACT_UNITS];
} kn_contact_body;

typedef struct kn_contact_pose {
    int64_t seq;
    double at_s, position_m[3], velocity_m_s[3], orientation_wxyz[4];
} kn_contact_pose;

typedef struct kn_contact_model { // plain data, read-only for the caller; a copy is a snapshot
    kn_contact_model_def def;
    kn_contact_body body;
    kn_contact_pose pose[KN_CONTACT_REPLAY]; // newest at (poses - 1) % KN_CONTACT_REPLAY
    int64_t poses;
    double now_s, posed_s;                  // sum of the render steps; time of the last pose, stored or not
    kn_contact_unit unit[KN_CONTACT_UNITS]; // datagrams of the tick that is arriving
    double c2[KN_CONTACT_LAW];              // c2 received at the forces of the law; 0: none yet
    unsigned have;                          // bit i: unit[i] has arrived
    int first;                              // index of the unit that arrived first
    int64_t utime, taken_seq;               // newest datagram; pose of the message in use, -1: none
    int32_t generation, flags;
    double valid_s, taken_s, taken_m[3], taken_n; // message in use: validity, time and place of its pose, |F0|
    double stale_s;                               // time since the message became stale
    bool returning;                               // the force rises again after an outage
    double lost;                // faded share of the felt force, 0 .. 1, once the server has nothing within reach
    double orientation_wxyz[4]; // the device's present orientation
    double torque_n_m[3];       // torque on the hand about the tool's position, from the last render
    double share;               // rendered share of the body's force: 1, or rising to 1
    double gain;
    int64_t taken, refused, replayed; // counts since init: messages taken, datagrams refused, poses replayed
} kn_contact_model;

typedef enum kn_contact_take {
    KN_CONTACT_TAKEN,   // the message is complete and is rendered from now on
    KN_CONTACT_WAITING, // other contacts of the tick are missing; all of them apply together or not at all
    KN_CONTACT_FOREIGN, // the message belongs to another session
    KN_CONTACT_LATE,    // the message is not newer than the one in use, or its pose is forgotten
    KN_CONTACT_BAD      // not a finite number, a normal that is not unit, a pose never sent, or a place far from it
} kn_contact_take;

void kn_contact_model_init(kn_contact_model *m, const kn_contact_model_def *def);

// Set the tool's orientation from now on, a unit quaternion as in probe_pose_t. Call before pose and render. A tool
// that does not turn (a plate) and a device of three axes need no call.
void kn_contact_model_turn(kn_contact_model *m, const double orientation_wxyz[4]);

// Record a pose that is sent. Call before the tick's render. `seq` must increase from call to call. After 3 ms without
// a pose the force fades; after 20 ms it is zero.
void kn_contact_model_pose(kn_contact_model *m, int64_t seq, const double position_m[3], const double velocity_m_s[3]);

// Take one datagram. Nothing in it is trusted: every number is checked or clipped.
kn_contact_take kn_contact_model_take(kn_contact_model *m, const kn_contact_unit *unit);

// Advance the model by one step of dt_s (0.1 .. 10 ms) at the device's position and velocity, and store the force on
// the hand. A position that is not finite counts as a missing pose.
void kn_contact_model_render(kn_contact_model *m, double dt_s, const double position_m[3], const double velocity_m_s[3],
                             double force_n[3]);

// Return true if no message is in use, or if the message in use is too old or its place is too far away.
bool kn_contact_model_stale(const kn_contact_model *m);

// Return the energy that the coupling and the springs k1 store, J. The reservoir of a passivity observer may be this
// large.
double kn_contact_model_energy(const kn_contact_model *m, const double position_m[3]);

#endif
