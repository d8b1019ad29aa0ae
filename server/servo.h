#ifndef KN_SERVER_SERVO_H
#define KN_SERVER_SERVO_H
// The servo tick as a pure function, without clock, thread or socket. The daemon, `knead replay`, tests and bench all
// run this code.
//
//     read     which probes have a session, a fresh pose, a pose clear of the object? are ticks too slow?
//     watch    silence, ramps, latches: is each probe in the model?          (core/safety.h)
//     step     the lattice                                                   (backend)
//     guard    finite -> impulse guard -> clamp -> gain, per probe           (core/safety.h)
//     account  counters, events, histogram                                   (the caller publishes)
//
// A tick depends only on the state, the tick number, the missed cycles, the commands and the poses that the tick used.
// Each force record echoes the pose that its tick used. So a log with forces holds every input, and a replay gives the
// same bits.
//
// Two decisions depend on a clock. Each is also an event, so that a replay repeats it without a clock:
//   - After KN_OVER_TICKS ticks in a row above the scene's budget_s, the next tick takes the next lower point of
//     quality. The servo never returns to a higher point by itself.
//     (A point of quality is a solver effort that the scene names.)
//   - When ticks keep taking longer than a millisecond, the force on the hand fades, with FAULT_OVERLOAD as the reason.
#include "core/energy.h"
#include "core/safety.h"
#include "core/scene/scene.h"
#include "server/backend/backend.h"
#include "server/sets.h"
#include "server/undo.h"
#include <stdint.h>

typedef struct kn_pose { // a validated pose: finite, unit quaternion, in the workspace, newer than the last one
    int64_t session, seq, sent_ns, utime;
    double position_m[3], orientation_wxyz[4], velocity_m_s[3];
    int32_t buttons;
} kn_pose;

// Bits of kn_pose.buttons.
#define KN_BUTTON_CLUTCH 1          // the device moves, the tool stays
#define KN_BUTTON_GRIP 2            // the contact is tied to the tool, up to the probe's grip
#define KN_BUTTON_LEAVING (1 << 30) // not a button: this pose is the session's last

typedef struct kn_clutch { // a probe's clutch, see clutch.h
    bool held;
    double offset_m[3], turn_wxyz[4]; // from device to tool
    double stays_m[3], stays_wxyz[4]; // pose at which the tool stays while the clutch is held
} kn_clutch;

// Slow ticks in a row before the servo acts. Delays by the machine make one or two ticks slow; ten slow ticks in a row
// mean too much work.
#define KN_OVER_TICKS 10
// An overload is a run of at least KN_OVER_TICKS ticks, each above 1 ms, that together took this long, ns.
#define KN_OVERLOAD_NS INT64_C(100000000)

typedef enum kn_take { // why a tick changes to another point of quality (a solver effort of the scene)
    KN_TAKE_NONE,
    KN_TAKE_COMMAND, // an operator chose the point; kn_servo.asked follows
    KN_TAKE_BUDGET   // in a replay: the recorded server changed to it when it was over its budget
} kn_take;

// Input of one tick. The servo applies reset, restore, undo and change in this order, before the step.
typedef struct kn_tick_in {
    int64_t tick;                               // number on the 1 ms grid
    int32_t missed;                             // cycles skipped just before this tick
    bool stop;                                  // the server is shutting down: fade every force to zero
    bool reset;                                 // make the object as new and detach the probes
    const kn_state *restore;                    // replace the object by this state and detach the probes; NULL: no
    int64_t restored_generation, restored_tick; // of the snapshot that holds `restore`, for the event
    bool undo;                // replace the object by the newest undo point (servo->undo), if there is one
    struct kn_change *change; // continue the object in this change's model; NULL: no change
    bool recover, estop;      // an operator's commands, see kn_safety_in
    int64_t deadline;         // units of work of a step, at most, from this tick on (core/deadline.h); 0: unchanged
    int overload;             // in a replay: 1: the recorded overload begins; -1: it ends; 0: unchanged
    kn_take take;
    kn_quality quality;      // point of quality to change to unless `take` is KN_TAKE_NONE; kn_point.live must be set
    int64_t execution_ns;    // duration of the last tick up to its forces; 0: no clock, no judgement by time
    int64_t (*now_ns)(void); // CLOCK_MONOTONIC, for time stamps in kn_tick_out; NULL: no clock
    int64_t deadline_ns;     // CLOCK_MONOTONIC; a backend that is later than this repeats its last answer; 0: no limit
    // Latest pose of each probe; NULL: no session (none yet, left, or silent for 1 s).
    const kn_pose *pose[KN_PROBES_MAX];
    bool fresh[KN_PROBES_MAX]; // no earlier tick has used that pose
} kn_tick_in;

typedef struct kn_force { // answer to one probe: all fields of contact_force_t except its times
    bool live;            // the probe has a session
    bool left; // the session has sent its last pose, the force is 0 and the tool is out of the model: end the session
    int64_t session, seq, sent_ns;
    double contact_force_n[3], contact_torque_n_m[3];
    double force_n[3], torque_n_m[3];
    double proxy_position_m[3], proxy_orientation_wxyz[4];
    double gain, energy_j, residual;
    int32_t contacts, flags, fault;
} kn_force;

// Events of one tick at most: 4 probes x (END, OPEN, DETACH, ATTACH, FAULT), and 12 events without a probe.
#define KN_EVENTS_PER_TICK 32
typedef struct kn_event {
    int64_t tick, session;
    uint64_t state_hash; // hash of the state before this tick's step; 0: not computed (a FAULT found after the step)
    double arg[8];       // meaning depends on `kind`, see proto/README.md
    int32_t kind, probe; // kind: KIND_* of event_t; probe: index in the scene, -1: none
} kn_event;

typedef struct kn_tick_out {
    int64_t tick;
    int32_t missed;
    int probes;
    kn_force force[KN_PROBES_MAX];
    bool local; // the backend identifies local contact models: `contact` is set for each probe with a session
    int event_count;
    kn_event event[KN_EVENTS_PER_TICK];
    int64_t stepped_ns;        // time of the backend's answer, CLOCK_MONOTONIC; 0: no clock
    int64_t units;             // units of work that the step took (core/deadline.h)
    bool capped;               // the solver stopped at its iteration cap or its deadline
    bool replaced;             // a reset, restore or undo replaced the object
    struct kn_change *changed; // change taken in this tick; NULL: none
    uint64_t restored_hash;    // hash of the object after a restore or an undo; 0: neither
    bool stopped;              // the server is stopping and every gain is zero: the loop may end
    // Local contact models. Only the first contact_count contact units of a probe are set, and at least the first one.
    kn_contact_unit contact[KN_PROBES_MAX][KN_CONTACT_UNITS];
} kn_tick_out;

typedef struct kn_servo {  // state of the servo; plain data apart from the pointers
    const kn_scene *scene; // a change replaces scene, model, backend, sets and audit
    const kn_model *model;
    kn_backend *backend;
    const kn_sets *sets;        // settings that override those of the scene at the start; NULL: none
    const kn_audit_news *audit; // energy audit, reported by checkpoint events; NULL: no audit
    kn_undo *undo;              // NULL: nothing can be undone
    kn_safety safety[KN_PROBES_MAX];
    kn_pose last[KN_PROBES_MAX]; // last pose used; session 0: none
    kn_pose tool[KN_PROBES_MAX]; // the tool's pose for `last`, after the clutch
    kn_clutch clutch[KN_PROBES_MAX];
    int64_t deadline;          // units of work that a step may take; 0: no deadline
    int64_t slow_ns;           // sum of the times of the latest ticks in a row that took longer than 1 ms
    int slow;                  // number of ticks in slow_ns, at most KN_OVER_TICKS
    bool overloaded;           // slow_ns reached KN_OVERLOAD_NS: no tool is in the model
    int64_t ticks;             // ticks since init; the next three counters also count since init
    int64_t capped;            // steps that stopped at the solver's iteration cap or the deadline
    int64_t late;              // ticks in which the backend missed its deadline
    int64_t diverged;          // ticks in which the physics gave non-finite numbers
    int32_t generation;        // of the object: counts resets, restores and undos
    kn_quality quality, asked; // quality in use; quality that the scene or an operator asked for
    int over;                  // latest ticks in a row above the budget, at most KN_OVER_TICKS
    bool exhausted;            // there is no lower point of quality, and an event has recorded this
    bool stopping;
    bool estopped; // an operator's emergency stop is in force; stored for other modules only
} kn_servo;

// Start a servo for an untouched object, which the backend holds. Ticks may begin at any number. Borrows scene, model
// and backend, and every change that a tick takes.
void kn_servo_init(kn_servo *servo, const kn_scene *scene, const kn_model *model, kn_backend *backend);

// Return whether effort `a` is cheaper than `b`: the smallest or the largest number of iterations of `a` is below that
// of `b`, and neither is above. A server over its budget changes only to a cheaper point.
bool kn_servo_cheaper(const kn_effort *a, const kn_effort *b);

// Run one tick. Real-time safe: no allocation, lock or I/O.
void kn_servo_tick(kn_servo *servo, const kn_tick_in *in, kn_tick_out *out);

#endif
