#ifndef KN_CORE_GRID_H
#define KN_CORE_GRID_H
// The regular lattice: where its nodes and edges stand in memory, and how stiff each edge is.
//
// Nodes are the corners of n-1 cubic cells along x, y, z. Every cell has 12 sides, 12 face diagonals, 4 body diagonals;
// each is an edge with the whole material law. Edges are assembled per cell: a side gets 1/4, a face diagonal 1/2, a
// body diagonal 1 from each cell that holds it, so edges on the surface carry their share and no more, and the uniaxial
// patch test is exact on any block. Diagonals may be e times as stiff as the sides, 0 <= e <= 1; then kappa = k/E of a
// side, from C11 - 2 C12^2/(C11 + C12) in 3-D and C11 - C12^2/C11 in plane stress, is
//
//     block   kappa = h (3 + 17 e)/(3 (1 + e)(1 + 8 e)):  h/2.7 with e = 1      flat   kappa = t (1 + e)/(1 + 2 e)
//
// A block is as stiff in every direction with e = 3/11 only, and has nu = 1/4 then; e = 1 has nu = 0.35 along its axes and
// 2.3 times the shear modulus of an isotropic body of its E and nu.
//
// The stress that the damper sees is |f|/(gamma kappa weight L0). gamma makes a lattice creep as the 1-D element does:
// 1 without diagonals, 0.46 with full ones, in between by a table that was fitted.
//
// A flat object is one layer of nodes in the x-z plane, t thick, in plane stress: nothing moves along y.
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

typedef struct kn_grid {
    int n[3];         // nodes along x, y, z, >= 1
    double spacing_m; // side h of a cell
    bool flat;        // one layer across y, in plane stress
    double depth_m;   // of a cell along y: thickness of a flat object, else h
    double diagonal;  // e: stiffness of a diagonal / that of a side, 0 .. 1
    int axis[3];      // world axis (0 x, 1 y, 2 z) that a (along the row), b (rows), c (planes) run along
    int len[3];       // n along a, b, c
    int vectors;      // K, vectors per row
    int rows;         // len[1] * len[2]
    int nodes;        // n[0] * n[1] * n[2]
    double kappa_m;   // k of an inner side / E of the material
    double gamma;     // stress area of an edge / (kappa L0)
} kn_grid;

// One edge of the lattice as a plain list sees it (RK4, tests, drawing).
typedef struct kn_edge {
    int i, j;      // node ids; the edge runs from i to j
    int slot;      // index of its strain in the field [row][13][K][16]
    double weight; // share of an inner side, of a diagonal times e: scales k1, c1, c2 and the stress area alike
    double rest_m; // L0
} kn_edge;

// Steps of forward edge e along a, b, c.
extern const int kn_grid_forward[KN_FORWARD][3];

// Chooses the row axis and fills the derived numbers. n[] >= 1; spacing_m > 0; thickness_m > 0 makes a flat object of
// n[1] = 1, 0 a block (or a bar or sheet as deep as a cell); diagonal = 0 leaves the diagonals out.
void kn_grid_init(kn_grid *g, const int n[3], double spacing_m, double thickness_m, double diagonal);

// Lays rows along that axis in that many vectors, which must hold it: for grids that share fields.
void kn_grid_lay(kn_grid *g, int axis, int vectors);

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

// Share of the material around a node that belongs to it, 1/8 (corner) .. 1 (inside): mass = rho h^2 depth share.
double kn_grid_share(const kn_grid *g, int node);

// Fills out[] (NULL: only counts) with every edge; returns their number. Fixed order.
int kn_grid_edges(const kn_grid *g, kn_edge *out);

#endif
