#ifndef KN_CORE_SCRATCH_H
#define KN_CORE_SCRATCH_H
// The solvers' memory within a step. It lies in the state's arena, but it is neither saved nor hashed.
#include "core/contact.h"
#include "core/deadline.h"
#include "core/kernel.h"
#include "core/solver_rk4.h"

typedef struct kn_rigid { // rigid motions of an object that nothing holds, see rigid.h
    bool on;              // the rigid motions are used in this step
    float *arm;           // 4 components per node: vector from the centre of mass, and 1 for a node, 0 in padding
    double centre_m[3];   // centre of mass of the object
    double factor[6][6];  // Cholesky factor of R'AR
} kn_rigid;

typedef struct kn_scratch {
    kn_work work; // implicit: first member, because kernels find it at state->scratch
    kn_contact contact;
    kn_effort effort;     // implicit: effort of this step
    kn_deadline deadline; // implicit: deadline of this step
    kn_rigid rigid;       // implicit
    int *last_held;       // implicit: nodes whose velocities the last step prescribed
    int last_held_count;
    uint8_t *row_base;    // implicit: [rows] 1 where the support holds a node of the row
    kn_boundary boundary; // RK4: boundary of the step; its arrays are `fixed`, `velocity`, `force`, `reaction`
    uint8_t *fixed;
    double (*velocity)[3], (*force)[3], (*reaction)[3];
    void *stages; // RK4: memory of its stages; FIXED: memory of the integer step
} kn_scratch;

static inline kn_scratch *kn_state_scratch(const kn_state *state) { return state->scratch; }

#endif
