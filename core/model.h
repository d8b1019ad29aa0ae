#ifndef KN_CORE_MODEL_H
#define KN_CORE_MODEL_H
// The model: everything about an object and its solver that does not change while it is touched.
// Fill a kn_model_def (kn_model_def_default gives a sensible one), build, share among any number of states and threads.
// Nothing here is written after kn_model_build; only build allocates.
#include "core/cell.h"
#include "core/grid.h"
#include "core/law.h"
#include "core/material.h"
#include "core/simplices.h"
#include <stdint.h>

#define KN_PROBES_MAX 4
#define KN_NAME_MAX 24 // bytes with the NUL: KNEAD_CONTACT_<name> must fit LCM's 63-byte channel names

typedef enum kn_structure {
    KN_STRUCTURE_DIAGONALS, // sides, face and body diagonals
    KN_STRUCTURE_AXIS       // sides only: a block of them cannot keep its shape; exact for a single bar
} kn_structure;

typedef enum kn_support {
    KN_SUPPORT_BONDED,       // the base is glued to the table
    KN_SUPPORT_FRICTIONLESS, // the base stays in its plane and slides freely (held in tension too)
    KN_SUPPORT_NONE,         // free body
    KN_SUPPORT_FRICTION      // a table under it that only pushes, with friction: what is on it can be lifted off
} kn_support;

typedef enum kn_skin_form { // of a block between its nodes, as every tool but a plate meets it: see contact.h
    KN_SKIN_SPLINE,         // quadratic
    KN_SKIN_BILINEAR        // as good where tools are wide: radius of two spacings and more
} kn_skin_form;

typedef enum kn_probe_shape {
    KN_PROBE_PLATE,  // level rectangle, sticks to the top nodes it touches and lets go in tension
    KN_PROBE_SPHERE, // rigid ball, a disc to a flat block; the others: see shape.h. All press by foundation contact
    KN_PROBE_CAPSULE,
    KN_PROBE_BOX,
    KN_PROBE_CROSS,
    KN_PROBE_CYLINDER,
    KN_PROBE_UNION,
    KN_PROBE_MESH // one part, of a file
} kn_probe_shape;

typedef struct kn_probe_def {
    char name[KN_NAME_MAX]; // channel suffix: KNEAD_POSE_<name>; [a-z0-9_]+
    kn_probe_shape shape;
    double size_m[3];             // PLATE: extent along x and y; BOX: x, y, z; CROSS: arm length, arm width, height
    double radius_m;              // SPHERE, CAPSULE, CYLINDER: >= spacing (refused below), >= 1.5 spacing advised
    double length_m;              // CAPSULE, CYLINDER: along its axis, z
    double edge_m;                // BOX, CROSS, CYLINDER: radius of its edges; 0: sharp
    const struct kn_shape *parts; // UNION, MESH: what it is made of, in its frame, not owned: outlives the model
    double foundation_n_m3;       // contact stiffness per area; 0 = default (2.5e7, see contact.h)
    double friction;              // of the contact, Coulomb's mu when it slips; 0: frictionless
    double adhesion_pa;           // tension that the contact carries before it lets go; 0: none
    double grip_n;                // force up to which `grip` ties the contact to the tool; 0: no grip
    double coupling_n_m;   // virtual coupling between pose and tool; 0: the tool follows its pose rigidly (contact.h)
    double coupling_n_s_m; // its damping
    double reach_m[2]
                  [2]; // of x, of y: between which its centre stays; all 0: anywhere. A scene's: the model asks `fine`
} kn_probe_def;

typedef enum kn_solver { KN_SOLVER_IMPLICIT, KN_SOLVER_RK4, KN_SOLVER_FIXED } kn_solver;
typedef enum kn_precision { KN_PRECISION_F32, KN_PRECISION_F64 } kn_precision;

// Instruction sets with the same 16 logical lanes and the same bits. AUTO takes the best the processor has.
typedef enum kn_isa { KN_ISA_AUTO, KN_ISA_BASE, KN_ISA_AVX2, KN_ISA_AVX512 } kn_isa;

typedef struct kn_solver_def {
    kn_solver kind;
    kn_precision precision; // RK4 and FIXED are always F64: FIXED keeps its integers in them
    kn_linearization linearization;
    kn_isa isa;
    double dt_s;        // step, s
    int iterations;     // CG iterations that every step gets
    int iterations_max; // hard cap, reached only while the residual is above the tolerance
    double tolerance;   // preconditioned residual, relative to the largest of the recent steps; 0 = never extend
    int passes;         // linearisations per step; 1 in real time, 3-5 with SECANT for a converged reference
    double mass_scale;  // >= 1; RK4's way to a stable step, stated in the scene, never chosen silently
} kn_solver_def;

// The part of a kn_solver_def that may change from step to step: it costs time, and no memory knows it.
typedef struct kn_effort {
    int iterations, iterations_max; // iterations 0: all of it is the model's own
    double tolerance;
    int passes;
    kn_linearization linearization;
} kn_effort;

typedef struct kn_model_def {
    kn_material material;
    double density_kg_m3;     // > 0
    double gravity_m_s2;      // downwards, >= 0
    const kn_simplices *mesh; // checked, in the scene's frame, not owned: outlives the model. NULL: a block
    int nodes[3];             // of a block, along x, y, z
    double spacing_m;         // of a mesh: its mean edge
    double thickness_m;       // > 0: a flat object in the x-z plane, nodes[1] = 1, in plane stress; else 0
    kn_structure structure;
    double diagonal_stiffness; // of a diagonal / that of a side, in (0, 1]; ignored without diagonals
    int fine[2][3]; // of a block: first and last corner of the box, in cells, that keeps its spacing; outside of it
                    // cells are twice as wide (composite.h). All even; all 0: one lattice everywhere
    kn_pressure pressure;
    double inside_pressure_pa; // absolute, at rest; > 0 with pressure
    kn_skin_form skin;         // of a block; a mesh's is its triangles
    kn_support support;
    double support_friction; // FRICTION: Coulomb's mu on the table, >= 0
    int probe_count;         // 0 .. KN_PROBES_MAX
    kn_probe_def probe[KN_PROBES_MAX];
    kn_solver_def solver;
} kn_model_def;

typedef struct kn_net_moduli { // of a net whose E was made 1
    double young[3];           // along x, y, z; a flat one's y is 0
    double poisson;            // mean of the axes
    double shear;              // mean of the planes; E/2(1 + nu) if it were isotropic
} kn_net_moduli;

#define KN_FACES_MAX 32
typedef struct kn_face { // one flat side of the block as a grid of nodes, for contact and drawing
    int origin;          // node id of its (0,0)
    int step[2];         // node id step along u and v; u x v points outwards
    int len[2];          // nodes along u and v
    double spacing_m;
} kn_face;

struct kn_kernels; // the loops chosen for this model's precision, law and processor (core/kernel.h)
struct kn_composite;
struct kn_shape;

typedef struct kn_model {
    kn_model_def def;
    kn_grid grid;                   // of a composite: as if all of it were fine
    struct kn_composite *composite; // else NULL
    kn_law law;
    // the lattice as solver, contact and drawing see it: a field of C components is [row][C][stride]
    int node_count;
    int row_count;
    size_t stride;        // reals of one component in a row: whole vectors, or 1 in a net, whose rows are nodes
    size_t edge_reals;    // in a field of one real per edge, padding included
    size_t *offset;       // [nodes] of the node's x component in a 3-component field; y and z follow a stride apart
    double (*rest_m)[3];  // [nodes] undeformed position: right-handed, z up
    double *node_mass_kg; // [nodes]
    uint8_t *support;     // [nodes] bit k set: the support holds component k
    int top_count;        // nodes that a plate can hold
    int *top;             // [top_count] their ids
    double *top_share;    // [top_count] of a load spread evenly over the top; sums to 1
    double size_m;        // longest extent
    double kappa_m;       // k of an edge of weight 1 / E of the material
    kn_net_moduli moduli; // of a net, else 0
    double creep_error;   // of a net: what the fit of gamma left, relative
    double gamma;         // stress area of an edge / (kappa weight L0)
    const struct kn_kernels *kernels;
    kn_isa isa;                 // what AUTO became
    void *tables;               // constants of the kernels in the model's precision, one block
    int skin_count;             // a net's outside, else 0
    int (*skin)[3];             // [skin_count] triangles of nodes, counter-clockwise from outside
    int face_count;             // faces that a probe can touch: top, four sides, base when the support is NONE
    int outside_count;          // and those that it cannot, behind them
    kn_face face[KN_FACES_MAX]; // face[0] is the top, or a part of it
    struct kn_shape *shape;     // [probe_count] of every probe but plates
    int base_count;             // nodes of the outside that the table can push: see outside.h
    int *base;                  // [base_count] their ids
    double *base_area_m2;       // [base_count] the table's share of each
    kn_edge *edges;             // of a net, under RK4 and FIXED, else NULL
    int edge_count;
    kn_cell *cells;      // with pressure, of a net or under RK4, else NULL
    double *cell_volume; // [cell_count] at rest, m^3
    int cell_count;
    struct kn_fixed_model *fixed; // FIXED only, else NULL: solver_fixed.h
    double rk4_limit_s;           // RK4 only: largest stable step at rest, 2.785 / lambda_max(C/M) by power iteration
    size_t state_bytes;           // of one kn_state with its arrays
} kn_model;

// Defaults: dough of the first paper, 5 x 5 x 3 cm, h = 1 cm, bonded, no probe; implicit F32 blend, 1 ms, 4..24
// CG iterations.
kn_model_def kn_model_def_default(void);

// Of the box around the undeformed object, whose base is centred over the origin, m.
void kn_model_def_extent(const kn_model_def *def, double extent_m[3]);

// Builds, or returns NULL and one sentence in error (which names RK4's limit when its step is unstable).
// Allocates once.
kn_model *kn_model_build(const kn_model_def *def, char *error, size_t error_size);
void kn_model_destroy(kn_model *model); // NULL is fine

// Whether this processor can run the kernels of an instruction set.
bool kn_isa_supported(kn_isa isa);

double kn_model_mass(const kn_model *model); // kg, without mass_scale

// Reals in a field of that many components, padding included.
static inline size_t kn_model_field(const kn_model *model, int components)
{
    return (size_t)model->row_count * (size_t)components * model->stride;
}

#endif
