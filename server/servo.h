#ifndef KN_SERVER_SERVO_H
#define KN_SERVER_SERVO_H
// The servo tick as a pure function, without clock, thread or socket. The daemon, `knead replay`, tests and bench all
// run this code. servo.c holds the servo's state, servo_tick.c the tick, and operator_orders.c the orders in a tick.
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
//   - After KN_OVER_TICKS consecutive ticks above the scene's budget_s, the next tick takes the next lower quality
//     point, that is, a cheaper solver effort that the scene names. The servo never returns to a higher quality point
//     by itself.
//   - When ticks keep taking longer than a millisecond, the force on the hand fades, with FAULT_OVERLOAD as the reason.
#include "core/lattice/measure.h"
#include "core/safety.h"
#include "core/scene/scene.h"
#include "server/backend/backend.h"
#include "server/scene_change.h"
#include "server/team.h"
#include <stdint.h>

// A validated pose: finite, unit quaternion, in the workspace, newer than the session's previous pose.
typedef struct kn_pose {
    int64_t session, seq, sent_ns, utime;
    double position_m[3], orientation_wxyz[4], velocity_m_s[3];
    int32_t buttons;
} kn_pose;

// Bits of kn_pose.buttons.
#define KN_BUTTON_CLUTCH 1          // while this button is held, the device moves and the tool stays
#define KN_BUTTON_GRIP 2            // the object sticks to the tool, up to the probe's grip force
#define KN_BUTTON_LEAVING (1 << 30) // not a button: this pose is the session's last

// The clutch of a probe lets a device reach a scene that is larger than the device's workspace. While the clutch is
// held, the hand moves and the tool stays. Afterwards the tool is offset from the device by the hand's motion. The
// force on the hand fades while the clutch is held (core/safety.h).
typedef struct kn_clutch {
    bool held;
    // offset_m: translation from the device's pose to the tool's pose; turn_wxyz: rotation
    double offset_m[3], turn_wxyz[4];
    double stays_m[3], stays_wxyz[4]; // position and orientation of the tool while the clutch is held
} kn_clutch;

// Number of consecutive slow ticks before the servo reduces its work. Delays caused by the machine make one or two
// ticks slow; ten slow ticks in a row mean too much work.
#define KN_OVER_TICKS 10
// An overload is a run of at least KN_OVER_TICKS ticks, each above 1 ms, that together took this long, ns.
#define KN_OVERLOAD_NS INT64_C(100000000)

// Fraction of the scene's time budget (budget_s) that a step may take. The rest is for work that is not counted in
// units of work (core/solve/step_effort.h), and for delays by a busy hyperthread.
#define KN_STEP_SHARE 0.7

// Reason why a tick changes to another quality point (a solver effort that the scene names).
typedef enum kn_quality_cause {
    KN_QUALITY_CAUSE_NONE,
    KN_QUALITY_CAUSE_COMMAND, // an operator chose the quality point; kn_servo.asked is set to this point, too
    KN_QUALITY_CAUSE_BUDGET   // in a replay: the recorded server exceeded its time budget and chose this quality point
} kn_quality_cause;

// Input of one tick. The servo applies reset, restore, undo and change in this order, before the step.
typedef struct kn_tick_in {
    int64_t tick;   // number of the tick on the 1 ms grid
    int32_t missed; // number of 1 ms cycles skipped just before this tick
    bool stop;      // true: fade every force to zero, because the server is shutting down
    bool reset;     // true: return the object to its initial state and detach the probes
    // State that replaces the object; the probes are detached; NULL: no replacement.
    const kn_state *restore;
    // Generation and tick of the snapshot that holds `restore`; recorded in the event.
    int64_t restored_generation, restored_tick;
    bool undo;               // true: replace the object by the newest undo point (servo->undo), if there is one
    kn_scene_change *change; // change of the scene; the object continues in the change's model; NULL: no change
    bool recover;            // true: clear latched faults (an operator's command)
    bool estop;              // true: an operator's emergency stop (see kn_safety_in)
    // Largest number of units of work (core/solve/step_effort.h) per step, from this tick on; 0: unchanged.
    int64_t deadline;
    // In a replay: 1: the recorded overload begins; -1: the recorded overload ends; 0: unchanged.
    int overload;
    kn_quality_cause take;
    kn_quality quality; // new quality point; its kn_point.live must be set; not read if `take` is KN_QUALITY_CAUSE_NONE
    bool held;          // in a replay: the recorded force of this tick is that of an earlier tick (FLAG_HELD)
    // Time from the start of the last tick until its forces were ready, ns; 0: no clock, so ticks are not judged by
    // time.
    int64_t execution_ns;
    int64_t (*now_ns)(void); // CLOCK_MONOTONIC, for time stamps in kn_tick_out; NULL: no clock
    // Time (CLOCK_MONOTONIC) by which the backend must answer, ns. If the backend is late, the answer of the last tick
    // is used. 0: no limit.
    int64_t deadline_ns;
    // Latest pose of each probe; NULL: no session (none yet, left, or silent for 1 s).
    const kn_pose *pose[KN_PROBES_MAX];
    bool fresh[KN_PROBES_MAX]; // true if no earlier tick has used this probe's pose
} kn_tick_in;

typedef struct kn_force { // answer to one probe: all fields of the message contact_force_t except its times
    bool live;            // true: the probe has a session
    // True: end the session, because it has sent its last pose, the force is 0 and the tool no longer acts on the
    // object.
    bool left;
    int64_t session, seq, sent_ns;
    double contact_force_n[3], contact_torque_n_m[3];
    double force_n[3], torque_n_m[3];
    double proxy_position_m[3], proxy_orientation_wxyz[4];
    double gain, energy_j, residual;
    int32_t contacts, flags, fault;
} kn_force;

// Largest number of events in one tick: 4 probes x (END, OPEN, DETACH, ATTACH, FAULT), and 12 events without a probe.
#define KN_EVENTS_PER_TICK 32
typedef struct kn_event {
    int64_t tick, session;
    // Hash of the object's state before this tick's step; 0: not computed, because the step itself caused the FAULT.
    uint64_t state_hash;
    double arg[8];       // meaning depends on `kind`, see proto/REFERENCE.md
    int32_t kind, probe; // `kind`: KIND_* of event_t; `probe`: index of the probe in the scene, -1: no probe
} kn_event;

typedef struct kn_tick_out {
    int64_t tick;
    int32_t missed;
    int probes;
    kn_force force[KN_PROBES_MAX];
    bool local; // true: the backend identifies local contact models, and sets `contact` for each probe with a session
    int event_count;
    kn_event event[KN_EVENTS_PER_TICK];
    int64_t stepped_ns; // time at which the backend answered (CLOCK_MONOTONIC, ns); 0: no clock
    int64_t units;      // number of units of work (core/solve/step_effort.h) that the step took
    // True if the solver stopped at its iteration cap or its deadline, before it met its tolerance.
    bool capped;
    bool replaced;            // true: a reset, restore or undo replaced the object
    kn_scene_change *changed; // change of the scene that this tick applied; NULL: none
    uint64_t restored_hash;   // hash of the object's state after a restore or an undo; 0: this tick did neither
    bool stopped;             // true if the server is stopping and every gain is zero, so the loop may end
    // Local contact models. Only the first contact_count contact units of a probe are set, and at least the first one.
    kn_contact_unit contact[KN_PROBES_MAX][KN_CONTACT_UNITS];
} kn_tick_out;

typedef struct kn_servo { // state of the servo; plain data apart from the pointers
    // Scene being served; a change of the scene replaces the fields scene, model, backend, settings and audit.
    const kn_scene *scene;
    const kn_model *model;
    kn_backend *backend;
    const kn_settings *settings; // settings that override those of the scene at the start; NULL: none
    const kn_audit_news *audit;  // energy audit, reported by checkpoint events; NULL: no audit
    kn_helper *helper;           // second thread of a step; NULL: none
    const kn_state *settled;     // state of the object at the start and after a reset; NULL: the undeformed one
    bool untouched;              // the object is the settled one, which stays as it is until a tool acts on it
    struct kn_undo *undo;        // undo points of the object; NULL: undo is not available
    kn_safety safety[KN_PROBES_MAX];
    kn_pose last[KN_PROBES_MAX]; // last pose of each probe that a tick used; session 0: none
    kn_pose tool[KN_PROBES_MAX]; // pose of each tool: the pose in `last` moved by the probe's clutch
    kn_clutch clutch[KN_PROBES_MAX];
    int64_t deadline; // number of units of work that a step may take; 0: no deadline
    int64_t slow_ns;  // total duration of the latest run of consecutive ticks longer than 1 ms, ns
    int slow;         // number of ticks summed in slow_ns, counted up to KN_OVER_TICKS
    bool overloaded;  // true after slow_ns reached KN_OVERLOAD_NS; no tool acts on the object during an overload
    double force_n[KN_PROBES_MAX][3], torque_n_m[KN_PROBES_MAX][3]; // contact of the last tick that was not held
    bool lost;  // the backend has lost its circuit in the last tick, and has put the object back to an older state
    bool still; // the object stands still until a lost circuit is back; no tool may begin to act on it
    // Number of ticks since kn_servo_init. The fields capped, late and diverged count since kn_servo_init as well.
    int64_t ticks;
    int64_t capped;     // number of steps that stopped at the solver's iteration cap or its deadline
    int64_t late;       // number of ticks in which the backend missed its deadline
    int64_t diverged;   // number of ticks in which the physics gave non-finite numbers
    int32_t generation; // generation of the object: number of resets, restores and undos
    // `quality`: quality point in use; `asked`: quality point that the scene or an operator requested
    kn_quality quality, asked;
    int over;       // number of consecutive ticks above the time budget, counted up to KN_OVER_TICKS
    bool exhausted; // true if no lower quality point exists and an event has recorded this
    bool stopping;
    bool estopped; // true: an operator's emergency stop is in force; kept here for other modules to read
} kn_servo;

// Working data of one tick. kn_servo_tick creates it; the orders (operator_orders.h) act on it.
typedef struct kn_tick {
    kn_servo *servo;
    const kn_tick_in *in;
    kn_tick_out *out;
    kn_safety_in watch[KN_PROBES_MAX];
    kn_input input;
    kn_output output;
    kn_fault fault[KN_PROBES_MAX]; // latched fault before the step
    bool stepped, diverged;
    bool shadowed; // true: the circuit was late or not in step, and its twin's result is used
    bool held;     // true: the circuit was late, and the output is that of an earlier tick
    bool change;   // true: the solver effort or the material changes in this tick, so forces fade to 0 and return
    bool hashed;
    uint64_t hash; // state hash before the step, taken when the first event needs it
} kn_tick;

// Start a servo for an untouched object, which the backend holds. The first tick may have any number. `scene`, `model`,
// `backend` and every change that a tick applies must outlive the servo.
void kn_servo_init(kn_servo *servo, const kn_scene *scene, const kn_model *model, kn_backend *backend);

// Let the servo begin with this state, which must outlive the servo; NULL: the undeformed one, which the backend holds.
void kn_servo_begin(kn_servo *servo, const kn_state *settled);

// Reset the clutch to no offset, for a new session.
void kn_clutch_open(kn_clutch *clutch);
// Compute the pose of the tool from the pose of the device.
void kn_clutch_move(kn_clutch *clutch, const kn_pose *device, kn_pose *tool);

// Return whether effort `a` is cheaper than `b`: at least one of the two iteration limits (smallest, largest number of
// iterations) is lower in `a`, and neither is higher. A server that exceeds its time budget changes only to a cheaper
// quality point.
bool kn_servo_cheaper(const kn_effort *a, const kn_effort *b);

// Append an event to the output of a tick, with the hash of the object's state before the step. The caller may fill in
// the event's arguments.
kn_event *kn_tick_event(kn_tick *t, int kind, int probe);

// Run one tick (servo_tick.c). Real-time safe: no allocation, lock or I/O.
void kn_servo_tick(kn_servo *servo, const kn_tick_in *in, kn_tick_out *out);

#endif
