#ifndef KN_CORE_COMPOSITE_H
#define KN_CORE_COMPOSITE_H
// A block of two resolutions: cells of side h in a box under the tool, of 2h around it. Parts are blocks of the regular
// lattice, each with its own kernels' tables; nodes that several of them have, or that hang on a coarse face, are tied:
//
//     +-----+-----+-+-+-+-+-----+-----+      parts   0 below, then beside it along x, along y, the box last
//     |     |     +-f-f-f-+     |     |      o       follows one node of an earlier part (1 master, the same place)
//     |     |     f-f-f-f-f     |     |      f on    the box's faces follow the 1, 2 or 4 coarse nodes around them,
//     +-----o-----o-f-o-f-o-----o-----+              v = mean of the masters
//     |     |     |     |     |       |
//     +-----+-----+-----+-----+-------+
//
// With v = T y, y the velocities that are free, the step solves T'AT dy = T'r: products run part by part as if they
// were alone, before them masters' directions go to the tied nodes, after them tied nodes' results go to the masters.
// Every edge keeps kappa = h/2.7 of its own cell and the same gamma: the material is the same on both sides.
//
// What it costs in accuracy. A uniform strain is carried exactly through faces and edges of the box; in shear its
// corners are not in balance, by up to a ninth of a boundary node's force: seven coarse cells meet one fine one there,
// and the corner forces of body diagonals, which cancel between neighbours, grow with h^2. So corners belong where
// little happens: core/scene/draft_fine.c keeps them 0.7 of a tool's width away from it. tests/physics/test_composite.c
// measures.
#include "core/kernel.h"

#define KN_COMPOSITE_PARTS 7

typedef struct kn_tie { // a node that follows the mean of its masters
    size_t node;        // offsets of x components in a 3-component field
    size_t master[4];
    int count; // 1, 2 or 4
} kn_tie;

typedef struct kn_composite {
    kn_kernels kernels;       // of the model: those of the parts, tied
    const kn_kernels *inside; // of every part
    int part_count;
    struct kn_model *part; // [part_count] a regular block each: its grid, law and tables; no nodes of its own
    int corner[KN_COMPOSITE_PARTS][3]; // of each part, in fine cells
    int coarse[KN_COMPOSITE_PARTS];    // 2, of the box 1: cells of the fine lattice to a spacing
    int node_first[KN_COMPOSITE_PARTS + 1], row_first[KN_COMPOSITE_PARTS + 1];
    kn_tie *tie; // by the part of the node that is tied; masters are in earlier parts
    int tie_first[KN_COMPOSITE_PARTS + 1];
    int *place; // node at every even place, x fastest, -1 inside the box: of the earliest part
} kn_composite;

// Smallest box of even corners that holds the places low..high, m in the block's frame, and `margin` around and below
// them; it reaches the top. False when it would be as good as the whole block: then there is nothing to gain.
bool kn_composite_box(const kn_model_def *def, const double low_m[3], const double high_m[3], double margin_m,
                      int fine[2][3]);

// Whether it has a fine box at all.
bool kn_composite_is(const kn_model_def *def);

// Nodes of all its parts, those tied among them: what a state holds.
int kn_composite_nodes(const kn_model_def *def);

// What keeps an object from having a fine box at all, and what is wrong with its own, in words; NULL: nothing.
const char *kn_composite_unfit(const kn_model_def *def);
const char *kn_composite_check(const kn_model_def *def);

// Fills the model's nodes, faces, kernels. NULL, or what went wrong.
const char *kn_composite_build(kn_model *model);
void kn_composite_kernels(kn_model *model);         // composite_step.c: its last step
void kn_composite_destroy(kn_composite *composite); // NULL is fine

// Displacement, m, at a node of the lattice as if it were fine everywhere: means of coarse nodes outside of the box.
// For any block.
void kn_composite_displacement(const kn_model *model, const kn_state *state, const int ixyz[3], double u_m[3]);

// Memory of its own, beside the model's.
size_t kn_composite_bytes(const kn_model *model);

// Edges of all parts; those in a face of two parts stand in both, half each.
int kn_composite_edges(const kn_model *model);

// The node itself, or the one that it follows when that is in the same place.
int kn_composite_master(const kn_model *model, int node);

// Nodes that follow others and carry nothing themselves.
int kn_composite_tied(const kn_model *model);

#endif
