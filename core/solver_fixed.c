#include "core/solver_fixed.h"
#include "core/algebra/bytes.h"
#include "core/solve/solver.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MOST_M_S 2.0  // largest velocity whose displacement in a step fits 25 bits
#define PHI_N 0x1p-17 // largest phi
#define PHI_LEAST_N 0x1p-21
#define OCTAVES (KN_FIXED_SEGMENTS / 32)

// --- the image ------------------------------------------------------------------------------------------------------

static double power_of_two_below(double v) { return exp2(floor(log2(v))); }

// Return the stress area of an edge, m^2. stiffness_of returns the change of its tension per change of length, N/m, if
// its damper were rigid.
static double area_of(const kn_model *m, const kn_edge *e) { return m->gamma * m->kappa_m * e->weight * e->rest_m; }
static double stiffness_of(const kn_model *m, const kn_edge *e)
{
    return m->law.a_pa_s / m->law.dt_s * m->kappa_m * e->weight;
}

typedef struct range { // extreme values over all edges: largest stiffness, least stress area, largest rest length
    double stiffest_n_m, least_area_m2, longest_m;
} range;

static range range_of(const kn_model *m)
{
    range r = {0, INFINITY, 0};
    for (int e = 0; e < m->edge_count; e++) {
        r.stiffest_n_m = fmax(r.stiffest_n_m, stiffness_of(m, &m->edges[e]));
        r.least_area_m2 = fmin(r.least_area_m2, area_of(m, &m->edges[e]));
        r.longest_m = fmax(r.longest_m, m->edges[e].rest_m);
    }
    return r;
}

// Choose lambda and phi as solver_fixed.h says.
static void choose_units(const kn_model *m, kn_fixed_model *f, const range *r)
{
    f->lambda_m = power_of_two_below(MOST_M_S * m->law.dt_s / (1 << (KN_FIXED_U - 1)));
    // one lambda must change the tension of the stiffest edge by at least phi/16
    double soft = 16 * r->stiffest_n_m * f->lambda_m;
    f->phi_n = fmax(PHI_LEAST_N, fmin(PHI_N, soft > 0 ? power_of_two_below(soft) : PHI_N));
}

// Return the largest shift in 0..40 with which value * 2^shift fits an unsigned number of `bits` bits.
static int shift_within(double value, int bits)
{
    int shift = (int)floor(log2(((1 << bits) - 1) / value));
    return shift < 0 ? 0 : shift > 40 ? 40 : shift;
}

// Choose the weights omega of Chebyshev's polynomial for eigenvalues of D^-1 M in 2/kappa .. 2; see fixed.h (2). kappa
// grows with the number of iterations. relax scales the interval of eigenvalues so that its centre is 1.
static void choose_polynomial(kn_fixed_config *c)
{
    const double kappa = 2.0 + 1.0 * c->iterations * c->iterations;
    const double middle = 1 + 1 / kappa, rho = (1 - 1 / kappa) / middle;
    double omega = 1;
    for (int k = 0; k < c->iterations; k++) {
        c->omega[k] = (int32_t)lround(ldexp(omega, KN_FIXED_OMEGA_FRACTION));
        omega = k == 0 ? 1 / (1 - 0.5 * rho * rho) : 1 / (1 - 0.25 * rho * rho * omega);
    }
    c->relax = (int32_t)lround(ldexp(1 / middle, KN_FIXED_RELAX_FRACTION));
}

static void choose_config(const kn_model *m, kn_fixed_model *f, const range *r)
{
    kn_fixed_config *c = &f->image.config;
    c->node_count = m->node_count;
    c->edge_count = m->edge_count;
    c->passes = m->def.solver.passes;
    c->iterations = m->def.solver.iterations;
    double d = 4 * r->longest_m / f->lambda_m / (1 << (KN_FIXED_D - 1)); // room for edges to stretch fourfold
    c->d_shift = d > 1 ? (int)ceil(log2(d)) : 0;
    c->kv_shift = shift_within(r->stiffest_n_m * f->lambda_m / f->phi_n, KN_FIXED_KV);
    double beta = m->law.mat.k1_pa * m->law.dt_s / m->law.a_pa_s * (1 << KN_FIXED_H_FRACTION);
    c->beta_shift = beta > 0 ? shift_within(beta, KN_FIXED_BETA) : 0;
    c->beta = (int32_t)lround(ldexp(beta, c->beta_shift));
    choose_polynomial(c);
}

static int64_t to_units(double value, double unit) { return llround(value / unit); }

// Fill the image's nodes: rest position, weight and support in integers.
static void fill_nodes(const kn_model *m, kn_fixed_model *f)
{
    for (int n = 0; n < m->node_count; n++) {
        kn_fixed_node *node = &f->image.node[n];
        for (int k = 0; k < 3; k++) node->x[k] = to_units(m->rest_m[n][k], f->lambda_m);
        node->load[2] = (int32_t)to_units(-m->def.gravity_m_s2 * m->node_mass_kg[n], f->phi_n);
        node->held = m->support[n];
    }
}

// Fill the image's edges: ends, stiffness and reciprocal stress area in integers. ia is at least 1, because a key of 0
// would have no exponent.
static void fill_edges(const kn_model *m, kn_fixed_model *f, const range *r)
{
    const kn_fixed_config *c = &f->image.config;
    for (int e = 0; e < m->edge_count; e++) {
        const kn_edge *edge = &m->edges[e];
        double area = area_of(m, edge), kv = stiffness_of(m, edge) * f->lambda_m / f->phi_n;
        int32_t ia = (int32_t)lround(((1 << KN_FIXED_IA) - 1) * r->least_area_m2 / area);
        f->image.edge[e] = (kn_fixed_edge){.i = (uint16_t)edge->i,
                                           .j = (uint16_t)edge->j,
                                           .kv = (int32_t)lround(ldexp(kv, c->kv_shift)),
                                           .ia = ia > 0 ? ia : 1};
        f->spring[e] = m->law.mat.k1_pa * area / f->phi_n * (1 << KN_FIXED_H_FRACTION);
    }
}

// Fill the table of R = T(b)/b. Its octaves are placed so that the flowing branch of the law begins in the last octave
// but one. A key below the first octave gets the first value of the table.
static void fill_table(const kn_model *m, kn_fixed_model *f, const range *r)
{
    const double key = ((1 << KN_FIXED_IA) - 1) * r->least_area_m2 / f->phi_n; // the key of 1 Pa
    const double most = m->law.bh_pa > 0 && isfinite(m->law.bh_pa) ? m->law.bh_pa : 1;
    f->image.config.octave = (int32_t)floor(log2(most * key)) + 2 - OCTAVES;
    for (int i = 0; i <= KN_FIXED_SEGMENTS; i++) {
        double b = ldexp(1 + (i % 32) / 32.0, f->image.config.octave + i / 32) / key;
        f->image.table[i] = (int32_t)lround(ldexp(kn_law_stress(&m->law, b) / b, KN_FIXED_R_FRACTION));
    }
}

// --- the error of the solve ------------------------------------------------------------------------------------------

// Run the trial: apply the boundary list in each tick to the lattice at rest. Return the sum of the vertical reactions
// in the last tick.
static double trial(const kn_fixed_image *image, const kn_fixed_bound *bound, int count, void *memory,
                    int64_t (*reaction)[3])
{
    kn_fixed engine;
    kn_fixed_result result;
    double force = 0;
    kn_fixed_init(&engine, image, memory);
    for (int tick = 0; tick < KN_FIXED_TRIAL; tick++) kn_fixed_tick(&engine, bound, count, reaction, &result);
    for (int i = 0; i < count; i++) force += (double)reaction[i][2];
    return force;
}

// List the boundary records of the trial: the node in the middle of the top and its neighbours are held and move down
// at 1 cm/s. Return the number of records.
static int patch_of_top(const kn_model *m, const kn_fixed_model *f, kn_fixed_bound *bound)
{
    int middle = 0, count = 0;
    double nearest = INFINITY;
    // find the node of the top nearest to the z axis, then its neighbours
    for (int t = 0; t < m->top_count; t++) {
        const double *x = m->rest_m[m->top[t]];
        if (hypot(x[0], x[1]) < nearest) nearest = hypot(x[0], x[1]), middle = m->top[t];
    }
    for (int t = 0; t < m->top_count; t++) {
        const double *x = m->rest_m[m->top[t]], *o = m->rest_m[middle];
        if (hypot(x[0] - o[0], x[1] - o[1]) > 1.1 * m->def.spacing_m) continue;
        bound[count++] = (kn_fixed_bound){.node = (uint16_t)m->top[t],
                                          .holds = true,
                                          .value = {0, 0, (int32_t)to_units(-0.01 * m->law.dt_s, f->lambda_m)}};
    }
    return count;
}

// Compare the force of the trial with the force that six passes of 32 iterations give. Return false if memory is short.
static bool measure_error(const kn_model *m, kn_fixed_model *f)
{
    const size_t top = (size_t)m->top_count + 1;
    // the reference is the same image with far more passes and iterations
    kn_fixed_image much = f->image;
    much.config.passes = 6;
    much.config.iterations = KN_FIXED_ITERATIONS_MAX;
    choose_polynomial(&much.config);
    void *memory = aligned_alloc(64, kn_fixed_bytes(&f->image));
    kn_fixed_bound *bound = calloc(top, sizeof *bound);
    int64_t(*reaction)[3] = calloc(top, sizeof *reaction);
    const bool fits = memory && bound && reaction;
    if (fits && m->top_count > 0) {
        const int count = patch_of_top(m, f, bound);
        const double force = trial(&f->image, bound, count, memory, reaction);
        const double converged = trial(&much, bound, count, memory, reaction);
        f->error = converged > 0 ? fabs(force - converged) / converged : 0;
    }
    free(memory);
    free(bound);
    free(reaction);
    return fits;
}

// --- models that are refused -----------------------------------------------------------------------------------------

// Largest stiffness of a tool's foundation and of gas: stiffness times dt, as a multiple of the damping of an edge
// (kg/s, `edge` below). This solver takes their forces from the beginning of the step, and forces of larger stiffness
// would chatter. With jelly, chatter begins between 43 and 69 for a ball's foundation, and between 3.6 and 5.8 for gas.
#define FOUNDATION_MOST 16
#define GAS_MOST 2.5

// Return NULL, or the reason why forces from the beginning of the step would chatter.
static const char *too_stiff(const kn_model *m)
{
    const kn_model_def *d = &m->def;
    const double h = d->spacing_m, dt = d->solver.dt_s;
    const double edge = m->kappa_m * m->law.a_pa_s * (m->law.kind == KN_LAW_VOIGT ? 1 : m->law.slope_flow);
    if (d->pressure != KN_PRESSURE_NONE && kn_model_gas_pa(m) * h * dt > GAS_MOST * edge)
        return "fixed takes the gas pressure from the start of the step, and this gas is too stiff for that: needs "
               "the implicit solver";
    for (int p = 0; p < d->probe_count; p++)
        if (d->probe[p].shape != KN_PROBE_PLATE &&
            kn_probe_foundation(&d->probe[p]) * h * h * dt > FOUNDATION_MOST * edge)
            return "fixed takes a tool's depth from the start of the step, and this tool's foundation is too stiff "
                   "for that: needs a softer foundation or the implicit solver";
    return NULL;
}

// Check the model before the image is built. Return NULL, or the reason why the model is refused.
static const char *unfit(const kn_model *m)
{
    // check the limits of the number formats, then the parts of a model that this solver lacks
    const kn_solver_def *s = &m->def.solver;
    if (m->node_count > KN_FIXED_NODES_MAX) return "fixed numbers nodes with 16 bits: at most 65535 nodes";
    if (m->law.stroke) return "fixed has no end stops of the damper: needs a material without a stroke";
    if (m->def.support >= KN_SUPPORT_NONE) return "fixed has no inertia: needs a bonded or a frictionless support";
    if (s->passes > KN_FIXED_PASSES_MAX || s->iterations > KN_FIXED_ITERATIONS_MAX)
        return "fixed allows at most 15 passes of 32 iterations";
    return too_stiff(m);
}

// Check the image after it is built. Return NULL, or the reason why the image is refused.
static const char *misfit(const kn_fixed_model *f, const range *r, char *text, size_t size)
{
    const kn_fixed_config *c = &f->image.config;
    if (c->d_shift > 18) {
        snprintf(text, size, "fixed allows edges of up to %.3g m at this dt, and the longest edge here is %.3g m",
                 ldexp(f->lambda_m, 17 + 18) / 4, r->longest_m);
        return text;
    }
    const int32_t least = f->image.table[KN_FIXED_SEGMENTS];
    if (least < 64) {
        snprintf(text, size,
                 "fixed computes a damper's flow to 1 %% if c2 is at least (c1 + dt k1)/2048, but here c2 falls to "
                 "(c1 + dt k1)/%.3g",
                 ldexp(1, KN_FIXED_R_FRACTION) / fmax(least, 0.5));
        return text;
    }
    return kn_fixed_check(&f->image);
}

static bool allocate(const kn_model *m, kn_fixed_model *f)
{
    f->image.node = calloc((size_t)m->node_count, sizeof *f->image.node);
    f->image.edge = calloc((size_t)m->edge_count + 1, sizeof *f->image.edge);
    f->spring = calloc((size_t)m->edge_count + 1, sizeof *f->spring);
    return f->image.node && f->image.edge && f->spring;
}

const char *kn_fixed_build(kn_model *model, char *text, size_t size)
{
    const char *wrong = unfit(model);
    if (wrong) return wrong;
    kn_fixed_model *f = model->fixed = calloc(1, sizeof *f);
    if (!f || !allocate(model, f)) return "not enough memory for the model";
    const range r = range_of(model);
    choose_units(model, f, &r);
    choose_config(model, f, &r);
    fill_nodes(model, f);
    fill_edges(model, f, &r);
    fill_table(model, f, &r);
    if ((wrong = misfit(f, &r, text, size))) return wrong;
    if (!measure_error(model, f)) return "not enough memory for the model";
    if (!(f->error > KN_FIXED_ERROR_MOST)) return NULL;
    snprintf(text, size,
             "fixed has an error of %.0f %% in the force of a press with %d passes of %d iterations: needs more",
             100 * f->error, f->image.config.passes, f->image.config.iterations);
    return text;
}

void kn_fixed_destroy(kn_fixed_model *fixed)
{
    if (!fixed) return;
    free(fixed->image.node);
    free(fixed->image.edge);
    free(fixed->spring);
    free(fixed);
}

// --- the step -------------------------------------------------------------------------------------------------------

typedef struct work { // data of a step, in the scratch memory
    kn_fixed engine;
    double (*load_n)[3];    // [node] loads from tools, top and gas
    double *moved_m;        // [node][3] displacements, for the gas; NULL without gas
    int32_t *place;         // [node] index of the node's record in `bound`, -1: none
    kn_fixed_bound *bound;  // boundary list of the tick, at most one record per node
    int64_t (*reaction)[3]; // reaction of each record in `bound`
    kn_fixed_watch watch;
    int count; // number of records in `bound`
    bool late; // the watch was late: the next step continues with this boundary list
} work;

// Lay out the data of a step from `base` on, and return its size in bytes. If `base` is NULL, only measure.
static size_t lay_out(const kn_model *m, char *base)
{
    const size_t nodes = (size_t)m->node_count;
    work unused;
    kn_arena a = {.base = base};
    work *w = kn_arena_take(&a, sizeof *w);
    if (!base) w = &unused;
    *w = (work){0};
    w->load_n = kn_arena_take(&a, nodes * sizeof *w->load_n);
    w->moved_m = m->cell_count > 0 ? kn_arena_take(&a, 3 * nodes * sizeof *w->moved_m) : NULL;
    w->place = kn_arena_take(&a, nodes * sizeof *w->place);
    w->bound = kn_arena_take(&a, nodes * sizeof *w->bound);
    w->reaction = kn_arena_take(&a, nodes * sizeof *w->reaction);
    void *memory = kn_arena_take(&a, kn_fixed_bytes(&m->fixed->image));
    if (base) kn_fixed_init(&w->engine, &m->fixed->image, memory);
    return a.used;
}

size_t kn_fixed_scratch(const kn_model *model) { return lay_out(model, NULL); }
void kn_fixed_scratch_init(const kn_model *model, void *scratch) { lay_out(model, scratch); }

void kn_fixed_watch_by(kn_scratch *scratch, kn_fixed_watch watch)
{
    work *w = scratch->stages;
    w->watch = watch;
    w->late = false;
}

bool kn_fixed_late(const kn_scratch *scratch) { return ((const work *)scratch->stages)->late; }

static void read_nodes(const kn_model *m, const kn_state *state, kn_fixed *engine)
{
    const kn_fixed_model *f = m->fixed;
    const double *moved = state->displacement, *velocity = state->velocity;
    for (int n = 0; n < m->node_count; n++) {
        for (size_t k = 0; k < 3; k++) {
            const size_t at = m->offset[n] + k * m->stride, c = 3 * (size_t)n + k;
            engine->x[c] = f->image.node[n].x[k] + to_units(moved[at], f->lambda_m);
            engine->u[c] = (int32_t)to_units(velocity[at] * m->law.dt_s, f->lambda_m);
        }
    }
}

static void read_edges(const kn_model *m, const kn_state *state, kn_fixed *engine)
{
    const double *strain = state->strain;
    for (int e = 0; e < m->edge_count; e++) engine->h[e] = llround(strain[m->edges[e].slot] * m->fixed->spring[e]);
}

void kn_fixed_read(const kn_model *m, const kn_state *state, kn_fixed *engine)
{
    read_nodes(m, state, engine);
    read_edges(m, state, engine);
}

static void write_nodes(const kn_model *m, const kn_fixed *engine, kn_state *state)
{
    const kn_fixed_model *f = m->fixed;
    double *moved = state->displacement, *velocity = state->velocity;
    for (int n = 0; n < m->node_count; n++) {
        for (size_t k = 0; k < 3; k++) {
            const size_t at = m->offset[n] + k * m->stride, c = 3 * (size_t)n + k;
            moved[at] = f->lambda_m * (double)(engine->x[c] - f->image.node[n].x[k]);
            velocity[at] = f->lambda_m * engine->u[c] / m->law.dt_s;
        }
    }
}

static void write_edges(const kn_model *m, const kn_fixed *engine, kn_state *state)
{
    const kn_fixed_model *f = m->fixed;
    double *strain = state->strain;
    for (int e = 0; e < m->edge_count; e++)
        strain[m->edges[e].slot] = f->spring[e] > 0 ? (double)engine->h[e] / f->spring[e] : 0;
}

void kn_fixed_write(const kn_model *m, const kn_fixed *engine, kn_state *state)
{
    write_nodes(m, engine, state);
    write_edges(m, engine, state);
}

// Return the boundary record of a node. If there is none, add a record that pushes with force 0.
static kn_fixed_bound *record(work *w, int *count, int node)
{
    if (w->place[node] < 0) {
        w->place[node] = *count;
        w->bound[(*count)++] = (kn_fixed_bound){.node = (uint16_t)node};
        memset(w->load_n[node], 0, sizeof w->load_n[node]);
    }
    return &w->bound[w->place[node]];
}

// Add the boundary records of the nodes under plates, which move with the plate. A velocity is clamped to twice the
// largest allowed velocity: its displacement then fits 32 bits, and kn_fixed_tick still flags the displacement as
// saturated.
static void hold_nodes(const kn_model *m, const kn_contact *contact, work *w, int *count)
{
    for (int i = 0; i < contact->hold_count; i++) {
        const kn_held_node *hold = &contact->hold[i];
        kn_fixed_bound *b = record(w, count, hold->node);
        b->holds = true;
        for (int k = 0; k < 3; k++)
            b->value[k] = (int32_t)to_units(fmax(-1, fmin(1, hold->velocity_m_s[k] / (2 * MOST_M_S))) * 2 * MOST_M_S *
                                                m->law.dt_s,
                                            m->fixed->lambda_m);
    }
}

// Add the dead load on the top and the force of every pressing sample to the loads of their nodes.
static void push_nodes(const kn_model *m, kn_contact *contact, double top_load_n, work *w, int *count)
{
    for (int t = 0; top_load_n != 0 && t < m->top_count; t++) {
        record(w, count, m->top[t]);
        w->load_n[m->top[t]][2] -= top_load_n * m->top_share[t];
    }
    for (int i = 0; i < contact->sample_count; i++) {
        kn_sample *s = &contact->sample[i];
        kn_sample_push(s);
        if (s->pressing_n == 0) continue;
        for (int a = 0; a < s->patch->nodes; a++) {
            record(w, count, s->patch->node[a]);
            for (int k = 0; k < 3; k++) w->load_n[s->patch->node[a]][k] += s->weight[a] * s->force_n[k];
        }
    }
}

// Add the forces of the gas at the present positions to the loads. Gas loads every node, so every node gets a record.
static void push_gas(const kn_model *m, work *w, int *count)
{
    const kn_fixed_image *image = &m->fixed->image;
    for (int n = 0; n < m->node_count; n++) {
        record(w, count, n);
        for (int k = 0; k < 3; k++)
            w->moved_m[3 * n + k] = m->fixed->lambda_m * (double)(w->engine.x[3 * n + k] - image->node[n].x[k]);
    }
    kn_gas_push(m, m->rest_m[0], w->moved_m, w->load_n[0]);
}

// Convert the loads to integers in units of phi. A load is clamped to the 25 bits of the circuit.
static void quantize_loads(const kn_model *m, work *w, int count)
{
    const double most = (1 << (KN_FIXED_T - 1)) - 1;
    for (int i = 0; i < count; i++) {
        kn_fixed_bound *b = &w->bound[i];
        for (int k = 0; !b->holds && k < 3; k++)
            b->value[k] = (int32_t)lround(fmax(-most, fmin(most, w->load_n[b->node][k] / m->fixed->phi_n)));
    }
}

// Store the force of each held node, and the residual of the step relative to the largest force of a node or sample.
static void read_forces(const kn_model *m, kn_contact *contact, const work *w, const kn_fixed_result *result,
                        kn_output *output)
{
    double largest = 0;
    for (int i = 0; i < contact->hold_count; i++) {
        kn_held_node *hold = &contact->hold[i];
        for (int k = 0; k < 3; k++) {
            hold->force_n[k] = m->fixed->phi_n * (double)w->reaction[w->place[hold->node]][k];
            hold->force_n[k] += w->load_n[hold->node][k]; // a record that holds carries no load
            largest = fmax(largest, fabs(hold->force_n[k]));
        }
    }
    for (int i = 0; i < contact->sample_count; i++) largest = fmax(largest, contact->sample[i].pressing_n);
    output->residual = largest > 0 ? m->fixed->phi_n * (double)result->residual / largest : 0;
    output->iterations = m->fixed->image.config.iterations;
    output->passes = m->fixed->image.config.passes;
    output->capped = (result->flags & ~(uint32_t)KN_FIXED_SAT_RESIDUAL) != 0;
}

// Convert the state to integers, and build the boundary list of the tick.
static void build_list(const kn_model *model, const kn_state *state, kn_contact *contact, double top_load_n, work *w)
{
    w->count = 0;
    memset(w->place, 0xff, (size_t)model->node_count * sizeof *w->place);
    // convert the state to integers; clear the flags, so that they tell about this step only
    w->engine.flags = 0;
    read_nodes(model, state, &w->engine);
    // build the boundary list: held nodes, pushed nodes, gas
    hold_nodes(model, contact, w, &w->count);
    push_nodes(model, contact, top_load_n, w, &w->count);
    if (w->moved_m) push_gas(model, w, &w->count);
    quantize_loads(model, w, w->count);
}

bool kn_solve_fixed(const kn_model *model, kn_state *state, kn_scratch *scratch, const kn_input *input,
                    kn_output *output)
{
    work *w = scratch->stages;
    kn_fixed_result result = {0};
    kn_fixed_where where = KN_FIXED_HERE;
    if (!w->late) build_list(model, state, &scratch->contact, input->top_load_n, w);
    // tell the watch before the tick, so that a circuit can compute the tick at the same time, or instead
    if (w->watch.begin) where = w->watch.begin(w->watch.self, w->bound, w->count, &w->engine, w->reaction, &result);
    w->late = where == KN_FIXED_LATE;
    if (w->late) return false;
    if (where == KN_FIXED_HERE) {
        read_edges(model, state, &w->engine);
        kn_fixed_tick(&w->engine, w->bound, w->count, w->reaction, &result);
        if (w->watch.end) w->watch.end(w->watch.self, (const int64_t(*)[3])w->reaction, &result);
        write_edges(model, &w->engine, state);
    }
    write_nodes(model, &w->engine, state);
    read_forces(model, &scratch->contact, w, &result, output);
    return true;
}
