#ifndef KN_CORE_SPRINGS_H
#define KN_CORE_SPRINGS_H
// Every edge of a model as one list, whatever the model is made of: a block, a net, the parts of a composite. For who
// looks at an object without stepping it: energy.h, gauge.h.
#include "core/state.h"

typedef struct kn_spring {
    int i, j, slot; // as kn_edge has them, of the whole model
    double rest_m;
    double volume_m3; // (gamma L0)^2 kappa weight: stores k1 u^2/2 of each, and pulls with stress * volume/(gamma L0)
} kn_spring;

typedef struct kn_spring_now { // at the end of the last step; strains of the Voigt part are relative to gamma L0
    double length_m;
    double voigt;     // u
    double stress_pa; // s of law.h, tension positive
    double residual;  // part of (L - L0)/L0 that nothing brings back
} kn_spring_now;

typedef struct kn_springs {
    const kn_model *model; // borrowed
    kn_law law;            // of the step; of no time in Runge-Kutta and in integers, whose states are the step's end
    double gamma;
    int count;
    kn_spring *spring; // [count]
} kn_springs;

// Allocates; false: memory is short.
bool kn_springs_init(kn_springs *springs, const kn_model *model);
void kn_springs_free(kn_springs *springs);      // zeroed is fine
size_t kn_springs_bytes(const kn_model *model); // memory that init takes, what it frees again included

// Real-time safe, some 100 ns; a law of force takes a Newton iteration.
kn_spring_now kn_spring_look(const kn_springs *springs, const kn_state *state, int number);

#endif
