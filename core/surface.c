#include "core/surface.h"

#include "core/lattice/lattice.h"

#include <stdlib.h>
#include <string.h>

// One side of the block across axis a; u x v points outwards.
//
//     v ^   3---2      counter-clockwise from outside; the diagonals of the quads alternate like a chequerboard,
//       |   | / |      so no direction is favoured
//       +-> 0---1
//         u
typedef struct side {
    int a, u, v; // axes: a is normal to the side, u and v are along the side
    int at;      // index of the side's nodes along axis a
} side;

// Describe side number 0..5 of a block. The order of its axes u and v makes u x v point outwards.
static side side_of(const kn_grid *g, int number)
{
    int a = number / 2, u = (a + 1) % 3, v = (a + 2) % 3; // u x v = +a
    if (number % 2) return (side){a, u, v, g->n[a] - 1};
    return (side){a, v, u, 0};
}

// Return the id of the node with the indices iu, iv along u and v of a side.
static int side_node(const kn_grid *g, const side *s, int iu, int iv)
{
    int ixyz[3];
    ixyz[s->a] = s->at;
    ixyz[s->u] = iu;
    ixyz[s->v] = iv;
    return kn_grid_node(g, ixyz[0], ixyz[1], ixyz[2]);
}

// The two ways to split a quad into two triangles, as corner numbers of the quad.
static const int split[2][2][3] = {{{0, 1, 2}, {0, 2, 3}}, {{0, 1, 3}, {1, 2, 3}}};

// List the triangles of a block's skin as node ids, and return their number. If out is NULL, only count them.
static int triangles(const kn_grid *g, int (*out)[3])
{
    int count = 0;
    for (int number = 0; number < 6; number++) {
        side s = side_of(g, number);
        for (int iv = 0; iv + 1 < g->n[s.v]; iv++)
            for (int iu = 0; iu + 1 < g->n[s.u]; iu++)
                for (int t = 0; t < 2; t++, count++) {
                    if (!out) continue;
                    int corner[4] = {side_node(g, &s, iu, iv), side_node(g, &s, iu + 1, iv),
                                     side_node(g, &s, iu + 1, iv + 1), side_node(g, &s, iu, iv + 1)};
                    for (int k = 0; k < 3; k++) out[count][k] = corner[split[(iu + iv) & 1][t][k]];
                }
    }
    return count;
}

// List the triangles on the outside of a composite, and return their number. If out is NULL, only count them. A tied
// node in the same place as its master is replaced by the master, so that the parts share vertices.
static int composite_triangles(const kn_model *m, int (*out)[3])
{
    int count = 0;
    for (int f = 0; f < m->outside_count; f++) {
        const kn_face *face = &m->face[f];
        for (int v = 0; v + 1 < face->len[1]; v++)
            for (int u = 0; u + 1 < face->len[0]; u++)
                for (int t = 0; t < 2; t++, count++) {
                    int near = face->origin + u * face->step[0] + v * face->step[1];
                    int corner[4] = {near, near + face->step[0], near + face->step[0] + face->step[1],
                                     near + face->step[1]};
                    for (int k = 0; out && k < 3; k++)
                        out[count][k] = kn_composite_master(m, corner[split[(u + v) & 1][t][k]]);
                }
    }
    return count;
}

kn_surface *kn_surface_create(const kn_model *model)
{
    kn_grid g = model->grid;
    bool block = model->skin_count == 0;
    if (g.flat) g.n[1] = 2; // a flat object is drawn with a front and a back layer
    size_t nodes = (size_t)model->node_count * (g.flat ? 2 : 1);
    kn_surface *s = calloc(1, sizeof *s);
    // vertex[i]: at first 1 if a triangle uses node i; later the index of this node's vertex
    int *vertex = calloc(nodes, sizeof *vertex);
    if (!s || !vertex) goto fail;
    // count the triangles first, then list them as node ids
    s->triangle_count = model->composite ? composite_triangles(model, NULL)
                        : block          ? triangles(&g, NULL)
                                         : model->skin_count;
    s->node = malloc(nodes * sizeof *s->node);
    s->across_m = calloc(nodes, sizeof *s->across_m);
    s->triangle = malloc(((size_t)s->triangle_count * 3 + 1) * sizeof *s->triangle);
    if (!s->node || !s->across_m || !s->triangle) goto fail;
    if (model->composite) composite_triangles(model, (int(*)[3])s->triangle);
    else if (block) triangles(&g, (int(*)[3])s->triangle);
    else memcpy(s->triangle, model->skin, (size_t)s->triangle_count * sizeof *model->skin);
    // give numbers to the nodes that triangles use, and replace node ids by vertex numbers
    for (int i = 0; i < 3 * s->triangle_count; i++) vertex[s->triangle[i]] = 1;
    for (int node = 0; node < (int)nodes; node++)
        if (vertex[node]) {
            int v = vertex[node] = s->vertex_count++;
            s->node[v] = node;
            // flat block: node ids of the doubled grid alternate between a front row and a back row; a vertex is half
            // the thickness away from its node
            if (!g.flat) continue;
            int row = node / g.n[0];
            s->node[v] = row / 2 * g.n[0] + node % g.n[0];
            s->across_m[v] = (row % 2 - 0.5) * g.depth_m;
        }
    for (int i = 0; i < 3 * s->triangle_count; i++) s->triangle[i] = vertex[s->triangle[i]];
    free(vertex);
    return s;
fail:
    free(vertex);
    kn_surface_destroy(s);
    return NULL;
}

void kn_surface_destroy(kn_surface *s)
{
    if (!s) return;
    free(s->node);
    free(s->across_m);
    free(s->triangle);
    free(s);
}

void kn_surface_rest(const kn_surface *s, const kn_model *model, int vertex, double x_m[3])
{
    memcpy(x_m, model->rest_m[s->node[vertex]], 3 * sizeof *x_m);
    x_m[1] += s->across_m[vertex];
}

void kn_surface_positions(const kn_surface *s, const kn_model *model, const kn_state *state, float *xyz)
{
    for (int i = 0; i < s->vertex_count; i++) {
        double x_m[3];
        kn_state_position(model, state, s->node[i], x_m);
        x_m[1] += s->across_m[i];
        for (int k = 0; k < 3; k++) xyz[3 * i + k] = (float)x_m[k];
    }
}
