#include "clients/identify/constitutive_models.h"
#include "clients/identify/creep_fit.h"
#include "clients/identify/element_response.h"
#include <math.h>
#include <stdio.h>
#include <string.h>

// ---- the list of material models

// Write the name of a class of elements. In creep the name is the Voigt form of the element. In relaxation the name
// lists the Maxwell elements and the spring. It does not mention a dashpot in parallel.
static void class_name(const kn_oneport *o, bool relax, char text[KN_ELEMENT_TEXT])
{
    static const char *const units[] = {"", "Maxwell unit", "two Maxwell units", "three Maxwell units"};
    if (!relax) {
        kn_oneport_voigt(o, text);
        return;
    }
    const char *spring = o->fluid ? "" : o->relaxation ? " | spring" : "spring";
    snprintf(text, KN_ELEMENT_TEXT, "%s%s", o->relaxation < 4 ? units[o->relaxation] : "Maxwell units", spring);
}

int kn_element_classes(kn_element_class class[KN_CATALOGUE], bool relax)
{
    int count = 0;
    for (int i = 0; i < KN_CATALOGUE; i++) {
        kn_element e;
        char error[64], name[KN_ELEMENT_TEXT];
        // parsing cannot fail, since the catalogue is a constant of this program
        if (!kn_element_parse(&e, kn_catalogue[i].expression, error, sizeof error)) continue;
        const kn_oneport oneport = kn_oneport_of(&e);
        int k = 0;
        // Elements whose responses have the same name form one class. The class lists the letters of its elements in
        // the first paper's figure 2.
        class_name(&oneport, relax, name);
        while (k < count && strcmp(class[k].name, name) != 0) k++;
        if (k == count) {
            class[count] = (kn_element_class){.oneport = oneport};
            memcpy(class[count++].name, name, sizeof name);
        }
        char *letters = class[k].letters;
        const size_t n = strlen(letters), size = sizeof class[k].letters;
        if (n + 3 <= size) snprintf(letters + n, size - n, n ? " %c" : "%c", kn_catalogue[i].letter);
    }
    return count;
}

int kn_constitutive_models(kn_constitutive_model model[KN_CONSTITUTIVE_MAX], bool relax)
{
    kn_element_class class[KN_CATALOGUE];
    int count = kn_element_classes(class, relax);
    for (int i = 0; i < count; i++) {
        const kn_oneport *o = &class[i].oneport;
        model[i] = (kn_constitutive_model){.kind = KN_CONSTITUTIVE_UNITS, .relax = relax, .damper = !relax && o->fluid};
        model[i].spring = relax ? !o->fluid : o->elastic;
        model[i].units = relax ? o->relaxation : o->retardation;
        snprintf(model[i].name, sizeof model->name, "%.40s", class[i].name);
        memcpy(model[i].letters, class[i].letters, sizeof model->letters);
    }
    // The papers' damper has four variants. In relaxation c1 and P0 may each be absent. In creep P0 and P1 may each be
    // absent. See model_comparison.h.
    for (int more = 0; more < 4; more++) {
        kn_constitutive_model *d = &model[count++];
        *d = (kn_constitutive_model){.kind = KN_CONSTITUTIVE_PAPERS, .relax = relax, .letters = "d"};
        d->c1 = !relax || more % 2;
        d->p0 = more / 2;
        d->p1 = !relax && more % 2;
        snprintf(d->name, sizeof d->name, "(s|d)-d thinning%s", d->p0 ? " above P0" : d->c1 ? "" : ", c1 = 0");
    }
    for (kn_constitutive_kind kind = KN_CONSTITUTIVE_LOGARITHM; kind <= KN_CONSTITUTIVE_FRACTIONAL; kind++) {
        kn_constitutive_model *d = &model[count++];
        *d = (kn_constitutive_model){.kind = kind, .relax = relax, .yardstick = true};
        const char *logarithm = relax ? "a - b ln t" : "b ln(1 + t/tau)";
        snprintf(d->name, sizeof d->name, "%s", kind == KN_CONSTITUTIVE_LOGARITHM ? logarithm : "fractional Maxwell");
    }
    return count;
}

// ---- unknowns of the models, with their bounds

// Largest modulus, largest stress, first time and last time of the readings. The bounds of the unknowns are these
// values times powers of ten.
typedef struct size {
    double modulus_pa, stress_pa, first_s, last_s;
} size;

// Find the largest values and the range of times over all curves.
static size size_of(bool relax, int curves, const kn_compared_curve *curve)
{
    size z = {0, 0, INFINITY, 0};
    for (int c = 0; c < curves; c++) {
        const kn_compared_part *early = &curve[c].part[0], *late = &curve[c].part[1];
        double most = 0, load = 0;
        for (int i = 0; i < early->count; i++) {
            most = fmax(most, early->value[i]);
            if (early->time_s[i] > 0) z.first_s = fmin(z.first_s, early->time_s[i]);
        }
        for (int i = 0; !relax && i < curve[c].curve->steps; i++) load = fmax(load, curve[c].curve->step[i].stress_pa);
        z.stress_pa = fmax(z.stress_pa, relax ? most : load);
        z.modulus_pa = fmax(z.modulus_pa, relax ? most / curve[c].strain : load / most);
        if (early->count) z.last_s = fmax(z.last_s, early->time_s[early->count - 1]);
        if (late->count) z.last_s = fmax(z.last_s, late->time_s[late->count - 1]);
    }
    return z;
}

static void add(kn_fit_unknown out[KN_FIT_UNKNOWNS], int *n, const char *name, const char *unit, double low,
                double high)
{
    out[(*n)++] = (kn_fit_unknown){.name = name, .unit = unit, .low = low, .high = high};
}

// List the unknowns of springs and dampers. Each Maxwell or Voigt element has a modulus and a time. A single spring and
// a single damper have one unknown each.
static int unknowns_of_units(const kn_constitutive_model *model, const size *z, kn_fit_unknown out[KN_FIT_UNKNOWNS])
{
    static const char *const k[] = {"k1", "k2", "k3"}, *const tau[] = {"tau1", "tau2", "tau3"};
    const double low = 1e-6 * z->modulus_pa, high = 1e4 * z->modulus_pa;
    int n = 0;
    for (int i = 0; i < model->units && i < 3; i++) {
        add(out, &n, k[i], "Pa", low, high);
        add(out, &n, tau[i], "s", 1e-3 * z->first_s, 1e4 * z->last_s);
    }
    if (model->spring) add(out, &n, model->relax ? "k_inf" : "k0", "Pa", low, high);
    if (model->damper) add(out, &n, "c", "Pa*s", low * z->first_s, high * z->last_s);
    return n;
}

// List the unknowns of the papers' damper. A relaxation at a held strain does not determine k1. The unknowns in
// relaxation are therefore ratios to k1, and the stress of each curve at time 0.
static int unknowns_of_papers(const kn_constitutive_model *model, const size *z, int curves,
                              kn_fit_unknown out[KN_FIT_UNKNOWNS])
{
    static const char *const begin[] = {"Pi", "Pi(2)", "Pi(3)", "Pi(4)", "Pi(5)", "Pi(6)"};
    const double p = z->stress_pa, low = 1e-6 * z->modulus_pa, high = 1e4 * z->modulus_pa;
    int n = 0;
    if (model->relax) add(out, &n, "alpha/k1", "s", 1e-3 * z->first_s, 1e80 * z->last_s);
    else {
        add(out, &n, "k1", "Pa", low, high);
        add(out, &n, "c1", "Pa*s", low * z->first_s, high * z->last_s);
        add(out, &n, "alpha", "Pa*s", low * z->first_s, 1e80 * z->modulus_pa * z->last_s);
    }
    // below the lower bound of beta, c2 would hardly depend on the stress
    add(out, &n, "beta", "1/Pa", 1e-2 / p, 200 / p);
    if (model->relax && model->c1) add(out, &n, "c1/k1", "s", 1e-4 * z->first_s, 10 * z->last_s);
    if (model->p0) add(out, &n, "P0", "Pa", 1e-3 * p, p);
    if (model->p1) add(out, &n, "P1", "Pa", 0.05 * p, 3 * p);
    for (int c = 0; model->relax && c < curves && c < 6; c++) add(out, &n, begin[c], "Pa", 1e-3 * p, 10 * p);
    return n;
}

int kn_constitutive_unknowns(const kn_constitutive_model *model, int curves, const kn_compared_curve *curve,
                             kn_fit_unknown out[KN_FIT_UNKNOWNS])
{
    const size z = size_of(model->relax, curves, curve);
    const double most = 1e4 * z.modulus_pa;
    int n = 0;
    switch (model->kind) {
    case KN_CONSTITUTIVE_UNITS: return unknowns_of_units(model, &z, out);
    case KN_CONSTITUTIVE_PAPERS: return unknowns_of_papers(model, &z, curves, out);
    case KN_CONSTITUTIVE_LOGARITHM:
        add(out, &n, model->relax ? "a" : "1/b", "Pa", model->relax ? -most : 1e-6 * z.modulus_pa, most);
        if (model->relax) add(out, &n, "b", "Pa", -most, most);
        else add(out, &n, "tau", "s", 1e-6 * z.first_s, 1e3 * z.last_s);
        out[0].linear = out[1].linear = model->relax;
        return n;
    case KN_CONSTITUTIVE_FRACTIONAL: break;
    }
    add(out, &n, "V", "Pa*s^a", 1e-6 * z.modulus_pa, 1e3 * most * z.last_s);
    add(out, &n, "a", "", 0.02, 1);
    add(out, &n, "G", "Pa*s^b", 1e-6 * z.modulus_pa, 1e3 * most * z.last_s);
    add(out, &n, "b/a", "", 0.01, 0.98);
    out[1].linear = out[3].linear = true;
    return n;
}

// ---- predictions of the models

// Sum the stresses of the Maxwell elements. If the strain rises during the time ramp_s, each term is averaged over the
// rise. This gives the factor (1 - exp(-r))/r with r = ramp_s/tau.
static void units_relax(const kn_constitutive_model *model, const double *v, const kn_compared_curve *c, int count,
                        const double *t, double *out)
{
    for (int i = 0; i < count; i++) {
        double sum = model->spring ? v[2 * model->units] : 0;
        for (int k = 0; k < model->units; k++) {
            const double tau = v[2 * k + 1], r = c->ramp_s / tau;
            sum += v[2 * k] * exp(-t[i] / tau) * (r > 0 ? -expm1(-r) / r : 1);
        }
        out[i] = c->strain * sum;
    }
}

// Compute the stress of the papers' element while its strain is held. The stress of curve `number` at time 0 is one of
// the unknowns v[].
static void papers_relax(const kn_constitutive_model *model, const double *v, int number, int count, const double *t,
                         double *out)
{
    int n = 2;
    kn_held_element held = {.alpha_s = v[0], .beta_per_pa = v[1], .p1_pa = INFINITY};
    if (model->c1) held.c1_s = v[n++];
    if (model->p0) held.p0_pa = v[n++];
    held.begin_pa = v[n + number];
    kn_held_element_stress(&held, count, t, out);
}

// Return the Voigt chain of a creep model for the values v[] of its unknowns.
static kn_voigt_chain chain_of(const kn_constitutive_model *model, const double *v)
{
    kn_voigt_chain chain = {.voigts = model->units};
    int n = 0;
    if (model->kind == KN_CONSTITUTIVE_PAPERS) {
        chain =
            (kn_voigt_chain){.voigts = 1, .k_pa = {v[0]}, .c_pa_s = {v[1]}, .alpha_pa_s = v[2], .beta_per_pa = v[3]};
        n = 4;
        if (model->p0) chain.p0_pa = v[n++];
        chain.p1_pa = model->p1 ? v[n] : 600 / v[3]; // without P1, clamp the stress where exp(beta P) would overflow
        return chain;
    }
    for (int i = 0; i < model->units && i < KN_VOIGT_CHAIN_VOIGTS; i++, n += 2) {
        // The unknowns of a Voigt element are its modulus and its retardation time.
        chain.k_pa[i] = v[n];
        chain.c_pa_s[i] = v[n] * v[n + 1];
    }
    if (model->spring) chain.spring_pa = v[n++];
    if (model->damper) chain.alpha_pa_s = v[n];
    return chain;
}

bool kn_constitutive_predict(const kn_constitutive_model *model, const double *value, kn_compared_curve *curve, int c,
                             int count, const double *time_s, double *out)
{
    if (count == 0) return true;
    if (model->yardstick) return kn_yardstick_predict(model, value, &curve[c], count, time_s, out);
    if (!model->relax) {
        const kn_voigt_chain chain = chain_of(model, value);
        return !(chain.p0_pa > chain.p1_pa) && kn_creep_strain(&chain, curve[c].curve, count, time_s, out);
    }
    if (model->kind == KN_CONSTITUTIVE_PAPERS) papers_relax(model, value, c, count, time_s, out);
    else units_relax(model, value, &curve[c], count, time_s, out);
    return true;
}

// Type of a list of starts for the search of a model's parameters. The starts are derived from the readings. One start
// is not enough, since the sum of squares of exponentials has many minima.
typedef double (*places)[KN_FIT_UNKNOWNS];

// ---- starts of a search for a relaxation curve

// Summary of the early readings as moduli (stress/strain). a, b: coefficients of the line a - b ln t through the
// readings of all curves. first, middle, last: three moments, each with the modulus of the first curve at that moment.
typedef struct look {
    double a, b, first_s, middle_s, last_s, first_pa, middle_pa, last_pa;
} look;

// Return the modulus at the time time_s: that of the first reading, among the early ones, that is not before this time.
static double modulus_near(const kn_compared_curve *c, double time_s)
{
    const kn_compared_part *p = &c->part[0];
    int i = 0;
    while (i + 1 < p->count && p->time_s[i] < time_s) i++;
    return p->value[i] / c->strain;
}

// Fit the line a - b ln t by least squares to the moduli of the early readings of all curves.
static look look_at(int curves, const kn_compared_curve *curve)
{
    double n = 0, t = 0, y = 0, tt = 0, ty = 0;
    look l = {.first_s = INFINITY};
    for (int c = 0; c < curves; c++)
        for (int i = 0; i < curve[c].part[0].count; i++) {
            const double at = curve[c].part[0].time_s[i], value = curve[c].part[0].value[i] / curve[c].strain;
            if (!(at > 0)) continue;
            l.first_s = fmin(l.first_s, at);
            l.last_s = fmax(l.last_s, at);
            n += 1, t += log(at), y += value, tt += log(at) * log(at), ty += log(at) * value;
        }
    l.b = n * tt - t * t > 0 ? -(n * ty - t * y) / (n * tt - t * t) : 0;
    l.a = n > 0 ? (y + l.b * t) / n : 0;
    l.middle_s = sqrt(l.first_s * l.last_s);
    l.first_pa = modulus_near(curve, l.first_s);
    l.middle_pa = modulus_near(curve, l.middle_s);
    l.last_pa = modulus_near(curve, l.last_s);
    return l;
}

// Make up to four starts for Maxwell elements. Each start spreads the relaxation times differently over the logarithm
// of the measured time.
static int start_units_relax(const kn_constitutive_model *model, const look *l, places start)
{
    static const double share[4][3] = {{0.3, 0.8, 1}, {0.6, 0.95, 1.2}, {0.1, 0.5, 0.9}, {0.9, 1.2, 1.5}};
    for (int s = 0; s < 4; s++) {
        const double width = log(l->last_s / l->first_s);
        for (int k = 0; k < model->units; k++) {
            start[s][2 * k] = l->first_pa / (model->units + model->spring);
            start[s][2 * k + 1] = l->first_s * exp(share[s][model->units == 1 ? 1 : k] * width);
        }
        if (model->spring) start[s][2 * model->units] = l->last_pa * (s % 2 ? 0.3 : 0.8);
    }
    return model->units ? 4 : 1;
}

// Make starts for the papers' damper. At late times equation (1) of element_response.h becomes t = alpha/k1 exp(-beta
// P)/(beta P). The stress P then falls by 1/beta whenever t grows by a factor of e, so beta follows from the line
// through the early readings.
static int start_papers_relax(const kn_constitutive_model *model, const look *l, int curves,
                              const kn_compared_curve *curve, places start)
{
    static const double steeper[2] = {1, 2}, early[4] = {1e-2, 1, 1e2, 1};
    const double strain = curve[0].strain, middle = l->middle_pa * strain;
    const double falls = fmax(l->b, 1e-3 * l->first_pa) * strain;
    int count = 0;
    for (int s = 0; s < 2; s++)
        for (int k = 0; k < 4; k++, count++) {
            const double beta = steeper[s] / falls, x = fmin(beta * middle, 150);
            int n = 0;
            start[count][n++] = l->middle_s * x * exp(x);
            start[count][n++] = beta;
            if (model->c1) start[count][n++] = early[k] * l->first_s / (1 + beta * l->first_pa * strain);
            if (model->p0) start[count][n++] = l->last_pa * strain * (k % 2 ? 1.1 : 1.6);
            for (int c = 0; c < curves && n < KN_FIT_UNKNOWNS; c++)
                start[count][n++] = modulus_near(&curve[c], l->first_s) * curve[c].strain * (k == 3 ? 1.1 : 1);
        }
    return count;
}

// Make starts for the fractional Maxwell model. In three starts, the orders come from the slopes of ln G over ln t at
// both ends of the readings (G: modulus, t: time). Two more starts are close to a Maxwell element, whose relaxation
// time follows from the total fall of G.
static int start_fractional_relax(const look *l, places start)
{
    const double early = log(l->first_pa / l->middle_pa) / log(l->middle_s / l->first_s);
    const double late = log(l->middle_pa / l->last_pa) / log(l->last_s / l->middle_s);
    const double tau = l->last_s / fmax(log(l->first_pa / l->last_pa), 1e-3);
    for (int s = 0; s < 3; s++) {
        const double b = fmin(fmax(early, 0.01), 0.5),
                     a = s == 2 ? 0.9 : fmin(fmax(late * (s ? 4 : 1.5), 1.5 * b), 0.95);
        start[s][0] = l->last_pa * pow(l->last_s, a) * (s ? 3 : 1);
        start[s][1] = a;
        start[s][2] = l->first_pa * pow(l->first_s, b);
        start[s][3] = fmin(b / a, 0.9);
    }
    for (int s = 3; s < 5; s++) {
        const double a = s == 3 ? 0.97 : 0.7, b = 0.02;
        start[s][0] = l->first_pa * pow(tau, a);
        start[s][1] = a;
        start[s][2] = l->first_pa * pow(l->first_s, b);
        start[s][3] = b / a;
    }
    return 5;
}

static int starts_relax(const kn_constitutive_model *model, int curves, const kn_compared_curve *curve, places start)
{
    const look l = look_at(curves, curve);
    switch (model->kind) {
    case KN_CONSTITUTIVE_UNITS: return start_units_relax(model, &l, start);
    case KN_CONSTITUTIVE_PAPERS: return start_papers_relax(model, &l, curves, curve, start);
    case KN_CONSTITUTIVE_LOGARITHM: start[0][0] = l.a, start[0][1] = l.b; return 1;
    case KN_CONSTITUTIVE_FRACTIONAL: break;
    }
    return start_fractional_relax(&l, start);
}

// ---- starts of a search for a creep curve

// The largest load of all curves. nominal_pa: its nominal stress; time_s: its duration up to the last early reading;
// stress_pa, compliance: stress and compliance at that reading. least_pa: nominal stress of the smallest load.
typedef struct load {
    double nominal_pa, time_s, stress_pa, compliance, least_pa;
} load;

// Find the largest load of all curves, and the strain at the last early reading under it.
static load largest(int curves, const kn_compared_curve *curve)
{
    load l = {.least_pa = INFINITY};
    for (int c = 0; c < curves; c++)
        for (int k = 0; k < curve[c].curve->steps; k++) {
            const double nominal = curve[c].curve->step[k].stress_pa;
            if (nominal > 0) l.least_pa = fmin(l.least_pa, nominal);
            if (!(nominal > l.nominal_pa)) continue;
            const kn_compared_part *p = &curve[c].part[0];
            const double until = k + 1 < curve[c].curve->steps ? curve[c].curve->step[k + 1].time_s : INFINITY;
            int i = 0;
            while (i + 1 < p->count && p->time_s[i + 1] <= until) i++;
            const double strain = p->count ? fmax(p->value[i], 1e-9) : 1e-9;
            l.nominal_pa = nominal;
            l.time_s = p->count ? fmax(p->time_s[i] - curve[c].curve->step[k].time_s, 1e-9) : 1;
            l.stress_pa = nominal * (curve[c].curve->constant_area ? 1 : fmax(1 - strain, 0.05));
            l.compliance = strain / l.stress_pa;
        }
    return l;
}

// Make four starts for springs and dampers. Each start spreads the retardation times over the duration of the load in
// another way, and shares the compliance equally among the parts.
static int start_units_creep(const kn_constitutive_model *model, const load *l, places start)
{
    static const double share[4][3] = {{0.1, 1, 3}, {0.02, 0.3, 1}, {0.5, 3, 10}, {0.005, 0.1, 1}};
    const double parts = model->units + model->spring + model->damper;
    for (int s = 0; s < 4; s++) {
        int n = 0;
        for (int k = 0; k < model->units; k++) {
            start[s][n++] = parts / l->compliance;
            start[s][n++] = share[s][k] * l->time_s;
        }
        if (model->spring) start[s][n++] = parts / l->compliance * (s % 2 ? 5 : 1);
        if (model->damper) start[s][n++] = parts * l->time_s / l->compliance * (s > 1 ? 5 : 1);
    }
    return 4;
}

// Make four starts for k1, c1, alpha and beta from the compliance under the largest load.
static int start_papers_creep(const load *l, places start)
{
    static const double thins[2] = {0.7, 3};
    for (int s = 0; s < 4; s++) {
        const double stress = (l->nominal_pa + l->stress_pa) / 2, x = thins[s / 2];
        start[s][0] = 4 / l->compliance;
        start[s][1] = 4 / l->compliance * l->time_s * (s % 2 ? 0.3 : 0.05);
        start[s][2] = 1.5 * l->time_s / l->compliance * exp(x);
        start[s][3] = x / stress;
    }
    return 4;
}

// Make starts for P0 and P1 from the fit of the other four parameters. P1 starts below the largest stress, since a P1
// above all stresses has no effect and the search would leave it there.
static int start_clamps_creep(const kn_constitutive_model *model, const load *l, const kn_fit_unknown *found,
                              places start)
{
    static const double above[3] = {0.6, 0.8, 0.95}, below[3] = {1.2, 0.5, 0.9};
    for (int s = 0; s < 3; s++) {
        int n = 0;
        for (; n < 4; n++) start[s][n] = found[n].value;
        if (model->p0) start[s][n++] = below[s] * l->least_pa;
        if (model->p1) start[s][n] = above[s] * l->nominal_pa;
    }
    return 3;
}

static int starts_creep(const kn_constitutive_model *model, int curves, const kn_compared_curve *curve, int count,
                        const kn_fit_unknown *found, places start)
{
    static const double order[4][2] = {{0.3, 0.3}, {0.6, 0.3}, {0.95, 0.2}, {0.9, 0.6}};
    const load l = largest(curves, curve);
    if (model->kind == KN_CONSTITUTIVE_UNITS) return start_units_creep(model, &l, start);
    if (model->kind == KN_CONSTITUTIVE_PAPERS && (model->p0 || model->p1) && count >= 4)
        return start_clamps_creep(model, &l, found, start);
    if (model->kind == KN_CONSTITUTIVE_PAPERS) return start_papers_creep(&l, start);
    for (int s = 0; s < 4; s++) {
        const double a = order[s][0], b = order[s][1] * a, half = 2 / l.compliance;
        if (model->kind == KN_CONSTITUTIVE_LOGARITHM) {
            const double tau = l.time_s * pow(10, -1 - s);
            start[s][0] = log1p(l.time_s / tau) / l.compliance;
            start[s][1] = tau;
            continue;
        }
        start[s][0] = half * pow(l.time_s, a) / tgamma(1 + a);
        start[s][1] = a;
        start[s][2] = half * pow(l.time_s, b) / tgamma(1 + b);
        start[s][3] = order[s][1];
    }
    return 4;
}

int kn_constitutive_starts(const kn_constitutive_model *model, int curves, const kn_compared_curve *curve, int count,
                           const kn_fit_unknown *found, double start[][KN_FIT_UNKNOWNS])
{
    memset(start, 0, KN_CONSTITUTIVE_STARTS * sizeof *start);
    return model->relax ? starts_relax(model, curves, curve, start)
                        : starts_creep(model, curves, curve, count, found, start);
}
