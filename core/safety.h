#ifndef KN_CORE_SAFETY_H
#define KN_CORE_SAFETY_H
// The output stage between physics and a hand, and the watch over the poses that feed it. Pure: time comes in as ticks of
// 1 ms. The server runs one per probe; every client that drives a device runs kn_watchdog on the forces it receives.
//
//     pose --> kn_safety_watch --> [ lattice step, if attached ] --> kn_safety_filter --> force
//              silence, speed,                                       finite -> impulse guard -> clamp -> gain
//              ramp, latch
#include <stdbool.h>
#include <stdint.h>

typedef struct kn_safety_limits { // the scene's `device:` profile; 0 in a field = its default
    double clamp_n;          // default 3.3 N; profile bench 40 N. |force| never exceeds it
    double torque_clamp_n_m; // default clamp_n * 0.05 m
    double guard_n_per_ms;   // default 4 N/ms: impulse guard of one tick
    double brake_m_s;        // default 1.2 m/s: faster, the hand is only damped
    double brake_n_s_per_m;  // default 1.5 N s/m: that damping
    int hold_ms;             // default 3: the last force may stand this long without a pose
    int zero_ms;             // default 20: force is zero this long after the last pose
    int ramp_up_ms;          // default 200, never less
    int flow_ms;             // default 200: poses must have flowed this long before a re-engagement
} kn_safety_limits;

// Same numbers as contact_force_t's FLAG_* and FAULT_* (the server asserts it).
enum {
    KN_FLAG_ENGAGED = 1, KN_FLAG_RAMPING = 2, KN_FLAG_LATCHED = 4, KN_FLAG_REENGAGE_LIFT = 8, KN_FLAG_CLAMPED = 16,
    KN_FLAG_GUARD = 32, KN_FLAG_BRAKE = 64, KN_FLAG_STALE = 128
};
typedef enum kn_fault {
    KN_FAULT_NONE, KN_FAULT_POSE_SILENCE, KN_FAULT_IMPULSE, KN_FAULT_NONFINITE, KN_FAULT_ESTOP, KN_FAULT_STOPPING
} kn_fault;

const char *kn_fault_name(kn_fault fault);   // "pose silence"
const char *kn_fault_remedy(kn_fault fault); // "lift the tool clear of the object"

typedef struct kn_safety { // one probe's; plain data, part of the servo's state
    kn_safety_limits limits;
    double gain, gain_slope; // slope per ms, signed
    double last_force_n[3];  // before the gain: what the guard compares with
    double hold_force_n[3];
    int silent_ms;   // since the last fresh pose
    int flowing_ms;  // since the first pose after a silence
    int attached;    // the probe is in the model
    int latched;
    int guard_hits[3]; // ages of the last hits, in ticks
    double guard_last_sign;
    kn_fault fault;
    int64_t clamps, guards, faults; // counters since init
} kn_safety;

typedef struct kn_safety_in {
    bool live;       // a session owns the probe
    bool fresh;      // a new pose arrived for this tick
    bool clear;      // that pose is clear of the object
    bool stop;       // the server is stopping: ramp down and latch
    bool recover;    // operator's recover command
    int elapsed_ms;  // 1 + missed cycles
    double speed_m_s;
    double velocity_m_s[3];
} kn_safety_in;

// Fills zero fields of limits with defaults and starts latched-free, detached, gain 0.
void kn_safety_init(kn_safety *s, const kn_safety_limits *limits);

// Before the step: advances watchdog, latch and gain ramp by elapsed_ms. Returns whether the probe is in the model this tick.
// A probe enters the model only clear of the object; it leaves it when the gain has come down to 0.
bool kn_safety_watch(kn_safety *s, const kn_safety_in *in);

// After the step: what the hand is given. force and torque are the contact's; out is zero when anything is not finite.
// Returns KN_FLAG_* bits of this tick.
int kn_safety_filter(kn_safety *s, const kn_safety_in *in, const double force_n[3], const double torque_n_m[3],
                     double out_force_n[3], double out_torque_n_m[3]);

// The device's own watchdog: hold <= hold_ms after the last message, zero by zero_ms, latched until rearmed.
typedef struct kn_watchdog {
    int hold_ms, zero_ms;
    int silent_ms;
    bool tripped;
    int64_t trips;
} kn_watchdog;
void kn_watchdog_init(kn_watchdog *w, int hold_ms, int zero_ms);
// Called every ms. Factor 0..1 that multiplies the last received force.
double kn_watchdog_tick(kn_watchdog *w, bool fresh, int elapsed_ms);
void kn_watchdog_rearm(kn_watchdog *w);

#endif
