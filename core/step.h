#ifndef KN_CORE_STEP_H
#define KN_CORE_STEP_H
// One tick of the physics. No allocation, lock, clock or I/O; every loop has a bound known when the model was built.
#include "core/state.h"

typedef enum kn_status {
    KN_OK,
    KN_DIVERGED // a non-finite number: forces are zero and stay zero until kn_state_reset
} kn_status;

// Advance the state by one time step, model->def.solver.dt_s, and store the forces on the probes in `output`.
kn_status kn_step(const kn_model *model, kn_state *state, const kn_input *input, kn_output *output);

#endif
