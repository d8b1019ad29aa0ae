#ifndef KN_CORE_STATE_H
#define KN_CORE_STATE_H
// The state of an object: everything that changes while it is touched. A state is one block of memory. A copy of this
// block is a snapshot, and tests compare its hash. This header also defines the input and output of one step (step.h).
// All numbers are in SI units, in the scene's frame.
#include "core/model.h"
#include <stdint.h>

// State of one probe: the simulated tool that touches the object.
typedef struct kn_probe_state {
    double position_m[3];   // position of the simulated tool, which follows the pose (tool.h)
    double velocity_m_s[3]; // mean velocity of the tool over the last step
    double work_j;          // work of the probe on the object since the probe was attached
    int32_t attached;       // 1: the probe is in the model; 0: the probe touches nothing
    int32_t contacts;       // number of nodes (plate) or samples (other shapes) that carried load in the last step
} kn_probe_state;

// Additional state of a tool that turns or is coupled. Hashed for such tools only.
typedef struct kn_tool_state {
    double orientation_wxyz[4]; // orientation of the simulated tool, a unit quaternion
    double turn_rad_s[3];       // mean angular velocity of the tool over the last step
    double relief_m;            // distance by which a tool that was attached inside the object is still shrunk
    double grip_n;              // force up to which the tool grips the skin; 0: no grip; < 0: the grip was torn loose
} kn_tool_state;

// An anchor: the memory of sticking contact at one sample, which is a point of the skin under one tool.
typedef struct kn_anchor {
    uint64_t key;        // key of the sample (contact.c); anchors are stored in ascending order of their keys
    double stretch_m[3]; // elastic tangential displacement of the skin on the tool since the sample began to stick
    int64_t flags;       // KN_ANCHOR_*
} kn_anchor;
#define KN_ANCHOR_SLIPS 1 // the sample slid in the last step, with its force on Coulomb's cone
#define KN_ANCHOR_BONDS 2 // the sample touched the tool in the last step, so adhesion may hold it

// The fields of a state, which are saved and hashed in this order: name, number of reals per node. `strain` has one
// real for each of a node's 13 forward edges.
#define KN_STATE_FIELDS(X)                                                                                             \
    X(displacement, 3)    /* m, from the rest position: exact to 1e-9 m in f32; a coordinate would be less exact */    \
    X(velocity, 3)        /* m/s, over the last step */                                                                \
    X(change, 3)          /* m/s, change of the velocity in the last step */                                           \
    X(strain, KN_FORWARD) /* u of each forward edge before the last step; NULL if the law is KN_LAW_VOIGT */

#define KN_SECANT_REST 500 // number of steps with the secant linearisation after chatter was detected

typedef struct kn_state {
    int64_t tick; // number of steps since reset; not hashed, so an untouched object keeps its hash
    kn_probe_state probe[KN_PROBES_MAX];
    uint64_t chatter_bits; // bit i is set if the increment of the contact force changed sign i steps ago
    // last_force_n: contact force of the last step; last_delta_n: its increment in this step
    double last_force_n, last_delta_n;
    // largest norm of the preconditioned residual in recent steps, with a decay over 1 s
    double residual_scale;
    int64_t secant_steps; // number of steps that will still use the secant linearisation
    // 1 after a force or displacement was not finite; kn_step then does nothing until kn_state_reset
    int32_t bad;
    int32_t anchor_count; // number of anchors in use
    kn_tool_state tool[KN_PROBES_MAX];
#define KN_FIELD(name, components) void *name; // float or double, as the model's precision says
    KN_STATE_FIELDS(KN_FIELD)
#undef KN_FIELD
    uint8_t *held;     // [KN_PROBES_MAX][top_count] 1 where a plate holds the node
    kn_anchor *anchor; // [samples of the contact] if the model has contact that sticks, else NULL
} kn_state;

// Memory that a step needs beside the state, several times as large. A scratch serves all states of its model, one
// after another, so a thread that steps many states needs one scratch. It keeps the contact of the last step (touch.h).
typedef struct kn_scratch kn_scratch;

typedef struct kn_probe_input {
    bool attached;          // true: the probe is in the model; false: the probe touches nothing
    double position_m[3];   // position of the pose that the tool follows
    double velocity_m_s[3]; // velocity of the pose as the device reports it, never a difference of poses
    // Rotation from tool to scene, a unit quaternion; all 0: identity. Plates stay level, smooth spheres do not turn.
    double orientation_wxyz[4];
    bool grip; // the tool grips the skin that it touches, up to the force grip_n of the probe
} kn_probe_input;

typedef struct kn_input {
    kn_probe_input probe[KN_PROBES_MAX];
    double top_load_n; // dead load spread evenly over the top face, downwards (creep tests)
    kn_effort effort;  // IMPLICIT: effort of this step; all 0: the model's own effort
    int64_t deadline;  // IMPLICIT: largest number of units of work that the step may take (step_effort.h); 0: no limit
} kn_input;

typedef struct kn_probe_output {
    double force_n[3];          // force of the object on the probe
    double torque_n_m[3];       // torque of the object on the probe, about the probe's position
    double position_m[3];       // position of the simulated tool (the proxy) at the end of the step
    double orientation_wxyz[4]; // orientation of the proxy; identity for a plate and a smooth sphere
    double work_j;              // work of the probe on the object since the probe was attached
    int contacts;               // number of nodes (plate) or samples (other shapes) that carry load
} kn_probe_output;

typedef struct kn_output {
    kn_probe_output probe[KN_PROBES_MAX];
    double residual; // preconditioned norm of the step's last residual, relative to the largest norm of recent steps
    int iterations;  // number of conjugate gradient iterations of the last linearisation
    int passes;      // number of linearisations solved; fewer than requested if fewer already met the tolerance
    int64_t units;   // units of work that the step took, see step_effort.h
    bool capped;     // the residual was above the tolerance when iterations_max or the deadline ended the step
    bool secant;     // the step used the secant linearisation because chatter was detected
} kn_output;

// A state and a scratch belong to one model, which must outlive them. The functions _create allocate; the caller
// destroys.
size_t kn_state_size(const kn_model *model);                 // memory of a state [bytes]
kn_state *kn_state_create(const kn_model *model);            // undeformed and at rest; NULL: memory is short
void kn_state_destroy(kn_state *state);                      // does nothing if `state` is NULL
void kn_state_reset(const kn_model *model, kn_state *state); // set the object undeformed and at rest; real-time safe
void kn_state_copy(const kn_model *model, kn_state *dst, const kn_state *src); // real-time safe
size_t kn_scratch_size(const kn_model *model);                                 // memory of a scratch [bytes]
kn_scratch *kn_scratch_create(const kn_model *model);                          // NULL: memory is short
void kn_scratch_destroy(kn_scratch *scratch);                                  // does nothing if `scratch` is NULL
#define KN_TEAM_PARTS 2
typedef void kn_team_work(void *job, int part);
// Two threads that share the loops over edges and nodes of a step. core starts no thread for a step: the program brings
// the second one. The bits are the same with a team and without one. A team serves one step at a time.
typedef struct kn_team {
    // Call work(job, part) for every part below KN_TEAM_PARTS, on any threads and in any order, and return when all
    // calls have returned. A step calls this function about six times per iteration. If steps are real-time safe, this
    // function must be, too.
    void (*run)(struct kn_team *team, kn_team_work *work, void *job);
    int least; // least number of vectors of 16 nodes with which it pays to hand a loop over
} kn_team;
// Let a team do the steps with this scratch, which keeps the pointer; NULL: the calling thread does them alone. Return
// whether the team takes part: only in the implicit solver, and only for objects that are large enough. Real-time safe.
bool kn_scratch_team(const kn_model *model, kn_scratch *scratch, kn_team *team);
// Return the size in bytes of a field of the state with `components` numbers per node; 0: the state has no such field.
size_t kn_state_field(const kn_model *model, int components);

// Return a 64-bit hash of everything in a state that a snapshot saves, except the tick. The hash is equal for all
// compilers, optimisation levels and instruction sets. Real-time safe.
uint64_t kn_state_hash(const kn_model *model, const kn_state *state);

// Store the present position of a node, m. Real-time safe.
void kn_state_position(const kn_model *model, const kn_state *state, int node, double x_m[3]);
// Store the velocity of a node over the last step, m/s. Real-time safe.
void kn_state_velocity(const kn_model *model, const kn_state *state, int node, double v_m_s[3]);

// Return the distance between probe p at a pose and the object, m. A value <= 0 means that the probe touches the object
// or is inside. Real-time safe.
double kn_clearance(const kn_model *model, const kn_state *state, int p, const double position_m[3],
                    const double orientation_wxyz[4]);

#endif
