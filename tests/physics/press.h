#ifndef KN_TESTS_PHYSICS_PRESS_H
#define KN_TESTS_PHYSICS_PRESS_H
// The first paper's press test as code, for the physics tests and the bench: a plate (or a ball) goes down on a block,
// stays, and comes up again; the force at every sample and the shape at the end are kept.
#include "core/step.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define GF_N 0.00980665 // one gram-force
#define GF_CM2 98.0665  // Pa. The papers' gf/cm^3 act over the 1 cm cube they were measured on: gf/cm^2 per unit strain

static inline kn_material dough(void)
{
    return (kn_material){.k1_pa = 470 * GF_CM2,
                         .c1_pa_s = 2500 * GF_CM2,
                         .damper = KN_DAMPER_EXPONENTIAL,
                         .alpha_pa_s = 8.16e4 * GF_CM2,
                         .beta_per_pa = 0.0815 / GF_CM2,
                         .p0_pa = 9 * GF_CM2,
                         .p1_pa = 80 * GF_CM2};
}

static inline kn_material jelly(void)
{
    return (kn_material){.k1_pa = 1e4, .c1_pa_s = 500, .damper = KN_DAMPER_NONE};
}

static inline kn_material clay(void) // k1 = 0, c1 = c2 = 2c: a body of viscosity c
{
    return (kn_material){.c1_pa_s = 4e4, .damper = KN_DAMPER_CONSTANT, .c2_pa_s = 4e4};
}

// A 5 x 5 x 3 cm block of dough with cells of 1/per_cm centimetre under a plate 1 cm wide and as long as the block.
static inline kn_model_def press_def(int per_cm)
{
    kn_model_def def = kn_model_def_default();
    def.material = dough();
    def.density_kg_m3 = 1200;
    def.spacing_m = 0.01 / per_cm;
    def.nodes[0] = def.nodes[1] = 5 * per_cm + 1;
    def.nodes[2] = 3 * per_cm + 1;
    def.structure = KN_STRUCTURE_DIAGONALS;
    def.support = KN_SUPPORT_BONDED;
    def.probe_count = 1;
    def.probe[0] = (kn_probe_def){.name = "plate", .shape = KN_PROBE_PLATE, .size_m = {0.01, 0.05}};
    return def;
}

// The same block under a ball of 1 cm radius.
static inline kn_model_def ball_def(int per_cm)
{
    kn_model_def def = press_def(per_cm);
    def.probe[0] = (kn_probe_def){.name = "ball", .shape = KN_PROBE_SPHERE, .radius_m = 0.01};
    return def;
}

// f64, secant, linearised until nothing moves: what the fast settings are measured against, at the same dt.
static inline kn_model_def converged(kn_model_def def)
{
    def.solver.precision = KN_PRECISION_F64;
    def.solver.linearization = KN_LINEARIZATION_SECANT;
    def.solver.passes = 5;
    def.solver.tolerance = 1e-8;
    def.solver.iterations_max = 1000;
    return def;
}

static inline kn_model *build(const kn_model_def *def)
{
    char error[256];
    kn_model *model = kn_model_build(def, error, sizeof error);
    if (!model) {
        fprintf(stderr, "cannot build the model: %s\n", error);
        exit(1);
    }
    return model;
}

// A hand that presses 1 cm/s fast, stays, and comes up to 1 cm above the top; it takes 50 ms to gain and to lose its
// speed.
typedef struct press {
    double depth_m, hold_s;
} press;

#define PRESS_SPEED 0.01 // m/s
#define PRESS_RAMP 0.05  // s

static inline double press_down_s(const press *p)
{
    return p->depth_m / PRESS_SPEED + PRESS_RAMP;
} // when it stands still
static inline double press_up_s(const press *p)
{
    return press_down_s(p) + p->hold_s;
} // when it starts to rise

// Way made t seconds into a move over `distance_m`, from rest to rest.
static inline double press_way(double distance_m, double t)
{
    double left = distance_m / PRESS_SPEED + PRESS_RAMP - t;
    if (left <= 0) return distance_m;
    if (t < PRESS_RAMP) return PRESS_SPEED * t * t / (2 * PRESS_RAMP);
    if (left < PRESS_RAMP) return distance_m - PRESS_SPEED * left * left / (2 * PRESS_RAMP);
    return PRESS_SPEED * (t - PRESS_RAMP / 2);
}

static inline double press_depth(const press *p, double t)
{
    if (t <= press_up_s(p)) return press_way(p->depth_m, t);
    return p->depth_m - press_way(p->depth_m + 0.01, t - press_up_s(p));
}

// Input of the step that ends at time t: where the hand is now, and its mean speed until then. A plate that follows it
// is exactly on the path at the end of every step of any length; one that overshot by a micrometre when the hand stops
// would go back by it, and let go of the stiff dough meanwhile.
static inline kn_input press_input(const kn_model *model, const press *p, double t)
{
    double dt = model->def.solver.dt_s, depth = press_depth(p, t - dt);
    double top = model->rest_m[model->top[0]][2];
    double offset =
        model->def.probe[0].shape == KN_PROBE_SPHERE ? model->def.probe[0].radius_m : 0; // centre above its foot
    kn_input in = {0};
    in.probe[0].attached = true;
    in.probe[0].position_m[2] = top + offset - depth;
    in.probe[0].velocity_m_s[2] = (depth - press_depth(p, t)) / dt;
    return in;
}

typedef struct run {
    int samples;
    double (*force_n)[3]; // [samples] on the probe, at (i + 1) sample_s
    double (*shape_m)[3]; // [nodes] displacement at the end
    int nodes;
    double mean_iterations, worst_residual;
    long secant_steps;
    uint64_t hash;
    kn_status status;
} run;

static inline void displacement(const kn_model *model, const kn_state *state, int node, double u_m[3])
{
    kn_state_position(model, state, node, u_m);
    for (int k = 0; k < 3; k++) u_m[k] -= model->rest_m[node][k];
}

// Runs `seconds` of a press and samples the force every sample_s (a multiple of the step).
static inline run press_run(const kn_model_def *def, const press *p, double seconds, double sample_s)
{
    kn_model *model = build(def);
    kn_state *state = kn_state_create(model);
    int every = (int)lround(sample_s / def->solver.dt_s), steps = (int)lround(seconds / def->solver.dt_s);
    run r = {.nodes = model->node_count, .samples = steps / every};
    r.force_n = calloc((size_t)r.samples, sizeof *r.force_n);
    r.shape_m = calloc((size_t)r.nodes, sizeof *r.shape_m);
    if (!state || !r.force_n || !r.shape_m) abort();
    for (int i = 0; i < r.samples * every; i++) {
        kn_input in = press_input(model, p, (i + 1) * def->solver.dt_s);
        kn_output out;
        r.status = kn_step(model, state, &in, &out);
        r.mean_iterations += out.iterations / (double)steps;
        r.worst_residual = fmax(r.worst_residual, out.residual);
        r.secant_steps += out.secant;
        if ((i + 1) % every == 0) memcpy(r.force_n[i / every], out.probe[0].force_n, sizeof *r.force_n);
    }
    for (int i = 0; i < r.nodes; i++) displacement(model, state, i, r.shape_m[i]);
    r.hash = kn_state_hash(model, state);
    kn_state_destroy(state);
    kn_model_destroy(model);
    return r;
}

static inline void run_free(run *r)
{
    free(r->force_n);
    free(r->shape_m);
}

// |a - b| / |b| over n vectors, Euclidean.
static inline double relative_error(const double (*a)[3], const double (*b)[3], int n)
{
    double difference = 0, size = 0;
    for (int i = 0; i < n; i++)
        for (int k = 0; k < 3; k++) {
            difference += (a[i][k] - b[i][k]) * (a[i][k] - b[i][k]);
            size += b[i][k] * b[i][k];
        }
    return sqrt(difference / size);
}

static inline double force_error(const run *a, const run *b)
{
    return relative_error((const double(*)[3])a->force_n, (const double(*)[3])b->force_n,
                          a->samples < b->samples ? a->samples : b->samples);
}

static inline double shape_error(const run *a, const run *b)
{
    return relative_error((const double(*)[3])a->shape_m, (const double(*)[3])b->shape_m, a->nodes);
}

static inline double peak_n(const run *r)
{
    double peak = 0;
    for (int i = 0; i < r->samples; i++) peak = fmax(peak, r->force_n[i][2]);
    return peak;
}

// Total variation of the vertical force over its peak: 2 for a clean rise and fall, more when it chatters.
static inline double variation(const run *r)
{
    double sum = 0, before = 0;
    for (int i = 0; i < r->samples; i++) {
        sum += fabs(r->force_n[i][2] - before);
        before = r->force_n[i][2];
    }
    return sum / peak_n(r);
}

#endif
