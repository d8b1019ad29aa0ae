#include "core/grid.h"

#include <math.h>

// Return the number of lanes of all rows, padding included, if the rows run along an axis. The row axis is the one with
// the fewest lanes.
static long padded(const int n[3], int along)
{
    long vectors = (n[along] + KN_LANES - 1) / KN_LANES;
    return vectors * KN_LANES * ((long)n[0] * n[1] * n[2] / n[along]);
}

void kn_grid_lay(kn_grid *g, int axis, int vectors)
{
    g->axis[0] = axis;
    g->axis[1] = axis == 0 ? 1 : 0;
    g->axis[2] = axis == 2 ? 1 : 2;
    for (int a = 0; a < 3; a++) g->len[a] = g->n[g->axis[a]];
    g->vectors = vectors;
    g->rows = g->len[1] * g->len[2];
}

static void choose_axes(kn_grid *g)
{
    int best = 0; // if two axes are equally good, x is preferred, then y: the layout is equal on every machine
    for (int a = 1; a < 3; a++)
        if (padded(g->n, a) < padded(g->n, best)) best = a;
    kn_grid_lay(g, best, (g->n[best] + KN_LANES - 1) / KN_LANES);
}

// Return kappa, the stiffness k of a side divided by Young's modulus E of the material, m.
static double side_per_modulus(double h, double thickness, double e)
{
    if (thickness > 0) return thickness / ((1 + 2 * e) / (1 + e));
    return h / (3 * (1 + e) * (1 + 8 * e) / (3 + 17 * e));
}

// Return gamma for diagonals that are e times as stiff as sides. The table minimises the worst creep error of the first
// paper's dough at 20, 28, 50 and 70 gf/cm^2 (60 s under load, 30 s of rest, small strains, relative L2 against the 1-D
// element). One factor cannot fit all loads, least of all if diagonals carry a part of the load. The worst errors, for
// the values of e in the table from left to right:
//     block  0  1  2  4  8  13  18  13  7 %        flat  0  1  1  1  2  3  5  11  4 %
static double creep_area(double e, bool flat)
{
    enum { ROWS = 9 };
    static const double at[ROWS] = {0, 0.003, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1};
    static const double area[2][ROWS] = {{1, 0.99, 0.96, 0.925, 0.835, 0.725, 0.595, 0.505, 0.46},
                                         {1, 0.995, 0.99, 0.98, 0.955, 0.915, 0.845, 0.70, 0.72}};
    // between two values of e in the table, gamma is linear in log e
    int i = 0;
    while (i + 2 < ROWS && e > at[i + 1]) i++;
    if (e >= at[i + 1]) return area[flat][i + 1];
    double t = i == 0 ? e / at[1] : log(e / at[i]) / log(at[i + 1] / at[i]);
    return area[flat][i] + t * (area[flat][i + 1] - area[flat][i]);
}

void kn_grid_init(kn_grid *g, const int n[3], double spacing_m, double thickness_m, double diagonal)
{
    for (int a = 0; a < 3; a++) g->n[a] = n[a];
    g->spacing_m = spacing_m;
    g->flat = thickness_m > 0;
    g->depth_m = g->flat ? thickness_m : spacing_m;
    g->diagonal = diagonal;
    choose_axes(g);
    g->nodes = n[0] * n[1] * n[2];
    g->kappa_m = side_per_modulus(spacing_m, thickness_m, diagonal);
    g->gamma = creep_area(diagonal, g->flat);
}

int kn_grid_node(const kn_grid *g, int ix, int iy, int iz) { return (iz * g->n[1] + iy) * g->n[0] + ix; }

void kn_grid_coords(const kn_grid *g, int node, int ixyz[3])
{
    ixyz[0] = node % g->n[0];
    ixyz[1] = node / g->n[0] % g->n[1];
    ixyz[2] = node / (g->n[0] * g->n[1]);
}

// Compute a node's coordinates along the grid axes: place in its row (a), row in its plane (b), plane (c).
static void lattice_coords(const kn_grid *g, int node, int abc[3])
{
    int ixyz[3];
    kn_grid_coords(g, node, ixyz);
    for (int k = 0; k < 3; k++) abc[k] = ixyz[g->axis[k]];
}

// Return the offset of one component of node number `a` of a row. With K vectors per row, this node is in lane a / K of
// vector a % K.
static size_t row_slot(const kn_grid *g, int row, int components, int component, int a)
{
    size_t vector =
        ((size_t)row * (size_t)components + (size_t)component) * (size_t)g->vectors + (size_t)(a % g->vectors);
    return vector * KN_LANES + (size_t)(a / g->vectors);
}

size_t kn_grid_offset(const kn_grid *g, int node)
{
    int abc[3];
    lattice_coords(g, node, abc);
    return row_slot(g, abc[2] * g->len[1] + abc[1], 3, 0, abc[0]);
}

void kn_grid_rest(const kn_grid *g, int node, double x_m[3])
{
    int ixyz[3];
    kn_grid_coords(g, node, ixyz);
    x_m[0] = (ixyz[0] - 0.5 * (g->n[0] - 1)) * g->spacing_m;
    x_m[1] = (ixyz[1] - 0.5 * (g->n[1] - 1)) * g->spacing_m;
    x_m[2] = ixyz[2] * g->spacing_m;
}

// Return the extent of the material that belongs to node i of n along one axis, in cells: 0.5 at the two ends, else 1.
// For a single layer of nodes (bar, sheet), return 1.
static double end_share(int i, int n) { return n > 1 && (i == 0 || i == n - 1) ? 0.5 : 1.0; }

double kn_grid_share(const kn_grid *g, int node)
{
    int ixyz[3];
    kn_grid_coords(g, node, ixyz);
    double share = 1;
    for (int k = 0; k < 3; k++) share *= end_share(ixyz[k], g->n[k]);
    return share;
}

const int kn_grid_forward[KN_FORWARD][3] = {
    {1, 0, 0},  {-1, 1, 0}, {0, 1, 0}, {1, 1, 0},  {-1, -1, 1}, {0, -1, 1}, {1, -1, 1},
    {-1, 0, 1}, {0, 0, 1},  {1, 0, 1}, {-1, 1, 1}, {0, 1, 1},   {1, 1, 1},
};

static int node_at(const kn_grid *g, const int abc[3])
{
    int ixyz[3];
    for (int k = 0; k < 3; k++) ixyz[g->axis[k]] = abc[k];
    return kn_grid_node(g, ixyz[0], ixyz[1], ixyz[2]);
}

// Fill *edge with forward edge e of a node. Return false if the lattice has no such edge.
static bool edge_at(const kn_grid *g, int node, int e, kn_edge *edge)
{
    int abc[3], to[3], steps = 0;
    lattice_coords(g, node, abc);
    double weight = 1;
    for (int k = 0; k < 3; k++) {
        to[k] = abc[k] + kn_grid_forward[e][k];
        if (to[k] < 0 || to[k] >= g->len[k]) return false;
        if (kn_grid_forward[e][k] != 0) steps++;
        // half in the first and in the last plane across this axis, because there the edge has cells on one side only
        else weight *= end_share(abc[k], g->len[k]);
    }
    if (steps > 1 && g->diagonal == 0) return false;
    edge->i = node;
    edge->j = node_at(g, to);
    edge->slot = (int)row_slot(g, abc[2] * g->len[1] + abc[1], KN_FORWARD, e, abc[0]);
    edge->weight = steps > 1 ? weight * g->diagonal : weight;
    edge->rest_m = g->spacing_m * (steps == 1 ? 1.0 : steps == 2 ? 1.4142135623730951 : 1.7320508075688772);
    return true;
}

int kn_grid_edges(const kn_grid *g, kn_edge *out)
{
    int count = 0;
    for (int node = 0; node < g->nodes; node++)
        for (int e = 0; e < KN_FORWARD; e++) {
            kn_edge edge;
            if (!edge_at(g, node, e, &edge)) continue;
            if (out) out[count] = edge;
            count++;
        }
    return count;
}
