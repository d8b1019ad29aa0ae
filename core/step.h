#ifndef KN_CORE_STEP_H
#define KN_CORE_STEP_H
// One tick of the physics. No allocation, lock, clock or I/O; every loop has a bound known when the model was built.
#include "core/state.h"

typedef struct kn_probe_input {
    bool attached;              // false: the probe is not in the model (no session, latched, fading finished)
    double position_m[3];       // tool pose, scene frame
    double velocity_m_s[3];     // as the device reports it, never a difference of poses
    double orientation_wxyz[4]; // unit, tool to frame; all 0: identity. Plates stay level, smooth spheres do not turn
    bool grip;                  // hold on to the touched skin, up to the probe's grip_n
} kn_probe_input;

typedef struct kn_input {
    kn_probe_input probe[KN_PROBES_MAX];
    double top_load_n; // dead load spread evenly over the top face, downwards (creep tests)
    kn_effort effort;  // IMPLICIT: effort of this step; zero: the model's own
    int64_t deadline;  // IMPLICIT: units that the step may take, see deadline.h; 0: no deadline
} kn_input;

typedef struct kn_probe_output {
    double force_n[3];          // force of the object on the probe
    double torque_n_m[3];       // about the probe's position
    double position_m[3];       // position of the model's probe (proxy)
    double orientation_wxyz[4]; // orientation of the proxy; identity for a plate and a smooth sphere
    double work_j;              // work on the object since the probe was attached
    int contacts;               // nodes (plate) or samples (other shapes) under load
} kn_probe_output;

typedef struct kn_output {
    kn_probe_output probe[KN_PROBES_MAX];
    double residual; // |P^1/2 r| at the end of the solve / largest of the recent steps
    int iterations;  // CG iterations of the last linearisation
    int passes;      // linearisations solved; fewer than asked for if the law was met within the tolerance
    int64_t units;   // units that the step took, see deadline.h
    bool capped;     // stopped by iterations_max or the deadline with the residual above the tolerance
    bool secant;     // the secant fallback was in use
} kn_output;

typedef enum kn_status {
    KN_OK,
    KN_DIVERGED // a non-finite number: forces are zero and stay zero until kn_state_reset
} kn_status;

// Advance the state by model->def.solver.dt_s.
kn_status kn_step(const kn_model *model, kn_state *state, const kn_input *input, kn_output *output);

// Return the distance of a pose of probe p from the object, m: > 0 clear, <= 0 in contact or inside. Real-time safe.
double kn_clearance(const kn_model *model, const kn_state *state, int p, const double position_m[3],
                    const double orientation_wxyz[4]);

#endif
