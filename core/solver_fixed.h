#ifndef KN_CORE_SOLVER_FIXED_H
#define KN_CORE_SOLVER_FIXED_H
// A model as a circuit's image, and its step by that image: the same integers in the same order as core/fixed.h says.
//
// Units. lambda, the largest power of two of a metre at which 2^24 of them per step are at most 2 m/s. phi, of a
// newton: 2^-17 (an edge bears 128 N), less where edges are so soft that one lambda would be under phi/16, never under
// 2^-21. A state holds every integer exactly as f64: displacement = lambda (x - rest), velocity = lambda u/dt, strain =
// phi H/(2^12 k1 area); so it is copied, saved, hashed and restored as any other, and goes on to the same bits.
//
// What it is not, beside the implicit step in f64: inertia (c1 holds dough's mass back within a microsecond), the end
// stops of a damper, friction and coupling of tools. A plate's nodes are prescribed. What presses otherwise pushes with
// its depth at the begin of the step, spread over the nodes of its patch; so does gas with the volume of its cells.
// Both reach a circuit as loads of nodes, and a model where that would not be stable is refused.
#include "core/fixed.h"
#include "core/step.h"

#define KN_FIXED_TRIAL 4        // ticks
#define KN_FIXED_ERROR 0.02     // of which more is worth a warning
#define KN_FIXED_ERROR_MOST 0.2 // and more is refused

typedef struct kn_fixed_model {
    kn_fixed_image image;
    double lambda_m, phi_n;
    double *spring; // [edge] of its strain, H in 2^-12 phi; 0: k1 is
    double error;   // of the force, KN_FIXED_TRIAL ticks into a press that begins at 1 cm/s at once: what passes and
                  // iterations leave, against many of both
} kn_fixed_model;

// Fills model->fixed; what is needed of grid or net, law and masses is there. NULL, or what keeps this model from being
// one of integers, in a text of the caller's. Allocates.
const char *kn_fixed_build(kn_model *model, char *text, size_t size);
void kn_fixed_destroy(kn_fixed_model *fixed); // NULL is fine

// Bytes of scratch that a step needs, 64-byte granular; prepared once.
size_t kn_fixed_scratch(const kn_model *model);
void kn_fixed_scratch_init(const kn_model *model, void *scratch);

// The integers of a state, into an engine of the model's image: its x, u, h.
void kn_fixed_read(const kn_model *model, const kn_state *state, kn_fixed *into);

// Who computes the same beside: is told what a tick is given, before it is computed, and what came out.
typedef struct kn_fixed_watch {
    void *self;
    void (*begin)(void *self, const kn_fixed_bound *bound, int count);
    void (*end)(void *self, const int64_t (*reaction)[3], const kn_fixed_result *result);
} kn_fixed_watch;
void kn_fixed_watch_by(kn_state *state, kn_fixed_watch watch); // of a KN_SOLVER_FIXED model; copies of it have none

// Advances displacement, velocity and strain by one step; forces into the contact's holds and samples. Real-time safe.
void kn_solve_fixed(const kn_model *model, kn_state *state, const kn_input *input, kn_output *output);

#endif
