#ifndef KN_CORE_ENSEMBLE_H
#define KN_CORE_ENSEMBLE_H
// Many states of one model that are stepped together on several threads: the same object under many hands, as a search
// or a learner needs it. The states do not interact. A state has the same bits for any number of threads, and the bits
// of a state that kn_step has stepped alone.
#include "core/step.h"
#include "core/touch.h"

typedef struct kn_ensemble kn_ensemble;

// Create `count` undeformed states, and threads - 1 threads that wait until kn_ensemble_step gives them work. Memory:
// kn_state_size for each state and kn_scratch_size for each thread. `model` must outlive the ensemble. Return NULL if
// count or threads is below 1, if memory is short, or if a thread cannot be started.
kn_ensemble *kn_ensemble_create(const kn_model *model, int count, int threads);
void kn_ensemble_destroy(kn_ensemble *ensemble); // does nothing if `ensemble` is NULL

// Return a state, which the ensemble owns, to reset, read, copy or write it between steps; NULL: no such number.
kn_state *kn_ensemble_state(kn_ensemble *ensemble, int number);

// Take `steps` steps (>= 1) of each state i with input[i]. An input holds the poses at the beginning of the first step;
// over the steps, a pose moves with its velocity. Store in output[i] what the last step gave, and in touch[i], unless
// `touch` is NULL, the touch patches of the probes after it. Return KN_DIVERGED if any state has diverged (its member
// `bad` is 1). Return KN_BAD_INPUT, without a step, if kn_step would take any of the inputs for bad, or if `steps` is
// below 1. Not real-time safe: it waits for its threads. One call at a time, and not after a fork.
kn_status kn_ensemble_step(kn_ensemble *ensemble, int steps, const kn_input input[], kn_output output[],
                           kn_touch (*touch)[KN_PROBES_MAX]);

#endif
