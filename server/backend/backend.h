#ifndef KN_SERVER_BACKEND_H
#define KN_SERVER_BACKEND_H
// The servo's only way to the lattice. A backend steps the model somewhere: on this processor, in fixed point, on a
// board. submit never blocks; wait returns by the deadline whatever happened, so the servo never hangs on a device.
#include "core/contact_fit.h"
#include "core/solver_fixed.h"
#include <stdint.h>

typedef enum kn_backend_status {
    KN_BACKEND_OK,
    KN_BACKEND_SHADOWED, // the circuit did not answer in time: output is its twin's, the same bits
    KN_BACKEND_LATE,    // no answer by the deadline; output is the last one
    KN_BACKEND_DIVERGED // physics gone bad: zero forces until reset
} kn_backend_status;

typedef struct kn_backend {
    const char *name; // "cpu", "fixed"
    void *self;
    void (*submit)(void *self, const kn_input *input);
    kn_backend_status (*wait)(void *self, int64_t deadline_ns, kn_output *output); // CLOCK_MONOTONIC deadline
    const kn_state *(*state)(void *self); // the lattice as it stands after the last wait; valid until the next submit
    void (*reset)(void *self);            // object as new
    void (*restore)(void *self, const kn_state *state); // as in a state of this model; a kept one, too
    // Where local contact models are identified, else NULL: the units of probe p as of the last wait, up to
    // KN_CONTACT_UNITS, their physical fields; and the part of the work that can wait until the tick's forces are on
    // their way.
    void (*contact)(void *self, int p, kn_contact_unit unit[]);
    void (*afterwards)(void *self);
    void (*destroy)(void *self);
} kn_backend;

// --backend fixed, over a scene: integers as the circuit has them, kept in f64.
#define KN_FIXED_SETS 2
extern const char *const kn_fixed_set[KN_FIXED_SETS];

// Steps of dt_s that make up one tick of 1 ms; 0 when no whole number of them does.
int kn_backend_steps(double dt_s);

// On this processor, in the caller's thread: submit takes the steps of one tick, wait returns at once. Borrows model.
// False when memory is short or kn_backend_steps(model's dt) is 0.
bool kn_backend_cpu(kn_backend *backend, const kn_model *model);

// Of a model of KN_SOLVER_FIXED: who is told what goes into each step and what comes out, see core/solver_fixed.h.
void kn_backend_cpu_watch(kn_backend *backend, kn_fixed_watch watch);

// Has that backend identify local contact models; device: see kn_contact_fit_create, as is what false means.
bool kn_backend_cpu_identify(kn_backend *backend, kn_coupling device);

#endif
