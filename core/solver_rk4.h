#ifndef KN_CORE_SOLVER_RK4_H
#define KN_CORE_SOLVER_RK4_H
// The papers' own method: explicit Runge-Kutta of order 4 over positions, velocities and Voigt strains, in f64.
// It is here as the oracle of the implicit step and for scenes that ask for it; dough with its real mass needs steps of
// 2e-7 s, so a model whose step is longer than kn_rk4_limit is refused when built (mass_scale is the declared way out).
//
//     m x'' = sum of s gamma kappa weight L0 n  +  m g  +  f                      node
//     s + c1 g(s) = c1 w + k1 u,    u' = w - g(s),    w = L'/(gamma L0)           edge, see law.h
//
// The law of the model is built with dt = 0, so A = c1; with c1 = 0 the same lines read s = k1 u. Without a damper
// (KN_LAW_VOIGT) there is no u in the state: u = (L - L0)/(gamma L0).
//
// Inertia is node_mass_kg * mass_scale, weight is node_mass_kg alone: a scaled object weighs what it always did.
// Stages use the plain list model->edges in its order: same bits on every machine, no instruction set to choose.
#include "core/state.h"
#include <stdint.h>

// What holds and pushes the nodes during one step. Arrays are the caller's, indexed by node id.
typedef struct kn_boundary {
    const uint8_t *fixed;            // [nodes] bit k set: component k follows velocity_m_s instead of the forces
    const double (*velocity_m_s)[3]; // [nodes] of fixed components, constant over the step; others are ignored
    const double (*force_n)[3];      // [nodes] load and contact forces, constant over the step; NULL = none
    double (*reaction_n)[3]; // [nodes] out: mean force over the step by which fixed components are held, 0 elsewhere;
                             // it holds m dv/dt when velocity_m_s changes. What a probe feels is minus the sum.
} kn_boundary;

// Largest stable step at rest, s: 2.785 / fastest rate of the lattice. That is the largest eigenvalue of C/M by power
// iteration with C = c1/(1 + c1/c2(0)) per edge (or sqrt of K/M's, pressure included, or the Voigt part's own rate
// where these are faster). "At rest" is the stiffest state. Up to 20 times above it the flowing damper bounds the
// instability: no NaN, wrong forces. Reads def, grid, law, edges and node_mass_kg. Allocates while it works; -1 when
// memory is short.
double kn_rk4_limit(const kn_model *model);

// Bytes of scratch a step needs, 64-byte granular.
size_t kn_rk4_scratch(const kn_model *model);

// Advances displacement, velocity and strain by def.solver.dt_s. Nothing else in the state changes (tick is the
// caller's). Real-time safe in the sense of no allocation and bounded loops; scratch is 8-byte aligned, kn_rk4_scratch
// bytes.
void kn_rk4_step(const kn_model *model, kn_state *state, const kn_boundary *boundary, void *scratch);

#endif
