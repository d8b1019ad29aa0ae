#ifndef KN_CORE_SAFETY_H
#define KN_CORE_SAFETY_H
// The output stage between the physics and a hand, with a watchdog over the poses of the hand. The functions are pure:
// they have no clock, and count time in ticks of 1 ms. All are real-time safe. The structs are plain data of the
// caller. The server runs one output stage per probe. Every client that drives a device runs kn_watchdog on the forces
// that it receives.
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
// A transition (fading out, coming back) ramps the gain. No transition limits the rate of a contact force: a rate
// limiter in the contact loop is negative damping and causes limit cycles. While the hand does not feel live contact,
// its force changes by at most
//     kn_safety_slope(limits) = max(0.5 N, clamp / 17) per ms.
// This holds because the force that fades is the last force given, frozen, and not the present contact force. In live
// contact, the force changes by at most guard_n_per_ms for each ms since the last tick with a pose, but for at most
// hold_ms and 3 ms. By default this is 4 N, or 12 N after 3 ms without a pose or a tick.
#include <stdbool.h>
#include <stdint.h>

typedef struct kn_safety_limits { // the scene's `device:` profile; a field of 0 takes its default
    double clamp_n;               // limit of |force|; default 3.3 N, the limit of the smallest common desktop devices
    double torque_clamp_n_m;      // limit of |torque|; default clamp_n * 0.05 m
    double guard_n_per_ms;        // impulse guard; default 4 N/ms, which no first touch at up to 1 m/s reaches
    double brake_m_s;             // above this speed the hand feels only damping, no contact; default 1.2 m/s
    double brake_n_s_per_m;       // damping that a hand faster than brake_m_s feels; default 1.5 N s/m
    // ratio of the hand's force to the object's, applied before guard and clamp; default 1
    double force_scale;
    int hold_ms;    // the last force is held for at most this long without a pose; default 3
    int zero_ms;    // time from the last pose until the force is zero; default 20
    int ramp_up_ms; // time in which the gain rises from 0 to 1; default and least value 200
    // time for which poses must arrive without a gap before the tool may engage; default 200
    int flow_ms;
} kn_safety_limits;

// Flags of a force. KN_FLAG_* and KN_FAULT_* have the same numbers as FLAG_* and FAULT_* of contact_force_t.
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
// A fault replaces the faults above it in this list. But OVERLOAD replaces no fault, and all others replace OVERLOAD.
typedef enum kn_fault {
    KN_FAULT_NONE,
    KN_FAULT_POSE_SILENCE, // no poses arrived; cleared when the tool is lifted, by a new session or by recover
    KN_FAULT_IMPULSE,      // the impulse guard tripped; cleared by a new session or by recover
    KN_FAULT_NONFINITE,    // a force was not finite; cleared by a reset of the object
    KN_FAULT_ESTOP,        // emergency stop by an operator; cleared by recover
    KN_FAULT_STOPPING,     // the server is stopping; never cleared
    KN_FAULT_OVERLOAD // poses arrived, but the server's ticks were late; cleared by the same events as POSE_SILENCE
} kn_fault;
#define KN_FAULTS (KN_FAULT_OVERLOAD + 1)

const char *kn_fault_name(kn_fault fault);   // static name for users, e.g. "pose silence"
const char *kn_fault_remedy(kn_fault fault); // static text that tells a user how to clear the fault

// The impulse guard limits the change of a force that goes to a hand. In normal use the guard never acts. A change
// above the limit is a hit: it is cut to the limit and counted. The guard trips on three hits in 20 ticks, on two hits
// in opposite directions, or on one change above twice the limit. In these cases the physics chatters or a message is
// corrupt, and the caller should let the last good force fade.
typedef struct kn_guard {
    double most_n_per_ms; // limit of the change of the force per ms
    double step_n[3];     // change of the force that was requested at the last hit [N]
    int age[2];           // [0]: number of ticks since the last hit, at most 20; [1]: since the hit before it
} kn_guard;
typedef enum kn_guard_result {
    KN_GUARD_FREE,    // the change of the force is allowed
    KN_GUARD_LIMITED, // the change of the force was cut to the allowed change: a new hit
    KN_GUARD_GOES_ON, // the change was cut again in the ms of the last hit: no new hit
    KN_GUARD_TRIPPED  // the guard tripped: the force must fade
} kn_guard_result;
void kn_guard_init(kn_guard *g, double most_n_per_ms); // set the limit (4 N/ms if it is 0), forget all hits
void kn_guard_age(kn_guard *g, int ticks);             // let `ticks` ticks of 1 ms pass
// Pass a force through the guard. Before the call, force_n is the last force that got through. After the call, force_n
// is asked_n, or as near to asked_n as the allowed change permits. allowed_n is the allowed change, N: most_n_per_ms
// times the number of ms since the last force. If the guard trips, force_n stays unchanged.
kn_guard_result kn_guard_pass(kn_guard *g, const double asked_n[3], double allowed_n, double force_n[3]);

typedef struct kn_safety { // state of the output stage of one probe
    // limits: limits in use; next: new limits, which come into use when the hand feels no force
    kn_safety_limits limits, next;
    bool relimiting;  // the limits in `next` wait to come into use
    double gain;      // factor of the force, 0..1
    double gain_drop; // decrease of the gain in this tick
    // contact force at the scale of the hand, after the guard, before clamp and gain; stays unchanged while the contact
    // is not live
    double force_n[3];
    double torque_n_m[3];
    double brake_n[3]; // damping force that replaces the contact force of a hand faster than brake_m_s
    kn_guard guard;
    int silent_ms;  // time since the last fresh pose
    int flowing_ms; // time since the first pose after a silence of zero_ms; stops counting at flow_ms
    int gap_ms;     // time since force_n was last set to a contact force
    bool attached;  // the probe is in the model, so it can touch the simulated object
    // latched: `fault` stays until a command or the hand clears it. It is false while a short pose silence only fades
    // the force.
    bool latched;
    bool braking;   // the hand is too fast and feels only damping
    bool yielding;  // the force fades to 0 because the physics changes or the hand holds the clutch
    bool rejoining; // force_n was frozen longer than hold_ms and approaches the contact force
    bool nonfinite; // NONFINITE is latched, or is hidden by an ESTOP; true until the object is reset
    kn_fault fault; // reason why the force is latched or fading
    // counts since init: ticks in which the clamp acted, ticks in which the guard acted, faults
    int64_t clamps, guards, faults;
    int64_t slewed; // ticks in which a gain below 1 or the limit on its slope changed the force; not in snapshots
    int64_t brakes; // number of ticks with braking; not in snapshots
    int64_t tripped[KN_FAULTS]; // number of faults of each kind, indexed by kn_fault
} kn_safety;

typedef struct kn_safety_in {
    bool live;    // the session of a client owns the probe
    bool opened;  // this is the first tick of the session
    bool fresh;   // a new pose arrived for this tick
    bool clear;   // the pose does not touch the object; read only while the probe is not attached
    bool leaving; // the last pose was the session's last: the force fades as in a silence, and no fault is latched
    bool stop;    // the server is stopping: ramp down and latch
    bool reset;   // the object was reset: the probe leaves the model at once, and its last force fades
    // The operator's command `recover`: clear a latched fault other than NONFINITE and STOPPING, and take the probe out
    // of the model. If an ESTOP hid a NONFINITE, the NONFINITE is latched again.
    bool recover;
    bool overload; // ticks keep taking longer than their period: the force fades and a fault is latched
    bool estop;    // emergency stop by an operator: the force fades and a fault is latched, with or without a session
    bool clutch;   // the clutch is held, so the tool stays while the device moves: the force fades to 0
    // the physics changes in this tick: the felt force fades to 0 and comes back, and the probe stays attached
    bool change;
    int elapsed_ms;         // time since the last tick: 1 + number of missed ticks
    double velocity_m_s[3]; // velocity of the tool
} kn_safety_in;

// Start the stage: detached, gain 0, no fault. Limits of 0 get their defaults.
void kn_safety_init(kn_safety *s, const kn_safety_limits *limits);
// Return the largest change of the force while the hand feels no live contact [N/ms]. This function does not replace
// limits of 0 by their defaults: pass kn_safety.limits.
double kn_safety_slope(const kn_safety_limits *limits);

// Change the limits while the stage runs. The felt force fades under the old limits and comes back under the new ones,
// if the caller also sets kn_safety_in.change. kn_safety_raised tells the caller whether the new limits allow more.
void kn_safety_relimit(kn_safety *s, const kn_safety_limits *limits);
// Return the scene key of the first limit in `limits` that allows more than its value in `than`: a higher force, a
// steeper force, or a longer time without poses. Return NULL if there is none.
const char *kn_safety_raised(const kn_safety_limits *limits, const kn_safety_limits *than);

// Advance watchdog, latch and gain by elapsed_ms. Call before the step of the lattice. Return true if the probe is in
// the model in this tick. A probe enters the model only when it does not touch the object. After a fault, the probe
// leaves the model when the gain has fallen to 0.
bool kn_safety_watch(kn_safety *s, const kn_safety_in *in);

// Compute the force [N] and torque [N m] for the hand from those of the contact. Call after the step of the lattice.
// Return the KN_FLAG_* bits of this tick. A non-finite number never gets through: it latches NONFINITE, and the last
// good force fades.
int kn_safety_filter(kn_safety *s, const kn_safety_in *in, const double force_n[3], const double torque_n_m[3],
                     double out_force_n[3], double out_torque_n_m[3]);

// Latch a fault that another module has found (ESTOP, diverged physics). The force fades from the next kn_safety_watch
// on.
void kn_safety_trip(kn_safety *s, kn_fault fault);

// The watchdog of a client that drives a device. It is needed because a killed server cannot ramp down its force. If
// messages stop, the client holds the last force for hold_ms. Then the force fades, is zero at zero_ms, and stays zero
// until kn_watchdog_rearm. If messages arrive again before zero_ms, a ramp brings the force back.
typedef struct kn_watchdog {
    // hold_ms: time without a message until the force fades; zero_ms: time until the force is zero
    int hold_ms, zero_ms;
    int silent_ms; // time since the last message
    double factor; // factor 0..1 for the last received force
    bool armed;    // a message has arrived since kn_watchdog_init or kn_watchdog_rearm
    bool tripped;  // messages were missing for zero_ms: the force stays zero until kn_watchdog_rearm
    int64_t trips; // number of times that the watchdog has tripped
} kn_watchdog;
void kn_watchdog_init(kn_watchdog *w, int hold_ms, int zero_ms); // defaults if 0: hold_ms 3 ms, zero_ms hold_ms + 17 ms
// Call every ms. `fresh`: a message has arrived since the last call. elapsed_ms: time since the last call. Return the
// factor 0..1 by which to multiply the last received force.
double kn_watchdog_tick(kn_watchdog *w, bool fresh, int elapsed_ms);
void kn_watchdog_rearm(kn_watchdog *w); // end a trip: the next message arms the watchdog again

#endif
