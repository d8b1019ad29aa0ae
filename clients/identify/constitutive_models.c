#include "clients/identify/constitutive_models.h"
#include "clients/identify/element_response.h"
#include "clients/identify/fractional.h"
#include "core/oneport.h"
#include <math.h>
#include <stdio.h>
#include <string.h>

// ---- the list of laws

// Return the law by which a class of one-ports appears in a relaxation or creep experiment.
static kn_constitutive_model of_class(const kn_oneport *o, bool relax)
{
    kn_constitutive_model law = {.kind = KN_CONSTITUTIVE_UNITS, .relax = relax};
    law.spring = relax ? !o->fluid : o->elastic;
    law.damper = !relax && o->fluid;
    law.units = relax ? o->relaxation : o->retardation;
    if (!relax) {
        char text[KN_ELEMENT_TEXT];
        kn_oneport_voigt(o, text);
        snprintf(law.name, sizeof law.name, "%.40s", text);
        return law;
    }
    static const char *const units[] = {"", "Maxwell unit", "two Maxwell units", "three Maxwell units"};
    const char *rest = law.spring ? law.units ? " | spring" : "spring" : "";
    snprintf(law.name, sizeof law.name, "%s%s", law.units < 4 ? units[law.units] : "Maxwell units", rest);
    return law;
}

static void add_letter(kn_constitutive_model *law, char letter)
{
    const size_t n = strlen(law->letters);
    if (n + 3 > sizeof law->letters) return;
    snprintf(law->letters + n, sizeof law->letters - n, n ? " %c" : "%c", letter);
}

// Add one law for each class of the catalogue. Elements that this experiment cannot tell apart share a law and list
// their letters.
static int add_catalogue(kn_constitutive_model law[KN_CONSTITUTIVE_MAX], bool relax)
{
    int count = 0;
    for (int i = 0; i < KN_CATALOGUE; i++) {
        kn_element e;
        char error[64];
        // parsing cannot fail, since the catalogue is a constant of this program
        if (!kn_element_parse(&e, kn_catalogue[i].expression, error, sizeof error)) continue;
        const kn_oneport o = kn_oneport_of(&e);
        const kn_constitutive_model one = of_class(&o, relax);
        int k = 0;
        while (k < count && strcmp(law[k].name, one.name) != 0) k++;
        if (k == count) law[count++] = one;
        add_letter(&law[k], kn_catalogue[i].letter);
    }
    return count;
}

int kn_constitutive_models(kn_constitutive_model law[KN_CONSTITUTIVE_MAX], bool relax)
{
    int count = add_catalogue(law, relax);
    // The papers' damper, alone and with further parameters: see models.h.
    for (int more = 0; more < 4; more++) {
        kn_constitutive_model *d = &law[count++];
        *d = (kn_constitutive_model){
            .kind = KN_CONSTITUTIVE_DOUGH, .relax = relax, .letters = "d", .c1 = !relax || more % 2};
        d->p0 = more / 2;
        d->p1 = !relax && more % 2;
        snprintf(d->name, sizeof d->name, "(s|d)-d thinning%s", d->p0 ? " above P0" : d->c1 ? "" : ", c1 = 0");
    }
    law[count] = (kn_constitutive_model){.kind = KN_CONSTITUTIVE_LOGARITHM, .relax = relax, .yardstick = true};
    snprintf(law[count++].name, sizeof law->name, relax ? "a - b ln t" : "b ln(1 + t/tau)");
    law[count] = (kn_constitutive_model){.kind = KN_CONSTITUTIVE_FRACTIONAL, .relax = relax, .yardstick = true};
    snprintf(law[count++].name, sizeof law->name, "fractional Maxwell");
    return count;
}

// ---- unknowns

// Typical sizes of the readings; the bounds are powers of ten around them.
typedef struct size {
    double modulus_pa, stress_pa, first_s, last_s;
} size;

// Find the typical sizes over all curves.
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

static void add(kn_fit_unknown out[KN_FIT_UNKNOWNS], int *n, const char *name, double low, double high, bool linear)
{
    out[(*n)++] = (kn_fit_unknown){.name = name, .low = low, .high = high, .linear = linear};
}

// List the unknowns of springs and dampers. Each Maxwell or Voigt element has a modulus and a time. A single spring and
// a single damper have one unknown each.
static int unknowns_of_units(const kn_constitutive_model *law, const size *z, kn_fit_unknown out[KN_FIT_UNKNOWNS])
{
    static const char *const k[] = {"k1", "k2", "k3"}, *const tau[] = {"tau1", "tau2", "tau3"};
    const double low = 1e-6 * z->modulus_pa, high = 1e4 * z->modulus_pa;
    int n = 0;
    for (int i = 0; i < law->units && i < 3; i++) {
        add(out, &n, k[i], low, high, false);
        add(out, &n, tau[i], 1e-3 * z->first_s, 1e4 * z->last_s, false);
    }
    if (law->spring) add(out, &n, law->relax ? "k_inf" : "k0", low, high, false);
    if (law->damper) add(out, &n, "c", low * z->first_s, high * z->last_s, false);
    return n;
}

static const char *const begin_name[KN_FIT_UNKNOWNS] = {"Pi",    "Pi(2)", "Pi(3)", "Pi(4)",  "Pi(5)",  "Pi(6)",
                                                        "Pi(7)", "Pi(8)", "Pi(9)", "Pi(10)", "Pi(11)", "Pi(12)"};

// List the unknowns of the papers' damper. A hold does not determine k1, so the unknowns are ratios to k1, and the
// stress of each curve at time 0 is an unknown.
static int unknowns_of_dough(const kn_constitutive_model *law, const size *z, int curves,
                             kn_fit_unknown out[KN_FIT_UNKNOWNS])
{
    const double p = z->stress_pa, low = 1e-6 * z->modulus_pa, high = 1e4 * z->modulus_pa;
    int n = 0;
    if (law->relax) {
        add(out, &n, "alpha/k1", 1e-3 * z->first_s, 1e80 * z->last_s, false);
        // a beta below the lower bound would leave c2 almost independent of the stress
        add(out, &n, "beta", 1e-2 / p, 200 / p, false);
        if (law->c1) add(out, &n, "c1/k1", 1e-4 * z->first_s, 10 * z->last_s, false);
    } else {
        add(out, &n, "k1", low, high, false);
        add(out, &n, "c1", low * z->first_s, high * z->last_s, false);
        add(out, &n, "alpha", low * z->first_s, 1e80 * z->modulus_pa * z->last_s, false);
        add(out, &n, "beta", 1e-2 / p, 200 / p, false);
    }
    if (law->p0) add(out, &n, "P0", 1e-3 * p, p, false);
    if (law->p1) add(out, &n, "P1", 0.05 * p, 3 * p, false);
    for (int c = 0; law->relax && c < curves && n < KN_FIT_UNKNOWNS; c++)
        add(out, &n, begin_name[c], 1e-3 * p, 10 * p, false);
    return n;
}

int kn_constitutive_model_unknowns(const kn_constitutive_model *law, int curves, const kn_compared_curve *curve,
                                   kn_fit_unknown out[KN_FIT_UNKNOWNS])
{
    const size z = size_of(law->relax, curves, curve);
    const double most = 1e4 * z.modulus_pa;
    int n = 0;
    switch (law->kind) {
    case KN_CONSTITUTIVE_UNITS: return unknowns_of_units(law, &z, out);
    case KN_CONSTITUTIVE_DOUGH: return unknowns_of_dough(law, &z, curves, out);
    case KN_CONSTITUTIVE_LOGARITHM:
        add(out, &n, law->relax ? "a" : "1/b", law->relax ? -most : 1e-6 * z.modulus_pa, most, law->relax);
        if (law->relax) add(out, &n, "b", -most, most, true);
        else add(out, &n, "tau", 1e-6 * z.first_s, 1e3 * z.last_s, false);
        return n;
    case KN_CONSTITUTIVE_FRACTIONAL: break;
    }
    add(out, &n, "V", 1e-6 * z.modulus_pa, 1e3 * most * z.last_s, false);
    add(out, &n, "a", 0.02, 1, true);
    add(out, &n, "G", 1e-6 * z.modulus_pa, 1e3 * most * z.last_s, false);
    add(out, &n, "b/a", 0.01, 0.98, true);
    return n;
}

const char *kn_constitutive_model_unit(const kn_constitutive_model *law, int unknown)
{
    kn_fit_unknown u[KN_FIT_UNKNOWNS];
    const kn_compared_curve none = {.strain = 1};
    // the unknowns after the parameters are the stresses of the curves at time 0
    if (unknown >= kn_constitutive_model_unknowns(law, 0, &none, u)) return "Pa";
    const char *name = u[unknown].name;
    if (law->kind == KN_CONSTITUTIVE_FRACTIONAL) return unknown == 0 ? "Pa*s^a" : unknown == 2 ? "Pa*s^b" : "";
    if (!strcmp(name, "beta")) return "1/Pa";
    if (!strncmp(name, "tau", 3) || strstr(name, "/k1")) return "s";
    return name[0] == 'c' || !strcmp(name, "alpha") ? "Pa*s" : "Pa";
}

// ---- predictions

// Sum the Maxwell elements. A ramp multiplies each of them by its mean over the ramp, (1 - exp(-r))/r.
static bool units_relax(const kn_constitutive_model *law, const double *v, const kn_compared_curve *c, int count,
                        const double *t, double *out)
{
    for (int i = 0; i < count; i++) {
        double sum = law->spring ? v[2 * law->units] : 0;
        for (int k = 0; k < law->units; k++) {
            const double tau = v[2 * k + 1], r = c->ramp_s / tau;
            sum += v[2 * k] * exp(-t[i] / tau) * (r > 0 ? -expm1(-r) / r : 1);
        }
        out[i] = c->strain * sum;
    }
    return true;
}

// Stress of the papers' element in a hold, from the stress of curve `number` at time 0.
static bool dough_relax(const kn_constitutive_model *law, const double *v, int number, int count, const double *t,
                        double *out)
{
    int n = 2;
    kn_held_element h = {.alpha_s = v[0], .beta_per_pa = v[1], .p1_pa = INFINITY};
    if (law->c1) h.c1_s = v[n++];
    if (law->p0) h.p0_pa = v[n++];
    h.begin_pa = v[n + number];
    kn_held_element_stress(&h, count, t, out);
    return true;
}

// The logarithm ln t, or its mean over the ramp of the strain.
static bool logarithm_relax(const double *v, const kn_compared_curve *c, int count, const double *t, double *out)
{
    const double r = c->ramp_s;
    for (int i = 0; i < count; i++) {
        const double end = t[i] + r, from = t[i] > 0 ? t[i] * log(t[i]) : 0;
        const double ln = r > 1e-6 * t[i] ? (end * log(end) - from) / r - 1 : log(t[i]);
        out[i] = c->strain * (v[0] - v[1] * ln);
    }
    return true;
}

// The unknown for the order b is its share of the order a, so that b < a.
static kn_fractional_maxwell_maxwell fractional_of(const double *v)
{
    return (kn_fractional_maxwell_maxwell){.v_pa_s = v[0], .v_order = v[1], .g_pa_s = v[2], .g_order = v[3] * v[1]};
}

static bool fractional_relax(const double *v, const kn_compared_curve *c, int count, const double *t, double *out)
{
    const kn_fractional_maxwell_maxwell f = fractional_of(v);
    kn_fractional_maxwell_relax(&f, c->ramp_s, count, t, out);
    for (int i = 0; i < count; i++) out[i] *= c->strain;
    return true;
}

// Creep of a chain under the curve's loads.
static bool row_creep(const kn_voigt_chain *chain, const kn_compared_curve *c, int count, const double *t, double *out)
{
    kn_voigt_chain_step step[KN_CURVE_STEPS];
    for (int i = 0; i < c->curve->steps; i++)
        step[i] = (kn_voigt_chain_step){c->curve->step[i].time_s, c->curve->step[i].stress_pa};
    return kn_voigt_chain_creep(chain, c->curve->constant_area, c->curve->steps, step, count, t, out);
}

// Return the chain of a law in creep.
static kn_voigt_chain row_of(const kn_constitutive_model *law, const double *v)
{
    kn_voigt_chain row = {.voigts = law->units};
    int n = 0;
    if (law->kind == KN_CONSTITUTIVE_DOUGH) {
        row = (kn_voigt_chain){.voigts = 1, .k_pa = {v[0]}, .c_pa_s = {v[1]}, .alpha_pa_s = v[2], .beta_per_pa = v[3]};
        n = 4;
        if (law->p0) row.p0_pa = v[n++];
        row.p1_pa = law->p1 ? v[n] : 600 / v[3]; // without P1, clamp the stress where exp(beta P) would overflow
        return row;
    }
    for (int i = 0; i < law->units && i < KN_VOIGT_CHAIN_VOIGTS; i++, n += 2) {
        // The unknowns of a Voigt element are its modulus and its retardation time.
        row.k_pa[i] = v[n];
        row.c_pa_s[i] = v[n] * v[n + 1];
    }
    if (law->spring) row.spring_pa = v[n++];
    if (law->damper) row.alpha_pa_s = v[n];
    return row;
}

// J = ln(1 + t/tau)/v0 and its integral. A short lag uses the power series, since the closed form cancels.
static void logarithm_compliance(const void *of, int count, const double *lag, const double *ln_lag, double *j,
                                 double *k)
{
    const double *v = of;
    (void)ln_lag;
    for (int i = 0; i < count; i++) {
        const double u = lag[i] / v[1], ln = log1p(u);
        j[i] = ln / v[0];
        k[i] = (u < 1e-4 ? u * u * (0.5 - u / 6) : (1 + u) * ln - u) * v[1] / v[0];
    }
}

// J = t^a/(V Gamma(1+a)) + t^b/(G Gamma(1+b)) and its integral, term by term.
static void fractional_compliance(const void *of, int count, const double *lag, const double *ln_lag, double *j,
                                  double *k)
{
    const kn_fractional_maxwell_maxwell *f = of;
    const double a = f->v_order, b = f->g_order;
    const double v = 1 / (f->v_pa_s * tgamma(1 + a)), g = 1 / (f->g_pa_s * tgamma(1 + b));
    for (int i = 0; i < count; i++) {
        const double at_v = v * exp(a * ln_lag[i]), at_g = g * exp(b * ln_lag[i]);
        j[i] = at_v + at_g;
        k[i] = lag[i] * (at_v / (1 + a) + at_g / (1 + b));
    }
}

static bool predict_relax(const kn_constitutive_model *law, const double *v, const kn_compared_curve *c, int number,
                          int count, const double *t, double *out)
{
    switch (law->kind) {
    case KN_CONSTITUTIVE_UNITS: return units_relax(law, v, c, count, t, out);
    case KN_CONSTITUTIVE_DOUGH: return dough_relax(law, v, number, count, t, out);
    case KN_CONSTITUTIVE_LOGARITHM: return logarithm_relax(v, c, count, t, out);
    case KN_CONSTITUTIVE_FRACTIONAL: return fractional_relax(v, c, count, t, out);
    }
    return false;
}

bool kn_constitutive_model_predict(const kn_constitutive_model *law, const double *value, kn_compared_curve *curve,
                                   int c, int count, const double *time_s, double *out)
{
    if (count == 0) return true;
    if (law->relax) return predict_relax(law, value, &curve[c], c, count, time_s, out);
    if (law->kind == KN_CONSTITUTIVE_UNITS || law->kind == KN_CONSTITUTIVE_DOUGH) {
        const kn_voigt_chain row = row_of(law, value);
        return !(row.p0_pa > row.p1_pa) && row_creep(&row, &curve[c], count, time_s, out);
    }
    // Laws that are no springs and dampers are computed by superposition (memory.h), which needs the nodes.
    if (!curve[c].memory.nodes) return false;
    const kn_fractional_maxwell_maxwell f = fractional_of(value);
    if (law->kind == KN_CONSTITUTIVE_FRACTIONAL)
        return kn_superposition_creep(&curve[c].memory, fractional_compliance, &f, count, time_s, out);
    return kn_superposition_creep(&curve[c].memory, logarithm_compliance, value, count, time_s, out);
}
