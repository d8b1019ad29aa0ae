#include "clients/identify/served_lattice.h"
#include "clients/cli/command.h"
#include "core/level_plate.h"
#include "core/scene/keys.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

// ---- creep of the lattice

#define SIDE_M 0.01 // side of a cube that stands for a specimen of unknown size
#define STEP_S 0.03 // time step; gas needs steps of at most 30 ms

bool kn_served_lattice_cut(kn_served_lattice *served, const kn_curve *curve, double spacing_m)
{
    const double height_m = curve->height_m > 0 ? curve->height_m : SIDE_M;
    const double high = round(height_m / spacing_m), h = height_m / fmax(high, 1);
    const double wide = curve->area_m2 > 0 ? round(sqrt(curve->area_m2) / h) : high;
    if (fmin(wide, high) < 2 || fmax(wide, high) > KN_SERVED_CELLS_MAX) return false;
    served->cells[0] = (int)wide, served->cells[1] = (int)high;
    served->spacing_m = h;
    return true;
}

void kn_served_lattice_shape(const kn_served_lattice *served, kn_model_def *def)
{
    def->spacing_m = served->spacing_m;
    for (int k = 0; k < 3; k++) def->nodes[k] = served->cells[k == 2] + 1;
    memset(def->fine, 0, sizeof def->fine);
    def->support = KN_SUPPORT_FRICTIONLESS;
    def->gravity_m_s2 = 0;
    def->force_factor = 1; // coarse cells are too stiff under a small tool, not under a plate on all of them
}

static kn_model *make_lattice(const kn_served_lattice *served, const kn_material *material)
{
    const kn_affine_structure *structure = &served->structure;
    char error[256];
    const kn_solver_def solver = kn_model_def_default().solver;
    kn_model_def def = served->object ? *served->object : kn_model_def_default();
    if (!served->object) {
        def.diagonal_stiffness = structure->diagonal;
        def.pressure = structure->gas_pa > 0 ? KN_PRESSURE_CELLS : KN_PRESSURE_NONE;
        if (structure->gas_pa > 0) def.inside_pressure_pa = structure->gas_pa;
    }
    def.material = *material;
    kn_served_lattice_shape(served, &def);
    def.probe_count = 1;
    def.solver = solver;
    def.probe[0] = (kn_probe_def){.name = "plate", .shape = KN_PROBE_PLATE, .size_m = {1, 1}};
    def.solver.precision = KN_PRECISION_F32;
    def.solver.dt_s = STEP_S;
    def.solver.passes = 12;
    def.solver.iterations_max = 300;
    def.solver.tolerance = 1e-3;
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
    return sum / (m->def.spacing_m * (m->def.nodes[2] - 1));
}

static bool creep(const kn_model *m, const kn_curve *c, double *strain)
{
    kn_state *state = kn_state_create(m), *trial = kn_state_create(m);
    kn_scratch *scratch = kn_scratch_create(m);
    kn_level_plate plate = {0};
    const kn_input idle = {0};
    kn_output out;
    const double area_m2 = pow(m->def.spacing_m * (m->def.nodes[0] - 1), 2);
    double load_n = 0;
    const bool done = state && trial && scratch;
    bool stands = done;
    int64_t tick = (int64_t)floor(c->step[0].time_s / STEP_S);
    for (int i = 0, next = 0; done && i < c->count; i++) {
        for (; stands && ((double)tick + 0.5) * STEP_S < c->time_s[i]; tick++) {
            while (next < c->steps && c->step[next].time_s <= ((double)tick + 0.5) * STEP_S) {
                load_n = c->step[next++].stress_pa * area_m2;
                kn_level_plate_lower(&plate, m, state);
            }
            if (load_n > 0)
                stands = kn_level_plate_step(&plate, m, state, trial, scratch, load_n, &idle, &out) == KN_PLATE_CARRIED;
            else stands = kn_step(m, state, scratch, &idle, &out) == KN_OK;
        }
        strain[i] = stands ? 1 - height_of(m, state) : 1;
    }
    kn_state_destroy(state);
    kn_state_destroy(trial);
    kn_scratch_destroy(scratch);
    return done;
}

bool kn_served_lattice_creep(const kn_served_lattice *served, const kn_material *material, const kn_curve *curve,
                             double *strain)
{
    kn_model *m = make_lattice(served, material);
    const bool good = m && creep(m, curve, strain);
    kn_model_destroy(m);
    return good;
}

// ---- the fit

enum { RUNS = 6 }; // most runs of the lattice

typedef struct search {
    const kn_served_lattice *served;
    int curves, readings;
    const kn_curve *curve;
    double highest_pa; // largest measured stress
    bool constant;     // the element has a constant damper, and so have the lattice's edges
    // [readings] residual of every reading of all curves; at: of the lattice, at the logarithms `from` of the unknowns;
    // slope: by how much it changes with each of these logarithms in the block
    double *at, *slope[KN_FIT_UNKNOWNS], from[KN_FIT_UNKNOWNS];
    double *strain, *spare; // [readings] scratch
} search;

// Lower P1 until kneadd can step the damper: its law must fit the tables of core/law.h, which span 16 octaves of b, and
// those of the circuit, whose c2 is at least A/2048 (core/solver_fixed.c). A law beyond the tables takes forty times the
// time.
static kn_material within_tables(kn_material material)
{
    const double span = 0.97 * 65536, flow = 0.93 * 2048;
    double low = 1.01 * material.p0_pa, high = material.p1_pa;
    for (int i = 0; i < 40; i++) {
        kn_law law;
        kn_law_init(&law, &material, STEP_S);
        const bool fits =
            law.bh_pa <= span * law.b0_pa && law.a_pa_s <= flow * kn_material_c2(&material, material.p1_pa);
        if (fits && i == 0) return material;
        *(fits ? &low : &high) = material.p1_pa;
        material.p1_pa = 0.5 * (low + high);
    }
    material.p1_pa = low;
    return material;
}

kn_material kn_lattice_material(const double value[KN_FIT_UNKNOWNS], bool constant)
{
    if (constant)
        return (kn_material){.k1_pa = value[KN_ESTIMATE_K1],
                             .c1_pa_s = value[KN_ESTIMATE_C1],
                             .damper = KN_DAMPER_CONSTANT,
                             .c2_pa_s = value[KN_ESTIMATE_ALPHA]};
    double number[KN_ESTIMATE_NUMBERS];
    memcpy(number, value, sizeof number);
    number[KN_ESTIMATE_P1] += number[KN_ESTIMATE_P0];
    return within_tables(kn_estimate_material(number));
}

// Compute the residuals of strains, each relative to the root mean square of its own curve: all curves count alike.
static void residuals(const search *s, const double *strain, double *residual)
{
    for (int k = 0; k < s->curves; k++) {
        const kn_curve *c = &s->curve[k];
        double size = 0;
        for (int i = 0; i < c->count; i++) size += c->value[i] * c->value[i];
        for (int i = 0; i < c->count; i++) *residual++ = (*strain++ - c->value[i]) / sqrt(size);
    }
}

// Compute the residuals of the block.
static bool misfit_block(void *of, const double value[KN_FIT_UNKNOWNS], double *residual)
{
    const search *s = of;
    const kn_material material = kn_lattice_material(value, s->constant);
    double *strain = s->strain;
    for (int k = 0; k < s->curves; strain += s->curve[k++].count) {
        const kn_curve *c = &s->curve[k];
        if (!kn_affine_block_creep(&s->served->structure, &material, c, c->count, c->time_s, strain)) return false;
    }
    residuals(s, s->strain, residual);
    return true;
}

// Compute the residuals of the lattice near the last run, with the slopes of the block.
static bool misfit_near(void *of, const double value[KN_FIT_UNKNOWNS], double *residual)
{
    const search *s = of;
    memcpy(residual, s->at, (size_t)s->readings * sizeof *residual);
    for (int u = 0; u < KN_ESTIMATE_NUMBERS; u++)
        for (int i = 0; i < s->readings; i++) residual[i] += s->slope[u][i] * (log(value[u]) - s->from[u]);
    return true;
}

// Compute the slopes of the block's residuals at the present values of the unknowns.
static bool find_slopes(search *s, const kn_fit *fit)
{
    const double small = 1e-3;
    double value[KN_FIT_UNKNOWNS];
    bool good = true;
    kn_fit_values(fit, value);
    for (int u = 0; u < KN_ESTIMATE_NUMBERS && good; u++) {
        const double here = value[u];
        s->from[u] = log(here);
        value[u] = here * (1 + small);
        good = misfit_block(s, value, s->slope[u]);
        value[u] = here / (1 + small);
        // the lattice's residuals are not needed yet, so their array holds the other side of the difference
        good = good && misfit_block(s, value, s->at);
        value[u] = here;
        for (int i = 0; i < s->readings; i++) s->slope[u][i] = (s->slope[u][i] - s->at[i]) / (2 * log1p(small));
    }
    return good;
}

// Return the root mean square difference of a strain from the readings, as a share of the largest reading.
static double apart(const double *strain, const kn_curve *c)
{
    double sum = 0;
    for (int i = 0; i < c->count; i++) sum += (strain[i] - c->value[i]) * (strain[i] - c->value[i]);
    return sqrt(sum / c->count) / kn_curve_largest(c);
}

double kn_affine_block_left(const kn_affine_structure *structure, const kn_material *material, const kn_curve *c)
{
    double *strain = calloc((size_t)c->count, sizeof *strain);
    const bool good = strain && kn_affine_block_creep(structure, material, c, c->count, c->time_s, strain);
    const double left = good ? apart(strain, c) : (double)NAN;
    free(strain);
    return left;
}

// Run the lattice for all curves. Store its strains in s->strain, and what is left on each curve.
static bool run_lattice(search *s, const kn_material *material, double left[KN_CURVES_MAX])
{
    bool good = true;
    double *strain = s->strain;
    for (int k = 0; k < s->curves && good; strain += s->curve[k++].count) {
        good = kn_served_lattice_creep(s->served, material, &s->curve[k], strain);
        left[k] = apart(strain, &s->curve[k]);
    }
    return good;
}

// The search begins with the parameters of the element. P1 stays below WIDEST times the largest measured stress, since
// readings beyond it do not exist.
#define WIDEST 1.5
#define ALPHA_MOST 1e12 // Pa s: the largest c2 and a plausible alpha of a scene

void kn_lattice_unknowns(kn_fit *fit, const kn_material *m, double highest_pa)
{
    const bool constant = m->damper == KN_DAMPER_CONSTANT;
    const double start[KN_ESTIMATE_NUMBERS] = {m->k1_pa,
                                               m->c1_pa_s,
                                               constant ? m->c2_pa_s : m->alpha_pa_s,
                                               constant ? 1 : m->beta_per_pa,
                                               constant ? 1 : m->p0_pa,
                                               constant ? 1 : m->p1_pa - m->p0_pa};
    static const kn_key_id key[] = {KN_KEY_K1, KN_KEY_C1, KN_KEY_ALPHA, KN_KEY_BETA, KN_KEY_P0, KN_KEY_P1};
    fit->unknowns = KN_ESTIMATE_NUMBERS;
    for (int i = 0; i < KN_ESTIMATE_NUMBERS; i++)
        fit->unknown[i] = (kn_fit_unknown){.name = constant && i == KN_ESTIMATE_ALPHA ? "c2" : kn_estimate_name[i],
                                           .unit = kn_estimate_unit[i],
                                           .value = start[i],
                                           .low = 1e-3 * start[i],
                                           .high = fmin(1e3 * start[i], kn_keys[key[i]].most),
                                           .fixed = constant && i > KN_ESTIMATE_ALPHA};
    fit->unknown[KN_ESTIMATE_ALPHA].high = fmin(fit->unknown[KN_ESTIMATE_ALPHA].high, ALPHA_MOST);
    fit->unknown[KN_ESTIMATE_ALPHA].value = fmin(fit->unknown[KN_ESTIMATE_ALPHA].value, 0.5 * ALPHA_MOST);
    if (constant) return;
    kn_fit_unknown *p1 = &fit->unknown[KN_ESTIMATE_P1];
    if (highest_pa > 0) p1->high = fmax(WIDEST * highest_pa, 2 * p1->low);
    p1->value = fmin(p1->value, 0.9 * p1->high);
}

bool kn_lattice_fit(kn_fit *fit)
{
    bool good = kn_fit_run(fit);
    for (int i = KN_ESTIMATE_P1; good && fit->singular && i >= KN_ESTIMATE_P0; i--) {
        fit->unknown[i].fixed = true;
        good = kn_fit_run(fit);
    }
    return good;
}

void kn_lattice_numbers(kn_parameter_estimate number[KN_ESTIMATE_NUMBERS], const kn_fit *fit,
                        const kn_material *material, const kn_fit_interval *given)
{
    const bool constant = material->damper == KN_DAMPER_CONSTANT;
    for (int i = 0; i < (constant ? KN_ESTIMATE_BETA : KN_ESTIMATE_NUMBERS); i++) {
        const kn_fit_unknown *u = &fit->unknown[i];
        kn_parameter_estimate *n = &number[i];
        kn_fit_interval interval = {KN_FIT_CURVATURE, u->low, u->high, true, true};
        if (!u->fixed) interval = given ? given[i] : kn_fit_interval_by(fit, i, 0.95, KN_FIT_CURVATURE);
        const double more = i == KN_ESTIMATE_P1 ? fit->unknown[KN_ESTIMATE_P0].value : 0;
        const double value = i == KN_ESTIMATE_P1 ? material->p1_pa : u->value;
        interval.low += more, interval.high += more;
        kn_parameter_estimate_set(n, u->name, u->unit, value, interval);
        const bool lowered = value < 0.999 * (u->value + more);
        if (lowered) n->known = KN_UNKNOWN;
        if (n->known == KN_UNKNOWN)
            snprintf(n->words, sizeof n->words, "%s; the scene uses %.5g %s",
                     lowered ? "lowered, since kneadd's tables end there" : "not determined by these measurements",
                     n->value, n->unit);
    }
}

// Fit the block, and then improve the parameters by runs of the lattice: Gauss-Newton steps with the lattice's residuals
// and the block's slopes. No number changes by more than the factor `reach` in a step. A step that makes the lattice
// worse is taken back, and the next one is shorter.
static bool improve(kn_served_lattice *served, search *s, kn_fit *fit, kn_progress *bar)
{
    const double enough = 0.97; // the search ends when a step leaves more than this share of the mean square
    double value[KN_FIT_UNKNOWNS], left[KN_CURVES_MAX], reach = 2, best = INFINITY;
    kn_fit_unknown bound[KN_FIT_UNKNOWNS];
    kn_fit next;
    fit->misfit = misfit_block;
    kn_lattice_unknowns(fit, &served->material, s->highest_pa);
    if (!kn_fit_run(fit)) return false;
    memcpy(bound, fit->unknown, sizeof bound);
    next = *fit;
    for (int run = 0; run < RUNS; run++) {
        kn_progress_step(bar, run + 1);
        kn_fit_values(&next, value);
        const kn_material material = kn_lattice_material(value, s->constant);
        if (!run_lattice(s, &material, left)) break;
        const double now = kn_fit_squares(left, s->curves), before = best;
        if (now < best) {
            best = now;
            *fit = next;
            for (int i = 0; i < fit->unknowns; i++) // an interval may go beyond the reach of a step
                fit->unknown[i].low = bound[i].low, fit->unknown[i].high = bound[i].high;
            served->material = material;
            memcpy(served->left, left, sizeof left);
            served->rounds = run + 1;
            kn_lattice_numbers(served->number, fit, &served->material, NULL);
            if (now > enough * before) break;
            double *lattice = s->strain;
            s->strain = s->spare, s->spare = lattice;
            if (!find_slopes(s, fit)) break;
            residuals(s, lattice, s->at);
        } else {
            reach = sqrt(reach);
        }
        next = *fit;
        next.misfit = misfit_near;
        for (int i = 0; i < next.unknowns; i++) {
            next.unknown[i].low = fmax(bound[i].low, next.unknown[i].value / reach);
            next.unknown[i].high = fmin(bound[i].high, next.unknown[i].value * reach);
            next.unknown[i].fixed = bound[i].fixed;
        }
        if (!kn_lattice_fit(&next)) break;
    }
    return served->rounds > 0;
}

bool kn_served_lattice_fit(kn_served_lattice *served, const char *subcommand, int curves, const kn_curve *curve,
                           const kn_creep_fit *element)
{
    static kn_fit fit;
    search s = {.served = served, .curves = curves, .curve = curve, .highest_pa = element->highest_pa};
    s.constant = element->material.damper == KN_DAMPER_CONSTANT;
    served->material = element->material;
    served->rounds = 0;
    memcpy(served->number, element->number, sizeof served->number);
    for (int k = 0; k < curves; k++) s.readings += curve[k].count;
    fit = (kn_fit){.of = &s, .readings = s.readings};
    double *all = calloc((3 + KN_ESTIMATE_NUMBERS) * (size_t)s.readings, sizeof *all);
    if (!all) return false;
    s.at = all, s.strain = all + s.readings, s.spare = s.strain + s.readings;
    for (int u = 0; u < KN_ESTIMATE_NUMBERS; u++) s.slope[u] = s.spare + (u + 1) * s.readings;
    for (int k = 0; k < curves; k++)
        served->left[k] = served->before[k] = kn_affine_block_left(&served->structure, &served->material, &curve[k]);
    kn_progress bar = kn_progress_open(subcommand, RUNS + 1);
    const bool good = improve(served, &s, &fit, &bar);
    kn_progress_close(&bar);
    free(all);
    return good;
}
