#ifndef KN_BENCH_TURNS_H
#define KN_BENCH_TURNS_H
// Times of steps that can be set beside one another, on a machine that does other things too.
//
// Every runner does the same ticks in every round: the same states, so the same work, to the bit. Runners take turns
// every 20 ticks, so that all meet the same weather. Time is the thread's own, and of each tick the least of all
// rounds counts; rounds cut their turns at different ticks, so that no tick always pays for the caches that the
// runner before left behind. What is left is what the step costs.
#include "core/step.h"

typedef kn_input hand_fn(const kn_model *model, double t_s); // what the step that ends at t_s is given

typedef struct runner {
    void *self;
    void (*rewind)(void *self);
    double (*step)(void *self, int tick, int *iterations); // returns us
    double *us;                                            // [ticks] least of all rounds
    int *iterations;                                       // [ticks]
} runner;

typedef struct summary { // over the ticks
    double median_us, mean_us, p90_us, mean_iterations;
    int median_iterations;
} summary;

// Fills us and iterations of every runner, which the caller frees.
void turns_run(runner *runners, int count, int ticks, int rounds);
summary turns_summary(const runner *r, int ticks);
void turns_free(runner *runners, int count);

// One of ours: from `start` at tick `from` of the hand; start NULL is the object at rest, and it is copied. Any
// instruction set and iterations take the state of any other with the same lattice, law and precision.
runner turns_knead(const kn_model_def *def, hand_fn *hand, const kn_state *start, int from);
const kn_model *turns_model(const runner *r);
void turns_destroy(runner *r); // of turns_knead

// The state after so many ticks of the hand, for start.
kn_state *turns_warm(const kn_model_def *def, hand_fn *hand, int ticks);

// So many iterations in every step, whatever the residual says.
kn_model_def turns_fixed(kn_model_def def, int iterations);

#endif
