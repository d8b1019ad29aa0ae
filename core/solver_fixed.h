#ifndef KN_CORE_SOLVER_FIXED_H
#define KN_CORE_SOLVER_FIXED_H
// A model as an image for the circuit, and its step by that image: the same integers in the same order as in
// core/fixed.h.
//
// Units. lambda is the largest power of two of a metre for which 2^24 lambda per step are at most 2 m/s. phi is 2^-17 N
// (an edge bears 128 N). It is less if edges are so soft that one lambda would be under phi/16, but never under 2^-21
// N. A state holds every integer exactly as f64: displacement = lambda (x - rest), velocity = lambda u/dt, strain =
// phi H/(2^12 k1 area). A state can therefore be copied, saved, hashed and restored like any other, and it continues
// with the same bits.
//
// Missing in comparison with the implicit step in f64: inertia (c1 holds dough's mass back within a microsecond), the
// end stops of a damper, friction and coupling of tools. The nodes under a plate are prescribed. Any other tool pushes
// with its depth at the beginning of the step, spread over the nodes of its patch. Gas likewise pushes with the volume
// of its cells at the beginning of the step. Both reach a circuit as loads of nodes. A model for which this would be
// unstable is refused.
#include "core/fixed.h"
#include "core/state.h"

#define KN_FIXED_TRIAL 4        // ticks of the trial that measures `error`
#define KN_FIXED_ERROR 0.02     // relative error of the force above which the user gets a warning
#define KN_FIXED_ERROR_MOST 0.2 // relative error of the force above which the model is refused

typedef struct kn_fixed_model {
    kn_fixed_image image;
    double lambda_m, phi_n; // units of length and force of the image
    double *spring;         // [edge] force H of the spring k1 per strain, in 2^-12 phi; 0: k1 is 0
    // Relative error of the force KN_FIXED_TRIAL ticks after a press starts at 1 cm/s. It compares the image's numbers
    // of passes and iterations with far larger numbers.
    double error;
} kn_fixed_model;

// Build model->fixed. Grid or net, law and masses of the model must be complete. Return NULL, or the reason why the
// model cannot be one of integers; text is the caller's memory for that reason. Allocates.
const char *kn_fixed_build(kn_model *model, char *text, size_t size);
void kn_fixed_destroy(kn_fixed_model *fixed); // does nothing if `fixed` is NULL

// Return the bytes of scratch that a step needs, 64-byte granular. Scratch is prepared once.
size_t kn_fixed_scratch(const kn_model *model);
void kn_fixed_scratch_init(const kn_model *model, void *scratch);

// Convert a state to integers: x, u, h of an engine with the model's image.
void kn_fixed_read(const kn_model *model, const kn_state *state, kn_fixed *into);

// Callbacks for a circuit or program that computes the same ticks in parallel. `begin` gets the boundary list of a tick
// before the tick is computed, `end` gets the results of the tick. Both get `self`.
typedef struct kn_fixed_watch {
    void *self;
    void (*begin)(void *self, const kn_fixed_bound *bound, int count);
    void (*end)(void *self, const int64_t (*reaction)[3], const kn_fixed_result *result);
} kn_fixed_watch;
// Watch a state of a KN_SOLVER_FIXED model. Copies of the state are not watched.
void kn_fixed_watch_by(kn_state *state, kn_fixed_watch watch);

// Advance displacement, velocity and strain by one step, and write forces into the contact's holds and samples.
// Real-time safe.
void kn_solve_fixed(const kn_model *model, kn_state *state, const kn_input *input, kn_output *output);

#endif
