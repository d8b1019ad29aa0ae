#include "core/gauge.h"
#include "core/composite.h"
#include "core/six.h"
#include "core/springs.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

const kn_measure_name kn_measure_names[KN_MEASURES] = {
    [KN_MEASURE_DISPLACEMENT] = {"displacement", "displacement", "m"},
    [KN_MEASURE_STRESS] = {"stress", "von Mises stress", "Pa"},
    [KN_MEASURE_RESIDUAL] = {"residual", "residual strain", ""},
};

// Symmetric tensors are stored as vectors: xx yy zz yz xz xy.
typedef struct share { // weighted sums over the edges of a node
    double weight;     // sum of the edges' volumes V_e
    // normal equations of S, which depend on the directions at rest only: their Cholesky factor
    double fit[6][6];
    // right side of these equations, and sum of V_e r_e^2: both belong to the state that is read
    double against[6];
    double square;
} share;

struct kn_gauge {
    kn_springs springs;
    share *node;            // [node_count]
    int *master;            // [node_count] node in the same place that stores the sums of each node
    double stiffness[6][6]; // mean stiffness R <n n n n> of all edges
};

// Compute the tensor n n of an edge, where n is the edge's direction at rest.
static void square_of(const kn_gauge *g, const kn_spring *e, double out[6])
{
    static const int a[6] = {0, 1, 2, 1, 0, 0}, b[6] = {0, 1, 2, 2, 2, 1};
    const double(*x)[3] = (const double(*)[3])g->springs.model->rest_m;
    double n[3];
    for (int k = 0; k < 3; k++) n[k] = (x[e->j][k] - x[e->i][k]) / e->rest_m;
    for (int k = 0; k < 6; k++) out[k] = n[a[k]] * n[b[k]];
}

// Return the number of times that a component appears in n.S.n.
static double twice(int k) { return k < 3 ? 1 : 2; }

// Compute R <n n n n>, the mean stiffness of all edges, once per model.
static void average_stiffness(kn_gauge *g)
{
    const kn_model *m = g->springs.model;
    double volume_m3 = kn_model_mass(m) / m->def.density_kg_m3;
    for (int e = 0; e < g->springs.count; e++) {
        const kn_spring *s = &g->springs.spring[e];
        double nn[6];
        square_of(g, s, nn);
        for (int i = 0; i < 6; i++)
            for (int k = 0; k < 6; k++) g->stiffness[i][k] += s->volume_m3 / volume_m3 * nn[i] * twice(k) * nn[k];
    }
}

// Factor the fit of every node. A small weight on S itself keeps those components at 0 that a node's edges do not
// determine, such as the third direction of a flat object, or shear without diagonals.
static void factor_fits(kn_gauge *g)
{
    for (int e = 0; e < g->springs.count; e++) {
        const kn_spring *s = &g->springs.spring[e];
        double nn[6];
        square_of(g, s, nn);
        for (int end = 0; end < 2; end++) {
            share *to = &g->node[g->master[end ? s->j : s->i]];
            to->weight += s->volume_m3;
            for (int i = 0; i < 6; i++)
                for (int k = 0; k <= i; k++) to->fit[i][k] += s->volume_m3 * twice(i) * nn[i] * twice(k) * nn[k];
        }
    }
    for (share *s = g->node; s < g->node + g->springs.model->node_count; s++) {
        for (int i = 0; i < 6; i++) s->fit[i][i] += 1e-9 * s->weight;
        if (s->weight > 0) kn_six_factor(s->fit);
    }
}

kn_gauge *kn_gauge_create(const kn_model *model)
{
    kn_gauge *g = calloc(1, sizeof *g);
    size_t nodes = (size_t)model->node_count;
    bool fits = g && kn_springs_init(&g->springs, model);
    if (fits) g->node = calloc(nodes, sizeof *g->node);
    if (fits) g->master = calloc(nodes, sizeof *g->master);
    if (!fits || !g->node || !g->master) {
        kn_gauge_destroy(g);
        return NULL;
    }
    for (int i = 0; i < model->node_count; i++) g->master[i] = model->composite ? kn_composite_master(model, i) : i;
    average_stiffness(g);
    factor_fits(g);
    return g;
}

size_t kn_gauge_bytes(const kn_model *model)
{
    const size_t nodes = (size_t)model->node_count;
    return sizeof(kn_gauge) + nodes * (sizeof(share) + sizeof(int)) + kn_springs_bytes(model);
}

void kn_gauge_destroy(kn_gauge *gauge)
{
    if (!gauge) return;
    kn_springs_free(&gauge->springs);
    free(gauge->node);
    free(gauge->master);
    free(gauge);
}

// Add one edge's pull and residual strain to both of its nodes.
static void add_edge(kn_gauge *g, const kn_state *state, int number)
{
    const kn_spring *e = &g->springs.spring[number];
    const kn_spring_now now = kn_spring_look(&g->springs, state, number);
    const double pull_pa = now.stress_pa * now.length_m / (g->springs.gamma * e->rest_m);
    double nn[6];
    square_of(g, e, nn);
    for (int end = 0; end < 2; end++) {
        share *to = &g->node[g->master[end ? e->j : e->i]];
        to->square += e->volume_m3 * now.residual * now.residual;
        for (int i = 0; i < 6; i++) to->against[i] += e->volume_m3 * twice(i) * nn[i] * pull_pa;
    }
}

static double von_mises(const double s[6])
{
    double normal = (s[0] - s[1]) * (s[0] - s[1]) + (s[1] - s[2]) * (s[1] - s[2]) + (s[2] - s[0]) * (s[2] - s[0]);
    return sqrt(0.5 * normal + 3 * (s[3] * s[3] + s[4] * s[4] + s[5] * s[5]));
}

// Return von Mises' stress of a node: solve its fit for S, then sigma = R <n n n n> : S.
static double stress(const kn_gauge *g, const share *s)
{
    double x[6], sigma[6] = {0};
    if (!(s->weight > 0)) return 0;
    memcpy(x, s->against, sizeof x);
    kn_six_solve(s->fit, x);
    for (int i = 0; i < 6; i++)
        for (int k = 0; k < 6; k++) sigma[i] += g->stiffness[i][k] * x[k];
    return von_mises(sigma);
}

static double displacement(const kn_model *m, const kn_state *state, int node)
{
    double x[3], sum = 0;
    kn_state_position(m, state, node, x);
    for (int k = 0; k < 3; k++) sum += (x[k] - m->rest_m[node][k]) * (x[k] - m->rest_m[node][k]);
    return sqrt(sum);
}

void kn_gauge_read_all(kn_gauge *g, const kn_state *state, double *const value[KN_MEASURES])
{
    const kn_model *m = g->springs.model;
    const bool edges = value[KN_MEASURE_STRESS] || value[KN_MEASURE_RESIDUAL];
    for (int i = 0; i < m->node_count; i++) {
        memset(g->node[i].against, 0, sizeof g->node[i].against);
        g->node[i].square = 0;
    }
    for (int e = 0; edges && e < g->springs.count; e++) add_edge(g, state, e);
    for (int i = 0; i < m->node_count; i++) {
        const share *s = &g->node[g->master[i]];
        if (value[KN_MEASURE_DISPLACEMENT]) value[KN_MEASURE_DISPLACEMENT][i] = displacement(m, state, i);
        if (value[KN_MEASURE_STRESS]) value[KN_MEASURE_STRESS][i] = stress(g, s);
        if (value[KN_MEASURE_RESIDUAL]) value[KN_MEASURE_RESIDUAL][i] = s->weight > 0 ? sqrt(s->square / s->weight) : 0;
    }
}

void kn_gauge_read(kn_gauge *g, const kn_state *state, kn_measure what, double *value)
{
    double *one[KN_MEASURES] = {NULL};
    one[what] = value;
    kn_gauge_read_all(g, state, one);
}
