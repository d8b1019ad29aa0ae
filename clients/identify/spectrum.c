#include "clients/identify/spectrum.h"
#include "core/oneport.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { STARTS = 16 };

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

void kn_spectrum_modulus(const kn_spectrum_row *row, double frequency_hz, double *storage_pa, double *loss_pa)
{
    double moduli[KN_ELEMENT_MAX];
    for (int i = 0; i < row->net.element.leaves; i++) moduli[i] = row->net.part[i].modulus;
    modulus(&row->net.element, moduli, frequency_hz, storage_pa, loss_pa);
}

// All storage moduli, then all loss moduli.
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

// ---- the classes of the catalogue

static void add_letter(kn_spectrum_row *row, char letter)
{
    const size_t n = strlen(row->letters);
    if (n + 3 <= sizeof row->letters) snprintf(row->letters + n, sizeof row->letters - n, n ? " %c" : "%c", letter);
}

static void add_classes(kn_spectrum *s)
{
    for (int i = 0; i < KN_CATALOGUE; i++) {
        kn_element e;
        char error[64], text[KN_ELEMENT_TEXT];
        if (!kn_element_parse(&e, kn_catalogue[i].expression, error, sizeof error)) continue; // our own text
        const kn_oneport class = kn_oneport_of(&e);
        int k = 0;
        kn_oneport_voigt(&class, text);
        while (k < s->rows && strcmp(s->row[k].expression, text) != 0) k++;
        if (k == KN_SPECTRUM_ROWS) continue;
        if (k == s->rows) {
            kn_spectrum_row *row = &s->row[s->rows++];
            snprintf(row->expression, sizeof row->expression, "%s", text);
            row->name = kn_oneport_name(&class);
            kn_element_parse(&row->net.element, text, error, sizeof error);
        }
        add_letter(&s->row[k], kn_catalogue[i].letter);
    }
}

// ---- one fit

// A number in 0..1 that is the same in every run.
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

// Springs as large as some modulus that was measured, dampers as makes one at some frequency.
static void place(const work *w, unsigned *seed, double start[KN_FIT_UNKNOWNS])
{
    for (int leaf = 0; leaf < w->element->leaves; leaf++) {
        const kn_curve *c = &w->curve[(int)(draw(seed) * w->curves)];
        const int i = (int)(draw(seed) * c->count);
        const double size = w->scale * (draw(seed) < 0.5 ? c->value[i] : c->other[i]);
        start[leaf] = is_spring(w->element, leaf) ? size : size / (2 * acos(-1.0) * c->time_s[i]);
    }
}

static void bounds(const work *w, kn_fit *fit)
{
    static const char *const name[KN_SPECTRUM_PARTS] = {"1", "2", "3", "4"};
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
        fit->unknown[leaf] = (kn_fit_unknown){.name = name[leaf],
                                              .low = spring ? least / 1e4 : least / fast / 1e4,
                                              .high = spring ? most * 1e4 : most / slow * 1e4};
    }
}

// What each part is called: of a material k1, c1, c2, else s1, d1, ...
static void call(const kn_spectrum_row *row, int leaf, char name[8])
{
    const double m = row->net.part[leaf].modulus;
    const bool spring = is_spring(&row->net.element, leaf);
    kn_element_leaf_name(&row->net.element, leaf, name);
    if (row->is_material)
        snprintf(name, 8, "%s", spring ? "k1" : row->material.damper && m == row->material.c2_pa_s ? "c2" : "c1");
}

static void judge(kn_spectrum_row *row, kn_fit *fit, double confidence)
{
    static const char *const names[] = {"k1", "c1", "c2", "s1", "s2", "s3", "s4", "d1", "d2", "d3", "d4"};
    double value[KN_FIT_UNKNOWNS], *residual = calloc((size_t)fit->readings, sizeof *residual);
    for (int i = 0; i < fit->unknowns; i++) value[i] = row->net.part[i].modulus = fit->unknown[i].value;
    row->is_material = kn_network_material(&row->net, &row->material);
    row->aicc = kn_fit_aicc(fit->readings, fit->unknowns, fit->sum);
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
        kn_identified_take(&row->number[i], names[n], is_spring(&row->net.element, i) ? "Pa" : "Pa*s", value[i],
                           kn_fit_interval_of(fit, i, confidence));
    }
}

static void fit_row(const work *all, kn_spectrum_row *row, double confidence)
{
    work w = *all;
    unsigned seed = 1;
    double start[STARTS][KN_FIT_UNKNOWNS];
    w.element = &row->net.element;
    row->parts = w.element->leaves;
    row->aicc = INFINITY;
    kn_fit fit = {.readings = 2 * w.readings, .unknowns = row->parts, .misfit = misfit, .of = &w};
    bounds(&w, &fit);
    for (int s = 0; s < STARTS; s++) place(&w, &seed, start[s]);
    row->fitted = row->parts <= KN_SPECTRUM_PARTS && fit.readings > fit.unknowns + 2 &&
                  kn_fit_run_from(&fit, STARTS, (const double(*)[KN_FIT_UNKNOWNS])start);
    if (row->fitted) judge(row, &fit, confidence);
}

static int choose(const kn_spectrum *s, bool material)
{
    double least = INFINITY;
    int best = -1;
    for (int i = 0; i < s->rows; i++)
        if (s->row[i].fitted && (s->row[i].is_material || !material)) least = fmin(least, s->row[i].aicc);
    for (int i = 0; i < s->rows; i++) {
        const kn_spectrum_row *row = &s->row[i];
        if (!row->fitted || (material && !row->is_material) || row->aicc > least + KN_SPECTRUM_NEAR) continue;
        const bool fewer = best < 0 || row->parts < s->row[best].parts;
        if (fewer || (row->parts == s->row[best].parts && row->aicc < s->row[best].aicc)) best = i;
    }
    return best;
}

bool kn_spectrum_fit(kn_spectrum *s, int curves, const kn_curve *curve, double scale, double confidence)
{
    *s = (kn_spectrum){0};
    for (int c = 0; c < curves; c++) s->readings += curve[c].count;
    const work w = {.curve = curve, .curves = curves, .readings = s->readings, .scale = scale};
    add_classes(s);
    for (int i = 0; i < s->rows; i++) fit_row(&w, &s->row[i], confidence);
    s->best = choose(s, false);
    s->material = choose(s, true);
    return s->best >= 0;
}
