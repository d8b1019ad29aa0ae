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
    // The circuit did not answer in time; the output comes from its twin (the same computation on the processor), with
    // the same bits.
    KN_BACKEND_SHADOWED,
    KN_BACKEND_LATE, // the backend did not answer by the deadline; the output is that of the last tick
    // The circuit is lost, and the object went back to an older state; the output is that of the last tick.
    KN_BACKEND_LOST,
    KN_BACKEND_STILL,   // the object stands still because its circuit is lost (`still`); forces are zero
    KN_BACKEND_DIVERGED // the physics gave non-finite numbers; forces are zero until a reset
} kn_backend_status;

typedef struct kn_backend {
    const char *name; // name of the backend: "cpu", "fixed" or "fpga"
    void *self;
    void (*submit)(void *self, const kn_input *input);
    // Deadline_ns is a time of CLOCK_MONOTONIC.
    kn_backend_status (*wait)(void *self, int64_t deadline_ns, kn_output *output);
    // Return the object's state after the last wait; valid until the next submit.
    const kn_state *(*state)(void *self);
    // As `state`, but its strains may be those of an older tick. It never asks a circuit, as `state` may.
    // NULL: the same as `state`.
    const kn_state *(*shape)(void *self);
    const kn_scratch *(*scratch)(void *self); // scratch of the last step, which has its contact (touch.h)
    // Return how many ticks the object went back at the latest LOST, and whether the object stands still until a lost
    // circuit is back. NULL: the backend has no circuit.
    int (*back)(void *self);
    bool (*still)(void *self);
    void (*reset)(void *self);                          // put the object back to its initial state
    void (*restore)(void *self, const kn_state *state); // replace the object by a copy of a state of this model
    // Fill in the physical fields of the local contact model of probe p, as of the last wait. The model has at most
    // KN_CONTACT_UNITS contact units. NULL: the backend identifies no local contact models.
    void (*contact)(void *self, int p, kn_contact_unit unit[]);
    // Do the work that can wait until the forces of the tick have been sent. NULL: there is no such work.
    void (*afterwards)(void *self);
    void (*destroy)(void *self);
} kn_backend;

// Settings with which --backend fixed overrides a scene, so that the solver computes with the circuit's integers,
// stored in doubles.
#define KN_FIXED_SETS 2
extern const char *const kn_fixed_set[KN_FIXED_SETS];

// Return the number of time steps of dt_s in one tick of 1 ms; 0 if a tick is not a whole number of steps.
int kn_backend_steps(double dt_s);

// Create a backend that steps the model on this processor, in the caller's thread: submit computes the steps of one
// tick, and wait returns at once. Borrows `model`. Return false when memory is short or kn_backend_steps(model's dt) is
// 0.
bool kn_backend_cpu(kn_backend *backend, const kn_model *model);

// Set the functions that are called with the input and the result of each step (core/solver_fixed.h). The model must
// use the solver KN_SOLVER_FIXED.
void kn_backend_cpu_watch(kn_backend *backend, kn_fixed_watch watch);

// Return the backend's `shape`, or its `state` if it has none.
const kn_state *kn_backend_shape(const kn_backend *backend);

// Make the backend identify local contact models. kn_contact_fit_create explains `device` and the return value false.
bool kn_backend_cpu_identify(kn_backend *backend, kn_coupling device);

#endif
