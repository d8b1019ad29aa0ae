#ifndef KN_BENCH_TURNS_H
#define KN_BENCH_TURNS_H
// Comparable times of steps, on a machine that does other work too.
//
// Every runner does the same ticks in every round: the same states, so the same work, to the bit. Runners take turns
// every 20 ticks, so that all meet the same load. Time is the thread's own, and for each tick the least of all rounds
// counts. Rounds cut their turns at different ticks, so that no tick always pays for the caches that the runner
// before left behind. The remaining time is the cost of the step.
#include "core/step.h"

typedef kn_input hand_fn(const kn_model *model, double t_s); // input of the step that ends at t_s

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

// Fill us and iterations of every runner. The caller frees them.
void turns_run(runner *runners, int count, int ticks, int rounds);
summary turns_summary(const runner *r, int ticks);
void turns_free(runner *runners, int count);

// Return a runner of our step. It starts from a copy of `start` at tick `from` of the hand; NULL: the object at rest.
// A runner with any instruction set and iterations accepts the state of any other with the same lattice, law and
// precision.
runner turns_knead(const kn_model_def *def, hand_fn *hand, const kn_state *start, int from);
const kn_model *turns_model(const runner *r);
void turns_destroy(runner *r); // for a runner of turns_knead

// Return the state after so many ticks of the hand, for `start`.
kn_state *turns_warm(const kn_model_def *def, hand_fn *hand, int ticks);

// Return def with so many iterations in every step, independent of the residual.
kn_model_def turns_fixed(kn_model_def def, int iterations);

#endif
