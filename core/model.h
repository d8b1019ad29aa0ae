#ifndef KN_CORE_MODEL_H
#define KN_CORE_MODEL_H
// The model: everything about an object and its solver that does not change while the object is touched.
// Fill in a kn_model_def (start from kn_model_def_default) and build the model. Any number of states and
// threads may share it. Nothing here is written after kn_model_build, and only kn_model_build allocates.
#include "core/cell.h"
#include "core/grid.h"
#include "core/law.h"
#include "core/material.h"
#include "core/simplices.h"
#include <stdint.h>

#define KN_PROBES_MAX 4
#define KN_NAME_MAX 24 // bytes, with the NUL: KNEAD_CONTACT_<name> must fit LCM's 63-byte channel names

typedef enum kn_structure {
    KN_STRUCTURE_DIAGONALS, // sides, face and body diagonals
    KN_STRUCTURE_AXIS       // sides only: a block cannot keep its shape; exact for a single bar
} kn_structure;

typedef enum kn_support {
    KN_SUPPORT_BONDED,       // the base is glued to the table
    KN_SUPPORT_FRICTIONLESS, // the base stays in its plane and slides freely (held in tension too)
    KN_SUPPORT_NONE,         // free body
    KN_SUPPORT_FRICTION      // lies on a table that only pushes, with friction: the object can be lifted off
} kn_support;

typedef enum kn_skin_form { // skin of a block between its nodes, for every tool but a plate: see contact.h
    KN_SKIN_SPLINE,         // quadratic
    KN_SKIN_BILINEAR        // as good for wide tools: radius of two spacings and more
} kn_skin_form;

typedef enum kn_probe_shape {
    KN_PROBE_PLATE,  // level rectangle, sticks to the top nodes it touches and lets go in tension
    KN_PROBE_SPHERE, // rigid ball, a disc on a flat block. This and the shapes below (shape.h) use foundation contact
    KN_PROBE_CAPSULE,
    KN_PROBE_BOX,
    KN_PROBE_CROSS,
    KN_PROBE_CYLINDER,
    KN_PROBE_UNION,
    KN_PROBE_MESH // one part, from a surface file
} kn_probe_shape;

typedef struct kn_probe_def {
    char name[KN_NAME_MAX]; // channel suffix: KNEAD_POSE_<name>; [a-z0-9_]+
    kn_probe_shape shape;
    double size_m[3];             // PLATE: extent along x and y; BOX: x, y, z; CROSS: arm length, arm width, height
    double radius_m;              // SPHERE, CAPSULE, CYLINDER: >= spacing (refused below), >= 1.5 spacing advised
    double length_m;              // CAPSULE, CYLINDER: along its axis, z
    double edge_m;                // BOX, CROSS, CYLINDER: radius of its edges; 0: sharp
    const struct kn_shape *parts; // UNION, MESH: the parts in the tool frame; not owned, must outlive the model
    double foundation_n_m3;       // contact stiffness per area; 0 = default (2.5e7, see contact.h)
    double friction;              // Coulomb's mu of the contact while it slides; 0: frictionless
    double adhesion_pa;           // tension that the contact carries before it lets go; 0: none
    double grip_n;                // force up to which `grip` ties the contact to the tool; 0: no grip
    double coupling_n_m;   // virtual coupling between pose and tool; 0: the tool follows its pose rigidly (tool.h)
    double coupling_n_s_m; // damping of the virtual coupling
    // Range of the tool's centre along x and y; all 0: anywhere. The scene computes kn_model_def.fine from it; no step
    // reads it.
    double reach_m[2][2];
} kn_probe_def;

typedef enum kn_solver { KN_SOLVER_IMPLICIT, KN_SOLVER_RK4, KN_SOLVER_FIXED } kn_solver;
typedef enum kn_precision { KN_PRECISION_F32, KN_PRECISION_F64 } kn_precision;

// Instruction sets. All have the same 16 logical lanes and give the same bits. AUTO takes the best of the processor.
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
    double mass_scale;  // >= 1; gives RK4 a stable step; stated in the scene, never chosen silently
} kn_solver_def;

// The part of a kn_solver_def that may change from step to step. It sets how much time a step takes and how exact the
// step is. No memory layout depends on it.
typedef struct kn_effort {
    int iterations, iterations_max; // iterations 0: take all values from the model
    double tolerance;
    int passes;
    kn_linearization linearization;
} kn_effort;

typedef struct kn_model_def {
    kn_material material;
    double density_kg_m3;     // > 0
    double gravity_m_s2;      // downwards, >= 0
    const kn_simplices *mesh; // checked, in the scene's frame; not owned, must outlive the model. NULL: a block
    int nodes[3];             // block: nodes along x, y, z
    double spacing_m;         // block: side of a cell; mesh: mean edge
    double thickness_m;       // > 0: a flat object in the x-z plane, nodes[1] = 1, in plane stress; else 0
    kn_structure structure;
    double diagonal_stiffness; // stiffness of a diagonal / that of a side, in (0, 1]; ignored without diagonals
    int fine[2][3]; // block: first and last corner, in cells, of the box that keeps the spacing; cells outside the box
                    // are twice as wide (composite.h). All even; all 0: one lattice everywhere
    kn_pressure pressure;
    double inside_pressure_pa; // absolute, at rest; > 0 with pressure
    kn_skin_form skin;         // of a block; the skin of a mesh is its triangles
    kn_support support;
    double support_friction; // FRICTION: Coulomb's mu on the table, >= 0
    int probe_count;         // 0 .. KN_PROBES_MAX
    kn_probe_def probe[KN_PROBES_MAX];
    kn_solver_def solver;
} kn_model_def;

typedef struct kn_net_moduli { // elastic constants of a net that is scaled to E = 1
    double young[3];           // along x, y, z; y is 0 for a flat net
    double poisson;            // mean of the axes
    double shear;              // mean of the planes; E/2(1 + nu) if it were isotropic
} kn_net_moduli;

#define KN_FACES_MAX 32
typedef struct kn_face { // one flat side of the block as a grid of nodes, for contact and drawing
    int origin;          // node id of grid point (0,0)
    int step[2];         // node id step along u and v; u x v points outwards
    int len[2];          // nodes along u and v
    double spacing_m;
} kn_face;

struct kn_kernels; // the loops chosen for this model's precision, law and processor (core/kernel.h)
struct kn_composite;
struct kn_shape;

typedef struct kn_model {
    kn_model_def def;
    kn_grid grid;                   // grid of a block; of a composite: as if the whole block were fine
    struct kn_composite *composite; // NULL if the model is not a composite
    kn_law law;
    // The lattice for solver, contact and drawing. A field of C components is [row][C][stride].
    int node_count;
    int row_count;
    size_t stride;        // reals of one component in a row: whole vectors, or 1 in a net, whose rows are nodes
    size_t edge_reals;    // reals in a field of one real per edge, padding included
    size_t *offset;       // [nodes] offset of a node's x component in a 3-component field; y, z follow a stride apart
    double (*rest_m)[3];  // [nodes] undeformed position: right-handed, z up
    double *node_mass_kg; // [nodes]
    uint8_t *support;     // [nodes] bit k set: the support holds component k
    int top_count;        // number of nodes that a plate can hold
    int *top;             // [top_count] ids of those nodes
    double *top_share;    // [top_count] share of a load that is spread evenly over the top; sums to 1
    double size_m;        // longest extent
    double kappa_m;       // stiffness k of an edge with weight 1, divided by E of the material
    kn_net_moduli moduli; // net only, else 0
    double creep_error;   // net only: relative error that the fit of gamma left
    double gamma;         // stress area of an edge / (kappa weight L0)
    const struct kn_kernels *kernels;
    kn_isa isa;                 // instruction set in use, never AUTO
    void *tables;               // constants of the kernels in the model's precision, one block
    int skin_count;             // number of triangles of a net's outside, else 0
    int (*skin)[3];             // [skin_count] triangles of nodes, counter-clockwise from outside
    int face_count;             // faces that a probe can touch: top, four sides; base if support is NONE or FRICTION
    int outside_count;          // all faces; those that a probe cannot touch come last
    kn_face face[KN_FACES_MAX]; // face[0] is the top, or a part of it
    struct kn_shape *shape;     // [probe_count] shape of every probe but plates
    int base_count;             // number of nodes of the outside that the table can push: see outside.h
    int *base;                  // [base_count] ids of those nodes
    double *base_area_m2;       // [base_count] area of the outside that each of them stands for
    kn_edge *edges;             // of a net, or under RK4 and FIXED; else NULL
    int edge_count;
    kn_cell *cells;      // with pressure, of a net or under RK4; else NULL
    double *cell_volume; // [cell_count] volume at rest, m^3
    int cell_count;
    struct kn_fixed_model *fixed; // FIXED only, else NULL: solver_fixed.h
    double rk4_limit_s;           // RK4 only: largest stable step at rest, 2.785 / lambda_max(C/M) by power iteration
    size_t state_bytes;           // size of one kn_state with its arrays
} kn_model;

// Return the default definition: dough of the first paper, 5 x 5 x 3 cm, h = 1 cm, bonded, no probe; implicit F32
// blend, 1 ms, 4..24 CG iterations.
kn_model_def kn_model_def_default(void);

// Store the extent of the box around the undeformed object, m. The object's base is centred over the origin.
void kn_model_def_extent(const kn_model_def *def, double extent_m[3]);

// Build a model. Return NULL and store one sentence in error if it cannot be built; if RK4's step is unstable, the
// sentence names its limit. Allocates once.
kn_model *kn_model_build(const kn_model_def *def, char *error, size_t error_size);
void kn_model_destroy(kn_model *model); // NULL is fine

// Return true if this processor can run the kernels of an instruction set.
bool kn_isa_supported(kn_isa isa);

double kn_model_mass(const kn_model *model); // kg, without mass_scale

// Return the number of reals in a field of that many components, padding included.
static inline size_t kn_model_field(const kn_model *model, int components)
{
    return (size_t)model->row_count * (size_t)components * model->stride;
}

#endif
