#include "clients/identify/element_response.h"
#include "core/network.h"
#include <math.h>
#include <string.h>

enum { STAGES = KN_SDIRK_STAGES, UNITS = KN_VOIGT_CHAIN_VOIGTS + 2, NEWTON_MAX = 60, STEPS_MAX = 20000 };

// ---- a Voigt chain under a load or a strain

// Indices in the list of strains: the single spring, the first Voigt element, the single damper.
enum { SPRING = 0, VOIGT = 1, DAMPER = KN_VOIGT_CHAIN_VOIGTS + 1 };

static const double tolerance = 1e-7; // allowed error of one time step, as a share of the largest strain so far

typedef struct drive {
    bool load;          // true: the load is given; false: the rate of the strain is given
    double nominal_pa;  // nominal stress W/S0, if `load` is true
    bool constant_area; // true: the area is constant, so the stress is the nominal stress; used if `load` is true
    double rate_per_s;  // rate of the strain, if `load` is false
} drive;

typedef struct state {
    double time_s, x[UNITS], stress_pa, rate[UNITS], largest;
} state;

kn_voigt_chain kn_voigt_chain_of(const kn_material *m)
{
    return (kn_voigt_chain){.voigts = 1,
                            .k_pa = {m->k1_pa},
                            .c_pa_s = {m->c1_pa_s},
                            .alpha_pa_s = m->alpha_pa_s,
                            .beta_per_pa = m->beta_per_pa,
                            .p0_pa = m->p0_pa,
                            .p1_pa = m->p1_pa};
}

// Return the damping c(P) of the single damper at a stress P [Pa s].
static double viscosity(const kn_voigt_chain *chain, double stress_pa)
{
    if (chain->beta_per_pa == 0) return chain->alpha_pa_s;
    return chain->alpha_pa_s * exp(-chain->beta_per_pa * fmin(fmax(fabs(stress_pa), chain->p0_pa), chain->p1_pa));
}

// Return the strain rate of the single damper at the stress p, and the derivative of this rate in *slope. Both are 0 if
// the chain has no single damper.
static double flow(const kn_voigt_chain *chain, double p, double *slope)
{
    *slope = 0;
    if (chain->alpha_pa_s == 0) return 0;
    double c = viscosity(chain, p), a = fabs(p);
    bool inside = a > chain->p0_pa && a <= chain->p1_pa;
    *slope = (1 + (inside ? chain->beta_per_pa * a : 0)) / c;
    return p / c;
}

static double total(const double *x)
{
    double sum = 0;
    for (int i = 0; i < UNITS; i++) sum += x[i];
    return sum;
}

// The spring and the Voigt elements in one stage of length h of the time integrator. The strain of each of them grows
// by share * p + rest, which is linear in the stress p.
typedef struct stage {
    double h, share[UNITS], all; // all: sum of share[] over all elements
} stage;

static stage stage_of(const kn_voigt_chain *chain, double h)
{
    stage g = {.h = h};
    if (chain->spring_pa > 0) g.share[SPRING] = 1 / chain->spring_pa;
    // For a Voigt element, c x' + k x = p is solved by an implicit Euler stage.
    for (int i = 0; i < chain->voigts; i++) g.share[VOIGT + i] = h / (chain->c_pa_s[i] + h * chain->k_pa[i]);
    for (int i = 0; i < UNITS; i++) g.all += g.share[i];
    return g;
}

// For zero stress, compute the growth of each element's strain beyond `base` in the stage. Return the sum of all
// growths.
static double rests(const kn_voigt_chain *chain, const stage *g, const double *base, double *out)
{
    double sum = out[SPRING] = chain->spring_pa > 0 ? -base[SPRING] : 0;
    for (int i = 0; i < KN_VOIGT_CHAIN_VOIGTS; i++) {
        out[VOIGT + i] = i < chain->voigts ? -g->share[VOIGT + i] * chain->k_pa[i] * base[VOIGT + i] : 0;
        sum += out[VOIGT + i];
    }
    return sum;
}

// Find the stress at the end of a stage that begins with the strains `base`, and the growth of each strain. Newton's
// method searches for the stress p. The sum of the strains rises with p, so the root stays enclosed in an interval. If
// a Newton step leaves that interval, the interval is halved instead.
static bool meet(const kn_voigt_chain *chain, const drive *d, const stage *g, const double *base, double *stress,
                 double *taken)
{
    double p = *stress, low = -INFINITY, high = INFINITY, steep, rate;
    double feedback = d->load && !d->constant_area ? d->nominal_pa : 0;
    double rest = rests(chain, g, base, taken), begun = d->load ? total(base) : 0;
    for (int i = 0; i < NEWTON_MAX; i++) {
        rate = flow(chain, p, &steep);
        double sum = g->all * p + rest + g->h * rate, slope = g->all + g->h * steep;
        // f is the error of the stress if the load is given, or the error of the strain if the strain rate is given.
        double f = d->load ? p - d->nominal_pa + feedback * (begun + sum) : sum - g->h * d->rate_per_s;
        slope = d->load ? 1 + feedback * slope : slope;
        if (!isfinite(f) || !(slope > 0)) return false;
        // f rises with p, so the sign of f tells on which side of p the root is.
        if (f > 0) high = p;
        else low = p;
        double next = p - f / slope;
        // stop here: Newton's method squares the error, so the next step would be far smaller
        bool there = fabs(next - p) <= 1e-8 * fabs(p) + 1e-16 * fabs(d->nominal_pa);
        bool over = fabs(p) < chain->p1_pa && fabs(next) > chain->p1_pa && chain->beta_per_pa > 0;
        // do not step across P1, where the slope has a kink
        if (over) next = copysign(chain->p1_pa, next);
        if (!there && !(next > low && next < high) && isfinite(low) && isfinite(high)) next = (low + high) / 2;
        rate += steep * (next - p);
        p = next;
        if (there) break;
        // the halved interval is as small as the rounding error, so accept p
        if (i == NEWTON_MAX - 1) rate = flow(chain, p, &steep);
    }
    *stress = p;
    for (int i = 0; i < UNITS; i++) taken[i] += g->share[i] * p;
    taken[DAMPER] = g->h * rate;
    return true;
}

// Compute the stress and the strain rates that belong to the present strains.
static bool observe(const kn_voigt_chain *chain, const drive *d, state *s)
{
    double taken[UNITS], steep, p = s->stress_pa;
    bool spring = chain->spring_pa > 0;
    // A given load fixes the stress: load over current area. If the strain rate is given, the stress is that of the
    // single spring. Without a single spring, solve a stage that is too short to change the strains.
    if (d->load) p = d->nominal_pa * (1 - (d->constant_area ? 0 : total(s->x)));
    else if (spring) p = chain->spring_pa * s->x[SPRING];
    else {
        stage instant = stage_of(chain, 1e-15);
        if (!meet(chain, d, &instant, s->x, &p, taken)) return false;
    }
    s->stress_pa = p;
    double others = flow(chain, p, &steep);
    memset(s->rate, 0, sizeof s->rate);
    s->rate[DAMPER] = others;
    for (int i = 0; i < chain->voigts; i++) {
        if (chain->c_pa_s[i] > 0) s->rate[VOIGT + i] = (p - chain->k_pa[i] * s->x[VOIGT + i]) / chain->c_pa_s[i];
        others += s->rate[VOIGT + i];
    }
    // The strain of the spring follows from the stress, so its rate follows from the rates of the other elements.
    if (spring && d->load && !d->constant_area)
        s->rate[SPRING] = -d->nominal_pa * others / (chain->spring_pa + d->nominal_pa);
    else if (spring && !d->load) s->rate[SPRING] = d->rate_per_s - others;
    return true;
}

// Take one time step of length h. Return the error of the step as a share of the largest strain so far, or infinity if
// a stage has no solution.
static double step(const kn_voigt_chain *chain, const drive *d, const state *from, double h, state *to)
{
    double taken[STAGES][UNITS], base[UNITS], p = from->stress_pa, error = 0;
    const stage g = stage_of(chain, KN_SDIRK_GAMMA * h);
    for (int j = 0; j < STAGES; j++) {
        memcpy(base, from->x, sizeof base);
        for (int m = 0; m < j; m++)
            for (int i = 0; i < UNITS; i++) base[i] += kn_sdirk_row[j][m] / KN_SDIRK_GAMMA * taken[m][i];
        if (!meet(chain, d, &g, base, &p, taken[j])) return INFINITY;
    }
    *to = *from;
    to->time_s = from->time_s + h;
    to->stress_pa = p;
    for (int i = 0; i < UNITS; i++) {
        double difference = 0;
        // the last stage is the result of the step, since the method is stiffly accurate
        to->x[i] = base[i] + taken[STAGES - 1][i];
        for (int j = 0; j < STAGES; j++) difference += kn_sdirk_error[j] / KN_SDIRK_GAMMA * taken[j][i];
        error = fmax(error, fabs(difference));
        to->largest = fmax(to->largest, fabs(to->x[i]));
    }
    if (!observe(chain, d, to)) return INFINITY;
    return to->largest > 0 ? error / to->largest : 0;
}

// The requested readings. After each time step, the readings whose times lie within the step are interpolated.
typedef struct readings {
    int count, next;
    const double *time_s;
    double *out; // if the load is given: strains; otherwise: stresses
} readings;

static double hermite(double a, double slope_a, double b, double slope_b, double h, double s)
{
    double along_s = 1 - s;
    return along_s * along_s * ((1 + 2 * s) * a + s * h * slope_a) + s * s * ((3 - 2 * s) * b - along_s * h * slope_b);
}

// Interpolate the readings between the states a and b. A stress is computed from the interpolated strains.
static bool read_between(const kn_voigt_chain *chain, const drive *d, const state *a, const state *b, readings *r)
{
    for (; r->next < r->count && r->time_s[r->next] <= b->time_s; r->next++) {
        state at = *b;
        double h = b->time_s - a->time_s, s = h > 0 ? (r->time_s[r->next] - a->time_s) / h : 1;
        for (int i = 0; i < UNITS; i++) at.x[i] = hermite(a->x[i], a->rate[i], b->x[i], b->rate[i], h, s);
        if (!d->load && s < 1 && !observe(chain, d, &at)) return false;
        r->out[r->next] = d->load ? total(at.x) : at.stress_pa;
    }
    return true;
}

// Advance the chain without load: every Voigt element relaxes independently, in closed form.
static void rest(const kn_voigt_chain *chain, state *s, double until_s, readings *r)
{
    double begun[UNITS], from = s->time_s;
    memcpy(begun, s->x, sizeof begun);
    begun[SPRING] = 0;
    for (bool last = false; !last;) {
        last = r->next >= r->count || r->time_s[r->next] > until_s;
        double t = last ? until_s : r->time_s[r->next];
        memcpy(s->x, begun, sizeof begun);
        for (int i = 0; i < chain->voigts; i++) {
            double c = chain->c_pa_s[i];
            s->x[VOIGT + i] *= c > 0 ? exp(-chain->k_pa[i] / c * (t - from)) : chain->k_pa[i] > 0 ? 0 : 1;
        }
        if (!last) r->out[r->next++] = total(s->x);
    }
    s->time_s = until_s;
    s->stress_pa = 0;
}

// Integrate until the time `until_s` while the load or the rate of the strain is constant.
static bool follow(const kn_voigt_chain *chain, const drive *d, state *s, double until_s, readings *r)
{
    double span = until_s - s->time_s;
    if (!(span > 0)) return true;
    if (d->load && d->nominal_pa == 0 && isfinite(until_s)) return rest(chain, s, until_s, r), true;
    // When the load changes, the spring deforms at once.
    if (chain->spring_pa > 0 && d->load) {
        double others = total(s->x) - s->x[SPRING];
        s->x[SPRING] = d->constant_area ? d->nominal_pa / chain->spring_pa
                                        : d->nominal_pa * (1 - others) / (chain->spring_pa + d->nominal_pa);
    }
    if (!observe(chain, d, s)) return false;
    double h = 1e-4 * span;
    for (int n = 0; n < STEPS_MAX; n++) {
        state next;
        bool last = s->time_s + 1.0001 * h >= until_s;
        if (last) h = until_s - s->time_s;
        double error = step(chain, d, s, h, &next);
        // Repeat a rejected step with a smaller h. The factor on h follows from the error estimate, which is of order 4
        // in h.
        if (error > tolerance) {
            h *= fmin(fmax(0.9 * pow(tolerance / error, 0.25), 0.1), 0.5);
            if (!(h > 1e-15 * span)) return false;
            continue;
        }
        if (last) next.time_s = until_s;
        if (!read_between(chain, d, s, &next, r)) return false;
        *s = next;
        if (last) return true;
        h *= error > 0 ? fmin(0.9 * pow(tolerance / error, 0.25), 5) : 5;
    }
    return false;
}

bool kn_voigt_chain_creep(const kn_voigt_chain *chain, bool constant_area, int steps, const kn_voigt_chain_step *at,
                          int count, const double *time_s, double *strain)
{
    state s = {.time_s = at[0].time_s};
    readings r = {.count = count, .time_s = time_s, .out = strain};
    for (; r.next < count && time_s[r.next] <= s.time_s; r.next++) strain[r.next] = 0;
    for (int i = 0; i < steps && r.next < count; i++) {
        drive d = {.load = true, .nominal_pa = at[i].value, .constant_area = constant_area};
        double until = i + 1 < steps ? at[i + 1].time_s : time_s[count - 1];
        if (!follow(chain, &d, &s, until, &r)) return false;
    }
    return true;
}

bool kn_voigt_chain_stress(const kn_voigt_chain *chain, int steps, const kn_voigt_chain_step *at, int count,
                           const double *time_s, double *stress_pa)
{
    state s = {.time_s = at[0].time_s};
    readings r = {.count = count, .time_s = time_s, .out = stress_pa};
    if (at[0].value != 0) { // the strain jumps at the start, and only the spring can follow a jump
        if (!(chain->spring_pa > 0)) return false;
        s.x[SPRING] = at[0].value;
    }
    for (; r.next < count && time_s[r.next] < s.time_s; r.next++) stress_pa[r.next] = 0;
    for (int i = 0; i < steps && r.next < count; i++) {
        bool last = i + 1 == steps;
        double until = last ? time_s[count - 1] : at[i + 1].time_s, span = until - at[i].time_s;
        double grown = last ? 0 : at[i + 1].value - at[i].value;
        drive d = {.rate_per_s = span > 0 && !last ? grown / span : 0};
        // Only the spring can follow a jump of the strain.
        if (span == 0 && grown != 0) {
            if (!(chain->spring_pa > 0)) return false;
            s.x[SPRING] += grown;
        }
        if (!follow(chain, &d, &s, until, &r)) return false;
    }
    return true;
}

// ---- the exponential integral

#define EULER_GAMMA 0.57721566490153286061

// Return E1(x) by the power series -gamma - ln x - sum of (-x)^k/(k k!), where gamma is Euler's constant.
static double by_series(double x)
{
    double sum = 0, term = 1; // (-x)^k/k!
    for (int k = 1; k < 30; k++) {
        term *= -x / k;
        sum += term / k;
        if (fabs(term) < 1e-17) break;
    }
    return -EULER_GAMMA - log(x) - sum;
}

// Return E1(x) by the continued fraction exp(-x) (1/(x+1- 1/(x+3- 4/(x+5- ...)))), evaluated from the front by Lentz's
// method. About 80/x terms are needed.
static double by_fraction(double x)
{
    double b = x + 1, c = INFINITY, d = 1 / b, h = d;
    for (int i = 1; i < 200; i++) {
        const double a = -(double)i * i;
        b += 2;
        d = 1 / (a * d + b);
        c = b + a / c;
        const double factor = c * d;
        h *= factor;
        if (fabs(factor - 1) < 1e-16) break;
    }
    return h * exp(-x);
}

double kn_exponential_integral(double x)
{
    if (!(x > 0)) return x == 0 ? INFINITY : NAN;
    return x <= 1 ? by_series(x) : by_fraction(x);
}

// ---- the papers' element, held at a constant strain

#define SMALL 1e-12 // if beta P is below this limit, exp(-beta P) counts as 1

kn_held_element kn_held_element_of(const kn_material *m, double begin_pa)
{
    return (kn_held_element){.begin_pa = begin_pa,
                             .alpha_s = m->alpha_pa_s / m->k1_pa,
                             .c1_s = m->c1_pa_s / m->k1_pa,
                             .beta_per_pa = m->beta_per_pa,
                             .p0_pa = m->p0_pa,
                             .p1_pa = m->p1_pa};
}

// Return exp(-beta clamp(P, P0, P1)): the damping c2 as a share of alpha.
static double share(const kn_held_element *h, double p)
{
    return exp(-h->beta_per_pa * fmin(fmax(p, h->p0_pa), h->p1_pa));
}

double kn_held_element_time(const kn_held_element *h, double p)
{
    const double thins = p > h->p0_pa && p < h->p1_pa ? h->beta_per_pa * p : 0;
    return h->alpha_s * share(h, p) + h->c1_s * (1 + thins);
}

// Return the floor: the stress below which the damper is constant. Below the floor and above P1 the stress falls
// exponentially.
static double floor_of(const kn_held_element *h)
{
    return h->beta_per_pa > 0 ? fmax(h->p0_pa, SMALL / h->beta_per_pa) : INFINITY;
}

// Integrate exp(-u)/u between two values of u by the Gauss-Legendre rule with 2 * pairs points over ln u.
static double by_gauss(double middle, double half, int pairs, const double *place, const double *weight)
{
    double sum = 0;
    for (int i = 0; i < pairs; i++) {
        const double apart = exp(half * place[i]);
        sum += weight[i] * (exp(-middle * apart) + exp(-middle / apart));
    }
    return half * sum;
}

// Return E1(x) - E1(y) for y > x. If x and y are close, a Gauss rule of four or six points suffices. The rule takes a
// tenth of the time of two calls of kn_exponential_integral. It also avoids cancellation, and its relative error is
// 1e-13.
static double e1_between(double x, double y)
{
    static const double place4[2] = {0.3399810435848563, 0.8611363115940526};
    static const double weight4[2] = {0.6521451548625461, 0.3478548451374538};
    static const double place6[3] = {0.2386191860831969, 0.6612093864662645, 0.9324695142031521};
    static const double weight6[3] = {0.4679139345726910, 0.3607615730481386, 0.1713244923791704};
    const double half = log(y / x) / 2, wide = half * (1 + y);
    if (wide > 0.5) return kn_exponential_integral(x) - kn_exponential_integral(y);
    return wide > 0.05 ? by_gauss(sqrt(x * y), half, 3, place6, weight6)
                       : by_gauss(sqrt(x * y), half, 2, place4, weight4);
}

// Return the time in which the stress falls from the value `from` to the value `to`, by equation (1) of the header.
// Both stresses are between the floor and P1.
static double between(const kn_held_element *h, double from, double to)
{
    const double b = h->beta_per_pa;
    return h->alpha_s * e1_between(b * to, b * from) + h->c1_s * (log(from / to) + b * (from - to));
}

// Return the time constant of the fall below P0 or above P1, where the damper is constant. `clamped` is P0 or P1.
static double outside(const kn_held_element *h, double clamped) { return h->alpha_s * share(h, clamped) + h->c1_s; }

double kn_held_element_until(const kn_held_element *h, double to)
{
    const double low = floor_of(h);
    double from = h->begin_pa, t = 0;
    // Add up the times that the stress spends above P1, between P1 and the floor, and below the floor.
    if (from > h->p1_pa && low < h->p1_pa) {
        const double end = fmax(to, h->p1_pa);
        t += outside(h, h->p1_pa) * log(from / end);
        from = end;
    }
    if (from > low && from > to) {
        const double end = fmax(to, low);
        t += between(h, from, end);
        from = end;
    }
    return from > to ? t + outside(h, fmin(from, low)) * log(from / to) : t;
}

// Compute how the stress P relaxes by equation (1) of the header. P starts at the value `from` and never falls below
// the value `least`. Return ln P after the duration `wait`. Newton's method searches for ln P within an interval that
// encloses the root. Far below the root, the logarithm of the time is used in place of the time, since it is closer to
// linear in ln P.
static double after(const kn_held_element *h, double from, double wait, double least)
{
    double high = log(from), low = log(least), half = wait / kn_held_element_time(h, from) / 2;
    // first guess: the midpoint rule for d(ln P)/dt = -1/(time constant)
    double u = high - wait / kn_held_element_time(h, exp(high - half));
    if (!(wait > 0)) return high;
    for (int i = 0; i < NEWTON_MAX && low < high; i++) {
        if (!(u > low && u < high)) u = (low + high) / 2;
        const double p = exp(u), t = between(h, from, p), tau = kn_held_element_time(h, p);
        if (t > wait) low = u;
        else high = u;
        const double step = t > 2 * wait ? t / tau * log(t / wait) : (t - wait) / tau;
        u += step;
        // Newton's method squares the error, so after this step u is exact enough
        if (fabs(step) < 3e-7) return u;
    }
    return u;
}

// A stress that was found, and its time. The search for the next stress starts there.
typedef struct stretch {
    double from_pa, from_s;
} stretch;

void kn_held_element_stress(const kn_held_element *h, int count, const double *time_s, double *stress_pa)
{
    const double low = floor_of(h);
    const double at_p1 = h->begin_pa > h->p1_pa && low < h->p1_pa ? kn_held_element_until(h, h->p1_pa) : 0;
    const double at_low = h->begin_pa > low ? kn_held_element_until(h, low) : 0;
    stretch s = {h->begin_pa, 0}; // stress and time that were found last
    for (int i = 0; i < count; i++) {
        const double t = time_s[i];
        // Above P1 the stress falls exponentially.
        if (t < at_p1) {
            stress_pa[i] = h->begin_pa * exp(-t / outside(h, h->p1_pa));
            continue;
        }
        if (s.from_s < at_p1) s = (stretch){h->p1_pa, at_p1};
        // Between P1 and the floor, invert equation (1) from the last stress found. Below the floor the stress falls
        // exponentially again.
        if (t < at_low) s = (stretch){exp(after(h, s.from_pa, t - s.from_s, low)), t};
        stress_pa[i] = s.from_pa;
        if (t < at_low) continue;
        const double begin = fmin(h->begin_pa, low);
        stress_pa[i] = begin * exp(-(t - at_low) / outside(h, begin));
    }
}
