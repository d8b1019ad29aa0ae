#include "core/lattice/measure.h"
#include "core/algebra/algebra.h"
#include "core/lattice/lattice.h"
#include "core/solve/solver.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// --- edges ----------------------------------------------------------------------------------------------------------

// Append the edges of one part of a model to the list. `node` and `slot` are the first node and the first strain slot
// of the part in the whole model.
static void list_edges(kn_springs *s, const kn_model *part, const kn_edge *edge, int count, int node, int slot)
{
    double kappa_m = part->def.mesh ? part->kappa_m : part->grid.kappa_m;
    for (int e = 0; e < count; e++) {
        double length = s->gamma * edge[e].rest_m;
        s->spring[s->count++] = (kn_spring){edge[e].i + node, edge[e].j + node, edge[e].slot + slot, edge[e].rest_m,
                                            length * length * kappa_m * edge[e].weight};
    }
}

static int edges_of(const kn_model *m)
{
    if (m->def.mesh) return m->edge_count;
    return m->composite ? kn_composite_edges(m) : kn_grid_edges(&m->grid, NULL);
}

bool kn_springs_init(kn_springs *s, const kn_model *model)
{
    const kn_model *m = model;
    const kn_composite *c = m->composite;
    // u is the strain at the step's beginning with the implicit solver, at the step's end with all others; see
    // kn_springs.law
    bool stepped = m->def.solver.kind == KN_SOLVER_IMPLICIT;
    *s = (kn_springs){.model = m, .gamma = m->def.mesh ? m->gamma : m->grid.gamma};
    kn_law_build(&s->law, &m->def.material, stepped ? m->def.solver.dt_s : 0, true);
    size_t count = (size_t)edges_of(m) + 1;
    s->spring = malloc(count * sizeof *s->spring);
    kn_edge *edge = malloc(count * sizeof *edge);
    bool fits = s->spring && edge;
    // the model of a net has a list of edges; for a block and the parts of a composite, generate the list
    if (fits && m->def.mesh) list_edges(s, m, m->edges, m->edge_count, 0, 0);
    else if (fits && !c) list_edges(s, m, edge, kn_grid_edges(&m->grid, edge), 0, 0);
    for (int p = 0; fits && c && p < c->part_count; p++)
        list_edges(s, &c->part[p], edge, kn_grid_edges(&c->part[p].grid, edge), c->node_first[p],
                   c->row_first[p] * KN_FORWARD * (int)m->stride);
    free(edge);
    if (!fits) kn_springs_free(s);
    return fits;
}

// Return the peak memory of kn_springs_init, bytes.
static size_t springs_bytes(const kn_model *model)
{
    return ((size_t)edges_of(model) + 1) * (sizeof(kn_spring) + sizeof(kn_edge));
}

void kn_springs_free(kn_springs *springs)
{
    free(springs->spring);
    *springs = (kn_springs){0};
}

// Return the present length of an edge, and store its length one step ago in *before.
static double length_of(const kn_model *m, const kn_state *state, const kn_spring *e, double *before)
{
    double xi[3], xj[3], vi[3], vj[3], now = 0, then = 0;
    kn_state_position(m, state, e->i, xi);
    kn_state_position(m, state, e->j, xj);
    kn_state_velocity(m, state, e->i, vi);
    kn_state_velocity(m, state, e->j, vj);
    for (int k = 0; k < 3; k++) {
        double d = xj[k] - xi[k], last = d - m->def.solver.dt_s * (vj[k] - vi[k]);
        now += d * d;
        then += last * last;
    }
    *before = sqrt(then);
    return sqrt(now);
}

kn_spring_now kn_spring_look(const kn_springs *s, const kn_state *state, int number)
{
    const kn_spring *e = &s->spring[number];
    const kn_law *law = &s->law;
    const kn_material *mat = &law->mat;
    // rate: growth of the edge in the last step, as a strain rate; stretch: (L - L0)/L0
    double unit = s->gamma * e->rest_m, before, now = length_of(s->model, state, e, &before);
    double rate = (now - before) / (s->model->def.solver.dt_s * unit), stretch = (now - e->rest_m) / e->rest_m;
    kn_spring_now n = {.length_m = now};
    // without a damper the strain u follows from the length
    if (law->kind == KN_LAW_VOIGT) {
        n.voigt = stretch / s->gamma;
        n.stress_pa = mat->c1_pa_s * rate + mat->k1_pa * n.voigt;
        return n;
    }
    // if dt > 0, the state holds the strain before the last step: repeat the law's step
    double last = kn_real_get(s->model, state->strain, (size_t)e->slot), dt = law->dt_s;
    double b = law->a_pa_s * rate + mat->k1_pa * last;
    n.stress_pa = kn_law_stress(law, b);
    // strain that the damper would have if the Voigt part had kept its strain `last`
    double left = stretch - s->gamma * last;
    if (law->stroke && dt > 0)
        n.stress_pa = kn_law_stop(law, n.stress_pa, b, (left - law->in) / s->gamma, (law->out - left) / s->gamma);
    if (law->stroke && dt == 0 && // Runge-Kutta: rigid at a stop
        (n.stress_pa < 0 ? left <= law->in + KN_LAW_STROKE_ENDS : left >= law->out - KN_LAW_STROKE_ENDS))
        n.stress_pa = b;
    n.voigt = last + (dt > 0 ? dt * (n.stress_pa - mat->k1_pa * last) / law->a_pa_s : 0);
    // the strain of a Voigt part without a spring is permanent, too, because nothing brings the part back
    n.residual = stretch - (mat->k1_pa > 0 ? s->gamma * n.voigt : 0);
    return n;
}

// --- measures at the nodes ------------------------------------------------------------------------------------------

const kn_measure_name kn_measure_names[KN_MEASURES] = {
    [KN_MEASURE_DISPLACEMENT] = {"displacement", "displacement", "m"},
    [KN_MEASURE_STRESS] = {"stress", "von Mises stress", "Pa"},
    [KN_MEASURE_RESIDUAL] = {"residual", "residual strain", ""},
};

// Sums over the edges of one node, weighted by the edges' volumes V_e. Symmetric tensors are stored as vectors: xx yy
// zz yz xz xy.
typedef struct share {
    double weight;     // sum of V_e
    double fit[6][6];  // Cholesky factor of the normal equations for the tensor S; the same in every state
    double against[6]; // right side of the normal equations for the tensor S, in the state that is being evaluated
    double square;     // sum of V_e r_e^2 in the state that is being evaluated
} share;

struct kn_gauge {
    kn_springs springs;
    share *node;            // [node_count]
    int *master;            // [node_count] node whose `share` holds the sums: the node itself, or its master
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

// Return how often component k of a symmetric tensor S appears in n.S.n: 1 on the diagonal, 2 beside the diagonal.
static double twice(int k) { return k < 3 ? 1 : 2; }

// Compute R <n n n n>, the mean stiffness tensor of all edges.
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

// Factor the normal equations for the tensor S of every node. A small term on the diagonal keeps components of S at 0
// that the node's edges do not determine: those along y in a flat object, or shear in a lattice without diagonals.
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
    return sizeof(kn_gauge) + nodes * (sizeof(share) + sizeof(int)) + springs_bytes(model);
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

// Return von Mises' stress of a node, Pa: solve the normal equations for S, then sigma = R <n n n n> : S.
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

// --- energy ---------------------------------------------------------------------------------------------------------

typedef struct lattice { // lists of everything that stores energy
    const kn_model *model;
    kn_springs springs;
    kn_cell *cell;
    double *cell_volume_m3;
    int cells;
} lattice;

// --- lists ----------------------------------------------------------------------------------------------------------

// List all cells with their volumes at rest.
static bool list_cells(lattice *l)
{
    const kn_model *m = l->model;
    if (m->def.pressure == KN_PRESSURE_NONE) return true;
    l->cells = m->cells ? m->cell_count : kn_grid_cells(&m->grid, NULL);
    l->cell = malloc((size_t)l->cells * sizeof *l->cell + 1);
    l->cell_volume_m3 = malloc((size_t)l->cells * sizeof *l->cell_volume_m3 + 1);
    if (!l->cell || !l->cell_volume_m3) return false;
    if (m->cells) memcpy(l->cell, m->cells, (size_t)l->cells * sizeof *l->cell);
    else kn_grid_cells(&m->grid, l->cell);
    double whole = m->grid.spacing_m * m->grid.spacing_m * m->grid.depth_m;
    for (int i = 0; i < l->cells; i++) l->cell_volume_m3[i] = m->cells ? m->cell_volume[i] : whole;
    return true;
}

static void lattice_free(lattice *l)
{
    kn_springs_free(&l->springs);
    free(l->cell);
    free(l->cell_volume_m3);
}

static bool lattice_init(lattice *l, const kn_model *model)
{
    *l = (lattice){.model = model};
    bool fits = kn_springs_init(&l->springs, model) && list_cells(l);
    if (!fits) lattice_free(l);
    return fits;
}

// --- sums -----------------------------------------------------------------------------------------------------------

// Return the elastic energy stored in the spring of an edge, J.
static double in_edge(const kn_springs *s, const kn_state *state, int number)
{
    double u = kn_spring_look(s, state, number).voigt;
    return 0.5 * s->law.mat.k1_pa * u * u * s->spring[number].volume_m3;
}

// Return the kinetic energy of a node, J, and add its potential energy in the field of gravity to *height_j.
static double in_node(const kn_model *m, const kn_state *state, int i, double *height_j)
{
    double x[3], v[3];
    kn_state_position(m, state, i, x);
    kn_state_velocity(m, state, i, v);
    *height_j += m->node_mass_kg[i] * m->def.gravity_m_s2 * (x[2] - m->rest_m[i][2]);
    return 0.5 * m->node_mass_kg[i] * m->def.solver.mass_scale * kn_dot(v, v);
}

static double volume_of(const kn_model *m, const kn_state *state, const kn_cell *cell)
{
    double x[8][3], gradient[8][3];
    for (int i = 0; i < 8; i++)
        if (cell->corner[i] >= 0) kn_state_position(m, state, cell->corner[i], x[i]);
    if (m->def.mesh) return kn_simplex_volume(m->def.thickness_m, (const double(*)[3])x, gradient);
    return kn_cell_volume(&m->grid, (const double(*)[3])x, gradient);
}

// Return the energy of the gas at J = V/V0, in units of P0 V0. The energy is the integral of the pressure law in
// cell.h.
static double gas(double j)
{
    double slope, least = fmax(j, KN_CELL_LEAST), under = least - j, pressure = kn_cell_pressure(least, &slope);
    return least - 1 - log(least) + under * (pressure + 0.5 * slope * under);
}

typedef struct sum { // sums over the edges, nodes and cells of a state that have been visited so far
    kn_energy energy;
    double volume_m3, rest_m3; // present volume and rest volume of all cells
    int edge, node, cell;      // next edge, node and cell to sum
} sum;

// Sum the next `count` edges, nodes and cells. Return true when none are left.
static bool sum_some(const lattice *l, const kn_state *state, sum *s, int count)
{
    const kn_model *m = l->model;
    for (; count > 0 && s->edge < l->springs.count; count--)
        s->energy.elastic += in_edge(&l->springs, state, s->edge++);
    for (; count > 0 && s->node < m->node_count; count--)
        s->energy.kinetic += in_node(m, state, s->node++, &s->energy.height);
    for (; count > 0 && s->cell < l->cells; count--) {
        double rest = l->cell_volume_m3[s->cell], now = volume_of(m, state, &l->cell[s->cell++]);
        if (m->def.pressure == KN_PRESSURE_CELLS) s->energy.gas += kn_model_gas_pa(m) * rest * gas(now / rest);
        s->volume_m3 += now;
        s->rest_m3 += rest;
    }
    // with one pressure for the whole object, the energy of the gas needs the volume of all cells
    if (count == 0) return false;
    if (m->def.pressure == KN_PRESSURE_OBJECT)
        s->energy.gas = kn_model_gas_pa(m) * s->rest_m3 * gas(s->volume_m3 / s->rest_m3);
    return true;
}

bool kn_energy_of(const kn_model *model, const kn_state *state, kn_energy *energy)
{
    lattice l;
    sum s = {0};
    if (!lattice_init(&l, model)) return false;
    while (!sum_some(&l, state, &s, 1 << 20)) continue;
    *energy = s.energy;
    lattice_free(&l);
    return true;
}

// --- audit ----------------------------------------------------------------------------------------------------------

typedef struct moment { // the energies when a copy of the state was made
    // work_j: work of the tools since the last reset; either_j: sum of the absolute values of each tick's work
    double work_j, either_j;
    double contact_j; // largest energy that the contact layers may give back
    double stored_j;
} moment;

struct kn_audit {
    lattice lattice;
    kn_state *copy;
    sum sum;
    int at_once;          // number of edges, nodes and cells summed per tick
    bool summing, closed; // summing: the copy of the state is being summed; closed: `first` and `last` are valid
    // ticks: number of ticks audited since the last reset; steps: state->tick at the last audited tick
    int64_t ticks, steps;
    moment now, taken, first, last;
    double probe_work_j[KN_PROBES_MAX];
    bool attached[KN_PROBES_MAX];
    kn_audit_news news;
};

kn_audit *kn_audit_create(const kn_model *model)
{
    kn_audit *a = model->def.solver.kind == KN_SOLVER_IMPLICIT ? calloc(1, sizeof *a) : NULL;
    if (!a || !lattice_init(&a->lattice, model)) {
        free(a);
        return NULL;
    }
    a->copy = kn_state_create(model);
    a->at_once = 2 * (a->lattice.springs.count + model->node_count + a->lattice.cells) / KN_AUDIT_TICKS + 1;
    if (a->copy) return a;
    kn_audit_destroy(a);
    return NULL;
}

void kn_audit_destroy(kn_audit *audit)
{
    if (!audit) return;
    lattice_free(&audit->lattice);
    kn_state_destroy(audit->copy);
    free(audit);
}

// Add the tools' work of the last tick to the account. work_j of a tool begins at 0 when the tool is attached. A
// detached tool does no work.
static void book_work(kn_audit *a, const kn_state *state)
{
    for (int p = 0; p < a->lattice.model->def.probe_count; p++) {
        const kn_probe_state *probe = &state->probe[p];
        double done = !probe->attached ? 0 : a->attached[p] ? probe->work_j - a->probe_work_j[p] : probe->work_j;
        a->now.work_j += done;
        a->now.either_j += fabs(done);
        a->probe_work_j[p] = probe->work_j;
        a->attached[p] = probe->attached;
    }
}

// Return the most energy that contact may give back, J: for every active sample, half of force times deflection.
static double in_contact(const kn_contact *c)
{
    double most = 0;
    for (int i = 0; c && i < c->sample_count; i++) {
        const kn_sample *s = &c->sample[i];
        if (!s->line.active) continue;
        double pressing = fabs(s->pressing_n), side[3], square = 0;
        for (int k = 0; k < 3; k++) {
            side[k] = s->force_n[k] - s->pressing_n * s->normal[k];
            square += side[k] * side[k];
        }
        // upper bound: a foundation layer that gets stiffer with depth stores less than half of force times deflection
        most += 0.5 * (pressing * pressing + square) / s->foundation_n_m;
    }
    return most;
}

// Start a new energy account: forget all work and stored energy.
void kn_audit_restart(kn_audit *a)
{
    a->ticks = a->steps = 0;
    a->summing = a->closed = false;
    a->now = (moment){0};
    memset(a->probe_work_j, 0, sizeof a->probe_work_j);
    memset(a->attached, 0, sizeof a->attached);
}

// Judge the interval between the last two copies of the state. The stored energy must not exceed the energy of the
// earlier copy plus the tools' work between the two copies.
static void judge(kn_audit *a)
{
    kn_audit_news *news = &a->news;
    a->taken.stored_j = kn_energy_sum(&a->sum.energy);
    // the energy of a diverged state is not finite, so start a new account
    if (!isfinite(a->taken.stored_j)) {
        kn_audit_restart(a);
        return;
    }
    news->stored = a->sum.energy;
    news->work_j = a->taken.work_j;
    if (a->closed) {
        // most: the largest energy that the object may store now
        double most = a->last.stored_j + a->last.contact_j + a->taken.work_j - a->last.work_j;
        double either = a->taken.either_j - a->last.either_j;
        news->lost_j = most - a->taken.stored_j;
        news->windows++;
        if (!(news->lost_j >= -KN_AUDIT_SHARE * either - 1e-9)) {
            news->created++;
            news->most_j = fmax(news->most_j, -news->lost_j);
        }
    }
    if (!a->closed) a->first = a->taken;
    news->balance_j = a->taken.work_j - a->first.work_j - (a->taken.stored_j - a->first.stored_j);
    a->last = a->taken;
    a->closed = true;
    a->summing = false;
}

void kn_audit_follow(kn_audit *next, const kn_audit *last) { next->news = last->news; }

void kn_audit_tick(kn_audit *audit, const kn_state *state, const kn_scratch *scratch)
{
    kn_audit *a = audit;
    // if the state's tick has gone back, the state was reset
    if (state->tick < a->steps || state->bad) kn_audit_restart(a);
    a->steps = state->tick;
    if (state->bad) return; // the energies are not finite; keep the earlier judgements
    book_work(a, state);
    // copy the state once in KN_AUDIT_TICKS ticks, then sum the copy over the following ticks
    if (a->ticks++ % KN_AUDIT_TICKS == 0 && !a->summing) {
        kn_state_copy(a->lattice.model, a->copy, state);
        a->now.contact_j = in_contact(kn_scratch_contact(scratch, state));
        a->taken = a->now;
        a->sum = (sum){0};
        a->summing = true;
    } else if (a->summing && sum_some(&a->lattice, a->copy, &a->sum, a->at_once)) {
        judge(a);
    }
}

const kn_audit_news *kn_audit_read(const kn_audit *audit) { return &audit->news; }
