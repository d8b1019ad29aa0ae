#ifndef KN_CORE_STEP_H
#define KN_CORE_STEP_H
// One tick of the physics. No allocation, lock, clock or I/O; every loop has a bound known when the model was built.
#include "core/state.h"

typedef struct kn_probe_input {
    bool attached;          // false: the probe does not touch the object (no session, or latched and faded)
    double position_m[3];   // tool pose, scene frame
    double velocity_m_s[3]; // velocity of the tool as the device reports it, never a difference of poses
    // Rotation from tool to scene, a unit quaternion; all 0: identity. Plates stay level, smooth spheres do not turn.
    double orientation_wxyz[4];
    bool grip; // the tool grips the skin that it touches, up to the force grip_n of the probe
} kn_probe_input;

typedef struct kn_input {
    kn_probe_input probe[KN_PROBES_MAX];
    double top_load_n; // dead load spread evenly over the top face, downwards (creep tests)
    kn_effort effort;  // IMPLICIT: effort of this step; all 0: the model's own effort
    int64_t deadline;  // IMPLICIT: units of work that the step may take (deadline.h); 0: no deadline
} kn_input;

typedef struct kn_probe_output {
    double force_n[3];          // force of the object on the probe
    double torque_n_m[3];       // torque of the object on the probe, about the probe's position
    double position_m[3];       // position of the simulated tool (proxy)
    double orientation_wxyz[4]; // orientation of the proxy; identity for a plate and a smooth sphere
    double work_j;              // work of the probe on the object since the probe was attached
    int contacts;               // number of nodes (plate) or samples (other shapes) that carry load
} kn_probe_output;

typedef struct kn_output {
    kn_probe_output probe[KN_PROBES_MAX];
    double residual; // norm |P^1/2 r| of the residual at the end of the step, relative to the largest of recent steps
    int iterations;  // number of conjugate gradient iterations of the last linearisation
    int passes;      // number of linearisations solved; fewer than requested if the law was met within the tolerance
    int64_t units;   // units of work that the step took, see deadline.h
    bool capped;     // iterations_max or the deadline ended the step with the residual above the tolerance
    bool secant;     // the step used the secant linearisation because chatter was detected
} kn_output;

typedef enum kn_status {
    KN_OK,
    KN_DIVERGED // a non-finite number: forces are zero and stay zero until kn_state_reset
} kn_status;

// Advance the state by one time step, model->def.solver.dt_s, and store the forces on the probes in `output`.
kn_status kn_step(const kn_model *model, kn_state *state, const kn_input *input, kn_output *output);

// Return the distance of a pose of probe p from the object, m: > 0 clear, <= 0 in contact or inside. Real-time safe.
double kn_clearance(const kn_model *model, const kn_state *state, int p, const double position_m[3],
                    const double orientation_wxyz[4]);

#endif
