#include "clients/identify/sweep_fit.h"
#include "clients/identify/constitutive_models.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { STARTS = 16 };
#define NONE 1e10 // a spring or damper that is stiffer or softer than all measured moduli by this factor has no effect
// relative accuracy of the best rheometer; a smaller misfit comes from rounding and must not decide between elements
#define EXACT 1e-4

typedef struct work {
    const kn_curve *curve;
    int curves, readings;
    double scale;
    const kn_element *element;
} work;

static void modulus(const kn_element *e, const double *moduli, double hz, double *storage, double *loss)
{
    kn_oneport_modulus(e, e->root, moduli, 2 * acos(-1.0) * hz, storage, loss);
}

void kn_sweep_fit_modulus(const kn_sweep_fit_row *row, double frequency_hz, double *storage_pa, double *loss_pa)
{
    double moduli[KN_ELEMENT_MAX];
    for (int i = 0; i < row->net.element.leaves; i++) moduli[i] = row->net.part[i].modulus;
    modulus(&row->net.element, moduli, frequency_hz, storage_pa, loss_pa);
}

// Compute the residuals: all storage moduli, then all loss moduli.
static bool misfit(void *of, const double value[KN_FIT_UNKNOWNS], double *residual)
{
    const work *w = of;
    for (int c = 0, n = 0; c < w->curves; c++)
        for (int i = 0; i < w->curve[c].count; i++, n++) {
            double storage, loss;
            modulus(w->element, value, w->curve[c].time_s[i], &storage, &loss);
            if (!(storage > 0 && loss > 0)) return false;
            residual[n] = log(storage / (w->scale * w->curve[c].value[i]));
            residual[w->readings + n] = log(loss / (w->scale * w->curve[c].other[i]));
        }
    return true;
}

// Add one row for each class of the catalogue, with its Voigt form as the element.
static void add_classes(kn_sweep_fit *s)
{
    kn_element_class class[KN_CATALOGUE];
    s->rows = kn_element_classes(class, false);
    for (int i = 0; i < s->rows; i++) {
        kn_sweep_fit_row *row = &s->row[i];
        char error[64];
        memcpy(row->expression, class[i].name, sizeof row->expression);
        memcpy(row->letters, class[i].letters, sizeof row->letters);
        row->name = kn_oneport_name(&class[i].oneport);
        // parsing cannot fail, since the Voigt form is an expression
        kn_element_parse(&row->net.element, row->expression, error, sizeof error);
        row->parts = row->net.element.leaves;
        row->aicc = INFINITY;
    }
}

// ---- one fit

// Return a pseudo-random number in 0..1. Every run gets the same sequence.
static double draw(unsigned *seed)
{
    *seed = *seed * 1664525u + 1013904223u;
    return (*seed >> 8) / 16777216.0;
}

static bool is_spring(const kn_element *e, int leaf)
{
    for (int i = 0; i < e->nodes; i++)
        if (e->node[i].leaf == leaf && e->node[i].kind == KN_ELEMENT_SPRING) return true;
    return false;
}

// Choose a random start: each spring has one of the measured moduli, each damper has such a modulus at one of the
// frequencies.
static void place(const work *w, unsigned *seed, double start[KN_FIT_UNKNOWNS])
{
    for (int leaf = 0; leaf < w->element->leaves; leaf++) {
        const kn_curve *c = &w->curve[(int)(draw(seed) * w->curves)];
        const int i = (int)(draw(seed) * c->count);
        const double size = w->scale * (draw(seed) < 0.5 ? c->value[i] : c->other[i]);
        start[leaf] = is_spring(w->element, leaf) ? size : size / (2 * acos(-1.0) * c->time_s[i]);
    }
}

// Set the bounds of every spring and damper (part) far beyond the measured moduli and frequencies.
static void bounds(const work *w, kn_fit *fit)
{
    double least = INFINITY, most = 0, slow = INFINITY, fast = 0;
    for (int c = 0; c < w->curves; c++)
        for (int i = 0; i < w->curve[c].count; i++) {
            least = fmin(least, w->scale * fmin(w->curve[c].value[i], w->curve[c].other[i]));
            most = fmax(most, w->scale * fmax(w->curve[c].value[i], w->curve[c].other[i]));
            slow = fmin(slow, 2 * acos(-1.0) * w->curve[c].time_s[i]);
            fast = fmax(fast, 2 * acos(-1.0) * w->curve[c].time_s[i]);
        }
    for (int leaf = 0; leaf < fit->unknowns; leaf++) {
        const bool spring = is_spring(w->element, leaf);
        fit->unknown[leaf] = (kn_fit_unknown){.low = (spring ? least : least / fast) / NONE,
                                              .high = (spring ? most : most / slow) * NONE};
    }
}

// Search state: place the fitted parts of a smaller element within a larger one. Each part of the smaller element takes
// the place of a part of the same kind. The remaining parts are put at a bound where they have no effect. The placement
// with the least sum of squares is kept. If the larger element contains the smaller one, this sum equals that of the
// smaller element.
typedef struct nesting {
    kn_fit *fit; // fit of the larger element
    const kn_element *element;
    const kn_sweep_fit_row *within;
    double at[KN_FIT_UNKNOWNS], *best, least;
} nesting;

// Try all placements by recursion over the leaves (springs and dampers) of the larger element.
static void nest(nesting *n, int leaf, unsigned placed)
{
    const kn_element *small = &n->within->net.element;
    if (leaf == n->element->leaves) {
        const double sum = placed + 1 == 1u << small->leaves ? kn_fit_sum(n->fit, n->at) : (double)NAN;
        if (!(sum < n->least)) return;
        n->least = sum;
        memcpy(n->best, n->at, sizeof n->at);
        return;
    }
    for (int i = 0; i < small->leaves; i++) {
        if (placed & 1u << i || is_spring(small, i) != is_spring(n->element, leaf)) continue;
        n->at[leaf] = n->within->net.part[i].modulus;
        nest(n, leaf + 1, placed | 1u << i);
    }
    for (int high = 0; high < 2; high++) {
        n->at[leaf] = high ? n->fit->unknown[leaf].high : n->fit->unknown[leaf].low;
        nest(n, leaf + 1, placed);
    }
}

// Add starts from fitted elements with fewer parts. If this element contains one of them, the sum of squares cannot end
// above that of the contained element.
static int start_within(kn_fit *fit, const kn_element *element, const kn_sweep_fit *found,
                        double start[][KN_FIT_UNKNOWNS])
{
    int count = 0;
    for (int i = 0; i < found->rows; i++) {
        const kn_sweep_fit_row *row = &found->row[i];
        if (!row->fitted || row->parts >= element->leaves) continue;
        nesting n = {.fit = fit, .element = element, .within = row, .best = start[count], .least = INFINITY};
        nest(&n, 0, 0);
        count += isfinite(n.least);
    }
    return count;
}

// Name a part: k1, c1, c2 in a material, else s1, d1, ...
static void call(const kn_sweep_fit_row *row, int leaf, char name[8])
{
    const double m = row->net.part[leaf].modulus;
    const bool spring = is_spring(&row->net.element, leaf);
    kn_element_leaf_name(&row->net.element, leaf, name);
    if (row->is_material)
        snprintf(name, 8, "%s", spring ? "k1" : row->material.damper && m == row->material.c2_pa_s ? "c2" : "c1");
}

// Fill a row from its finished fit: parts, material, AICc, runs, misfit and intervals.
static void judge(kn_sweep_fit_row *row, kn_fit *fit, double confidence)
{
    static const char *const names[] = {"k1", "c1", "c2", "s1", "s2", "s3", "s4", "d1", "d2", "d3", "d4"};
    double value[KN_FIT_UNKNOWNS], *residual = calloc((size_t)fit->readings, sizeof *residual);
    kn_fit_values(fit, value);
    for (int i = 0; i < fit->unknowns; i++) row->net.part[i].modulus = value[i];
    row->is_material = kn_network_material(&row->net, &row->material);
    row->aicc = kn_fit_aicc(fit->readings, fit->unknowns, fit->sum + fit->readings * EXACT * EXACT);
    row->runs = NAN;
    if (residual && fit->misfit(fit->of, value, residual)) {
        row->runs = kn_fit_runs(fit->readings, residual);
        for (int i = 0; i < fit->readings; i++) row->error += fabs(expm1(residual[i])) / fit->readings;
    }
    free(residual);
    for (int i = 0; i < fit->unknowns; i++) {
        char name[8];
        call(row, i, name);
        size_t n = 0;
        while (n + 1 < sizeof names / sizeof *names && strcmp(names[n], name) != 0) n++;
        kn_parameter_estimate_set(&row->number[i], names[n], is_spring(&row->net.element, i) ? "Pa" : "Pa*s", value[i],
                                  kn_fit_interval_of(fit, i, confidence));
    }
}

// Fit one element from random starts and from the smaller elements that have been fitted.
static void fit_row(const work *all, const kn_sweep_fit *found, kn_sweep_fit_row *row, double confidence)
{
    work w = *all;
    unsigned seed = 1;
    double start[STARTS + KN_SWEEP_FIT_ROWS][KN_FIT_UNKNOWNS];
    w.element = &row->net.element;
    kn_fit fit = {.readings = 2 * w.readings, .unknowns = row->parts, .misfit = misfit, .of = &w};
    bounds(&w, &fit);
    for (int s = 0; s < STARTS; s++) place(&w, &seed, start[s]);
    if (row->parts > KN_SWEEP_FIT_PARTS || fit.readings <= fit.unknowns + 2) return;
    const int starts = STARTS + start_within(&fit, w.element, found, start + STARTS);
    row->fitted = kn_fit_run_from(&fit, starts, start);
    if (row->fitted) judge(row, &fit, confidence);
}

// Choose the row with the fewest parts among those within KN_SWEEP_FIT_NEAR of the least AICc. material: only rows that
// a scene can have.
static int choose(const kn_sweep_fit *s, bool material)
{
    double least = INFINITY;
    int best = -1;
    for (int i = 0; i < s->rows; i++)
        if (s->row[i].fitted && (s->row[i].is_material || !material)) least = fmin(least, s->row[i].aicc);
    for (int i = 0; i < s->rows; i++) {
        const kn_sweep_fit_row *row = &s->row[i];
        if (!row->fitted || (material && !row->is_material) || row->aicc > least + KN_SWEEP_FIT_NEAR) continue;
        const bool fewer = best < 0 || row->parts < s->row[best].parts;
        if (fewer || (row->parts == s->row[best].parts && row->aicc < s->row[best].aicc)) best = i;
    }
    return best;
}

bool kn_sweep_fit_run(kn_sweep_fit *s, int curves, const kn_curve *curve, double scale, double confidence)
{
    *s = (kn_sweep_fit){0};
    for (int c = 0; c < curves; c++) s->readings += curve[c].count;
    const work w = {.curve = curve, .curves = curves, .readings = s->readings, .scale = scale};
    add_classes(s);
    // fit smaller elements first, since larger elements start from them
    for (int parts = 1; parts <= KN_SWEEP_FIT_PARTS; parts++)
        for (int i = 0; i < s->rows; i++)
            if (s->row[i].parts == parts) fit_row(&w, s, &s->row[i], confidence);
    s->best = choose(s, false);
    s->material = choose(s, true);
    return s->best >= 0;
}
