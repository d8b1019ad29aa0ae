#ifndef KN_SERVER_BACKEND_H
#define KN_SERVER_BACKEND_H
// Interface through which the servo loop steps the lattice. A backend steps the model on this processor, in fixed
// point, or on a board. submit never blocks. wait returns by its deadline in any case, so the servo loop never hangs on
// a device.
#include "core/contact_fit.h"
#include "core/solver_fixed.h"
#include <stdint.h>

typedef enum kn_backend_status {
    KN_BACKEND_OK,
    KN_BACKEND_SHADOWED, // the circuit did not answer in time: output is its twin's, with the same bits
    KN_BACKEND_LATE,     // no answer by the deadline; output is that of the last tick
    KN_BACKEND_DIVERGED  // the physics diverged: zero forces until reset
} kn_backend_status;

typedef struct kn_backend {
    const char *name; // "cpu", "fixed", "fpga"
    void *self;
    void (*submit)(void *self, const kn_input *input);
    kn_backend_status (*wait)(void *self, int64_t deadline_ns, kn_output *output); // CLOCK_MONOTONIC deadline
    const kn_state *(*state)(void *self);               // state after the last wait; valid until the next submit
    void (*reset)(void *self);                          // put the object back to its initial state
    void (*restore)(void *self, const kn_state *state); // take a copy of a state of this model
    // Local contact models: contact gives the units of probe p as of the last wait, up to KN_CONTACT_UNITS, with their
    // physical fields. NULL if the backend identifies none.
    void (*contact)(void *self, int p, kn_contact_unit unit[]);
    // Do the work that can wait until the forces of the tick have been sent. NULL: there is none.
    void (*afterwards)(void *self);
    void (*destroy)(void *self);
} kn_backend;

// Settings that --backend fixed puts over a scene: integers as the circuit has them, kept in f64.
#define KN_FIXED_SETS 2
extern const char *const kn_fixed_set[KN_FIXED_SETS];

// Return the number of steps of dt_s in one tick of 1 ms; 0 if no whole number of them fits.
int kn_backend_steps(double dt_s);

// Create a backend on this processor, in the caller's thread: submit takes the steps of one tick, wait returns at once.
// It borrows the model. Return false when memory is short or kn_backend_steps(model's dt) is 0.
bool kn_backend_cpu(kn_backend *backend, const kn_model *model);

// Set the functions that are told the input and the result of each step (core/solver_fixed.h). The model must be of
// KN_SOLVER_FIXED.
void kn_backend_cpu_watch(kn_backend *backend, kn_fixed_watch watch);

// Make the backend identify local contact models. See kn_contact_fit_create for device and for a return value of false.
bool kn_backend_cpu_identify(kn_backend *backend, kn_coupling device);

#endif
