#ifndef KN_CORE_LATTICE_LATTICE_H
#define KN_CORE_LATTICE_LATTICE_H
// The nodes, edges, cells and skin of a model, as kn_model_build (build.c) assembles them. lattice.c builds a plain
// block, net.c a mesh, composite.c a block of two resolutions.
//
// A net: a lattice on triangles or tetrahedra. Every side of an element is an edge with the whole law of law.h.
//
// Stiffness. Each element adds k = E V/L^2 to the stiffness of each of its sides (Van Gelder). V is the volume of the
// element, or its area times the thickness, and L the length of the side. If all nodes moved with the body's mean
// strain, the body would have exactly Young's modulus E. In fact the nodes give way, and the body is softer. So one
// factor for all edges sets Young's modulus of the whole body to E (net.c). With springs alone, Poisson's ratio is 1/4
// in three dimensions and 1/3 in two. The shear modulus depends on the directions of the mesh's edges. `knead check`
// prints Poisson's ratio and the shear modulus.
//
// Stress. The damper of an edge e sees the stress |f|/(gamma kappa_e L0), where f is the force of the edge. gamma makes
// the body creep like the 1-D element of the material. gamma is a property of the mesh, 0.55 to 0.9, and is also
// fitted.
//
// Memory. A row of a field holds sixteen nodes, as in a block. The nodes of a cell of the coarse level
// (core/solve/coarse.h) begin a row and follow one another, those with the most edges first; ids are the mesh's. The
// list of edges is sorted by the lower of the two node ids of an edge; strains are in the order of the edges' ends in
// memory.
#include "core/solve/kernel.h"

#define KN_NO_MEMORY "not enough memory for the model"

// kn_model_nodes allocates the model's arrays of nodes and of top nodes, kn_model_cells its arrays of cells. The
// parameters are the numbers of entries. Return false if memory is short.
bool kn_model_nodes(kn_model *model, int nodes, int top);
bool kn_model_cells(kn_model *model, int cells);

// Return the components of a base node that a support holds; bit k is set if component k is held.
uint8_t kn_support_mask(kn_support support);

// List the top nodes in model->top. Before the call, model->top_share[node] is the share of every node in a load on the
// top, and `sum` is the sum of these shares. After the call, model->top_share[t] is the share of top node t; the sum is
// 1.
void kn_top_list(kn_model *model, double sum);

// Build the nodes of a plain block. Return false if memory is short.
bool kn_block_build(kn_model *model);

// Fill in the model's nodes, edges, skin and top from def.mesh. Return NULL, or a sentence that says what is wrong.
const char *kn_net_build(kn_model *model);

// List the edges or the gas cells of a block for a solver that needs the list; a net already has its own. Return false
// if memory is short.
bool kn_lattice_edges(kn_model *model);
bool kn_lattice_cells(kn_model *model);

// List the nodes on the object's outside that the table can push up, with their areas. Return false if memory is short.
bool kn_base_build(kn_model *model);

// Return the area that a triangle of three skin nodes has at rest, m^2.
double kn_skin_area(const kn_model *model, const int node[3]);

// --- block of two resolutions: composite.c --------------------------------------------------------------------------

// A block of two resolutions: cells of side h in a box under the tool, cells of side 2h around the box. The block is
// cut into parts. Each part is a block of the regular lattice with its own kernel tables. A node that several parts
// share, or that hangs on a coarse face, is tied to master nodes:
//
//     +-----+-----+-+-+-+-+-----+-----+      parts   0 below, then beside it along x, along y, the box last
//     |     |     +-f-f-f-+     |     |      o       follows one node of an earlier part (1 master, the same place)
//     |     |     f-f-f-f-f     |     |      f on    the box's faces follow the 1, 2 or 4 coarse nodes around them,
//     +-----o-----o-f-o-f-o-----o-----+              v = mean of the masters
//     |     |     |     |     |       |
//     +-----+-----+-----+-----+-------+
//
// Let v = T y, where y holds the velocities of the free nodes. The step solves T'AT dy = T'r. The product of the matrix
// A and a search direction is computed part by part, as if the parts were separate. Before the product, the masters'
// directions are copied to the tied nodes. After the product, the tied nodes' results are added to the masters. Every
// edge has kappa = h/2.7 of its own cell and the same gamma (grid.h), so the material is the same inside and outside
// the box.
//
// Accuracy. A uniform strain passes exactly through the faces and edges of the box. In shear the box's corners are out
// of balance by up to a ninth of a boundary node's force. At a corner of the box, seven coarse cells meet one fine
// cell. The corner forces of body diagonals grow with h^2, and they cancel only between neighbours of equal size. So
// the corners should lie where the object deforms little: core/scene/draft_quality.c keeps them 0.7 of a tool's width
// away from the tool. tests/physics/test_composite.c measures the error.

#define KN_COMPOSITE_PARTS 7

typedef struct kn_tie { // a node that follows the mean of its masters
    unsigned node;      // offset of the tied node's x component in a 3-component field
    unsigned master[4]; // offsets of the masters' x components
    int count;          // number of masters: 1, 2 or 4
} kn_tie;

typedef struct kn_pull {   // a tie as one of its masters sees it
    unsigned master, node; // offsets as in kn_tie
    float share;           // share of the master in the force on the tied node: 1, 0.5 or 0.25
} kn_pull;

typedef struct kn_composite {
    kn_kernels kernels;       // kernels of the whole model: the parts' kernels and the ties
    const kn_kernels *inside; // kernels of a single part; they run on one part after the other
    int part_count;
    // [part_count] a regular block for each part, with its grid, law and tables. A part has no arrays of nodes; the
    // arrays of the whole model hold the nodes of all parts.
    struct kn_model *part;
    kn_coarse part_coarse[KN_COMPOSITE_PARTS]; // coarse level of the model, with its places seen from each part
    int corner[KN_COMPOSITE_PARTS][3];         // first corner of each part, in fine cells
    int coarse[KN_COMPOSITE_PARTS]; // node spacing of each part, in fine cells: 1 in the fine box, 2 elsewhere
    // index of the first node and of the first row of each part; a last entry holds the total number
    int node_first[KN_COMPOSITE_PARTS + 1], row_first[KN_COMPOSITE_PARTS + 1];
    int ties, pulls;                        // numbers of ties and of pulls
    kn_tie *tie;                            // ties of all parts; the masters of a tie are in earlier parts, and free
    kn_pull *pull;                          // pulls of all ties, sorted by master, then by tied node
    int pull_first[KN_COMPOSITE_PARTS + 1]; // first pull whose master is in the part
    // Ids of the coarse nodes: the node at every place whose three coordinates in fine cells are even, x fastest. If
    // several coarse parts have a node at this place, the entry is the id of the node in the earliest part. Inside the
    // fine box the entry is -1.
    int *place;
} kn_composite;

// Find the smallest fine box that contains the points from low_m to high_m (scene's frame) and a margin of margin_m
// around and below these points. fine[0] and fine[1] are the box's first and last corner in fine cells; all six numbers
// are even. The box always reaches up to the top of the block. Return false if the box would be the whole block,
// because a composite then saves nothing.
bool kn_composite_box(const kn_model_def *def, const double low_m[3], const double high_m[3], double margin_m,
                      int fine[2][3]);

// Return true if the definition has a fine box.
bool kn_composite_is(const kn_model_def *def);

// Return the number of nodes of all parts together, tied nodes included. A state of the model holds this many nodes.
int kn_composite_nodes(const kn_model_def *def);

// kn_composite_unfit returns the reason why no fine box is possible in this object, or NULL. kn_composite_check returns
// the reason why the fine box of the definition is wrong, or NULL if the definition has a valid fine box or none.
const char *kn_composite_unfit(const kn_model_def *def);
const char *kn_composite_check(const kn_model_def *def);

// Build the nodes, faces and kernels of a model with a fine box. Return NULL, or a sentence that says what is wrong.
const char *kn_composite_build(kn_model *model);
void kn_composite_destroy(kn_composite *composite); // does nothing if `composite` is NULL

// Store the displacement, m, at the place ixyz, counted in fine cells. Outside the fine box, the result is the mean of
// the coarse nodes around the place. Works for any block.
void kn_composite_displacement(const kn_model *model, const kn_state *state, const int ixyz[3], double u_m[3]);

// Return the memory that the composite takes in addition to the model [bytes].
size_t kn_composite_bytes(const kn_model *model);

// Return the number of edges of all parts. An edge in the face between two parts is in the lists of both parts, with
// half its weight in each.
int kn_composite_edges(const kn_model *model);

// If a master of `node` lies in the same place as `node`, return this master; otherwise return `node`.
int kn_composite_master(const kn_model *model, int node);

// Return the number of tied nodes. A tied node follows its masters and carries no load itself.
int kn_composite_tied(const kn_model *model);

#endif
