#include "clients/identify/element_response.h"
#include <math.h>
#include <string.h>

enum { STAGES = 5, UNITS = KN_VOIGT_CHAIN_VOIGTS + 2, NEWTON_MAX = 60, STEPS_MAX = 20000 };

// Indices of the strains: the spring's, the Voigt elements', the damper's.
enum { SPRING = 0, VOIGT = 1, DAMPER = KN_VOIGT_CHAIN_VOIGTS + 1 };

static const double tolerance = 1e-7; // allowed error of one time step, as a share of the largest strain so far

#define GAMMA 0.25
// Coefficients divided by the diagonal GAMMA: they multiply GAMMA h times the rates.
static const double weight[STAGES][STAGES] = {
    {0},
    {1. / 2 / GAMMA},
    {17. / 50 / GAMMA, -1. / 25 / GAMMA},
    {371. / 1360 / GAMMA, -137. / 2720 / GAMMA, 15. / 544 / GAMMA},
    {25. / 24 / GAMMA, -49. / 48 / GAMMA, 125. / 16 / GAMMA, -85. / 12 / GAMMA}};
// Coefficients of the embedded error: the solution of order 4 minus that of order 3.
static const double against[STAGES] = {-3. / 16 / GAMMA, -27. / 32 / GAMMA, 25. / 32 / GAMMA, 0, 1. / 4 / GAMMA};

typedef struct drive {
    bool load;          // true: a load is given; false: the rate of the strain is given
    double nominal_pa;  // nominal stress W/S0, if `load` is true
    bool constant_area; // the stress is the nominal stress, if `load` is true
    double rate_per_s;  // rate of the strain, if `load` is false
} drive;

typedef struct state {
    double time_s, x[UNITS], stress_pa, rate[UNITS];
    double largest, step_s;
} state;

double kn_voigt_chain_viscosity(const kn_voigt_chain *chain, double stress_pa)
{
    if (chain->beta_per_pa == 0) return chain->alpha_pa_s;
    return chain->alpha_pa_s * exp(-chain->beta_per_pa * fmin(fmax(fabs(stress_pa), chain->p0_pa), chain->p1_pa));
}

// Return the flow rate of the damper at stress p, and its slope. Both are 0 without a damper.
static double flow(const kn_voigt_chain *chain, double p, double *slope)
{
    *slope = 0;
    if (chain->alpha_pa_s == 0) return 0;
    double c = kn_voigt_chain_viscosity(chain, p), a = fabs(p);
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

// The elements other than the damper in a stage of length h. Each takes up the strain share * p + rest, linear in the
// stress p.
typedef struct stage {
    double h, share[UNITS], all; // all: the sum of the shares
} stage;

static stage stage_of(const kn_voigt_chain *chain, double h)
{
    stage g = {.h = h};
    if (chain->spring_pa > 0) g.share[SPRING] = 1 / chain->spring_pa;
    // An implicit Euler stage of a Voigt element: c x' + k x = p.
    for (int i = 0; i < chain->voigts; i++) g.share[VOIGT + i] = h / (chain->c_pa_s[i] + h * chain->k_pa[i]);
    for (int i = 0; i < UNITS; i++) g.all += g.share[i];
    return g;
}

// Compute the strain that each element takes up beyond base at zero stress, and return the sum.
static double rests(const kn_voigt_chain *chain, const stage *g, const double *base, double *out)
{
    double sum = out[SPRING] = chain->spring_pa > 0 ? -base[SPRING] : 0;
    for (int i = 0; i < KN_VOIGT_CHAIN_VOIGTS; i++) {
        out[VOIGT + i] = i < chain->voigts ? -g->share[VOIGT + i] * chain->k_pa[i] * base[VOIGT + i] : 0;
        sum += out[VOIGT + i];
    }
    return sum;
}

// Find the stress of a stage that begins with the strains `base`, and the strain that each element takes up. The method
// is Newton's. The sum of the strains rises with p, so the root stays enclosed in an interval. If a Newton step leaves
// that interval, the interval is halved instead.
static bool meet(const kn_voigt_chain *chain, const drive *d, const stage *g, const double *base, double *stress,
                 double *taken)
{
    double p = *stress, low = -INFINITY, high = INFINITY, steep, rate;
    double feedback = d->load && !d->constant_area ? d->nominal_pa : 0;
    double rest = rests(chain, g, base, taken), begun = d->load ? total(base) : 0;
    for (int i = 0; i < NEWTON_MAX; i++) {
        rate = flow(chain, p, &steep);
        double sum = g->all * p + rest + g->h * rate, slope = g->all + g->h * steep;
        // f is the residual in the stress under a load, or in the strain under a strain drive.
        double f = d->load ? p - d->nominal_pa + feedback * (begun + sum) : sum - g->h * d->rate_per_s;
        slope = d->load ? 1 + feedback * slope : slope;
        if (!isfinite(f) || !(slope > 0)) return false;
        // f rises with p, so its sign tells on which side the root is.
        if (f > 0) high = p;
        else low = p;
        double next = p - f / slope;
        // Newton converges quadratically: the next error would be the square
        bool there = fabs(next - p) <= 1e-8 * fabs(p) + 1e-16 * fabs(d->nominal_pa);
        bool over = fabs(p) < chain->p1_pa && fabs(next) > chain->p1_pa && chain->beta_per_pa > 0;
        if (over) next = copysign(chain->p1_pa, next); // the slope has a kink at P1
        if (!there && !(next > low && next < high) && isfinite(low) && isfinite(high)) next = (low + high) / 2;
        rate += steep * (next - p);
        p = next;
        if (there) break;
        if (i == NEWTON_MAX - 1) rate = flow(chain, p, &steep); // halving has reached the rounding error, so accept p
    }
    *stress = p;
    for (int i = 0; i < UNITS; i++) taken[i] += g->share[i] * p;
    taken[DAMPER] = g->h * rate;
    return true;
}

// Compute the stress and the rates that belong to the present strains. If the strain is given and the chain has no
// spring, the stress follows from a stage that is too short to change the strains.
static bool observe(const kn_voigt_chain *chain, const drive *d, state *s)
{
    double taken[UNITS], steep, p = s->stress_pa;
    bool spring = chain->spring_pa > 0;
    // Under a load the stress follows from the strain, else from the spring.
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
    // The strain of the spring follows from the stress, so its rate balances the rates of the others.
    if (spring && d->load && !d->constant_area)
        s->rate[SPRING] = -d->nominal_pa * others / (chain->spring_pa + d->nominal_pa);
    else if (spring && !d->load) s->rate[SPRING] = d->rate_per_s - others;
    return true;
}

// Take one step of length h. Return its error as a share of the largest strain, or infinity if a stage has no solution.
static double step(const kn_voigt_chain *chain, const drive *d, const state *from, double h, state *to)
{
    double taken[STAGES][UNITS], base[UNITS], p = from->stress_pa, error = 0;
    const stage g = stage_of(chain, GAMMA * h);
    for (int j = 0; j < STAGES; j++) {
        memcpy(base, from->x, sizeof base);
        for (int m = 0; m < j; m++)
            for (int i = 0; i < UNITS; i++) base[i] += weight[j][m] * taken[m][i];
        if (!meet(chain, d, &g, base, &p, taken[j])) return INFINITY;
    }
    *to = *from;
    to->time_s = from->time_s + h;
    to->stress_pa = p;
    for (int i = 0; i < UNITS; i++) {
        double difference = 0;
        // the method is stiffly accurate, so the last stage is the result of the step
        to->x[i] = base[i] + taken[STAGES - 1][i];
        for (int j = 0; j < STAGES; j++) difference += against[j] * taken[j][i];
        error = fmax(error, fabs(difference));
        to->largest = fmax(to->largest, fabs(to->x[i]));
    }
    if (!observe(chain, d, to)) return INFINITY;
    return to->largest > 0 ? error / to->largest : 0;
}

// The readings to compute. When the integration passes the time of a reading, the reading is interpolated. Each step
// fills in the readings in (from, to].
typedef struct readings {
    int count, next;
    const double *time_s;
    double *out;
    bool strain;
} readings;

static double hermite(double a, double slope_a, double b, double slope_b, double h, double s)
{
    double along_s = 1 - s;
    return along_s * along_s * ((1 + 2 * s) * a + s * h * slope_a) + s * s * ((3 - 2 * s) * b - along_s * h * slope_b);
}

// Interpolate the readings between two states. A stress is computed from the interpolated strains.
static bool read_between(const kn_voigt_chain *chain, const drive *d, const state *a, const state *b, readings *r)
{
    for (; r->next < r->count && r->time_s[r->next] <= b->time_s; r->next++) {
        state at = *b;
        double h = b->time_s - a->time_s, s = h > 0 ? (r->time_s[r->next] - a->time_s) / h : 1;
        for (int i = 0; i < UNITS; i++) at.x[i] = hermite(a->x[i], a->rate[i], b->x[i], b->rate[i], h, s);
        if (!r->strain && s < 1 && !observe(chain, d, &at)) return false;
        r->out[r->next] = r->strain ? total(at.x) : at.stress_pa;
    }
    return true;
}

// Advance without load: every Voigt element relaxes independently, in closed form.
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
    // The spring deforms at once when the load changes.
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
        // A rejected step is repeated with a smaller h. The factor for h follows from the error estimate, which is of
        // order 4 in h.
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
    readings r = {.count = count, .time_s = time_s, .out = strain, .strain = true};
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
    if (at[0].value != 0) { // the strain jumps at the start, so the spring takes it up
        if (!(chain->spring_pa > 0)) return false;
        s.x[SPRING] = at[0].value;
    }
    for (; r.next < count && time_s[r.next] < s.time_s; r.next++) stress_pa[r.next] = 0;
    for (int i = 0; i < steps && r.next < count; i++) {
        bool last = i + 1 == steps;
        double until = last ? time_s[count - 1] : at[i + 1].time_s, span = until - at[i].time_s;
        double grown = last ? 0 : at[i + 1].value - at[i].value;
        drive d = {.rate_per_s = span > 0 && !last ? grown / span : 0};
        // A jump of strain is taken up by the spring alone.
        if (span == 0 && grown != 0) {
            if (!(chain->spring_pa > 0)) return false;
            s.x[SPRING] += grown;
        }
        if (!follow(chain, &d, &s, until, &r)) return false;
    }
    return true;
}
