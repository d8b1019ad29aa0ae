#include "core/solve/coarse.h"
#include "core/algebra/algebra.h"
#include "core/lattice/lattice.h"
#include "core/solve/solver.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// Number of coarse nodes: one for every NODES_EACH nodes, but at least LEAST and at most MOST. More than MOST bring
// nothing up to 16 820 nodes, where the coarse level takes an eighth of an iteration. No cell is divided into cells
// shorter than 2 spacings. The order of a net's nodes in memory, and so its snapshots, depends on these numbers.
#define NODES_EACH 50
#define LEAST 27
#define MOST 100
// A lattice with fewer nodes, held by its support, has no coarse level: it takes 4 iterations anyway. One that nothing
// holds takes twice as many without a coarse level, however small it is. But a small net has none, so that the order of
// its nodes does not depend on its support.
#define SMALLEST 500
// The rigid motions of an object that its support does not hold depend on the contact, which Ac does not contain. Here
// they get this share of the largest diagonal as resistance, so that the coarse level leaves them to kn_rigid
// (solver_implicit.c), or in flat objects and composites, which have none, to the blocks. A share of 1000 would stop
// other motions, too: under a plate that holds nodes, a third more iterations.
#define RIGID_SHARE 0.03

// Return the axis along which the cells are longest and can be divided once more, or -1 if there is none.
static int divisible(const kn_coarse *c, const double extent_m[3], double spacing_m, int most)
{
    int best = -1;
    double best_m = 0;
    for (int k = 0; k < 3; k++) {
        const int n = c->nodes[k], total = c->nodes[0] * c->nodes[1] * c->nodes[2];
        // the kernels of a block hold the coarse nodes of a row in the lanes of a vector; also after the division, a
        // cell is at least 2 spacings long
        if (n < 2 || n >= KN_LANES || total / n * (n + 1) > most || extent_m[k] < 2 * spacing_m * n) continue;
        if (extent_m[k] / (n - 1) > best_m) best = k, best_m = extent_m[k] / (n - 1);
    }
    return best;
}

// Find the box around the undeformed object: its extent, and for a mesh its first corner, m. Return the number of nodes
// of the object.
static int box_of(const kn_model *m, double first_m[3], double extent_m[3])
{
    const kn_simplices *s = m->def.mesh;
    for (int k = 0; k < 3; k++) extent_m[k] = s ? 0 : (m->grid.n[k] - 1) * m->grid.spacing_m;
    if (!s) return kn_composite_is(&m->def) ? kn_composite_nodes(&m->def) : m->grid.nodes;
    for (int k = 0; k < 3; k++) {
        double low = INFINITY, high = -INFINITY;
        for (int i = 0; i < s->node_count; i++) low = fmin(low, s->x_m[i][k]), high = fmax(high, s->x_m[i][k]);
        first_m[k] = low;
        extent_m[k] = high - low;
    }
    return s->node_count;
}

bool kn_coarse_plan(kn_model *m)
{
    double first_m[3] = {0}, extent_m[3];
    if (m->def.solver.kind != KN_SOLVER_IMPLICIT) return true;
    const int nodes = box_of(m, first_m, extent_m);
    if (nodes < SMALLEST && (m->def.mesh || m->def.support < KN_SUPPORT_NONE)) return true;
    const int most = nodes / NODES_EACH < LEAST ? LEAST : nodes / NODES_EACH > MOST ? MOST : nodes / NODES_EACH;
    kn_coarse *c = m->coarse = calloc(1, sizeof *c);
    if (!c) return false;
    // begin with one cell, and divide the longest cells again and again: they come near to cubes
    for (int k = 0; k < 3; k++) c->nodes[k] = extent_m[k] > 0 ? 2 : 1;
    for (int k; (k = divisible(c, extent_m, m->def.spacing_m, most)) >= 0;) c->nodes[k]++;
    for (int k = 0; k < 3; k++) {
        c->first_m[k] = first_m[k];
        c->cell_m[k] = c->nodes[k] > 1 ? extent_m[k] / (c->nodes[k] - 1) : 0;
    }
    c->unknowns = 3 * c->nodes[0] * c->nodes[1] * c->nodes[2];
    c->padded = (c->unknowns + KN_LANES - 1) / KN_LANES * KN_LANES;
    return true;
}

double kn_coarse_place(const kn_coarse *c, int axis, double x_m)
{
    const double most = c->nodes[axis] - 1;
    return most > 0 ? fmin(most, fmax(0, (x_m - c->first_m[axis]) / c->cell_m[axis])) : 0;
}

void kn_coarse_cell(const kn_coarse *c, const double x_m[3], int cell[3], double place[3])
{
    for (int k = 0; k < 3; k++) {
        place[k] = kn_coarse_place(c, k, x_m[k]);
        cell[k] = (int)place[k];
        if (cell[k] > c->nodes[k] - 2) cell[k] = c->nodes[k] > 1 ? c->nodes[k] - 2 : 0;
        place[k] -= cell[k];
    }
}

void kn_coarse_destroy(kn_coarse *coarse)
{
    if (!coarse) return;
    free(coarse->inverse);
    free(coarse);
}

// Return the reals that the transfers between a block and the coarse level need (kernel_coarse.h).
static size_t transfer_reals(const kn_model *block, const kn_coarse *coarse)
{
    const kn_grid *g = &block->grid;
    const size_t rows = (size_t)coarse->nodes[g->axis[1]] + 1, planes = (size_t)coarse->nodes[g->axis[2]] + 1;
    return (planes + (size_t)g->len[2]) * rows * 3 * kn_grid_stride(g);
}

size_t kn_coarse_reals(const kn_model *m)
{
    size_t most = 0;
    if (!m->coarse) return 0;
    if (!m->composite && !m->def.mesh) most = transfer_reals(m, m->coarse);
    for (int p = 0; m->composite && p < m->composite->part_count; p++) {
        const size_t reals = transfer_reals(&m->composite->part[p], m->coarse);
        most = reals > most ? reals : most;
    }
    return 2 * (size_t)m->coarse->padded + most;
}

size_t kn_coarse_bytes(const kn_model *m)
{
    const kn_coarse *c = m->coarse;
    return c ? sizeof *c + (size_t)c->unknowns * (size_t)c->padded * kn_model_real(m) : 0;
}

// --- the matrix -----------------------------------------------------------------------------------------------------

// Compute the columns of Ac with the model's own kernels: each is the product of A at rest and one coarse node's
// motion.
static bool coarse_matrix(const kn_model *m, double *a)
{
    const size_t n = (size_t)m->coarse->unknowns, padded = (size_t)m->coarse->padded;
    kn_state *state = kn_state_create(m);
    kn_scratch *scratch = kn_scratch_create(m);
    if (state && scratch) {
        const kn_work *w = &scratch->work;
        const size_t bytes = kn_state_field(m, 3);
        memset(w->r, 0, bytes);
        memset(w->p, 0, kn_state_field(m, 6));
        m->kernels->edge(m, state, w, m->def.solver.linearization, false);
        for (size_t j = 0; j < n; j++) {
            memset(w->coarse, 0, 2 * padded * kn_model_real(m));
            kn_real_set(m, w->coarse, padded + j, 1);
            memset(w->z, 0, bytes);
            memset(w->r, 0, bytes);
            m->kernels->prolongation(m, w);
            m->kernels->apply(m, state, w, 0);
            m->kernels->update(m, w, -1); // r = A T e_j
            m->kernels->restriction(m, w);
            for (size_t i = 0; i < n; i++) a[i * n + j] = kn_real_get(m, w->coarse, i);
        }
        // the products are exact to the model's precision only: make the matrix symmetric
        for (size_t i = 0; i < n; i++)
            for (size_t j = 0; j < i; j++) a[i * n + j] = a[j * n + i] = 0.5 * (a[i * n + j] + a[j * n + i]);
    }
    kn_state_destroy(state);
    kn_scratch_destroy(scratch);
    return state && scratch;
}

// Store in q[6][unknowns] the six rigid motions of the coarse nodes, made orthogonal and of length 1. A motion that the
// others contain, such as the turn of a row of nodes about its axis, becomes 0.
static void rigid_motions(const kn_coarse *c, double *q)
{
    const size_t n = (size_t)c->unknowns;
    for (size_t motion = 0; motion < 6; motion++) {
        double *to = q + motion * n, size2 = 0;
        for (size_t i = 0; i < n / 3; i++) {
            // x: place of the coarse node, from the middle of all
            const int node = (int)i,
                      at[3] = {node % c->nodes[0], node / c->nodes[0] % c->nodes[1], node / c->nodes[0] / c->nodes[1]};
            double x[3], v[3] = {0};
            for (int k = 0; k < 3; k++) x[k] = (at[k] - 0.5 * (c->nodes[k] - 1)) * c->cell_m[k];
            const size_t axis = motion % 3, a = (axis + 1) % 3, b = (axis + 2) % 3;
            if (motion < 3) v[axis] = 1;
            else v[a] = -x[b], v[b] = x[a];
            memcpy(to + 3 * i, v, sizeof v);
            size2 += kn_dot(v, v);
        }
        const double least = 1e-12 * size2;
        for (size_t e = 0; e < motion; e++) {
            double sum = 0;
            for (size_t i = 0; i < n; i++) sum += to[i] * q[e * n + i];
            for (size_t i = 0; i < n; i++) to[i] -= sum * q[e * n + i];
        }
        size2 = 0;
        for (size_t i = 0; i < n; i++) size2 += to[i] * to[i];
        for (size_t i = 0; i < n; i++) to[i] = size2 > least ? to[i] / sqrt(size2) : 0;
    }
}

// Add resistance to the rigid motions of the coarse nodes.
static bool resist_rigid(const kn_coarse *c, double *a)
{
    const size_t n = (size_t)c->unknowns;
    double most = 0, *q = calloc(6 * n, sizeof *q);
    if (!q) return false;
    rigid_motions(c, q);
    for (size_t i = 0; i < n; i++) most = fmax(most, a[i * n + i]);
    for (size_t motion = 0; motion < 6; motion++) {
        const double *v = q + motion * n;
        for (size_t i = 0; i < n; i++)
            for (size_t j = 0; j < n; j++) a[i * n + j] += RIGID_SHARE * most * v[i] * v[j];
    }
    free(q);
    return true;
}

// Replace the lower half of a symmetric matrix by its Cholesky factor. An unknown that nothing resists, such as the
// motion of a flat object out of its plane, gets a diagonal of 0.
static void factor(double *a, size_t n)
{
    for (size_t j = 0; j < n; j++) {
        double *row = a + j * n, left = row[j];
        for (size_t k = 0; k < j; k++) {
            const double *up = a + k * n;
            for (size_t l = 0; l < k; l++) row[k] -= row[l] * up[l];
            row[k] = up[k] > 0 ? row[k] / up[k] : 0;
            left -= row[k] * row[k];
        }
        row[j] = left > 1e-6 * row[j] ? sqrt(left) : 0;
    }
}

// Invert a symmetric matrix in place. An unknown that nothing resists gets a row and a column of 0. Return false if
// memory is short.
static bool invert(double *a, size_t n)
{
    double *b = calloc(n * n, sizeof *b); // inverse of the factor
    if (!b) return false;
    factor(a, n);
    for (size_t c = 0; c < n; c++)
        for (size_t i = c; i < n; i++) {
            double sum = i == c;
            for (size_t l = c; l < i; l++) sum -= a[i * n + l] * b[l * n + c];
            b[i * n + c] = a[i * n + i] > 0 ? sum / a[i * n + i] : 0;
        }
    memset(a, 0, n * n * sizeof *a);
    for (size_t l = 0; l < n; l++)
        for (size_t i = 0; i <= l; i++)
            for (size_t j = 0; j <= l; j++) a[i * n + j] += b[l * n + i] * b[l * n + j];
    free(b);
    return true;
}

bool kn_coarse_build(kn_model *m)
{
    kn_coarse *c = m->coarse;
    if (!c) return true;
    const size_t n = (size_t)c->unknowns, padded = (size_t)c->padded, bytes = n * padded * kn_model_real(m);
    double *a = calloc(n * n, sizeof *a);
    c->inverse = aligned_alloc(64, bytes);
    bool ok = a && c->inverse && coarse_matrix(m, a);
    if (ok && m->def.support >= KN_SUPPORT_NONE) ok = resist_rigid(c, a);
    ok = ok && invert(a, n);
    if (ok) {
        memset(c->inverse, 0, bytes);
        for (size_t i = 0; i < n; i++)
            for (size_t j = 0; j < n; j++) kn_real_set(m, c->inverse, i * padded + j, a[i * n + j]);
    }
    free(a);
    return ok;
}
