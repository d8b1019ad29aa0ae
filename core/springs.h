#ifndef KN_CORE_SPRINGS_H
#define KN_CORE_SPRINGS_H
// All edges of a model in one list: of a block, a net, or the parts of a composite. For modules that read an object
// without stepping it: energy.h, gauge.h.
#include "core/state.h"

typedef struct kn_spring {
    int i, j, slot; // as in kn_edge; nodes and slot are those of the whole model
    double rest_m;  // rest length L0
    // Volume V = (gamma L0)^2 kappa weight of the edge. The edge stores the energy V k1 u^2/2 and pulls with the force
    // stress * V/(gamma L0).
    double volume_m3;
} kn_spring;

// An edge at the end of the last step. Strains of the Voigt part are relative to gamma L0.
typedef struct kn_spring_now {
    double length_m;
    double voigt;     // strain u of the Voigt part
    double stress_pa; // s of law.h, tension positive
    double residual;  // permanent part of (L - L0)/L0
} kn_spring_now;

typedef struct kn_springs {
    const kn_model *model; // must outlive this struct
    kn_law law;            // law of the step; dt = 0 for Runge-Kutta and integers, whose state is at the step's end
    double gamma;
    int count;
    kn_spring *spring; // [count]
} kn_springs;

// List the edges. Allocates; returns false if memory is short.
bool kn_springs_init(kn_springs *springs, const kn_model *model);
void kn_springs_free(kn_springs *springs);      // free the list; does nothing to a zeroed struct
size_t kn_springs_bytes(const kn_model *model); // peak memory of kn_springs_init [bytes]

// Return the present values of one edge. Real-time safe, some 100 ns. A force-dependent law takes a Newton iteration.
kn_spring_now kn_spring_look(const kn_springs *springs, const kn_state *state, int number);

#endif
