#ifndef KN_CORE_ENERGY_H
#define KN_CORE_ENERGY_H
// The energy audit of the lattice: no energy may come out that has not gone in.
//
//     E(t2) <= E(t1) + contact(t1) + W(t1..t2),      E = kinetic + elastic + gas + height
//
// E is the energy that the object stores. W is the work of the tools (kn_probe_state.work_j). `contact` is the energy
// that the layers of tools and table may still return: at most half of force times depth, and for stuck friction half
// of force times stretch. The difference between the two sides has been dissipated. An edge stores k1 u^2/2 per volume,
// with u at the end of the step (law.h (1), (2)) and the volume (gamma L0)^2 kappa weight. Gas stores energy as in
// cell.h. Implicit Euler itself dissipates. Its linearisation around the guess and the remaining residual of the
// conjugate gradients may create a little energy. So KN_AUDIT_SHARE of the work done in either direction is tolerated.
//
// Summing a large lattice takes longer than a tick. So the state is copied once in KN_AUDIT_TICKS, after the forces
// have been sent. The copy takes 12 us for 847 nodes and 64 us for 5 733. The following ticks sum the copy edge by
// edge, at 1.5 and 12 us each.
#include "core/state.h"

#define KN_AUDIT_TICKS 1000 // ticks between two copies of the state
#define KN_AUDIT_SHARE 0.01 // tolerated creation of energy, as a share of the work done in either direction

typedef struct kn_energy { // energy stored in the object, J; all 0 for the undeformed object at rest
    double kinetic, elastic, gas, height;
} kn_energy;

static inline double kn_energy_sum(const kn_energy *e) { return e->kinetic + e->elastic + e->gas + e->height; }

typedef struct kn_audit_news {
    kn_energy stored; // energy stored in the last copy of the state
    double work_j;    // work of all tools from the last reset to the last copy of the state
    double lost_j;    // energy dissipated between the last two copies of the state; < 0: energy was created
    // Energy dissipated since the first copy of this object's state: work minus increase of the stored energy; < 0:
    // energy was created.
    double balance_j;
    int64_t windows; // number of intervals between two copies that were judged since the audit was created
    int64_t created; // number of intervals in which more energy was created than is tolerated
    double most_j;   // most energy created in one interval
} kn_audit_news;

typedef struct kn_audit kn_audit;

// Create an audit. `model` must outlive the audit. Return NULL if memory is short or the solver is not the implicit
// one.
kn_audit *kn_audit_create(const kn_model *model);
void kn_audit_destroy(kn_audit *audit); // does nothing if `audit` is NULL

// Start again after the object has been replaced: its stored energy is not the work of any tool. Real-time safe.
void kn_audit_restart(kn_audit *audit);

// Copy the counts of the audit `last` to the audit `next`. Call when the object continues in another model, which
// `next` audits. Real-time safe.
void kn_audit_follow(kn_audit *next, const kn_audit *last);

// Continue the audit after a tick. Call after every tick, also after a tick that reset the object. Real-time safe:
// copies the state once in KN_AUDIT_TICKS, else sums the energy of some edges.
void kn_audit_tick(kn_audit *audit, const kn_state *state);

const kn_audit_news *kn_audit_read(const kn_audit *audit);

// Sum the energy of a state at once. Not real-time safe. Return false if memory is short.
bool kn_energy_of(const kn_model *model, const kn_state *state, kn_energy *energy);

#endif
