#ifndef KN_CORE_GRID_H
#define KN_CORE_GRID_H
// The regular lattice: where its nodes and edges are in memory, and how stiff each edge is.
//
// Nodes are the corners of n-1 cubic cells along x, y, z. Every cell has 12 sides, 12 face diagonals and 4 body
// diagonals. Each of them is an edge with the whole material law. A cell adds 1/4 of the full stiffness to each of its
// sides, 1/2 to a face diagonal and 1 to a body diagonal. So an edge on the surface is weaker than an inner one, and
// the uniaxial patch test is exact on any block. Diagonals are e times as stiff as the sides, with 0 <= e <= 1. Then
// kappa = k/E of a side follows from the lattice's elastic constants: E = C11 - 2 C12^2/(C11 + C12) in 3-D and C11 -
// C12^2/C11 in plane stress:
//
//     block   kappa = h (3 + 17 e)/(3 (1 + e)(1 + 8 e)):  h/2.7 with e = 1      flat   kappa = t (1 + e)/(1 + 2 e)
//
// A block is equally stiff in all directions only with e = 3/11, where nu = 1/4. With e = 1, nu = 0.35 along the axes,
// and the shear modulus is 2.3 times that of an isotropic body of the same E and nu.
//
// The damper of an edge sees the stress |f|/(gamma kappa weight L0), where f is the edge's force and L0 its rest
// length. The factor gamma makes the lattice creep like the 1-D element of the material. gamma is 1 for e = 0 and 0.46
// for e = 1. For other e, gamma comes from a fitted table.
//
// A flat object is one layer of nodes in the x-z plane with thickness t, in plane stress: nothing moves along y.
//
// Memory. Rows run along the axis that fills 16 lanes best. A row has K = ceil(n/16) vectors, INTERLEAVED: lane l of
// vector k is node l*K + k of the row. So the neighbour at +1 is in the next vector, and only the last vector needs a
// lane rotation. A field of C components is  [row][component][K][16].  Forward edges of a node (13, half of 26):
//
//     e = 0                     own row, +1 along the row
//     e = 1 + 3g + (d+1)        row group g = 0..3, shifted d = -1, 0, +1 along the row:
//                               g0 (b+1)   g1 (b-1, c+1)   g2 (c+1)   g3 (b+1, c+1)
//
//        c ^     g1  g2  g3     a: along the row (lanes)
//          |      o   o   o     b: row within a plane
//          |      .   X   g0    c: plane
//          +---> b
//
// So the sums of a row are complete after the row and all rows before it have been visited. One pass over the rows is
// enough, without scatter and without colouring.
//
// All functions are real-time safe; kn_grid_edges takes time in proportion to the number of edges.
#include <stdbool.h>
#include <stddef.h>

#define KN_LANES 16   // lanes of a vector, equal on every machine, so that all machines sum in the same order
#define KN_FORWARD 13 // number of forward edges of a node

typedef struct kn_grid {
    int n[3];         // number of nodes along x, y, z, >= 1
    double spacing_m; // side h of a cell
    bool flat;        // the object is one layer of nodes in the x-z plane, in plane stress
    double depth_m;   // extent of a cell along y: thickness of a flat object, else h
    double diagonal;  // ratio e of a diagonal's stiffness to a side's, 0 .. 1
    // scene axis (0 x, 1 y, 2 z) of each grid axis: a runs along a row, b from row to row, c from plane to plane
    int axis[3];
    int len[3];     // number of nodes along the grid's axes a, b, c
    int vectors;    // number K of vectors per row
    int rows;       // number of rows, len[1] * len[2]
    int nodes;      // number of nodes, n[0] * n[1] * n[2]
    double kappa_m; // ratio of an inner side's stiffness k to Young's modulus E of the material [m]
    double gamma;   // ratio of an edge's stress area to kappa L0
} kn_grid;

// One edge of a lattice in a plain list, which Runge-Kutta, tests and drawing use.
typedef struct kn_edge {
    int i, j;      // node ids; the edge runs from i to j
    int slot;      // index of the edge's strain in the field `strain`; block: [row][13][K][16]
    double weight; // ratio of the edge's stiffness to that of an inner side; factor of k1, c1, c2 and stress area
    double rest_m; // rest length L0 [m]
} kn_edge;

// Offset from a node to the far end of each of its forward edges, in nodes along the grid's axes a, b, c.
extern const int kn_grid_forward[KN_FORWARD][3];

// Fill in *g: choose the row axis and compute the derived numbers. n[] >= 1; spacing_m > 0. thickness_m > 0 makes a
// flat object, which needs n[1] = 1. thickness_m = 0 makes a block; a bar or a sheet is a block, too. diagonal = 0
// leaves the diagonals out. A grid is plain data of the caller.
void kn_grid_init(kn_grid *g, const int n[3], double spacing_m, double thickness_m, double diagonal);

// Set the row axis and the number of vectors per row. Grids that share fields need equal numbers of vectors. The
// vectors must have a lane for every node of a row.
void kn_grid_lay(kn_grid *g, int axis, int vectors);

// Convert between grid coordinates and node ids. Ids count x fastest, then y, then z: id = (iz*ny + iy)*nx + ix.
int kn_grid_node(const kn_grid *g, int ix, int iy, int iz);
void kn_grid_coords(const kn_grid *g, int node, int ixyz[3]);

// Return the offset of a node's x component in a 3-component field. Its y component is kn_grid_stride(g) reals further,
// its z component twice as far.
size_t kn_grid_offset(const kn_grid *g, int node);
static inline size_t kn_grid_stride(const kn_grid *g) { return (size_t)g->vectors * KN_LANES; }
// Return the number of reals in a field with `components` numbers per node, padding included.
static inline size_t kn_grid_field(const kn_grid *g, int components)
{
    return (size_t)g->rows * (size_t)components * kn_grid_stride(g);
}

// Store a node's rest position, m. The frame is right-handed, z points up, and the origin is the centre of the block's
// base.
void kn_grid_rest(const kn_grid *g, int node, double x_m[3]);

// Return the mass of a node in units of the mass of one cell: 1/8 for a corner .. 1 for an inner node of a block. The
// mass of one cell is rho h^2 depth_m.
double kn_grid_share(const kn_grid *g, int node);

// List every edge in out[], in the order of node ids and forward edges, and return the number of edges. If out is NULL,
// only count the edges. The caller owns out[].
int kn_grid_edges(const kn_grid *g, kn_edge *out);

#endif
