#ifndef KN_CORE_CONTACT_MODEL_H
#define KN_CORE_CONTACT_MODEL_H
// The local contact model: a client behind a slow link renders this model instead of old forces. A message
// (KNEAD_CONTACT, proto/contact_model_t.lcm) describes the contact under one of the client's own poses. The client
// rebuilds this contact and replays its own later poses. So the client renders the contact under its present pose. This
// file and its source need only libc and libm, C99: copy the two into any client.
//
//     own pose x --k_vc, b_vc-- proxy p | surface --(A, H, k1)--(c2)-- object        along the normal n, and tangential
//
//     t: contact force; A: damping, H: force of the spring k1 (back stress), c2: damping of the force-dependent damper
//     t = A w_voigt + H    w = w_voigt + w_c2: speed at which the surface yields       with friction mu t; t >= 0
//     t = c2 w_c2          dH/dt = k1 w_voigt; A = c1 + dt k1: the edge law of the lattice at the scale of the contact
//     Q - G v_p + sum(t_i n_i) = 0,  Q = k_vc (x - p) + b_vc v,  G = b_vc + dt k_vc    no mass; up to 8 units
//     l^2 (k_vc turn of x to p - G w_p) + sum(a_i x t_i n_i) = 0      the same for turns; a_i: arm of unit i
//
// The force on the hand is the sum of the units' forces. The torque is the sum of their torques about the tool's
// position. A unit gives way at its own place, by v_p + w_p x a_i. So a tool that rocks presses with one side and lifts
// the other. If there are several units, each has its own foundation in front of it, of the compliance
// 1/k_vc (message) - 1/k_vc (this device). The foundation of a single unit is in series with the coupling. A rigid tool
// (k_vc 0) turns as the device does.
//
// The dampers A and c2 are in series with k_vc. So the device never feels a force A v or c2 v of its own velocity v,
// however large A and c2 are. Rejected: holding or extrapolating the force. Both are unstable on elastic material from
// 10-20 ms of round trip. A message has one c2, at its own force, but the c2 of dough falls to 1/300 within 0.4 N. So
// c2 at other forces comes from earlier messages, scaled to match this message at its force.
//
//     age of a message  0 ....... valid_ms          then no message            a new message
//     the contact       rendered as it is           leaks towards the device   in time: taken at once
//                                                   (50 ms, <= 0.016 N/ms)     late: its share of force rises from
//                                                                              the felt force, like a surface that
//                                                                              moves at 20 mm/s
//
// A hand cannot leave a pressed contact between two messages. So if the next message has no contact within reach, the
// object was replaced, or the server restarted. The contact then fades in 17 ms.
//
// In each tick of the device, 1 to 10 kHz: read x, v; call kn_contact_model_pose if this pose is sent; call
// kn_contact_model_take for every message that has arrived; call kn_contact_model_render for the force. All functions
// are real-time safe: no allocation, clock or lock. The model is plain memory of the caller; use it from one thread.
// The cost is bounded: kn_contact_model_render takes one step, and a complete message takes at most KN_CONTACT_REPLAY
// steps. A device still needs its own passivity controller and impulse guard behind this model.
#include <stdbool.h>
#include <stdint.h>

#define KN_CONTACT_UNITS 8 // largest number of contacts of one tool
#define KN_CONTACT_LAW 40  // number of forces, 0.02 to 17 N, for which c2 is remembered
// number of the client's last poses that the model stores, at least 0.5 ms apart; a message about an older pose is
// refused
#define KN_CONTACT_REPLAY 64

typedef struct kn_contact_unit { // one contact, the fields of contact_model_t; SI units, scene frame
    // time of the server's tick, us since 1970; datagrams with equal utime belong to one tick; a datagram with an older
    // utime is ignored
    int64_t utime;
    int64_t session; // session of the client; a message of another session is refused
    // number of the client's pose that the contact belongs to; the replay begins with the next pose
    int64_t pose_seq;
    int32_t generation;    // changes when the object is replaced (reset, another scene)
    int32_t flags;         // KN_FLAG_* bits of core/safety.h; the model reads only those named KN_CONTACT_* below
    int32_t contact_index; // index of this contact in its message, 0 .. contact_count - 1
    int32_t contact_count; // number of contacts in the message; 0: the object is not within the tool's reach
    // Position of the proxy. Along `normal`, it is the position at which the tool touches the surface. Tangentially, it
    // is the point where the force acts.
    double proxy_m[3];
    double normal[3];          // unit normal of the surface, out of the object
    double force_n;            // contact force F0 along normal, >= 0; 0: the tool does not touch the surface yet
    double proxy_velocity_m_s; // velocity of the surface along normal
    double a_n_s_per_m;        // damping A of the contact, clipped to [0.1, 1e4]
    // force H of the spring k1; |H| is clipped to the force of this spring at an extension of 0.1 m
    double h_n;
    double c2_n_s_per_m; // damping of the force-dependent damper, clipped to [10, 1e5]
    double k1_n_per_m;   // stiffness of the spring, clipped to [0, 2 k_vc]
    // Stiffness k_vc of the coupling in the server when the server computed force_n; 0: the tool is rigid. If the
    // device has a softer coupling, it renders only a part of H.
    double k_vc_n_per_m;
    double b_vc_n_s_per_m; // damping of the server's coupling
    double friction;       // coefficient of friction mu, clipped to [0, 3]
    // Friction anchor. Tangentially, it is the position that the tool would have without tangential force. The
    // difference proxy_m - friction_anchor_m is the arm from the tool's position to the point where the force acts.
    double friction_anchor_m[3];
    double valid_ms; // time for which the message is valid, clipped to [0, 100]
} kn_contact_unit;

enum { // bits of kn_contact_unit.flags, with the numbers that they have in contact_force_t
    KN_CONTACT_ENGAGED = 1,
    KN_CONTACT_RAMPING = 2,    // the server simulates the tool if ENGAGED or RAMPING is set
    KN_CONTACT_LATCHED = 4,    // the server has latched a fault
    KN_CONTACT_STOPPING = 1024 // the client fades its force to zero within 20 ms if LATCHED or STOPPING is set
};

typedef struct kn_contact_model_def { // a field of 0 takes its default
    int64_t session;                  // session of the client; messages of other sessions are refused
    // radius r of the tool, default 10 mm; larger values are cut to 10 mm. A message is valid until the tool has moved
    // by r/2 along the surface.
    double radius_m;
    // largest coupling stiffness k_vc that this device renders; default 600, for a light desktop device
    double stiffness_n_m;
    double damping_n_s_m; // coupling damping b_vc of this device; default 1.5
    // arm l: stiffness and damping for rotations are k_vc l^2 and b_vc l^2; default 0.03, as in the server
    double arm_m;
    // Ratio of the hand's force to the object's force, default 1. stiffness_n_m, damping_n_s_m and force_rise_n apply
    // to the force at the object, force_limit_n to the force on the hand.
    double force_scale;
    double force_limit_n;   // limit of |force| on the hand; default 3.3
    double force_rise_n;    // a message is valid until the force has risen by this much; default 2
    double server_period_s; // time step dt of the server, in A = c1 + dt k1; default 1 ms
} kn_contact_model_def;

typedef struct kn_contact_plane { // one contact unit while it is rendered; used by contact_model.c only
    double normal[3], level_m;    // the surface is all points x with normal . x + lever_m . turn = level_m
    // arm_m: vector from the proxy to the point where the force acts; lever_m: cross product of arm_m and normal
    double arm_m[3], lever_m[3];
    double c1, k1, c2, mu; // c1: dashpot; k1: spring; c2: damper at the present force; mu: friction coefficient
    double give_m_n, t_n;  // give_m_n: compliance of the unit's own foundation [m/N]; t_n: force along the normal [N]
    double thick;          // ratio of this unit's c2 to the c2 of the stored law at equal force
    // force of the spring k1 [N]. h_n: along the normal; shear_n: tangential
    double h_n, shear_n[3];
    double force_n[3]; // force on the tool
} kn_contact_plane;

typedef struct kn_contact_body { // the proxy and the surfaces of all units; used by contact_model.c only
    int count;
    bool rigid; // the proxy turns as the device does, whatever the torque
    // k, b: stiffness k_vc and damping b_vc of the coupling; arm_m: arm l of the coupling for rotations; proxy_m:
    // position of the proxy; force_n: force of the contact on the tool
    double k, b, arm_m, proxy_m[3], force_n[3];
    double from_wxyz[4];            // orientation of the device in the pose that the message answers
    double turn[3];                 // rotation vector of the proxy since the pose that the message answers
    double torque_n_m[3];           // torque of the contact on the tool about the proxy's position
    double law_m_s[KN_CONTACT_LAW]; // entry i: speed at which the damper c2 yields under 0.02 N * 2^(i/4)
    kn_contact_plane plane[KN_CONTACT_UNITS];
} kn_contact_body;

typedef struct kn_contact_pose {
    int64_t seq;
    double at_s, position_m[3], velocity_m_s[3], orientation_wxyz[4];
} kn_contact_pose;

typedef struct kn_contact_model { // plain data, read-only for the caller; a copy is a snapshot
    kn_contact_model_def def;
    kn_contact_body body;
    kn_contact_pose pose[KN_CONTACT_REPLAY]; // stored poses; the newest is at (poses - 1) % KN_CONTACT_REPLAY
    int64_t poses;                           // number of poses stored since init
    double now_s, posed_s;                  // now_s: total time rendered; posed_s: time of the last pose, stored or not
    kn_contact_unit unit[KN_CONTACT_UNITS]; // arrived datagrams of a message that is still incomplete
    double c2[KN_CONTACT_LAW];              // last received c2 at each of the law's forces; 0: none received yet
    unsigned have;                          // bit i is set if unit[i] has arrived
    int first;                              // index in unit[] of the datagram that arrived first
    // utime: server time of the newest datagram; taken_seq: pose_seq of the message in use, -1: none
    int64_t utime, taken_seq;
    int32_t generation, flags; // `generation` and `flags` of the message in use
    // Message in use. valid_s: time for which it is valid; taken_s, taken_m: time and position of its pose; taken_n:
    // size of its force.
    double valid_s, taken_s, taken_m[3], taken_n;
    double stale_s; // time since the message in use became stale
    bool returning; // the force rises again after a time without valid messages
    // share of the force that has been faded out since the server lost the contact, 0 .. 1
    double lost;
    double orientation_wxyz[4];       // the device's present orientation
    double torque_n_m[3];             // torque on the hand about the tool's position, from the last render
    double share;                     // share of the contact force that is rendered: 1, or rising to 1 after an outage
    double gain;                      // 0 .. 1: falls to 0 if the server releases the tool or the client's poses stop
    int64_t taken, refused, replayed; // counts since init: messages taken, datagrams refused, poses replayed
} kn_contact_model;

typedef enum kn_contact_take {
    KN_CONTACT_TAKEN,   // the message is complete and is rendered from now on
    KN_CONTACT_WAITING, // the datagram is stored; the message is used when the datagrams of its other contacts arrive
    KN_CONTACT_FOREIGN, // the message belongs to another session
    KN_CONTACT_LATE,    // the message is not newer than the one in use, or its pose is no longer stored
    // The message has a number that is not finite, a normal that is not a unit vector, a pose that was never sent, or a
    // contact far from its pose.
    KN_CONTACT_BAD
} kn_contact_take;

// Initialise the model: no message, no pose, no force. The model copies `def`.
void kn_contact_model_init(kn_contact_model *m, const kn_contact_model_def *def);

// Set the tool's present orientation, a unit quaternion w, x, y, z from tool to scene. Call before
// kn_contact_model_pose and kn_contact_model_render. Skip the call if the tool is a plate, which does not turn, or if
// the device has only three axes.
void kn_contact_model_turn(kn_contact_model *m, const double orientation_wxyz[4]);

// Record a pose that the client sends to the server, in the scene's frame. Call before kn_contact_model_render of the
// same tick. `seq` must increase from call to call. After 3 ms without a pose the force fades; after 20 ms the force is
// zero.
void kn_contact_model_pose(kn_contact_model *m, int64_t seq, const double position_m[3], const double velocity_m_s[3]);

// Process one received datagram. Every number of the datagram is checked or clipped. Return whether the message is
// taken, waits for further datagrams, or is refused.
kn_contact_take kn_contact_model_take(kn_contact_model *m, const kn_contact_unit *unit);

// Advance the model by one step of dt_s (0.1 .. 10 ms) at the device's position and velocity in the scene's frame.
// Store the force on the hand, at most force_limit_n, in force_n and the torque in m->torque_n_m. A position or
// velocity that is not finite counts as a missing pose.
void kn_contact_model_render(kn_contact_model *m, double dt_s, const double position_m[3], const double velocity_m_s[3],
                             double force_n[3]);

// Return true if no message is in use, or if the message in use is no longer valid: it is too old, the tool has moved
// or turned too far, or the force has risen too much.
bool kn_contact_model_stale(const kn_contact_model *m);

// Return the energy that the coupling and the springs k1 store, J. A passivity observer may let the hand get this
// energy back (stored_j in core/passivity.h).
double kn_contact_model_energy(const kn_contact_model *m, const double position_m[3]);

#endif
