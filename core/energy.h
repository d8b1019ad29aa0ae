#ifndef KN_CORE_ENERGY_H
#define KN_CORE_ENERGY_H
// The audit of the lattice: nothing may come out of it that has not gone in.
//
//     E(t2) <= E(t1) + contact(t1) + W(t1..t2),      E = kinetic + elastic + gas + height
//
// E is what the object stores, W the work of the tools (kn_probe_state.work_j), contact what tools' and table's layers
// may still push with: at most half of force times depth, of stuck friction half of force times stretch. What E is less
// than that has been dissipated. An edge stores k1 u^2/2 per volume, u at the end of the step (law.h (1), (2)), its
// volume (gamma L0)^2 kappa weight; gas as cell.h says. Implicit Euler itself dissipates; its straight lines around the
// guess and the gradients' remainder may create a little: KN_AUDIT_SHARE of the work done either way is not told.
//
// A large lattice takes longer to sum than a tick lasts. So the state is copied once in KN_AUDIT_TICKS, after the forces
// have gone out (12 us of 847 nodes, 64 of 5 733), and the copy is summed edge by edge in the ticks that follow (1.5, 12).
#include "core/state.h"

#define KN_AUDIT_TICKS 1000
#define KN_AUDIT_SHARE 0.01

typedef struct kn_energy { // J, of the undeformed object at rest all 0
    double kinetic, elastic, gas, height;
} kn_energy;

static inline double kn_energy_sum(const kn_energy *e) { return e->kinetic + e->elastic + e->gas + e->height; }

typedef struct kn_audit_news {
    kn_energy stored; // in the last copy
    double work_j;    // of all tools since the last reset, up to it
    double lost_j;    // dissipated from the copy before it on; < 0: created
    double balance_j; // work less what has been stored since the first copy of this object: dissipated; < 0: created
    int64_t windows;  // between two copies, judged since the audit was made
    int64_t created;  // of these: more came out than the share that is not told
    double most_j;    // created in one of them
} kn_audit_news;

typedef struct kn_audit kn_audit;

// Of an implicit model; borrows it. NULL: memory is short, or it is Runge-Kutta's.
kn_audit *kn_audit_create(const kn_model *model);
void kn_audit_destroy(kn_audit *audit); // NULL is fine

// The object has been replaced: what it stores is not the work of anybody. Real-time safe.
void kn_audit_restart(kn_audit *audit);

// The object goes on in another model, whose audit `next` is: with what `last` has counted. Real-time safe.
void kn_audit_follow(kn_audit *next, const kn_audit *last);

// After every tick, resets included. Real-time safe: every KN_AUDIT_TICKS a copy of the state, else some edges.
void kn_audit_tick(kn_audit *audit, const kn_state *state);

const kn_audit_news *kn_audit_read(const kn_audit *audit);

// All of it at once: not real-time safe. False when memory is short.
bool kn_energy_of(const kn_model *model, const kn_state *state, kn_energy *energy);

#endif
