#ifndef KN_CORE_CONTACT_MODEL_H
#define KN_CORE_CONTACT_MODEL_H
// The local contact model: what a client behind a slow link renders instead of old forces. A message (KNEAD_CONTACT,
// proto/contact_model_t.lcm) holds the contact as it was under one of the client's own poses; the client sets it up
// again and replays its own poses since then, so that what it renders is the contact under the pose of now.
// This file and its source need libc and libm alone, C99: copy the two into any client.
//
//     own pose x --k_vc, b_vc-- proxy p | surface --(A, H, k1)--(c2)-- object        along the normal n, and across it
//
//     t = A w + H       w = w_voigt + w_c2: how fast the surface goes in               with friction mu t; t >= 0
//     t = c2 w_c2       dH/dt = k1 w_voigt; A = c1 + dt k1: the edge law of the lattice at the scale of the contact
//     Q - G v_p + sum(t_i n_i) = 0,  Q = k_vc (x - p) + b_vc v,  G = b_vc + dt k_vc    no mass; up to 8 units
//     l^2 (k_vc turn of x to p - G w_p) + sum(a_i x t_i n_i) = 0      the same for turns; a_i: arm of unit i
//
// The force on the hand is the sum, the torque that about the tool's position. A unit gives way at its own place, by
// v_p + w_p x a_i, so a tool that rocks presses with one side and lifts the other. Several units have each a foundation
// of their own before them, 1/k_vc of the message less 1/k_vc of this device; of one alone it is in series with the
// coupling. A rigid tool (k_vc 0) turns as the device does.
//
// A and c2 are in series behind k_vc: however large they are, no rate term reaches the device. Holding or extrapolating
// the force instead is unstable on elastic material from 10-20 ms of round trip. A message has one c2, at its force;
// dough's falls to a 300th in 0.4 N. So c2 at other forces is what earlier messages said of them, times what makes it
// right at this one's.
//
//     age of a message  0 ....... valid_ms          then no news               a new message
//     the contact       rendered as it is           leaks towards the device   a share of it that rises from what is
//                                                   (50 ms, <= 0.016 N/ms)     felt as a surface at 20 mm/s would (a
//                                                                              message in time is taken at once)
//
// What is pressed and then not within reach at all, by the next message, no hand has left so fast: the object was
// replaced, or the server started again. It fades in 17 ms.
//
// Per tick of the device, 1 to 10 kHz:  read x, v;  kn_contact_model_pose if this pose is sent;  kn_contact_model_take
// for every message that came;  kn_contact_model_render -> force. No allocation, clock or lock; one thread. What it
// costs is bounded: a render is one step, a complete message at most KN_CONTACT_REPLAY of them.
// A device still wants its own passivity controller and impulse guard behind this.
#include <stdbool.h>
#include <stdint.h>

#define KN_CONTACT_UNITS 8   // contacts of one tool
#define KN_CONTACT_LAW 40    // forces, 0.02 to 17 N, for which c2 is remembered
#define KN_CONTACT_REPLAY 64 // own poses that are remembered, 0.5 ms apart or more: an older message comes too late

typedef struct kn_contact_unit { // contact_model_t; SI, scene frame
    int64_t utime;               // the server's: datagrams of one utime are one tick's; an older one is not looked at
    int64_t session;             // the client's own, else it is refused
    int64_t pose_seq;            // of the pose that the contact answers; replay begins with the next one
    int32_t generation;          // another one: the object is not the one of the last message (reset, another scene)
    int32_t flags;               // KN_FLAG_*, those below are looked at
    int32_t contact_index;       // 0 .. contact_count-1
    int32_t contact_count;       // 0: nothing within reach
    double proxy_m[3];           // along normal, where the tool's position is when it is on the surface; across it,
                                 // where the force acts, if the tool is at friction_anchor_m
    double normal[3];            // unit, out of the object
    double force_n;              // F0 along normal, >= 0; 0: this is a plane ahead of the tool
    double proxy_velocity_m_s;   // of the surface along normal
    double a_n_s_per_m;          // A, clipped to [b_vc, 1e4]
    double h_n;                  // H, clipped to what k1 holds at 0.1 m
    double c2_n_s_per_m;         // clipped to [10, 1e5]
    double k1_n_per_m;           // clipped to [0, 2 k_vc]
    double k_vc_n_per_m;         // that force_n came through; 0: rigid. A softer device renders less of H
    double b_vc_n_s_per_m;
    double friction;             // mu, clipped to [0, 3]
    double friction_anchor_m[3]; // across normal, where the tool would be if it carried no force that way; along it
                                 // such that proxy_m less it is the arm from there to where the force acts
    double valid_ms;             // clipped to [0, 100]
} kn_contact_unit;

enum { // of kn_contact_unit.flags; the same numbers as in contact_force_t
    KN_CONTACT_ENGAGED = 1,
    KN_CONTACT_RAMPING = 2, // either: the server has the tool in its model
    KN_CONTACT_LATCHED = 4,
    KN_CONTACT_STOPPING = 1024 // either: zero force within 20 ms
};

typedef struct kn_contact_model_def { // a field of 0 is its default
    int64_t session;
    double radius_m;        // of the tool: a message is good for r/2 across the normal; 5 mm at most and by default
    double stiffness_n_m;   // k_vc of this device, the most that is rendered; 600, a light desktop device's
    double damping_n_s_m;   // b_vc of it, 1.5
    double arm_m;           // l: turns are coupled by k_vc l^2 and b_vc l^2; the server's 0.03
    double force_scale;     // of the hand's force to the object's: 1. The coupling is the object's, limits the hand's
    double force_limit_n;   // most of |force|; 3.3
    double force_rise_n;    // a message is good for such a rise of force; 2
    double server_period_s; // dt in A; 1 ms
} kn_contact_model_def;

typedef struct kn_contact_plane { // private: a unit as it is rendered
    double normal[3], level_m;    // the surface is at normal . x + lever . turn = level_m
    double arm_m[3], lever_m[3];  // from the proxy to where the force acts; arm x normal
    double c1, k1, c2, mu;        // c2 at the force of now
    double give_m_n, t_n;         // of the foundation before it, which is its own; force along the normal
    double thick;                 // it is so many times the law's
    double h_n, shear_n[3];       // H along and across the normal
    double force_n[3];            // on the tool
} kn_contact_plane;

typedef struct kn_contact_body { // private: proxy and planes
    int count;
    bool rigid; // it turns as the device does, whatever the torque
    double k, b, arm_m, proxy_m[3], force_n[3];
    double from_wxyz[4];            // the device's orientation under the message's pose
    double turn[3];                 // of the proxy since that, a rotation vector
    double torque_n_m[3];           // about the proxy
    double law_m_s[KN_CONTACT_LAW]; // flow of c2, at forces a quarter of an octave apart
    kn_contact_plane plane[KN_CONTACT_UNITS];
} kn_contact_body;

typedef struct kn_contact_pose {
    int64_t seq;
    double at_s, position_m[3], velocity_m_s[3], orientation_wxyz[4];
} kn_contact_pose;

typedef struct kn_contact_model { // plain data, read only for the caller; copying it is a snapshot
    kn_contact_model_def def;
    kn_contact_body body;
    kn_contact_pose pose[KN_CONTACT_REPLAY]; // newest at (poses - 1) % KN_CONTACT_REPLAY
    int64_t poses;
    double now_s, posed_s;                  // time by render's steps; of the last pose, stored or not
    kn_contact_unit unit[KN_CONTACT_UNITS]; // datagrams of the tick that is coming in
    double c2[KN_CONTACT_LAW];              // as heard at those forces; 0: not yet
    unsigned have;                          // bit i: unit[i] is there
    int first;                              // the one that came first
    int64_t utime, taken_seq;               // newest datagram; pose of the message in force, -1 none
    int32_t generation, flags;
    double valid_s, taken_s, taken_m[3], taken_n; // of the message in force: its pose's time and place, |F0|
    double stale_s;                               // since it was valid
    bool returning;                               // after an outage
    double lost;                // of what is felt, 0 .. 1: the server has nothing within reach any more
    double orientation_wxyz[4]; // of the device now
    double torque_n_m[3];       // on the hand, about the tool's position, of the last render
    double share;               // of the body's force, what is rendered: 1, or rising to it
    double gain;
    int64_t taken, refused, replayed; // messages, datagrams, poses since init
} kn_contact_model;

typedef enum kn_contact_take {
    KN_CONTACT_TAKEN,   // complete: this is what is rendered from now on
    KN_CONTACT_WAITING, // for the other contacts of the same tick; they apply together or not at all
    KN_CONTACT_FOREIGN, // another session's
    KN_CONTACT_LATE,    // not newer than the one in force, or its pose is forgotten
    KN_CONTACT_BAD      // a number that is none, a normal that is no unit, a pose never sent, a place far from it
} kn_contact_take;

void kn_contact_model_init(kn_contact_model *m, const kn_contact_model_def *def);

// How the tool is turned from now on, before pose and render: unit, as in probe_pose_t. A tool that does not turn, as a
// plate, and a device of three axes need not say.
void kn_contact_model_turn(kn_contact_model *m, const double orientation_wxyz[4]);

// A pose as it is sent, before the tick's render. seq rises. Without one for 3 ms the force fades, by 20 ms it is zero.
void kn_contact_model_pose(kn_contact_model *m, int64_t seq, const double position_m[3], const double velocity_m_s[3]);

// One datagram. Nothing in it is believed: every number is checked or clipped.
kn_contact_take kn_contact_model_take(kn_contact_model *m, const kn_contact_unit *unit);

// One step of dt_s (0.1 .. 10 ms) of the device at that position and velocity: the force on the hand. A position that
// is no number counts as a pose that did not come.
void kn_contact_model_render(kn_contact_model *m, double dt_s, const double position_m[3], const double velocity_m_s[3],
                             double force_n[3]);

// Whether the message in force is too old, or too far from here.
bool kn_contact_model_stale(const kn_contact_model *m);

// What coupling and k1 hold, J: a passivity observer's reservoir may be that large.
double kn_contact_model_energy(const kn_contact_model *m, const double position_m[3]);

#endif
