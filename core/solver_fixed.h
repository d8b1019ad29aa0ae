#ifndef KN_CORE_SOLVER_FIXED_H
#define KN_CORE_SOLVER_FIXED_H
// The solver in integers: it turns a model into an image for the circuit, and steps a state by this image with the
// integers of core/fixed.h.
//
// Units. lambda, the unit of length, is the largest power of two of a metre for which 2^24 lambda per step are at most
// 2 m/s. phi, the unit of force, is 2^-17 N, so an edge bears 128 N. If edges are so soft that one lambda changes the
// tension of the stiffest edge by less than phi/16, phi is smaller, but not below 2^-21 N. A state holds every integer
// exactly as f64: displacement = lambda (x - rest), velocity = lambda u/dt, strain = phi H/(2^12 k1 area). So a state
// can be copied, saved, hashed and restored like any other, and continues with the same bits.
//
// In comparison with the implicit step in f64, this solver lacks inertia, end stops of a damper, and friction and
// coupling of tools. (In dough, c1 stops the motion of a node's mass within a microsecond.) The motion of the nodes
// under a plate is prescribed. Any other tool pushes nodes with forces that follow from its depth at the beginning of
// the step. Gas pushes nodes with forces that follow from the volumes at the beginning of the step. A model for which
// such forces would chatter is refused.
#include "core/fixed.h"
#include "core/state.h"

#define KN_FIXED_TRIAL 4        // ticks of the trial that measures `error`
#define KN_FIXED_ERROR 0.02     // relative error of the force above which the user gets a warning
#define KN_FIXED_ERROR_MOST 0.2 // relative error of the force above which the model is refused

typedef struct kn_fixed_model {
    kn_fixed_image image;
    double lambda_m, phi_n; // units of length and force of the image
    double *spring;         // [edge] force H of the spring k1 per strain, in 2^-12 phi; 0: k1 is 0
    // Relative error of the force that the image's numbers of passes and iterations leave. It is measured in a trial: a
    // press at 1 cm/s, after KN_FIXED_TRIAL ticks, compared with far more passes and iterations.
    double error;
} kn_fixed_model;

// Build model->fixed, which the model owns. Lattice, law and masses of the model must be complete. Return NULL, or the
// reason why integers cannot represent the model. The reason is a static text, or it is in the caller's text[size].
// Allocates.
const char *kn_fixed_build(kn_model *model, char *text, size_t size);
void kn_fixed_destroy(kn_fixed_model *fixed); // does nothing if `fixed` is NULL

// Return the number of bytes of scratch memory that a step needs, a multiple of 64. kn_fixed_scratch_init prepares the
// scratch once, before the first step.
size_t kn_fixed_scratch(const kn_model *model);
void kn_fixed_scratch_init(const kn_model *model, void *scratch);

// Convert a state to the integers x, u, h of `into`, which was initialised with the model's image. Real-time safe.
void kn_fixed_read(const kn_model *model, const kn_state *state, kn_fixed *into);
// The inverse of kn_fixed_read: store x, u, h in the state. Real-time safe.
void kn_fixed_write(const kn_model *model, const kn_fixed *from, kn_state *state);

// Where a tick is computed.
typedef enum kn_fixed_where {
    KN_FIXED_HERE,  // by this step
    KN_FIXED_THERE, // by a circuit, which has given its results; the strains of the state stay those of an older tick
    KN_FIXED_LATE   // by a circuit that has not answered: the step ends, and the next step continues it
} kn_fixed_where;

// Functions that the step calls, so that a circuit or another program can compute the same ticks in parallel or
// instead. `begin` gets the boundary list of a tick before the tick is computed, and the integers x, u of the state. If
// it returns THERE, it has stored the new x and u, the reactions and the result. If it returns LATE, kn_step returns
// without results. The next kn_step continues this step, whatever its own input: it calls `begin` with the same list.
// `end` gets the results of a tick that was computed here. Both get `self`.
typedef struct kn_fixed_watch {
    void *self;
    kn_fixed_where (*begin)(void *self, const kn_fixed_bound *bound, int count, kn_fixed *engine,
                            int64_t (*reaction)[3], kn_fixed_result *result);
    void (*end)(void *self, const int64_t (*reaction)[3], const kn_fixed_result *result);
} kn_fixed_watch;
// Have the steps with a scratch call `watch`, and drop a step that was LATE. The model must have KN_SOLVER_FIXED.
void kn_fixed_watch_by(kn_scratch *scratch, kn_fixed_watch watch);
bool kn_fixed_late(const kn_scratch *scratch); // return true if the last step was LATE, so that the next continues it

// Advance displacement, velocity and strain by one step, and store the forces of the contact's held nodes and samples.
// Return false if the watch was LATE. kn_step calls this function. Real-time safe.
bool kn_solve_fixed(const kn_model *model, kn_state *state, kn_scratch *scratch, const kn_input *input,
                    kn_output *output);

#endif
