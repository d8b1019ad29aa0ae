#include "clients/identify/least_squares.h"
#include <cminpack-1/cminpack.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

// step of the difference quotients, in the logarithm of an unknown: for models that are accurate to about 1e-8, and for
// coarse ones
static const double step_log = 1e-5, step_coarse = 1e-2;
// wall of each bound: if the logarithm of an unknown lies beyond a bound by x, an extra residual wall * x pushes the
// search back
static const double wall = 1e3;

typedef struct search {
    kn_fit *fit;
    int count;                   // number of free unknowns
    int number[KN_FIT_UNKNOWNS]; // indices of the free unknowns in fit->unknown[]
    int rows;                    // number of residuals: one for each reading, and one for each free unknown
    double x[KN_FIT_UNKNOWNS];   // current point of the search, in the search's variables
    // residual: [rows] residuals at x; jacobian: stored column by column; spare: scratch of MINPACK. All pointers from
    // `residual` on point into one block of memory.
    double *residual, *jacobian, *spare;
} search;

static double inwards(const kn_fit_unknown *u) { return kn_fit_inwards(u, u->value); }
static double lowest(const kn_fit_unknown *u) { return u->linear ? u->low : log(u->low); }
static double highest(const kn_fit_unknown *u) { return u->linear ? u->high : log(u->high); }

// Compute the values of all unknowns at a place of the search. A value beyond a bound is put on the bound.
static void values_at(const search *s, const double *x, double *value)
{
    for (int i = 0; i < s->fit->unknowns; i++) value[i] = s->fit->unknown[i].value;
    for (int k = 0; k < s->count; k++) {
        const kn_fit_unknown *u = &s->fit->unknown[s->number[k]];
        double in = fmin(fmax(x[k], lowest(u)), highest(u));
        value[s->number[k]] = u->linear ? in : fmin(fmax(exp(in), u->low), u->high);
    }
}

// Compute the residuals of the readings, then one residual per free unknown: the distance by which the unknown lies
// beyond a bound.
static bool residuals_at(const search *s, const double *x, double *residual)
{
    kn_fit *fit = s->fit;
    double value[KN_FIT_UNKNOWNS];
    values_at(s, x, value);
    if (!fit->misfit(fit->of, value, residual)) return false;
    for (int i = 0; i < fit->readings; i++)
        if (!isfinite(residual[i])) return false;
    for (int k = 0; k < s->count; k++) {
        const kn_fit_unknown *u = &fit->unknown[s->number[k]];
        residual[fit->readings + k] = wall * (x[k] - fmin(fmax(x[k], lowest(u)), highest(u)));
    }
    return true;
}

// One column of the Jacobian.
typedef struct column {
    const search *s;
    const double *x, *here; // values of the search's variables, and the residuals there
    int k;                  // number of the free unknown
    bool both;              // two-sided quotients, which are more accurate
    double *out;            // [rows] result
    bool made;
} column;

// Compute one column of the Jacobian by difference quotients. A side on which the model has no solution is left out.
static void *make_column(void *of)
{
    column *c = of;
    const search *s = c->s;
    const kn_fit_unknown *u = &s->fit->unknown[s->number[c->k]];
    double at[KN_FIT_UNKNOWNS], h = s->fit->coarse ? step_coarse : step_log;
    double *side = malloc(2 * (size_t)s->rows * sizeof *side);
    memset(c->out, 0, (size_t)s->rows * sizeof *c->out);
    if (!side) return NULL;
    if (u->linear) h *= u->high - u->low;
    memcpy(at, c->x, (size_t)s->count * sizeof *c->x);
    at[c->k] = c->x[c->k] + h;
    bool ahead = at[c->k] <= highest(u) && residuals_at(s, at, side), behind = false;
    at[c->k] = c->x[c->k] - h;
    if (c->both || !ahead) behind = at[c->k] >= lowest(u) && residuals_at(s, at, side + s->rows);
    const double width = (double)(ahead + behind) * h;
    const double *above = ahead ? side : c->here, *below = behind ? side + s->rows : c->here;
    c->made = ahead || behind;
    for (int i = 0; i < s->rows && c->made; i++) c->out[i] = (above[i] - below[i]) / width;
    free(side);
    return NULL;
}

// Compute all columns of the Jacobian at x: jacobian[k * stride]. made[k]: the column could be computed.
static void make_columns(const search *s, const double *x, const double *here, bool both, double *jacobian, int stride,
                         bool made[KN_FIT_UNKNOWNS])
{
    column all[KN_FIT_UNKNOWNS];
    pthread_t thread[KN_FIT_UNKNOWNS];
    int threads = 0;
    for (int k = 0; k < s->count; k++)
        all[k] = (column){s, x, here, k, both, jacobian + (size_t)stride * (size_t)k, .made = false};
    while (s->fit->concurrent && threads < s->count &&
           pthread_create(&thread[threads], NULL, make_column, &all[threads]) == 0)
        threads++;
    for (int k = threads; k < s->count; k++) make_column(&all[k]);
    for (int k = 0; k < threads; k++) pthread_join(thread[k], NULL);
    for (int k = 0; k < s->count; k++) made[k] = all[k].made;
}

// Keep an unknown at its bound if the sum of squares S would decrease beyond the bound. The unknown's column of the
// Jacobian then contains only the extra residual of the bound (`wall`). With the model's own column, every step would
// cross the bound and be rejected. The steps would then shrink until the other unknowns did not move either.
static void stay_inside(const search *s, const double *x, const double *residual, int k, double *out)
{
    const kn_fit_unknown *u = &s->fit->unknown[s->number[k]];
    double slope = 0, low = lowest(u), high = highest(u), near = 1e-9 * (high - low);
    for (int i = 0; i < s->fit->readings; i++) slope += out[i] * residual[i];
    if (!((x[k] <= low + near && slope > 0) || (x[k] >= high - near && slope < 0))) return;
    memset(out, 0, (size_t)s->rows * sizeof *out);
    out[s->fit->readings + k] = wall;
}

// Callback of MINPACK's lmder. lmder requests the residuals by `what` = 1, and the Jacobian by `what` = 2.
static int minpack_asks(void *p, int rows, int count, const double *x, double *residual, double *jacobian, int stride,
                        int what)
{
    search *s = p;
    (void)count;
    if (what == 1) {
        if (residuals_at(s, x, residual)) return 0;
        // the model has no solution at x; large residuals make MINPACK step back
        for (int i = 0; i < rows; i++) residual[i] = 1e10;
        return 0;
    }
    if (what == 2) {
        bool made[KN_FIT_UNKNOWNS];
        make_columns(s, x, residual, false, jacobian, stride, made);
        for (int k = 0; k < s->count; k++)
            if (made[k]) stay_inside(s, x, residual, k, jacobian + (size_t)stride * (size_t)k);
    }
    return 0;
}

// List the free unknowns, allocate the residuals, and compute the residuals at the present values of the unknowns.
// Return false if memory runs out or if the model has no solution at these values. The caller frees s->residual in any
// case.
static bool search_open(search *s, kn_fit *fit)
{
    *s = (search){.fit = fit};
    for (int i = 0; i < fit->unknowns; i++) {
        if (fit->unknown[i].fixed) continue;
        s->x[s->count] = inwards(&fit->unknown[i]);
        s->number[s->count++] = i;
    }
    s->rows = fit->readings + s->count;
    const size_t n = (size_t)s->count, m = (size_t)s->rows;
    s->residual = calloc(m * (n + 2) + 1, sizeof *s->residual);
    if (!s->residual) return false;
    s->jacobian = s->residual + m;
    s->spare = s->jacobian + m * n;
    return residuals_at(s, s->x, s->residual);
}

// Search for the minimum nearest to the present values of the unknowns. Set the unknowns to the values at the minimum
// and return the sum of squares there. Return INFINITY if there is no solution. The search ends when a step lowers the sum
// by less than the share `enough`.
static double descend_to(kn_fit *fit, double enough)
{
    search s;
    int ipvt[KN_FIT_UNKNOWNS], nfev, njev;
    double small[5][KN_FIT_UNKNOWNS], value[KN_FIT_UNKNOWNS], sum = INFINITY;
    if (search_open(&s, fit)) {
        // scale 1 for every unknown, since the search's variables are logarithms
        for (int k = 0; k < s.count; k++) small[0][k] = 1;
        if (s.count > 0)
            lmder(minpack_asks, &s, s.rows, s.count, s.x, s.residual, s.jacobian, s.rows, enough,
                  fit->coarse ? 1e-3 : 1e-8, 1e-12, fit->coarse ? 40 : 200, small[0], 2, fit->coarse ? 0.05 : 1, 0,
                  &nfev, &njev, ipvt, small[1], small[2], small[3], small[4], s.spare);
        // Put the result within the bounds, note which bounds were reached, and compute the sum of squares there.
        values_at(&s, s.x, value);
        for (int i = 0; i < fit->unknowns; i++) fit->unknown[i].value = value[i];
        for (int k = 0; k < s.count; k++) {
            kn_fit_unknown *u = &fit->unknown[s.number[k]];
            u->at_bound = s.x[k] <= lowest(u) + 1e-6 || s.x[k] >= highest(u) - 1e-6;
            s.x[k] = inwards(u);
        }
        sum = residuals_at(&s, s.x, s.residual) ? kn_fit_squares(s.residual, fit->readings) : INFINITY;
    }
    free(s.residual);
    return sum;
}

static double descend(kn_fit *fit) { return descend_to(fit, fit->coarse ? 1e-4 : 1e-10); }

// Invert a symmetric matrix in place by its Cholesky factor. Return false if the matrix is not positive definite. A
// pivot below 1e-12 of its diagonal element counts as 0, since rounding errors are that large.
static bool invert(int n, double a[KN_FIT_UNKNOWNS][KN_FIT_UNKNOWNS])
{
    double l[KN_FIT_UNKNOWNS][KN_FIT_UNKNOWNS] = {0}, inverse[KN_FIT_UNKNOWNS][KN_FIT_UNKNOWNS] = {0};
    for (int i = 0; i < n; i++)
        for (int j = 0; j <= i; j++) {
            double sum = a[i][j];
            for (int k = 0; k < j; k++) sum -= l[i][k] * l[j][k];
            if (i == j && !(sum > 1e-12 * a[i][i])) return false;
            l[i][j] = i == j ? sqrt(sum) : sum / l[j][j];
        }
    for (int c = 0; c < n; c++) // columns of L^-1
        for (int i = c; i < n; i++) {
            double sum = i == c;
            for (int k = c; k < i; k++) sum -= l[i][k] * inverse[k][c];
            inverse[i][c] = sum / l[i][i];
        }
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            a[i][j] = 0;
            for (int k = i > j ? i : j; k < n; k++) a[i][j] += inverse[k][i] * inverse[k][j];
        }
    return true;
}

// Compute the covariance C at the best values. An unknown that does not change the residuals is left out and gets an
// infinite variance.
static bool curve(kn_fit *fit)
{
    search s;
    double normal[KN_FIT_UNKNOWNS][KN_FIT_UNKNOWNS];
    int seen[KN_FIT_UNKNOWNS], count = 0;
    memset(fit->covariance, 0, sizeof fit->covariance);
    if (fit->jacobian) memset(fit->jacobian, 0, (size_t)fit->unknowns * (size_t)fit->readings * sizeof *fit->jacobian);
    const bool ok = search_open(&s, fit);
    const size_t rows = (size_t)s.rows;
    // Collect the columns of the unknowns that change the residuals.
    bool made[KN_FIT_UNKNOWNS];
    if (ok) make_columns(&s, s.x, s.residual, true, s.jacobian, s.rows, made);
    for (int k = 0; ok && k < s.count; k++) {
        const double *from = s.jacobian + rows * (size_t)k;
        const bool moves = made[k] && kn_fit_squares(from, fit->readings) > 0;
        if (moves && fit->jacobian)
            memcpy(fit->jacobian + (size_t)s.number[k] * (size_t)fit->readings, from,
                   (size_t)fit->readings * sizeof *from);
        if (moves) memmove(s.jacobian + rows * (size_t)count, from, rows * sizeof *from), seen[count++] = k;
        else fit->covariance[s.number[k]][s.number[k]] = INFINITY;
    }
    // Form J'J of these columns (J: the Jacobian) and invert it.
    for (int a = 0; a < count; a++)
        for (int b = 0; b < count; b++) {
            const double *at = s.jacobian + rows * (size_t)a, *bt = s.jacobian + rows * (size_t)b;
            normal[a][b] = 0;
            for (int i = 0; i < fit->readings; i++) normal[a][b] += at[i] * bt[i];
        }
    bool lost = ok && !invert(count, normal);
    fit->singular = lost || count < s.count;
    for (int a = 0; ok && a < count; a++)
        for (int b = 0; b < count; b++)
            fit->covariance[s.number[seen[a]]][s.number[seen[b]]] = lost ? a == b ? (double)INFINITY : 0 : normal[a][b];
    free(s.residual);
    return ok;
}

// Set the results of a search: sum of squares, degrees of freedom, scale and covariance.
static bool finish(kn_fit *fit, double sum)
{
    int count = 0;
    for (int i = 0; i < fit->unknowns; i++) count += !fit->unknown[i].fixed;
    fit->sum = sum;
    fit->freedom = fit->readings - count;
    fit->scale = fit->freedom > 0 ? sqrt(sum / fit->freedom) : (double)INFINITY;
    return isfinite(sum) && curve(fit);
}

bool kn_fit_run(kn_fit *fit) { return finish(fit, descend(fit)); }

bool kn_fit_search(kn_fit *fit) { return isfinite(fit->sum = descend_to(fit, 1e-2)); }

double kn_fit_inwards(const kn_fit_unknown *u, double value) { return u->linear ? value : log(value); }

double kn_fit_squares(const double *residual, int count)
{
    double sum = 0;
    for (int i = 0; i < count; i++) sum += residual[i] * residual[i];
    return sum;
}

void kn_fit_values(const kn_fit *fit, double value[KN_FIT_UNKNOWNS])
{
    for (int i = 0; i < fit->unknowns; i++) value[i] = fit->unknown[i].value;
}

bool kn_fit_run_from(kn_fit *fit, int starts, const double (*start)[KN_FIT_UNKNOWNS])
{
    kn_fit_unknown best[KN_FIT_UNKNOWNS];
    double least = INFINITY;
    for (int k = 0; k < starts; k++) {
        for (int i = 0; i < fit->unknowns; i++)
            fit->unknown[i].value = fmin(fmax(start[k][i], fit->unknown[i].low), fit->unknown[i].high);
        double sum = descend(fit);
        if (!(sum < least)) continue;
        least = sum;
        memcpy(best, fit->unknown, sizeof best);
    }
    if (isfinite(least)) memcpy(fit->unknown, best, sizeof best);
    return finish(fit, least);
}

double kn_fit_sum(const kn_fit *fit, const double value[KN_FIT_UNKNOWNS])
{
    double *residual = malloc((size_t)fit->readings * sizeof *residual);
    bool ok = residual && fit->misfit(fit->of, value, residual);
    double sum = ok ? kn_fit_squares(residual, fit->readings) : (double)NAN;
    free(residual);
    return sum;
}

// ---- intervals of the unknowns

double kn_fit_held(const kn_fit *fit, int unknown, double value)
{
    kn_fit other = *fit;
    other.unknown[unknown].value = value;
    other.unknown[unknown].fixed = true;
    double sum = descend(&other);
    return isfinite(sum) ? sum : NAN;
}

// The search for one end of a profile interval of one unknown. At each value of this unknown, the other unknowns are
// fitted. Each of these fits starts from the fit at the nearest value inside the interval. A start from outside might
// lie where the residuals have no gradient, and the search would stay there.
typedef struct side {
    kn_fit fit; // copy of the fit in which the unknown is fixed; fit.sum and fit.scale stay those of the best fit
    int unknown;
    // best: best value of the unknown, as a logarithm unless the unknown is linear; t: rise of the sum of squares S at
    // the end of the interval, in standard deviations
    double best, t;
    double within[KN_FIT_UNKNOWNS]; // values of all unknowns in the outermost fit that is still inside the interval
} side;

// Set the unknown to the value `in`. Return the rise of the sum of squares S in standard deviations. `in` is a
// logarithm unless the unknown is linear.
static double risen(side *p, double in)
{
    kn_fit_unknown *u = &p->fit.unknown[p->unknown];
    for (int i = 0; i < p->fit.unknowns; i++) p->fit.unknown[i].value = p->within[i];
    u->value = u->linear ? in : fmin(fmax(exp(in), u->low), u->high);
    const double sum = descend(&p->fit),
                 z = isfinite(sum) ? sqrt(fmax(sum - p->fit.sum, 0) / (p->fit.scale * p->fit.scale)) : (double)INFINITY;
    if (z < p->t) kn_fit_values(&p->fit, p->within);
    return z;
}

// Find the value at which the rise of the sum of squares reaches t. The value lies between `a`, inside the interval,
// and `b`, outside. The method is the Illinois variant of regula falsi.
static double reach(side *p, double a, double za, double b, double zb)
{
    const double t = p->t;
    double fa = za - t, fb = fmin(zb, 4 * t) - t;
    for (int i = 0; i < 40 && fabs(b - a) > 1e-3 * fabs(b - p->best); i++) {
        double c = b - fb * (b - a) / (fb - fa), fc = fmin(risen(p, c), 4 * t) - t;
        if (fabs(fc) < 4e-3 * t) return c;
        if ((fc > 0) != (fb > 0)) {
            a = b;
            fa = fb;
        } else fa /= 2;
        b = c;
        fb = fc;
    }
    return b;
}

// Step from the best value towards one bound, with doubling steps, until the rise of the sum of squares reaches t. Set
// *open if the rise does not reach t before the bound.
static double walk(const kn_fit *fit, int unknown, double t, double toward, bool *open)
{
    const kn_fit_unknown *u = &fit->unknown[unknown];
    side p = {.fit = *fit, .unknown = unknown, .t = t};
    double from = p.best = inwards(u), end = toward > 0 ? highest(u) : lowest(u), z = 0;
    // The first step is half the width of the interval by curvature, if the curvature is known.
    double guess = t * fit->scale * sqrt(fit->covariance[unknown][unknown]), span = u->linear ? u->high - u->low : 1;
    double step = isfinite(guess) && guess > 1e-9 * span ? fmin(guess, span / 2) : 0.02 * span;
    kn_fit_values(fit, p.within);
    p.fit.unknown[unknown].fixed = true;
    *open = false;
    while (toward * (end - from) > 0) {
        double next = toward * (end - from) < step ? end : from + toward * step, risen_to = risen(&p, next);
        if (risen_to >= t) return reach(&p, from, z, next, risen_to);
        from = next;
        z = risen_to;
        step *= 2;
    }
    *open = true;
    return end;
}

// Return the interval by curvature. Its ends are values of the search's variable (a logarithm unless the unknown is
// linear), limited to the bounds.
static kn_fit_interval by_curvature(const kn_fit *fit, int unknown, double t)
{
    const kn_fit_unknown *u = &fit->unknown[unknown];
    double half = t * fit->scale * sqrt(fit->covariance[unknown][unknown]), x = inwards(u);
    kn_fit_interval out = {.how = KN_FIT_CURVATURE, .low = x - half, .high = x + half};
    out.open_low = !(out.low >= lowest(u));
    out.open_high = !(out.high <= highest(u));
    out.low = out.open_low ? lowest(u) : out.low;
    out.high = out.open_high ? highest(u) : out.high;
    return out;
}

kn_fit_interval kn_fit_interval_by(const kn_fit *fit, int unknown, double confidence, kn_fit_how how)
{
    const kn_fit_unknown *u = &fit->unknown[unknown];
    if (u->fixed || fit->freedom < 1)
        return (kn_fit_interval){.low = u->low, .high = u->high, .open_low = true, .open_high = true};
    double t = kn_fit_student(confidence, fit->freedom);
    kn_fit_interval out = by_curvature(fit, unknown, t);
    if (how == KN_FIT_PROFILE && fit->scale > 0) {
        out.how = KN_FIT_PROFILE;
        out.low = walk(fit, unknown, t, -1, &out.open_low);
        out.high = walk(fit, unknown, t, 1, &out.open_high);
    }
    if (!u->linear) out.low = out.open_low ? u->low : exp(out.low);
    if (!u->linear) out.high = out.open_high ? u->high : exp(out.high);
    return out;
}

kn_fit_interval kn_fit_interval_of(const kn_fit *fit, int unknown, double confidence)
{
    const kn_fit_unknown *u = &fit->unknown[unknown];
    kn_fit_interval out = kn_fit_interval_by(fit, unknown, confidence, KN_FIT_CURVATURE);
    double half = (out.high - out.low) / 2;
    bool near = !out.open_low && !out.open_high && half <= 0.05 * fabs(u->value);
    return near || u->fixed ? out : kn_fit_interval_by(fit, unknown, confidence, KN_FIT_PROFILE);
}

// ---- a straight line through readings

double kn_line_slope(int count, const double *t, const double *x, const double *weight, double *mean_t, double *mean_x)
{
    double n = 0, tt = 0, tx = 0;
    *mean_t = *mean_x = 0;
    for (int i = 0; i < count; i++) n += weight ? weight[i] : 1;
    for (int i = 0; i < count; i++) {
        const double w = weight ? weight[i] : 1;
        *mean_t += w * t[i] / n;
        *mean_x += w * x[i] / n;
    }
    for (int i = 0; i < count; i++) {
        const double w = weight ? weight[i] : 1;
        tt += w * (t[i] - *mean_t) * (t[i] - *mean_t);
        tx += w * (t[i] - *mean_t) * (x[i] - *mean_x);
    }
    return tt > 0 ? tx / tt : 0;
}

// ---- quality of a fit

double kn_fit_runs(int readings, const double *residual)
{
    int up = 0, down = 0, runs = 0, before = 0;
    for (int i = 0; i < readings; i++) {
        int sign = (residual[i] > 0) - (residual[i] < 0);
        if (sign == 0) continue;
        runs += sign != before;
        before = sign;
        up += sign > 0;
        down += sign < 0;
    }
    double n = up + down, both = 2.0 * up * down;
    if (n < 20) return NAN;
    if (up == 0 || down == 0) return sqrt(n);
    double expected = both / n + 1, variance = both * (both - n) / (n * n * (n - 1));
    return (expected - runs) / sqrt(variance);
}

double kn_fit_aicc(int readings, int unknowns, double sum)
{
    // the scale of the residuals counts as one more unknown, besides the unknowns of the model
    double n = readings, p = unknowns + 1;
    if (n - p - 1 <= 0) return INFINITY;
    return n * log(sum / n) + 2 * p + 2 * p * (p + 1) / (n - p - 1);
}

// Return the quantile of the normal distribution, by Newton's method on the error function erf.
static double normal_quantile(double confidence)
{
    double z = 2;
    for (int i = 0; i < 50; i++) z -= (erf(z / sqrt(2.0)) - confidence) / (sqrt(2 / acos(-1.0)) * exp(-z * z / 2));
    return z;
}

// Return the probability between -t and t in Student's distribution, by Simpson's rule.
static double student_share(double t, double nu)
{
    enum { PARTS = 400 };
    double c = exp(lgamma((nu + 1) / 2) - lgamma(nu / 2)) / sqrt(nu * acos(-1.0)), sum = 0, h = t / PARTS;
    for (int i = 0; i <= PARTS; i++)
        sum += (i == 0 || i == PARTS ? 1 : i % 2 ? 4 : 2) * pow(1 + (i * h) * (i * h) / nu, -(nu + 1) / 2);
    return 2 * c * sum * h / 3;
}

double kn_fit_student(double confidence, double freedom)
{
    double z = normal_quantile(confidence);
    if (freedom > 1e4) return z;
    // Enclose the quantile between `low` and `high`, then bisect.
    double low = z, high = z;
    while (student_share(high, freedom) < confidence) high *= 2;
    for (int i = 0; i < 60; i++) {
        double middle = (low + high) / 2;
        *(student_share(middle, freedom) < confidence ? &low : &high) = middle;
    }
    return high;
}
