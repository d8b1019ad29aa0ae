#ifndef KN_CORE_SOLVER_RK4_H
#define KN_CORE_SOLVER_RK4_H
// The papers' own method: explicit Runge-Kutta of order 4 over positions, velocities and Voigt strains, in f64. The
// implicit step is tested against this method, and a scene may ask for it. Dough with its real mass needs steps of 2e-7
// s. So kn_model_build refuses a model whose step is longer than kn_rk4_limit; a scene may set mass_scale instead.
//
//     m x'' = sum of s gamma kappa weight L0 n  +  m g  +  f                      node
//     s + c1 g(s) = c1 w + k1 u,    u' = w - g(s),    w = L'/(gamma L0)           edge, see law.h
//
// The law of the model is built with dt = 0, so A = c1. With c1 = 0 the equations give s = k1 u. Without a damper
// (KN_LAW_VOIGT) there is no u in the state: u = (L - L0)/(gamma L0).
//
// Inertia is node_mass_kg * mass_scale, but weight is node_mass_kg alone: a scaled object keeps its weight.
// Stages use the plain list model->edges in its order, so every machine gives the same bits and there is no instruction
// set to choose.
#include "core/state.h"
#include <stdint.h>

// Constraints and forces on the nodes during one step. The arrays belong to the caller and are indexed by node id.
typedef struct kn_boundary {
    const uint8_t *fixed;            // [nodes] bit k is set: component k follows velocity_m_s instead of the forces
    const double (*velocity_m_s)[3]; // [nodes] velocity of the fixed components, constant over the step
    const double (*force_n)[3];      // [nodes] load and contact forces, constant over the step; NULL = none
    // [nodes] result: mean force over the step that holds the fixed components, 0 for other components. It includes
    // m dv/dt when velocity_m_s changes. A probe feels minus the sum of these forces.
    double (*reaction_n)[3];
} kn_boundary;

// Return the largest stable step at rest, s: 2.785 / fastest rate of the lattice. The fastest rate is the largest
// eigenvalue of C/M by power iteration, with C = c1/(1 + c1/c2(0)) per edge. The root of the largest eigenvalue of K/M
// (pressure included) or the Voigt part's own rate is taken if it is faster. Rest is the stiffest state. With steps up
// to 20 times longer, the flowing damper bounds the instability: there is no NaN, but the forces are wrong. Reads def,
// grid, law, edges and node_mass_kg. Allocates while it works; returns -1 if memory is short.
double kn_rk4_limit(const kn_model *model);

// Return the bytes of scratch that a step needs, a multiple of 64.
size_t kn_rk4_scratch(const kn_model *model);

// Advance displacement, velocity and strain by def.solver.dt_s. Nothing else in the state changes; the caller counts
// the tick. Real-time safe in the sense of no allocation and bounded loops. `scratch`: kn_rk4_scratch bytes, 8-byte
// aligned.
void kn_rk4_step(const kn_model *model, kn_state *state, const kn_boundary *boundary, void *scratch);

#endif
