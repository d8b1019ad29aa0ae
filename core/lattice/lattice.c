// The lattice of a plain block, and functions for all lattices: the arrays of nodes and cells, and the areas of the
// object's outside.
#include "core/lattice/lattice.h"
#include "core/algebra/algebra.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// --- arrays of nodes and cells --------------------------------------------------------------------------------------

bool kn_model_nodes(kn_model *m, int nodes, int top)
{
    m->node_count = nodes;
    m->top_count = top;
    m->offset = calloc((size_t)nodes, sizeof *m->offset);
    m->rest_m = calloc((size_t)nodes, sizeof *m->rest_m);
    m->node_mass_kg = calloc((size_t)nodes, sizeof *m->node_mass_kg);
    m->support = calloc((size_t)nodes, 1);
    m->top = calloc((size_t)top + 1, sizeof *m->top);
    m->top_share = calloc((size_t)top + 1, sizeof *m->top_share);
    return m->offset && m->rest_m && m->node_mass_kg && m->support && m->top && m->top_share;
}

bool kn_model_cells(kn_model *m, int cells)
{
    m->cell_count = cells;
    m->cells = calloc((size_t)cells + 1, sizeof *m->cells);
    m->cell_volume = calloc((size_t)cells + 1, sizeof *m->cell_volume);
    return m->cells && m->cell_volume;
}

uint8_t kn_support_mask(kn_support support)
{
    return support == KN_SUPPORT_BONDED ? 7 : support == KN_SUPPORT_FRICTIONLESS ? 4 : 0;
}

void kn_top_list(kn_model *m, double sum)
{
    m->top_count = 0;
    // on entry top_share is indexed by node, on return by top node; this works in place because top_count <= node
    for (int node = 0; node < m->node_count; node++) {
        const double share = m->top_share[node];
        if (!(share > 0)) continue;
        m->top_share[m->top_count] = share / sum;
        m->top[m->top_count++] = node;
    }
}

// --- block ----------------------------------------------------------------------------------------------------------

// List the faces of a block: top, four sides, base. u x v points outwards on each face. Faces that a probe cannot touch
// come last.
static void build_faces(kn_model *m)
{
    const int *n = m->grid.n, x = 1, y = n[0], z = n[0] * n[1];
    const double h = m->grid.spacing_m;
    const kn_face face[6] = {
        {(n[2] - 1) * z, {x, y}, {n[0], n[1]}, h},
        {(n[0] - 1) * x, {y, z}, {n[1], n[2]}, h},
        {0, {z, y}, {n[2], n[1]}, h},
        {(n[1] - 1) * y, {z, x}, {n[2], n[0]}, h},
        {0, {x, z}, {n[0], n[2]}, h},
        {0, {y, x}, {n[1], n[0]}, h},
    };
    memcpy(m->face, face, sizeof face);
    m->face_count = m->def.support >= KN_SUPPORT_NONE ? 6 : 5;
    m->outside_count = 6;
    if (!m->grid.flat) return;
    // a flat object has the faces top, two ends and base; its two flat sides are no faces, because no probe can touch
    // them
    m->face[2] = face[2];
    m->face[3] = face[5];
    m->face_count -= 2;
    m->outside_count -= 2;
}

// List the nodes of the top and their shares of a dead load, which sum to 1.
static void build_top(kn_model *m)
{
    const kn_face *top = &m->face[0];
    double shares = 0;
    for (int t = 0; t < m->top_count; t++) {
        m->top[t] = top->origin + t % top->len[0] * top->step[0] + t / top->len[0] * top->step[1];
        m->top_share[t] = kn_grid_share(&m->grid, m->top[t]);
        shares += m->top_share[t];
    }
    for (int t = 0; t < m->top_count; t++) m->top_share[t] /= shares;
}

bool kn_block_build(kn_model *m)
{
    const kn_grid *g = &m->grid;
    build_faces(m);
    if (!kn_model_nodes(m, g->nodes, m->face[0].len[0] * m->face[0].len[1])) return false;
    m->row_count = g->rows;
    m->stride = kn_grid_stride(g);
    m->edge_reals = kn_grid_field(g, KN_FORWARD);
    m->product_reals = (size_t)kn_work_edge(m) * m->edge_reals;
    m->kappa_m = g->kappa_m;
    m->gamma = g->gamma;
    m->size_m = fmax(fmax(g->n[0], g->n[1]), g->n[2]) * g->spacing_m;
    double h = g->spacing_m, whole = m->def.density_kg_m3 * h * h * g->depth_m;
    for (int i = 0; i < g->nodes; i++) {
        m->offset[i] = kn_grid_offset(g, i);
        kn_grid_rest(g, i, m->rest_m[i]);
        m->node_mass_kg[i] = whole * kn_grid_share(g, i);
        // in the order of the ids, z changes slowest, so the base has the first ids; nodes of a flat object stay in its
        // plane
        if (i < g->n[0] * g->n[1]) m->support[i] = kn_support_mask(m->def.support);
        if (g->flat) m->support[i] |= 2;
    }
    build_top(m);
    return true;
}

// List the cells of a block.
static bool build_cells(kn_model *m)
{
    const kn_grid *g = &m->grid;
    if (!kn_model_cells(m, kn_grid_cells(g, NULL))) return false;
    kn_grid_cells(g, m->cells);
    for (int c = 0; c < m->cell_count; c++) m->cell_volume[c] = g->spacing_m * g->spacing_m * g->depth_m;
    return true;
}

bool kn_lattice_edges(kn_model *m)
{
    if (m->def.mesh) return true; // kn_net_build has already listed the edges of a net
    m->edge_count = kn_grid_edges(&m->grid, NULL);
    m->edges = calloc((size_t)m->edge_count + 1, sizeof(kn_edge));
    if (m->edges) kn_grid_edges(&m->grid, m->edges);
    return m->edges != NULL;
}

bool kn_lattice_cells(kn_model *m) { return m->def.mesh || m->def.pressure == KN_PRESSURE_NONE || build_cells(m); }

// --- outside --------------------------------------------------------------------------------------------------------

// Compute the area that every node of a block's outside stands for. A node on an edge or corner belongs to several
// faces. It stands for the largest of its areas on these faces, because the object may lie on that face.
static void face_areas(const kn_model *m, double *area)
{
    for (int f = 0; f < m->outside_count; f++) {
        const kn_face *face = &m->face[f];
        for (int v = 0; v < face->len[1]; v++)
            for (int u = 0; u < face->len[0]; u++) {
                double share = face->spacing_m * face->spacing_m;
                if (m->grid.flat) share *= m->grid.depth_m / face->spacing_m;
                // a node at the rim of a face has half of the area of an inner node
                if (face->len[0] > 1 && (u == 0 || u == face->len[0] - 1)) share *= 0.5;
                if (face->len[1] > 1 && (v == 0 || v == face->len[1] - 1)) share *= 0.5;
                int node = face->origin + u * face->step[0] + v * face->step[1];
                area[node] = fmax(area[node], share);
            }
    }
}

double kn_skin_area(const kn_model *m, const int node[3])
{
    double u[3], v[3], n[3];
    for (int k = 0; k < 3; k++) {
        u[k] = m->rest_m[node[1]][k] - m->rest_m[node[0]][k];
        v[k] = m->rest_m[node[2]][k] - m->rest_m[node[0]][k];
    }
    kn_cross(u, v, n);
    return 0.5 * sqrt(kn_dot(n, n));
}

// Compute the area that every node of a net's outside stands for: a third of each of its triangles.
static void skin_areas(const kn_model *m, double *area)
{
    for (int t = 0; t < m->skin_count; t++)
        for (int c = 0; c < 3; c++) area[m->skin[t][c]] += kn_skin_area(m, m->skin[t]) / 3;
}

bool kn_base_build(kn_model *m)
{
    double *area = calloc((size_t)m->node_count, sizeof *area);
    if (!area) return false;
    if (m->skin_count > 0) skin_areas(m, area);
    else face_areas(m, area);
    for (int i = 0; i < m->node_count; i++) {
        if (m->support[i] & 4) area[i] = 0; // the support holds this node's height, so the table never pushes the node
        m->base_count += area[i] > 0;
    }
    m->base = calloc((size_t)m->base_count + 1, sizeof *m->base);
    m->base_area_m2 = calloc((size_t)m->base_count + 1, sizeof *m->base_area_m2);
    for (int i = 0, at = 0; m->base && m->base_area_m2 && i < m->node_count; i++) {
        if (!(area[i] > 0)) continue;
        m->base[at] = i;
        m->base_area_m2[at++] = area[i];
    }
    free(area);
    return m->base && m->base_area_m2;
}
