#ifndef KN_CORE_SAFETY_H
#define KN_CORE_SAFETY_H
// The output stage between physics and a hand, and the watchdog over the poses that feed it. Pure functions: time is
// counted in ticks of 1 ms. The server runs one output stage per probe. Every client that drives a device runs
// kn_watchdog on the forces that it receives.
//
//     pose --> kn_safety_watch --> [ lattice step, if attached ] --> kn_safety_filter --> force
//              silence, speed,                                       scale, finite -> impulse guard -> clamp -> gain
//              ramp, latch
//
//     gain 1 |------------.                               .----     hold, then down to 0 at zero_ms (within 17 ms),
//            |   contact   \                          . '           then up in ramp_up_ms once poses have flowed for
//          0 |              '------------------- . '                flow_ms AND the tool is clear: it enters in air
//            +---pose lost--+hold--20 ms--poses, lift------> t
//
// Transitions ramp the gain. They never limit the slew of contact: a rate limiter in the contact loop is negative
// damping and causes limit cycles. While the force is not live contact, it changes by at most
//     kn_safety_slope(limits) = max(0.5 N, clamp / 17) per ms,
// because the fading force is the last force that was given, frozen, and not the contact force. In contact, the force
// changes by at most guard_n_per_ms for each ms since the last tick with a pose, but for at most hold_ms. By default
// this is 4 N, or 12 N after 3 ms without a pose or a tick.
#include <stdbool.h>
#include <stdint.h>

typedef struct kn_safety_limits { // the scene's `device:` profile; a field of 0 takes its default
    double clamp_n;               // limit of |force|; default 3.3 N, that of the smallest common desktop devices
    double torque_clamp_n_m;      // limit of |torque|; default clamp_n * 0.05 m
    double guard_n_per_ms;        // impulse guard; default 4 N/ms, above any first touch below 1 m/s
    double brake_m_s;             // above this speed the hand feels only damping, no contact; default 1.2 m/s
    double brake_n_s_per_m;       // damping of a fast hand; default 1.5 N s/m
    // ratio of the hand's force to the object's, applied before guard and clamp; default 1
    double force_scale;
    int hold_ms;    // the last force is held for at most this long without a pose; default 3
    int zero_ms;    // time from the last pose until the force is zero; default 20
    int ramp_up_ms; // time in which the gain rises from 0 to 1; default 200, never less
    // time for which poses must arrive without a gap before the tool may engage; default 200
    int flow_ms;
} kn_safety_limits;

// The same numbers as contact_force_t's FLAG_* and FAULT_* (the server asserts it).
enum {
    KN_FLAG_ENGAGED = 1,
    KN_FLAG_RAMPING = 2,
    KN_FLAG_LATCHED = 4,
    KN_FLAG_REENGAGE_LIFT = 8,
    KN_FLAG_CLAMPED = 16,
    KN_FLAG_GUARD = 32,
    KN_FLAG_BRAKE = 64,
    KN_FLAG_STALE = 128
};
typedef enum kn_fault { // a later fault in this list replaces an earlier one; OVERLOAD replaces none
    KN_FAULT_NONE,
    KN_FAULT_POSE_SILENCE, // no poses arrived; cleared by lifting the tool while poses arrive, new session or recover
    KN_FAULT_IMPULSE,      // the impulse guard tripped; cleared by a new session or by recover, then lifting the tool
    KN_FAULT_NONFINITE,    // a force was not finite; cleared by a reset of the object, then lifting the tool
    KN_FAULT_ESTOP,        // emergency stop by an operator; cleared by recover, then lifting the tool
    KN_FAULT_STOPPING,     // the server is stopping; never cleared
    KN_FAULT_OVERLOAD      // poses arrived, but the server's ticks were late; cleared like a pose silence
} kn_fault;
#define KN_FAULTS (KN_FAULT_OVERLOAD + 1)

const char *kn_fault_name(kn_fault fault);   // name for users, e.g. "pose silence"
const char *kn_fault_remedy(kn_fault fault); // what clears the fault, e.g. "reset the object, then lift the tool ..."

// The impulse guard, for every stage that drives a hand. In normal use it never acts. A single wild value is limited
// and counted. The guard trips on three hits in 20 ticks, on two hits that point against each other, or on one hit
// above twice the limit. In these cases the physics chatters or a message is corrupt, and the last good force should
// fade instead.
typedef struct kn_guard {
    double most_n_per_ms; // largest change of the force that is not limited
    double step_n[3];     // change of the force that was requested at the last hit
    int age[2];           // ticks since the last hit, and since the hit before the last one
} kn_guard;
typedef enum kn_guard_result {
    KN_GUARD_FREE,    // the change of the force is allowed
    KN_GUARD_LIMITED, // the change of the force was cut to the allowed change: a hit
    KN_GUARD_GOES_ON, // the change was cut again within the same ms: counts as one hit
    KN_GUARD_TRIPPED  // the guard tripped: the force must fade
} kn_guard_result;
void kn_guard_init(kn_guard *g, double most_n_per_ms); // most_n_per_ms 0: 4 N/ms; forgets all hits
void kn_guard_age(kn_guard *g, int ticks);             // let `ticks` ticks of 1 ms pass
// Pass a force through the guard. force_n is the last force that got through; it becomes asked_n, or the part of
// asked_n that may be given. allowed_n is the change that is allowed since then: most_n_per_ms times the ms passed.
// TRIPPED leaves force_n unchanged.
kn_guard_result kn_guard_pass(kn_guard *g, const double asked_n[3], double allowed_n, double force_n[3]);

typedef struct kn_safety {         // output stage of one probe; plain data, part of the servo loop's state
    kn_safety_limits limits, next; // limits in use; new limits that come into use as soon as the hand feels no force
    bool relimiting;               // the limits in `next` wait to come into use
    double gain;                   // factor of the force, 0..1
    double gain_drop;              // decrease of the gain in this tick
    // last scaled contact force past the guard, before clamp and gain; frozen if not rendering
    double force_n[3];
    double torque_n_m[3];
    double brake_n[3]; // damping force that replaces the contact force of a hand faster than brake_m_s
    kn_guard guard;
    int silent_ms;  // time since the last fresh pose
    int flowing_ms; // time since the first pose after a silence of zero_ms; stops counting at flow_ms
    int gap_ms;     // time since force_n was last set to a contact force
    bool attached;  // the probe touches the simulated object, i.e. it is in the model
    // `fault` remains until it is cleared; false while a pose silence only fades the force
    bool latched;
    bool braking;                   // the hand is too fast and feels only damping
    bool yielding;                  // the force fades to 0 for a change of the physics or a clutch, then comes back
    bool rejoining;                 // force_n was frozen longer than hold_ms and approaches the contact force
    bool nonfinite;                 // NONFINITE is latched, or is hidden by an ESTOP; true until the object is reset
    kn_fault fault;                 // reason why the force is latched or fading
    int64_t clamps, guards, faults; // number of ticks with clamp, of guard hits, and of faults since init
    int64_t slewed;                 // number of ticks in which a ramp or slope reduced the force; not saved
    int64_t brakes;                 // number of ticks with braking; not saved
    int64_t tripped[KN_FAULTS];     // number of faults of each kind, indexed by kn_fault
} kn_safety;

typedef struct kn_safety_in {
    bool live;     // a client's session owns the probe
    bool opened;   // this is the first tick of the session
    bool fresh;    // a new pose arrived for this tick
    bool clear;    // the pose does not touch the object; read only while the probe is not attached
    bool leaving;  // the last pose was the session's last: the force fades as in a silence, and no fault is latched
    bool stop;     // the server is stopping: ramp down and latch
    bool reset;    // the object was reset: the probe leaves the model at once, and its last force fades
    bool recover;  // from an operator: clear a latched fault, but not NONFINITE or STOPPING; a NONFINITE hidden by an
                   // ESTOP is latched again; the probe leaves the model
    bool overload; // ticks keep taking longer than their period: fade and latch, whichever session owns the probe
    bool estop;    // emergency stop by an operator: fade and latch, whichever session owns the probe
    bool clutch;   // the hand releases the tool to move freely: the felt force fades to 0, the probe stays attached
    // the physics changes from this tick on: the felt force goes through 0, the probe stays attached
    bool change;
    int elapsed_ms;         // time since the last tick: 1 + number of missed ticks
    double velocity_m_s[3]; // velocity of the tool
} kn_safety_in;

// Fill in the defaults of zero limits and start without a fault: detached, gain 0.
void kn_safety_init(kn_safety *s, const kn_safety_limits *limits);
// Return the largest change of the force outside live contact [N/ms]. The defaults in `limits` must be filled in.
double kn_safety_slope(const kn_safety_limits *limits);

// Change the limits while the stage runs. The felt force fades under the old limits (set `change`, too) and comes back
// under the new ones. The caller must check with kn_safety_raised whether the new limits allow more.
void kn_safety_relimit(kn_safety *s, const kn_safety_limits *limits);
// Return the key of the first limit that allows more than `than`: a higher force, a steeper force, or a longer time
// without poses. NULL: none.
const char *kn_safety_raised(const kn_safety_limits *limits, const kn_safety_limits *than);

// Call before the step: advance watchdog, latch and gain by elapsed_ms. Return true if the probe is in the model in
// this tick. A probe enters the model only when it is clear of the object. The probe leaves the model when the gain has
// come down to 0 and does not rise again.
bool kn_safety_watch(kn_safety *s, const kn_safety_in *in);

// Call after the step: compute the force and torque for the hand from those of the contact. Return the KN_FLAG_* bits
// of this tick. A non-finite number never gets through: it latches NONFINITE, and the last good force fades in its
// place.
int kn_safety_filter(kn_safety *s, const kn_safety_in *in, const double force_n[3], const double torque_n_m[3],
                     double out_force_n[3], double out_torque_n_m[3]);

// Latch a fault from outside (ESTOP, diverged physics). The force fades from the next watch on.
void kn_safety_trip(kn_safety *s, kn_fault fault);

// The device's own watchdog, needed because a killed server cannot ramp anything down. The last force is held for
// hold_ms after its message, is zero by zero_ms, and stays zero until the watchdog is rearmed. A message that arrives
// in between is ramped in again.
typedef struct kn_watchdog {
    int hold_ms, zero_ms; // times without a message until the force fades, and until the force is zero
    int silent_ms;        // time since the last message
    double factor;        // factor 0..1 of the last received force
    bool armed;           // a message has arrived since kn_watchdog_init or kn_watchdog_rearm
    bool tripped;         // messages were missing for zero_ms: the force stays zero until kn_watchdog_rearm
    int64_t trips;        // number of times that the watchdog has tripped
} kn_watchdog;
void kn_watchdog_init(kn_watchdog *w, int hold_ms, int zero_ms); // 0: default of 3 ms and 20 ms
// Call every ms. Return the factor 0..1 by which to multiply the last received force.
double kn_watchdog_tick(kn_watchdog *w, bool fresh, int elapsed_ms);
void kn_watchdog_rearm(kn_watchdog *w);

#endif
