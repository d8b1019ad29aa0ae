#include "clients/identify/served_lattice.h"
#include "clients/cli/command.h"
#include "core/level_plate.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

// ---- creep of the lattice

// Specimen of the lattice: a cube of 1 cm, as only stresses and strains matter. STEP_S: time step; gas needs steps of at
// most 30 ms.
#define SIDE_M 0.01
#define STEP_S 0.03

static kn_model *make_lattice(const kn_affine_structure *structure, const kn_material *material)
{
    char error[256];
    kn_model_def def = kn_model_def_default();
    def.material = *material;
    def.spacing_m = SIDE_M / KN_SERVED_CELLS;
    for (int k = 0; k < 3; k++) def.nodes[k] = KN_SERVED_CELLS + 1;
    def.diagonal_stiffness = structure->diagonal;
    def.pressure = structure->gas_pa > 0 ? KN_PRESSURE_CELLS : KN_PRESSURE_NONE;
    if (structure->gas_pa > 0) def.inside_pressure_pa = structure->gas_pa;
    def.support = KN_SUPPORT_FRICTIONLESS;
    def.probe_count = 1;
    def.probe[0] = (kn_probe_def){.name = "plate", .shape = KN_PROBE_PLATE, .size_m = {10 * SIDE_M, 10 * SIDE_M}};
    def.solver.precision = KN_PRECISION_F64;
    def.solver.dt_s = STEP_S;
    def.solver.passes = 8;
    def.solver.iterations_max = 300;
    def.solver.tolerance = 1e-4;
    return kn_model_build(&def, error, sizeof error);
}

// Return the mean height of the top of the lattice, relative to its height at rest.
static double height_of(const kn_model *m, const kn_state *state)
{
    double sum = 0, x[3];
    for (int t = 0; t < m->top_count; t++) {
        kn_state_position(m, state, m->top[t], x);
        sum += m->top_share[t] * x[2];
    }
    return sum / SIDE_M;
}

// Compute the strain of the lattice at the readings of a curve. Once the plate has squeezed the lattice flat, the strain
// is 1.
static bool creep(const kn_model *m, const kn_curve *c, double *strain)
{
    kn_state *state = kn_state_create(m), *trial = kn_state_create(m);
    kn_level_plate plate = {0};
    const kn_input idle = {0};
    kn_output out;
    double load_n = 0;
    bool stands = state && trial;
    int64_t tick = (int64_t)floor(c->step[0].time_s / STEP_S);
    for (int i = 0, next = 0; state && trial && i < c->count; i++) {
        for (; stands && ((double)tick + 0.5) * STEP_S < c->time_s[i]; tick++) {
            while (next < c->steps && c->step[next].time_s <= ((double)tick + 0.5) * STEP_S) {
                load_n = c->step[next++].stress_pa * SIDE_M * SIDE_M;
                kn_level_plate_lower(&plate, m, state);
            }
            if (load_n > 0)
                stands = kn_level_plate_step(&plate, m, state, trial, load_n, &idle, &out) == KN_PLATE_CARRIED;
            else stands = kn_step(m, state, &idle, &out) == KN_OK;
        }
        strain[i] = stands ? 1 - height_of(m, state) : 1;
    }
    const bool done = state && trial;
    kn_state_destroy(state);
    kn_state_destroy(trial);
    return done;
}

// ---- the fit

typedef struct search {
    kn_affine_structure structure;
    int curves;
    const kn_curve *curve;
    double highest_pa;                 // largest measured stress
    bool constant;                     // the element has a constant damper, and so have the lattice's edges
    double *correction[KN_CURVES_MAX]; // [count] strain of the lattice minus that of the block, in the last round
    double *strain;                    // [count of the longest curve] scratch
} search;

// The unknowns are k1, c1, alpha, beta, P0, and P1 - P0, so that P1 stays above P0; with a constant damper k1, c1, c2.
static kn_material material_of(const double value[KN_FIT_UNKNOWNS], bool constant)
{
    if (constant)
        return (kn_material){.k1_pa = value[KN_ESTIMATE_K1],
                             .c1_pa_s = value[KN_ESTIMATE_C1],
                             .damper = KN_DAMPER_CONSTANT,
                             .c2_pa_s = value[KN_ESTIMATE_ALPHA]};
    double number[KN_ESTIMATE_NUMBERS];
    memcpy(number, value, sizeof number);
    number[KN_ESTIMATE_P1] += number[KN_ESTIMATE_P0];
    return kn_estimate_material(number);
}

// Residuals of all curves, each relative to the root mean square of its own strain: all curves count alike.
static bool misfit(void *of, const double value[KN_FIT_UNKNOWNS], double *residual)
{
    const search *s = of;
    const kn_material material = material_of(value, s->constant);
    for (int k = 0; k < s->curves; k++) {
        const kn_curve *c = &s->curve[k];
        double size = 0;
        for (int i = 0; i < c->count; i++) size += c->value[i] * c->value[i];
        if (!kn_affine_block_creep(&s->structure, &material, c, c->count, c->time_s, s->strain)) return false;
        for (int i = 0; i < c->count; i++)
            *residual++ = (s->strain[i] + s->correction[k][i] - c->value[i]) / sqrt(size);
    }
    return true;
}

// Return the root mean square difference of a strain from the readings, as a share of the largest reading.
static double apart(const double *strain, const kn_curve *c)
{
    double sum = 0;
    for (int i = 0; i < c->count; i++) sum += (strain[i] - c->value[i]) * (strain[i] - c->value[i]);
    return sqrt(sum / c->count) / kn_curve_largest(c);
}

// Run the lattice for all curves. Store its differences from the readings in left[], and the corrections of the block.
static bool correct(search *s, const kn_material *material, double left[KN_CURVES_MAX])
{
    kn_model *m = make_lattice(&s->structure, material);
    bool good = m;
    for (int k = 0; k < s->curves && good; k++) {
        const kn_curve *c = &s->curve[k];
        good = creep(m, c, s->correction[k]) &&
               kn_affine_block_creep(&s->structure, material, c, c->count, c->time_s, s->strain);
        left[k] = apart(s->correction[k], c);
        for (int i = 0; i < c->count && good; i++) s->correction[k][i] -= s->strain[i];
    }
    kn_model_destroy(m);
    return good;
}

static double mean_square(int count, const double *x)
{
    double sum = 0;
    for (int i = 0; i < count; i++) sum += x[i] * x[i];
    return sum / count;
}

// The search begins with the parameters of the element. P1 stays below WIDEST times the largest measured stress, since
// readings beyond it do not exist, and a damper over many decades costs a lattice forty times the time (kn_law_in_lanes).
#define WIDEST 1.5

static void set_unknowns(kn_fit *fit, const kn_material *m, double highest_pa)
{
    const bool constant = m->damper == KN_DAMPER_CONSTANT;
    const double start[KN_ESTIMATE_NUMBERS] = {m->k1_pa,
                                               m->c1_pa_s,
                                               constant ? m->c2_pa_s : m->alpha_pa_s,
                                               constant ? 1 : m->beta_per_pa,
                                               constant ? 1 : m->p0_pa,
                                               constant ? 1 : m->p1_pa - m->p0_pa};
    fit->unknowns = KN_ESTIMATE_NUMBERS;
    for (int i = 0; i < KN_ESTIMATE_NUMBERS; i++)
        fit->unknown[i] = (kn_fit_unknown){.name = kn_estimate_name[i],
                                           .unit = kn_estimate_unit[i],
                                           .value = start[i],
                                           .low = 1e-3 * start[i],
                                           .high = 1e3 * start[i],
                                           .fixed = constant && i > KN_ESTIMATE_ALPHA};
    if (constant) return;
    kn_fit_unknown *p1 = &fit->unknown[KN_ESTIMATE_P1];
    p1->high = fmax(WIDEST * highest_pa, 2 * p1->low);
    p1->value = fmin(p1->value, 0.9 * p1->high);
}

// Run the fit. If some combination of the parameters does not change the block's curves, hold P1 at its value, and then P0.
static bool run_fit(kn_fit *fit)
{
    bool good = kn_fit_run(fit);
    for (int i = KN_ESTIMATE_P1; good && fit->singular && i >= KN_ESTIMATE_P0; i--) {
        fit->unknown[i].fixed = true;
        good = kn_fit_run(fit);
    }
    return good;
}

// Store the parameters with their intervals. `constant`: the parameters of a force-dependent damper stay the element's.
static void finish(kn_served_lattice *served, const kn_fit *fit, bool constant)
{
    for (int i = 0; i < (constant ? KN_ESTIMATE_BETA : KN_ESTIMATE_NUMBERS); i++) {
        const kn_fit_unknown *u = &fit->unknown[i];
        kn_parameter_estimate *n = &served->number[i];
        kn_fit_interval interval = {KN_FIT_CURVATURE, u->low, u->high, true, true};
        if (!u->fixed) interval = kn_fit_interval_by(fit, i, 0.95, KN_FIT_CURVATURE);
        const double more = i == KN_ESTIMATE_P1 ? fit->unknown[KN_ESTIMATE_P0].value : 0;
        interval.low += more, interval.high += more;
        kn_parameter_estimate_set(n, n->name, n->unit, u->value + more, interval);
        if (n->known == KN_UNKNOWN)
            snprintf(n->words, sizeof n->words, "these curves do not show it in a lattice, which uses %.5g %s",
                     n->value, n->unit);
    }
}

// Alternate between the lattice and the fit of the block, until the lattice is as near to the readings as it gets.
static bool alternate(kn_served_lattice *served, search *s, kn_fit *fit, kn_progress *bar)
{
    enum { ROUNDS = 2 };
    double value[KN_FIT_UNKNOWNS], left[KN_CURVES_MAX];
    kn_material material = served->material;
    for (int k = 0; k < s->curves; k++) {
        const kn_curve *c = &s->curve[k];
        if (!kn_affine_block_creep(&s->structure, &material, c, c->count, c->time_s, s->strain)) return false;
        served->left[k] = served->before[k] = apart(s->strain, c);
    }
    set_unknowns(fit, &material, s->highest_pa);
    for (int round = 0; round < ROUNDS; round++) {
        kn_progress_step(bar, 2 * round);
        if (!run_fit(fit)) return round > 0;
        kn_fit_values(fit, value);
        material = material_of(value, s->constant);
        kn_progress_step(bar, 2 * round + 1);
        if (!correct(s, &material, left)) return round > 0;
        if (round > 0 && mean_square(s->curves, left) >= mean_square(s->curves, served->left)) break;
        served->material = material;
        memcpy(served->left, left, sizeof left);
        served->rounds = round + 1;
        finish(served, fit, s->constant);
    }
    return served->rounds > 0;
}

bool kn_served_lattice_fit(kn_served_lattice *served, const char *subcommand, const kn_affine_structure *structure,
                           int curves, const kn_curve *curve, const kn_creep_fit *element)
{
    static kn_fit fit;
    search s = {.structure = *structure, .curves = curves, .curve = curve, .highest_pa = element->highest_pa};
    s.constant = element->material.damper == KN_DAMPER_CONSTANT;
    int most = 0;
    *served = (kn_served_lattice){.structure = *structure, .material = element->material};
    memcpy(served->number, element->number, sizeof served->number);
    fit = (kn_fit){.misfit = misfit, .of = &s};
    bool good = true;
    for (int k = 0; k < curves; k++) {
        fit.readings += curve[k].count;
        most = curve[k].count > most ? curve[k].count : most;
        good &= (s.correction[k] = calloc((size_t)curve[k].count, sizeof(double))) != NULL;
    }
    s.strain = calloc((size_t)most, sizeof *s.strain);
    kn_progress bar = kn_progress_open(subcommand, 4);
    good = good && s.strain && alternate(served, &s, &fit, &bar);
    kn_progress_close(&bar);
    free(s.strain);
    for (int k = 0; k < curves; k++) free(s.correction[k]);
    return good;
}
