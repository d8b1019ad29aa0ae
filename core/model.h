#ifndef KN_CORE_MODEL_H
#define KN_CORE_MODEL_H
// The model: everything about an object and its solver that does not change while the object is touched. Fill in a
// kn_model_def (start from kn_model_def_default) and build the model. Any number of states and threads may share a
// model, because no function writes to it after kn_model_build. Only kn_model_build allocates. All numbers are in SI
// units.
#include "core/cell.h"
#include "core/grid.h"
#include "core/law.h"
#include "core/material.h"
#include "core/simplices.h"
#include <stdint.h>

#define KN_PROBES_MAX 4
// Size of a probe's name, NUL included [bytes]. KNEAD_CONTACT_<name> must fit LCM's 63-byte channel names.
#define KN_NAME_MAX 24

typedef enum kn_structure {
    KN_STRUCTURE_DIAGONALS, // edges are the sides, face diagonals and body diagonals of the cells
    // edges are the sides of the cells only; suited for a single row of nodes, but a block cannot keep its shape
    KN_STRUCTURE_AXIS
} kn_structure;

typedef enum kn_support {
    KN_SUPPORT_BONDED,       // the base is glued to the table
    KN_SUPPORT_FRICTIONLESS, // the base slides freely in its plane and cannot be lifted off
    KN_SUPPORT_NONE,         // the object is a free body
    KN_SUPPORT_FRICTION      // the object lies on a table with friction and can be lifted off
} kn_support;

typedef enum kn_skin_form { // shape of a block's skin between the nodes, as all tools but plates see it (contact.h)
    KN_SKIN_SPLINE,         // quadratic B-spline with the nodes as control points
    KN_SKIN_BILINEAR // bilinear between four nodes; as good as the spline if the tool's radius is at least 2 spacings
} kn_skin_form;

typedef enum kn_probe_shape {
    KN_PROBE_PLATE, // level rectangle that holds the top nodes it touches and releases nodes that pull too hard
    // rigid ball (on a flat block a disc); this and the shapes below use foundation contact (contact.h)
    KN_PROBE_SPHERE,
    KN_PROBE_CAPSULE,
    KN_PROBE_BOX,
    KN_PROBE_CROSS,
    KN_PROBE_CYLINDER,
    KN_PROBE_UNION,
    KN_PROBE_MESH // closed surface from a file
} kn_probe_shape;

typedef enum kn_plate_surface {
    KN_PLATE_STICKS, // held nodes move with the plate
    KN_PLATE_SLIDES  // held nodes slide along the plate without friction
} kn_plate_surface;

typedef struct kn_probe_def {
    char name[KN_NAME_MAX]; // channel suffix: KNEAD_POSE_<name>; [a-z0-9_]+
    kn_probe_shape shape;
    kn_plate_surface surface;
    double size_m[3]; // PLATE: extent along x and y; BOX: along x, y, z; CROSS: arm length, arm width, height
    // SPHERE, CAPSULE, CYLINDER: radius; the least radius is the lattice's spacing, 1.5 spacings are advised
    double radius_m;
    double length_m; // CAPSULE, CYLINDER: length along the tool's axis z
    double edge_m;   // BOX, CROSS, CYLINDER: radius of the rounded edges; 0: sharp edges
    // UNION, MESH: shape of the parts in the tool frame; not owned, must outlive the model
    const struct kn_shape *parts;
    double foundation_n_m3; // stiffness of the contact per area; 0: default of 2.5e7 N/m^3 (see contact.h)
    double friction;        // coefficient of sliding friction between tool and object; 0: frictionless
    // tension that the contact carries before the tool releases the skin, or the plate the node; 0: no adhesion
    double adhesion_pa;
    double grip_n; // force up to which a closed grip ties the touched skin to the tool; 0: no grip
    // stiffness of the virtual coupling between pose and tool; 0: the tool follows rigidly (tool.h)
    double coupling_n_m;
    double coupling_n_s_m; // damping of the virtual coupling
    // Range of the tool's centre along x and y; all 0: anywhere. The scene computes kn_model_def.fine from this range;
    // the steps do not use it.
    double reach_m[2][2];
} kn_probe_def;

typedef enum kn_solver { KN_SOLVER_IMPLICIT, KN_SOLVER_RK4, KN_SOLVER_FIXED } kn_solver;
typedef enum kn_precision { KN_PRECISION_F32, KN_PRECISION_F64 } kn_precision;

// Instruction sets of the kernels. All give equal bits, because each computes with 16 logical lanes. AUTO takes the
// best one that the processor has.
typedef enum kn_isa { KN_ISA_AUTO, KN_ISA_BASE, KN_ISA_AVX2, KN_ISA_AVX512 } kn_isa;

typedef struct kn_solver_def {
    kn_solver kind;
    kn_precision precision; // precision of a state's fields; RK4 and FIXED need F64 (FIXED stores integers in it)
    kn_linearization linearization;
    kn_isa isa;
    double dt_s;        // time step
    int iterations;     // number of conjugate gradient iterations that every step does, >= 1
    int iterations_max; // largest number of iterations of a step, >= iterations
    // A step continues after `iterations` iterations while its preconditioned residual exceeds tolerance times the
    // largest residual of the last second. 0: a step never continues. Range [0, 1).
    double tolerance;
    int passes; // linearisations of the law per step: 1 in real time, 3-5 with SECANT for a converged reference
    // factor of the inertia, >= 1; a larger factor keeps RK4 stable with longer steps; equal at all quality points
    double mass_scale;
} kn_solver_def;

// The part of a kn_solver_def that may change from step to step. It sets how much time a step takes and how exact the
// step is. The layout of a state does not depend on it.
typedef struct kn_effort {
    int iterations, iterations_max; // see kn_solver_def; if `iterations` is 0, the model's values replace all members
    double tolerance;
    int passes;
    kn_linearization linearization;
} kn_effort;

typedef struct kn_model_def {
    kn_material material;
    double density_kg_m3;     // > 0
    double gravity_m_s2;      // downwards, >= 0
    const kn_simplices *mesh; // checked mesh in the scene's frame, not owned, must outlive the model; NULL: a block
    int nodes[3];             // block: number of nodes along x, y, z
    double spacing_m;         // block: side of a cell; mesh: mean length of an edge
    double thickness_m;       // thickness of a flat object (x-z plane, nodes[1] = 1, plane stress); 0: not flat
    kn_structure structure;
    double diagonal_stiffness; // ratio of a diagonal's stiffness to a side's, in (0, 1]; ignored without diagonals
    // Block of two resolutions: first and last corner of the box of fine cells, counted in fine cells. Cells outside
    // the box are twice as wide (lattice.h). All six numbers are even; all 0: a uniform block.
    int fine[2][3];
    kn_pressure pressure;
    double inside_pressure_pa; // absolute pressure of the gas in the undeformed object; > 0 unless `pressure` is NONE
    // factor on all forces of the edges and of the gas, > 0: cells of this size are too stiff by a factor that a
    // comparison with a finer lattice gives. Inertia, weight and the contacts of tools are as without it.
    double force_factor;
    kn_skin_form skin; // skin of a block; the skin of a mesh is its triangles
    kn_support support;
    double support_friction; // FRICTION: coefficient of friction on the table, >= 0
    double support_depth_m;  // mesh: height above the lowest node up to which the support holds the nodes, >= 0
    int probe_count;         // number of probes, 0 .. KN_PROBES_MAX
    kn_probe_def probe[KN_PROBES_MAX];
    kn_solver_def solver;
} kn_model_def;

typedef struct kn_net_moduli { // elastic constants of a net, relative to Young's modulus E of the material
    double young[3];           // Young's modulus along x, y, z; 0 along y for a flat net
    double poisson;            // Poisson's ratio, mean over the axes
    double shear;              // shear modulus, mean over the planes; an isotropic body would have 1/(2 (1 + nu))
} kn_net_moduli;

#define KN_FACES_MAX 32
typedef struct kn_face { // one flat side of the block as a grid of nodes, for contact and drawing
    int origin;          // node id of the face's first corner
    int step[2];         // increment of the node id along the face's directions u and v; u x v points outwards
    int len[2];          // number of nodes along u and v
    double spacing_m;
} kn_face;

struct kn_kernels; // hot loops for one lattice, precision and instruction set (core/solve/kernel.h)
struct kn_composite;
struct kn_coarse;
struct kn_shape;

typedef struct kn_model {
    kn_model_def def;
    kn_grid grid;                   // grid of a block; for a composite, the grid as if the whole block were fine
    struct kn_composite *composite; // NULL if the model is not a composite
    struct kn_coarse *coarse;       // coarse level of the preconditioner (core/solve/coarse.h); NULL: none
    kn_law law;
    // The lattice. A field with C components per node has the layout [row_count][C][stride].
    int node_count;
    int row_count;
    size_t stride;        // number of reals of one component in a row; 16 in a net
    size_t edge_reals;    // number of reals in a field of one real per edge, padding included
    size_t product_reals; // number of reals of the vectors g of all edges (kn_work.g in core/solve/kernel.h)
    int *row_turns;       // [row_count] net: largest number of edges at a node of the row; else NULL
    // [node_count] offset of a node's x component in a 3-component field. The y component is one stride further, the z
    // component two strides.
    size_t *offset;
    double (*rest_m)[3];  // [node_count] position in the undeformed object; right-handed frame, z up
    double *node_mass_kg; // [node_count]
    uint8_t *support;     // [node_count] bit k is set if the support holds component k of the node
    int top_count;        // number of nodes that a plate can hold
    int *top;             // [top_count] ids of the nodes that a plate can hold
    double *top_share;    // [top_count] part of an evenly spread load that each top node carries; the sum is 1
    double top_area_m2;   // horizontal area of the undeformed top
    double size_m;        // longest extent of the undeformed object
    double kappa_m;       // ratio of the stiffness of an edge with weight 1 to Young's modulus E of the material
    kn_net_moduli moduli; // net: measured elastic constants; else 0
    double creep_error;   // net: relative error of the creep strain after gamma has been fitted
    double gamma;         // ratio of an edge's stress area to kappa weight L0
    const struct kn_kernels *kernels;
    kn_isa isa;     // instruction set in use, never AUTO
    void *tables;   // constants of the kernels in the model's precision, one block
    int skin_count; // number of triangles of a net's outside, else 0
    int (*skin)[3]; // [skin_count] triangles of nodes, counter-clockwise from outside
    // number of faces that a probe can touch: top and sides, and the base if the support is NONE or FRICTION
    int face_count;
    int outside_count;          // number of all faces of a block; faces that a probe cannot touch come last
    kn_face face[KN_FACES_MAX]; // face[0] is the top, or a part of it
    struct kn_shape *shape;     // [probe_count] shape of each probe; empty for a plate
    int base_count;             // number of nodes of the outside that the table can push: see lattice.h
    int *base;                  // [base_count] ids of the nodes that the table can push
    double *base_area_m2;       // [base_count] area of the object's outside that belongs to each node of `base`
    kn_edge *edges;             // [edge_count] list of edges of a net, or for RK4 and FIXED; else NULL
    int edge_count;
    kn_cell *cells;      // [cell_count] gas cells of a net, or of a block for RK4 and FIXED; else NULL
    double *cell_volume; // [cell_count] volume at rest, m^3
    int cell_count;
    struct kn_fixed_model *fixed; // FIXED: image of the model in integers (solver_fixed.h); else NULL
    double rk4_limit_s;           // RK4: largest stable step at rest, 2.785 / lambda_max(C/M) by power iteration
} kn_model;

// Return the default definition: a block of the first paper's dough, 5 x 5 x 3 cm with cells of 1 cm, bonded to the
// table, and one probe, a ball of 3 cm named finger. Its solver is the implicit one: F32, BLEND, steps of 1 ms, 4 to 24
// iterations.
kn_model_def kn_model_def_default(void);

// Store the extent of the box around the undeformed object along x, y, z, m. The object's base is centred over the
// origin.
void kn_model_def_extent(const kn_model_def *def, double extent_m[3]);

// Build a model, which the caller destroys. `def` NULL: the default definition. The model copies `def`, but not the
// mesh and the parts to which `def` points. If the model cannot be built, return NULL and store one sentence in
// error[error_size]. If the step of RK4 is unstable, the sentence names the longest stable step.
kn_model *kn_model_build(const kn_model_def *def, char *error, size_t error_size);
void kn_model_destroy(kn_model *model); // does nothing if `model` is NULL

// Return true if this processor can run the kernels of an instruction set.
bool kn_isa_supported(kn_isa isa);

double kn_model_mass(const kn_model *model); // mass of the object, not multiplied by mass_scale [kg]

// Return the number of reals in a field with `components` numbers per node, padding included.
static inline size_t kn_model_field(const kn_model *model, int components)
{
    return (size_t)model->row_count * (size_t)components * model->stride;
}

// Return true if the fields of the model's states are floats, false if they are doubles.
static inline bool kn_model_single(const kn_model *model) { return model->def.solver.precision == KN_PRECISION_F32; }
static inline size_t kn_model_real(const kn_model *model) // size of a real in the fields of a state [bytes]
{
    return kn_model_single(model) ? sizeof(float) : sizeof(double);
}

// Pressure of the gas in the undeformed object with the factor on all forces [Pa].
static inline double kn_model_gas_pa(const kn_model *m) { return m->def.force_factor * m->def.inside_pressure_pa; }

// Get, set or increase number i of a field in the model's precision. Use in scalar code only (contact, output); the
// kernels have a type for each precision.
static inline double kn_real_get(const kn_model *model, const void *field, size_t i)
{
    return kn_model_single(model) ? (double)((const float *)field)[i] : ((const double *)field)[i];
}
static inline void kn_real_set(const kn_model *model, void *field, size_t i, double value)
{
    if (kn_model_single(model)) ((float *)field)[i] = (float)value;
    else ((double *)field)[i] = value;
}
static inline void kn_real_add(const kn_model *model, void *field, size_t i, double value)
{
    kn_real_set(model, field, i, kn_real_get(model, field, i) + value);
}

#endif
