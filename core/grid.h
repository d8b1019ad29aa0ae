#ifndef KN_CORE_GRID_H
#define KN_CORE_GRID_H
// The regular lattice: where its nodes and edges stand in memory, and how stiff each edge is.
//
// Nodes are the corners of n-1 cubic cells along x, y, z. Every cell has 12 sides, 12 face diagonals, 4 body diagonals;
// each is an edge with the whole material law. Edges are assembled per cell: a side gets 1/4, a face diagonal 1/2, a
// body diagonal 1 from each cell that holds it, so edges on the surface carry their share and no more, and the uniaxial
// patch test is exact on any block. With equal k on all of them E = 2.7 k/h, i.e. kappa = k/E = h/2.7 metres. The
// stress that the damper sees is |f|/(gamma kappa L0): gamma = 0.46 makes a lattice creep as the 1-D element does
// within 3-7 % (20-70 gf/cm^2, 60 s).
//
// Memory. Rows run along the axis that fills 16 lanes best; a row has K = ceil(n/16) vectors, INTERLEAVED: lane l of
// vector k is the node l*K + k of the row. So the neighbour at +1 is the next vector, and only the last one needs a
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
// so a row's sums are complete once every row before it has been visited: no scatter, no colouring, one pass.
#include <stdbool.h>
#include <stddef.h>

#define KN_LANES 16   // lanes of every vector on every machine: the same sums in the same order everywhere
#define KN_FORWARD 13 // forward edges of a node

typedef enum kn_structure {
    KN_STRUCTURE_DIAGONALS, // sides, face and body diagonals, equal k: E' = 2.7, gamma = 0.46
    KN_STRUCTURE_AXIS       // sides only: E' = 1, gamma = 1. Cannot keep its shape in 3-D; exact for a single bar.
} kn_structure;

typedef struct kn_grid {
    int n[3];         // nodes along x, y, z, >= 1
    double spacing_m; // side h of a cell
    kn_structure structure;
    int axis[3];     // world axis (0 x, 1 y, 2 z) that a (along the row), b (rows), c (planes) run along
    int len[3];      // n along a, b, c
    int vectors;     // K, vectors per row
    int rows;        // len[1] * len[2]
    int nodes;       // n[0] * n[1] * n[2]
    double kappa_m;  // k of an inner edge / E of the material = h/2.7 (1/E' in general)
    double gamma;    // stress area of an edge / (kappa L0)
} kn_grid;

// One edge of the lattice as a plain list sees it (RK4, tests, drawing).
typedef struct kn_edge {
    int i, j;       // node ids; the edge runs from i to j
    int slot;       // index of its strain in the field [row][13][K][16]
    double weight;  // share of an inner edge, 1/4 .. 1: scales k1, c1, c2 and the stress area alike
    double rest_m;  // L0
} kn_edge;

// Steps of forward edge e along a, b, c.
extern const int kn_grid_forward[KN_FORWARD][3];

// Chooses the row axis and fills the derived numbers. n[] >= 1; spacing_m > 0.
void kn_grid_init(kn_grid *g, const int n[3], double spacing_m, kn_structure structure);

// Node ids count x fastest, then y, then z: id = (iz*ny + iy)*nx + ix.
int kn_grid_node(const kn_grid *g, int ix, int iy, int iz);
void kn_grid_coords(const kn_grid *g, int node, int ixyz[3]);

// Offset of a node's x component in a 3-component field; y and z follow at kn_grid_stride(g) and twice that.
size_t kn_grid_offset(const kn_grid *g, int node);
static inline size_t kn_grid_stride(const kn_grid *g) { return (size_t)g->vectors * KN_LANES; }
// Reals in a field of that many components, padding included.
static inline size_t kn_grid_field(const kn_grid *g, int components)
{
    return (size_t)g->rows * (size_t)components * kn_grid_stride(g);
}

// Rest position, m: right-handed, z up, origin at the centre of the block's base.
void kn_grid_rest(const kn_grid *g, int node, double x_m[3]);

// Share of the material around a node that belongs to it, 1/8 (corner) .. 1 (inside): mass = rho h^3 share.
double kn_grid_share(const kn_grid *g, int node);

// Fills out[] (NULL: only counts) with every edge; returns their number. Fixed order.
int kn_grid_edges(const kn_grid *g, kn_edge *out);

#endif
