#ifndef KN_CORE_SAFETY_H
#define KN_CORE_SAFETY_H
// The output stage between physics and a hand, and the watch over the poses that feed it. Pure: time comes in as ticks
// of 1 ms. The server runs one per probe; every client that drives a device runs kn_watchdog on the forces it receives.
//
//     pose --> kn_safety_watch --> [ lattice step, if attached ] --> kn_safety_filter --> force
//              silence, speed,                                       scale, finite -> impulse guard -> clamp -> gain
//              ramp, latch
//
//     gain 1 |------------.                               .----     hold, then down to 0 at zero_ms (17 ms), then up in
//            |   contact   \                          . '           ramp_up_ms once poses have flowed for flow_ms
//          0 |              '------------------- . '                AND the tool is clear: it always enters in air
//            +---pose lost--+hold--20 ms--poses, lift------> t
//
// Transitions ramp the gain and never limit the slew of contact: a rate limiter in the contact loop is negative damping
// and causes limit cycles. Whenever the force is not live contact it changes by at most
//     kn_safety_slope(limits) = max(0.5 N, clamp / 17) per ms,
// because what fades is the last force that was given, frozen, not the contact's. In contact it changes by at most
// guard_n_per_ms for each ms since the last tick with a pose, of at most hold_ms: by 4 N, by 12 N after 3 ms without a
// pose or a tick.
#include <stdbool.h>
#include <stdint.h>

typedef struct kn_safety_limits { // the scene's `device:` profile; 0 in a field = its default
    double clamp_n;               // default 3.3 N (smallest common desktop devices): most of |force|
    double torque_clamp_n_m;      // default clamp_n * 0.05 m
    double guard_n_per_ms;        // default 4 N/ms: impulse guard, above any first touch below 1 m/s
    double brake_m_s;             // default 1.2 m/s: faster, the hand is only damped
    double brake_n_s_per_m;       // default 1.5 N s/m: that damping
    double force_scale; // default 1: of what the hand is given to what the object feels, before guard and clamp
    int hold_ms;        // default 3: the last force may stand this long without a pose
    int zero_ms;        // default 20: force is zero this long after the last pose
    int ramp_up_ms;     // default 200, never less
    int flow_ms;        // default 200: poses must have flowed this long before an engagement
} kn_safety_limits;

// Same numbers as contact_force_t's FLAG_* and FAULT_* (the server asserts it).
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
typedef enum kn_fault { // a later one replaces an earlier one; OVERLOAD replaces none
    KN_FAULT_NONE,
    KN_FAULT_POSE_SILENCE, // cleared by lifting with poses flowing, a new session, recover
    KN_FAULT_IMPULSE,      // cleared by a new session, the way back that needs no operator, or recover, then lifting
    KN_FAULT_NONFINITE,    // cleared by reset, then lifting
    KN_FAULT_ESTOP,        // an operator's; cleared by recover, then lifting
    KN_FAULT_STOPPING,
    KN_FAULT_OVERLOAD // poses flowed and ticks came too late for them; cleared as a pose silence
} kn_fault;
#define KN_FAULTS (KN_FAULT_OVERLOAD + 1)

const char *kn_fault_name(kn_fault fault);   // "pose silence"
const char *kn_fault_remedy(kn_fault fault); // "lift the tool clear of the object"

// The impulse guard, for every stage that drives a hand. It is meant not to act: one wild value is limited and counted;
// three in 20 ticks, two that point against each other, or one above twice the limit are physics that chatter or a
// message that is none, and the last good force is to fade instead.
typedef struct kn_guard {
    double most_n_per_ms;
    double step_n[3]; // what the last hit asked for
    int age[2];       // ticks since the last and the last but one hit
} kn_guard;
typedef enum kn_guard_result {
    KN_GUARD_FREE,
    KN_GUARD_LIMITED,
    KN_GUARD_GOES_ON, // limited again within the ms of a hit: the same one
    KN_GUARD_TRIPPED
} kn_guard_result;
void kn_guard_init(kn_guard *g, double most_n_per_ms); // 0 = 4 N/ms; forgets its hits
void kn_guard_age(kn_guard *g, int ticks);             // of 1 ms, that have gone by
// force_n: the last one that got through, since which it may have changed by allowed_n, most_n_per_ms of every ms; becomes
// asked_n, or what of it may be given. TRIPPED leaves it.
kn_guard_result kn_guard_pass(kn_guard *g, const double asked_n[3], double allowed_n, double force_n[3]);

typedef struct kn_safety {         // one probe's; plain data, part of the servo's state
    kn_safety_limits limits, next; // in force; to come into force when nothing is felt
    bool relimiting;               // they have not yet
    double gain;                   // 0..1
    double gain_drop;              // how far it came down in this tick
    double force_n[3]; // last scaled contact force past the guard, before clamp and gain; frozen if not rendering
    double torque_n_m[3];
    double brake_n[3]; // damping force that stands in for contact above brake_m_s
    kn_guard guard;
    int silent_ms;  // since the last fresh pose
    int flowing_ms; // since the first pose after a silence of zero_ms; stops counting at flow_ms
    int gap_ms;     // since force_n was last renewed
    bool attached;  // the probe is in the model
    bool latched;   // fault stands until its way back is taken; false while a silence is only fading
    bool braking;
    bool yielding;                  // to a change of the physics or a clutch: the force fades to 0 and then comes back
    bool rejoining;                 // force_n was frozen longer than hold_ms and walks back to the contact's
    bool nonfinite;                 // that fault stands, or an emergency stop stands over it; until reset
    kn_fault fault;                 // why the force is latched or fading
    int64_t clamps, guards, faults; // counters since init
    int64_t slewed;                 // ticks in which a ramp or a slope held the force back; in no snapshot, as the next
    int64_t brakes;                 // ticks of braking
    int64_t tripped[KN_FAULTS];     // of the faults, by kn_fault
} kn_safety;

typedef struct kn_safety_in {
    bool live;     // a session owns the probe
    bool opened;   // its first tick
    bool fresh;    // a new pose arrived for this tick
    bool clear;    // the pose is clear of the object; looked at only while the probe is not attached
    bool leaving;  // the last pose was the session's last: the force fades as in a silence, and no fault is latched
    bool stop;     // the server is stopping: ramp down and latch
    bool reset;    // the object is as new: the probe leaves the model at once, the force it gave fades
    bool recover;  // operator's: a latched fault but NONFINITE is forgotten, one under an ESTOP stands again; the probe
                   // leaves the model
    bool overload; // ticks go on taking longer than the time between them: fade and latch, whoever holds the probe
    bool estop;    // operator's: fade and latch, whoever holds the probe
    bool clutch;   // the hand lets go of the tool to move: what it feels fades and stays 0 meanwhile, the probe stays
    bool change;   // the physics is another from this tick on: what the hand feels goes through 0, the probe stays
    int elapsed_ms;         // 1 + missed cycles: time since the last tick
    double velocity_m_s[3]; // of the tool
} kn_safety_in;

// Fills zero fields of limits with defaults and starts without a fault, detached, gain 0.
void kn_safety_init(kn_safety *s, const kn_safety_limits *limits);
double kn_safety_slope(const kn_safety_limits *limits); // N/ms, limits with defaults filled in

// Other limits while it runs: what is felt fades under those that it rose under (say `change`, too), and comes back
// under these. Whether they only lower what a hand may feel is the caller's to know: kn_safety_raised.
void kn_safety_relimit(kn_safety *s, const kn_safety_limits *limits);
// The first that allows more than `than` does: a higher force, a steeper one, for longer without poses. NULL: none.
const char *kn_safety_raised(const kn_safety_limits *limits, const kn_safety_limits *than);

// Before the step: advances watchdog, latch and gain by elapsed_ms. Returns whether the probe is in the model this
// tick. A probe enters the model only clear of the object; it leaves it when the gain has come down to 0 for good.
bool kn_safety_watch(kn_safety *s, const kn_safety_in *in);

// After the step: what the hand is given. force and torque are the contact's. Returns KN_FLAG_* bits of this tick.
// A non-finite number never gets through: it latches NONFINITE and the last good force fades in its place.
int kn_safety_filter(kn_safety *s, const kn_safety_in *in, const double force_n[3], const double torque_n_m[3],
                     double out_force_n[3], double out_torque_n_m[3]);

// Latches a fault from outside (ESTOP, diverged physics): the force fades from the next watch on.
void kn_safety_trip(kn_safety *s, kn_fault fault);

// The device's own watchdog, since a killed server cannot ramp anything down: the last force is held for hold_ms after
// its message, is zero by zero_ms, and stays zero until rearmed. A message that comes in between is ramped in again.
typedef struct kn_watchdog {
    int hold_ms, zero_ms;
    int silent_ms;
    double factor;
    bool armed; // a message has come since init or rearm
    bool tripped;
    int64_t trips;
} kn_watchdog;
void kn_watchdog_init(kn_watchdog *w, int hold_ms, int zero_ms); // 0 = 3 and 20
// Called every ms. Factor 0..1 that multiplies the last received force.
double kn_watchdog_tick(kn_watchdog *w, bool fresh, int elapsed_ms);
void kn_watchdog_rearm(kn_watchdog *w);

#endif
