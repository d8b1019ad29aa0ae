#ifndef KN_CORE_STEP_H
#define KN_CORE_STEP_H
// One step of the physics. It is real-time safe: no allocation, lock, clock or I/O, and every loop has a bound that is
// known when the model has been built.
#include "core/state.h"

typedef enum kn_status {
    KN_OK,
    KN_DIVERGED, // a number is not finite: all forces are 0 until kn_state_reset
    // The input attaches a probe that the model does not have, or its effort is out of range: nothing was stepped, all
    // forces are 0.
    KN_BAD_INPUT
} kn_status;

const char *kn_version(void);                 // version of the library, "MAJOR.MINOR.PATCH"
const char *kn_status_text(kn_status status); // the status as a sentence for messages

// Return whether kn_step takes this input: all attached probes are in the model, and the effort is in range.
bool kn_input_fits(const kn_model *model, const kn_input *input);

// Advance the state by one time step, model->def.solver.dt_s, and store the forces on the probes in `output`. State and
// scratch must be of this model. Several threads may step different states of one model, each with its own scratch.
kn_status kn_step(const kn_model *model, kn_state *state, kn_scratch *scratch, const kn_input *input,
                  kn_output *output);

#endif
