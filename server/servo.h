#ifndef KN_SERVER_SERVO_H
#define KN_SERVER_SERVO_H
// The tick as a pure function: no clock, thread or socket, so the daemon, `knead replay`, tests and bench run the same.
//
//     read     which probes have a session, a fresh pose, a pose clear of the object; is the time enough?
//     watch    silence, ramps, latches: is each probe in the model?          (core/safety.h)
//     step     the lattice                                                   (backend)
//     guard    finite -> impulse guard -> clamp -> gain, per probe           (core/safety.h)
//     account  counters, events, histogram                                   (the caller publishes)
//
// A tick is a function of (state, tick number, missed cycles, the poses it used) and nothing else: a log that holds the
// forces holds, by their echoes, all of these, and replays to the bit. Two things depend on a clock: KN_OVER_TICKS
// ticks running that took longer than the scene's budget_s make the next one take the next lower point of quality. That
// tick says so in an event, by which a replay does the same without a clock. No point is taken back by itself. The same
// holds for ticks that go on taking longer than a millisecond: what the hand feels fades, and the fault says why.
#include "core/energy.h"
#include "core/safety.h"
#include "core/scene/scene.h"
#include "server/backend/backend.h"
#include "server/sets.h"
#include "server/undo.h"
#include <stdint.h>

typedef struct kn_pose { // a validated pose: finite, unit quaternion, inside the workspace, newer than the last one
    int64_t session, seq, sent_ns, utime;
    double position_m[3], orientation_wxyz[4], velocity_m_s[3];
    int32_t buttons;
} kn_pose;

#define KN_BUTTON_CLUTCH 1          // bits of buttons: the device moves, the tool stays
#define KN_BUTTON_GRIP 2            // the contact is tied to the tool, up to the probe's grip
#define KN_BUTTON_LEAVING (1 << 30) // no button: this pose is the session's last

typedef struct kn_clutch { // see clutch.h
    bool held;
    double offset_m[3], turn_wxyz[4]; // from device to tool
    double stays_m[3], stays_wxyz[4]; // while held: where the tool does
} kn_clutch;

#define KN_OVER_TICKS 10                  // a slow tick or two are the machine's; ten running are too much work for it
#define KN_OVERLOAD_NS INT64_C(100000000) // that so many ticks running, each above its millisecond, must last in all

typedef enum kn_take { // whether a tick is to take a point of quality
    KN_TAKE_NONE,
    KN_TAKE_COMMAND, // an operator's, which becomes the point asked for
    KN_TAKE_BUDGET   // a log's: what was over its budget there
} kn_take;

typedef struct kn_tick_in {
    int64_t tick;            // on the 1 ms grid
    int32_t missed;          // cycles skipped just before this tick
    bool stop;               // shutting down: ramp to zero
    bool reset;              // before this tick: object as new, probes detached
    const kn_state *restore; // before this tick, after a reset: object as in that, probes detached; NULL: no
    int64_t restored_generation, restored_tick; // of the snapshot that it is from, told by the event
    bool undo;                                  // the same of the newest point of servo->undo, if there is one
    struct kn_change *change; // before this tick, after all these: the object goes on in that one's model; NULL: no
    bool recover, estop;      // an operator's, see kn_safety_in
    int64_t deadline;         // units that a step may take from this tick on (core/deadline.h); 0: as before
    int overload;             // a log's: 1, from this tick on ticks took too long there; -1, no longer; 0: as before
    kn_take take;
    kn_quality quality;      // to take; one of the scene's live points
    int64_t execution_ns;    // of the last tick, read to publish; 0: no clock, nothing is judged by it
    int64_t (*now_ns)(void); // CLOCK_MONOTONIC, for stamps in out; NULL: no clock
    int64_t deadline_ns;     // CLOCK_MONOTONIC: by then the backend answers or its last answer stands; 0: no clock
    const kn_pose
        *pose[KN_PROBES_MAX];  // the latest pose of each probe, NULL: no session (none yet, left, or silent for 1 s)
    bool fresh[KN_PROBES_MAX]; // that pose was not used by an earlier tick
} kn_tick_in;

typedef struct kn_force { // one probe's answer; everything contact_force_t needs but the clocks
    bool live;            // there is a session to answer
    bool left; // the session has sent its last pose, its force is 0, its tool is out of the model: it may end
    int64_t session, seq, sent_ns;
    double contact_force_n[3], contact_torque_n_m[3];
    double force_n[3], torque_n_m[3];
    double proxy_position_m[3], proxy_orientation_wxyz[4];
    double gain, energy_j, residual;
    int32_t contacts, flags, fault;
} kn_force;

#define KN_EVENTS_PER_TICK 32 // enough: 4 probes x (END, OPEN, DETACH, ATTACH, FAULT) and 12 of the tick itself
typedef struct kn_event {
    int64_t tick, session;
    uint64_t state_hash; // before this tick's step; 0, not taken: a FAULT found after the step
    double arg[8];       // by kind, see proto/README.md
    int32_t kind, probe; // event_t's KIND_*; index in the scene, -1 none
} kn_event;

typedef struct kn_tick_out {
    int64_t tick;
    int32_t missed;
    int probes;
    kn_force force[KN_PROBES_MAX];
    bool local; // the backend identifies local models: contact holds those of every probe with a session
    int event_count;
    kn_event event[KN_EVENTS_PER_TICK];
    int64_t stepped_ns; // when the backend had answered; 0: no clock
    int64_t units;      // that the step took
    bool capped;
    bool replaced;             // by reset, restore or undo
    struct kn_change *changed; // taken in this tick, NULL: none
    uint64_t restored_hash;    // of the object that a restore or an undo put in its place; 0: none did
    bool stopped;              // every gain is zero after stop was asked: the loop may end
    // the first contact_count of them, and where that is 0 the first one; the others are not set
    kn_contact_unit contact[KN_PROBES_MAX][KN_CONTACT_UNITS];
} kn_tick_out;

typedef struct kn_servo {  // plain data but for the backend
    const kn_scene *scene; // these, too, are another's after a change
    const kn_model *model;
    kn_backend *backend;
    const kn_sets *sets;        // over the scene of the start, NULL: none
    const kn_audit_news *audit; // of the lattice, told by checkpoints; NULL: nobody audits
    kn_undo *undo;              // NULL: nothing can be undone
    kn_safety safety[KN_PROBES_MAX];
    kn_pose last[KN_PROBES_MAX]; // last pose used, session 0: none
    kn_pose tool[KN_PROBES_MAX]; // what the clutch made of it
    kn_clutch clutch[KN_PROBES_MAX];
    int64_t deadline;          // units that every step may take; 0: none
    int64_t slow_ns;           // that ticks running took, each above its millisecond
    int slow;                  // how many
    bool overloaded;           // so they have for KN_OVERLOAD_NS: no tool is in the model
    int64_t ticks;             // executed; the counters below are since init, too
    int64_t capped;            // solver stopped at its iteration cap
    int64_t late;              // backend missed its deadline
    int64_t diverged;          // ticks that the physics answered with non-finite numbers
    int32_t generation;        // of the object: counts its resets and restores
    kn_quality quality, asked; // point in force; the one that the scene or an operator asked for
    int over;                  // ticks running that took longer than the budget
    bool exhausted;            // there is no lower point, and an event has said so
    bool stopping;
    bool estopped; // an operator's emergency stop stands; decides nothing here
} kn_servo;

// Borrows all three, and every change that a tick takes. The backend's object is as new; ticks may start at any number.
void kn_servo_init(kn_servo *servo, const kn_scene *scene, const kn_model *model, kn_backend *backend);

// Whether a server that is late takes a for b: less at least or at most, and neither is more.
bool kn_servo_cheaper(const kn_effort *a, const kn_effort *b);

// One tick. Real-time safe: no allocation, lock or I/O.
void kn_servo_tick(kn_servo *servo, const kn_tick_in *in, kn_tick_out *out);

#endif
