// The readings of relaxation curves in the form that a fit needs: the rise of the strain, means over time, and checks.
#include "clients/identify/least_squares.h"
#include "clients/identify/relaxation_fit.h"
#include "core/algebra/algebra.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { RISE_LEAST = 5 };
#define FALLS 0.98
// In a rise, stresses below this share of the largest stress are left out, since their logarithms are mostly noise.
#define LEAST_RISE 0.05

// ---- the rise of the strain

// Return the held strain: the median of the strain in the later half of the time. Return NAN if memory runs out.
static double held(const kn_curve *c)
{
    const double half = (c->time_s[0] + c->time_s[c->count - 1]) / 2;
    double *value = malloc((size_t)c->count * sizeof *value), median = NAN;
    int n = 0;
    for (int i = 0; value && i < c->count; i++)
        if (c->time_s[i] >= half) value[n++] = c->other[i];
    if (value) {
        qsort(value, (size_t)n, sizeof *value, kn_ascending);
        median = (value[(n - 1) / 2] + value[n / 2]) / 2;
    }
    free(value);
    return median;
}

// Return the strain at time t on the lines of the ramp: 0, then rising, then held.
static double follow(const kn_strain_ramp *r, double t)
{
    if (t <= r->start_s) return 0;
    return t >= r->end_s ? r->strain : r->strain * (t - r->start_s) / (r->end_s - r->start_s);
}

// Use the strain column itself instead of straight lines, up to the held strain. Thin it to as many readings as fit
// into step[].
static void take_column(kn_strain_ramp *r, const kn_curve *c, int end)
{
    const int most = KN_VOIGT_CHAIN_STEPS - 2;
    r->steps = 0;
    if (c->other[0] > 0) r->step[r->steps++] = (kn_voigt_chain_step){r->start_s, 0};
    for (int i = 0, before = -1; i < most; i++) {
        const int k = (int)((double)i * end / (most - 1));
        if (k == before || (r->steps && c->time_s[k] <= r->step[r->steps - 1].time_s)) continue;
        before = k;
        r->step[r->steps++] = (kn_voigt_chain_step){c->time_s[k], fmax(c->other[k], 0)};
    }
    r->end_s = r->step[r->steps - 1].time_s;
    r->step[r->steps - 1].value = r->strain;
}

bool kn_strain_ramp_of(kn_strain_ramp *r, const kn_curve *c)
{
    *r = (kn_strain_ramp){.strain = c->other ? held(c) : NAN, .straight = true};
    if (!(r->strain > 0)) return false;
    int low = 0, high = 0, end = 0;
    // Fit a line to the rise between 10 % and 90 % of the held strain: the readings from the index `low` on,
    // before the index `high`. If fewer than three readings are in this range, draw the line through the reading before
    // the range and the reading after it.
    while (high < c->count && c->other[high] < 0.9 * r->strain) high++;
    while (end < c->count - 1 && c->other[end] < 0.995 * r->strain) end++;
    for (low = high; low > 0 && c->other[low - 1] > 0.1 * r->strain; low--) continue;
    if (high == 0) { // the strain is held from the first reading on
        r->start_s = r->end_s = fmin(c->begin_s, c->time_s[0]);
        return true;
    }
    if (high == c->count) return false;
    const int first = high - low < 3 ? low - (low > 0) : low, last = high - low < 3 ? high : high - 1;
    double mean_s, mean;
    const double rate = kn_line_slope(last - first + 1, c->time_s + first, c->other + first, NULL, &mean_s, &mean);
    if (!(rate > 0)) return false;
    r->start_s = mean_s - mean / rate; // time at which the line has the strain 0
    r->end_s = r->start_s + r->strain / rate;
    r->steps = 2;
    r->step[0] = (kn_voigt_chain_step){r->start_s, 0};
    r->step[1] = (kn_voigt_chain_step){r->end_s, r->strain};
    for (int i = 0; i < c->count; i++)
        r->apart = fmax(r->apart, fabs(c->other[i] - follow(r, c->time_s[i])) / r->strain);
    const double noise = kn_curve_noise(c->count, c->time_s, c->other) / r->strain;
    r->straight = r->apart <= fmax(KN_STRAIN_RAMP_STRAIGHT, 5 * noise);
    if (!r->straight) take_column(r, c, end);
    return true;
}

// ---- means of readings over time

// Bins of time over which readings are averaged. In a rise the bins are equal spans of time, in a hold equal spans of
// ln(time).
typedef struct grid {
    const kn_strain_ramp *rise; // NULL: a hold
    double begin_s;             // in a hold: time at which t = 0 in ln(t)
    double corner_s;            // time at which the strain was reached; NAN: no corner
    double least;               // in a rise: values below this limit are left out
} grid;

// Return whether a reading is next to the corner between rise and hold. There the stress changes within one sampling
// period.
static bool beside_corner(const kn_curve *c, int i, double corner_s)
{
    const double before = i > 0 ? c->time_s[i - 1] : -INFINITY;
    const double after = i + 1 < c->count ? c->time_s[i + 1] : INFINITY;
    return before < corner_s && after > corner_s;
}

// Return the index of a reading's bin, or -INFINITY if the reading belongs to no bin.
static double bin_of(const grid *g, const kn_curve *c, int i)
{
    const double t = c->time_s[i] - g->begin_s;
    if (beside_corner(c, i, g->corner_s)) return -INFINITY;
    if (!g->rise) return t > 0 ? floor(KN_TIME_BINS_PER_DECADE * log10(t)) : -INFINITY;
    const double share = (c->time_s[i] - g->rise->start_s) / (g->rise->end_s - g->rise->start_s);
    if (!(share > 0 && share < 1) || c->value[i] < g->least) return -INFINITY;
    return floor(share * KN_RELAXATION_RISE_BINS);
}

// Turn the sums of the last bin into means. In a hold the value is a geometric mean. But readings near 0 have no useful
// logarithm, so the value is an arithmetic mean if the least value is at most half of the arithmetic mean.
static void close_bin(kn_time_bins *b, bool geometric, double ln_value, double least)
{
    const int k = b->count - 1;
    if (k < 0) return;
    b->time_s[k] /= b->weight[k];
    b->value[k] /= b->weight[k];
    if (geometric && least > 0.5 * b->value[k]) b->value[k] = exp(ln_value / b->weight[k]);
}

// Append the means of the readings in each bin of the grid.
static void average(kn_time_bins *b, const kn_curve *c, const grid *g)
{
    double last = -INFINITY, ln_value = 0, least = INFINITY;
    for (int i = 0; i < c->count; i++) {
        const double w = c->weight[i], bin = bin_of(g, c, i);
        if (bin == -INFINITY) continue;
        if (bin > last) {
            close_bin(b, !g->rise, ln_value, least);
            ln_value = 0;
            least = INFINITY;
            b->time_s[b->count] = b->value[b->count] = b->weight[b->count] = 0;
            b->line[b->count++] = c->line[i];
        }
        last = bin;
        b->time_s[b->count - 1] += w * (c->time_s[i] - g->begin_s);
        b->value[b->count - 1] += w * c->value[i];
        b->weight[b->count - 1] += w;
        ln_value += w * log(fmax(c->value[i], 1e-300));
        least = fmin(least, c->value[i]);
    }
    close_bin(b, !g->rise, ln_value, least);
}

static bool allocate(kn_time_bins *b, int readings)
{
    const size_t n = (size_t)readings + 1;
    *b = (kn_time_bins){.time_s = calloc(3 * n, sizeof *b->time_s), .line = calloc(n, sizeof *b->line)};
    if (!b->time_s || !b->line) return kn_time_bins_free(b), false;
    b->value = b->time_s + n;
    b->weight = b->value + n;
    return true;
}

bool kn_time_bins_make(kn_time_bins *b, const kn_curve *c, double begin_s)
{
    if (!allocate(b, c->count)) return false;
    average(b, c, &(grid){.begin_s = begin_s, .corner_s = NAN});
    return true;
}

void kn_time_bins_free(kn_time_bins *b)
{
    free(b->time_s);
    free(b->line);
    *b = (kn_time_bins){0};
}

// ---- preparing the curves for a fit

// Average the readings of the rise. Stresses near 0 are skipped, since they are mostly noise. A rise with fewer than
// RISE_LEAST means is dropped.
static void take_rise(kn_relaxation_curve *to)
{
    const kn_curve *c = to->curve;
    const double end_s = to->ramp.end_s;
    double most = 0;
    for (int i = 0; i < c->count; i++)
        if (!beside_corner(c, i, end_s)) most = fmax(most, c->value[i]);
    average(&to->rise, c, &(grid){&to->ramp, end_s, end_s, LEAST_RISE * most});
    to->rises = to->rise.count >= RISE_LEAST;
    if (!to->rises) to->rise.count = 0;
}

// Split one curve into a rise and a hold, and average the readings of each into means.
static bool take_curve(kn_relaxation_curve *to, const kn_curve *curve)
{
    kn_strain_ramp *ramp = &to->ramp;
    grid hold = {.begin_s = curve->begin_s, .corner_s = NAN};
    to->curve = curve;
    if (!kn_strain_ramp_of(ramp, curve)) *ramp = (kn_strain_ramp){.strain = curve->strain};
    if (!allocate(&to->rise, curve->count)) return false;
    if (ramp->end_s > ramp->start_s) {
        take_rise(to);
        hold.begin_s = hold.corner_s = ramp->end_s;
    }
    // Store the means of the hold after those of the rise, in the same arrays.
    const int n = to->rise.count;
    to->hold = (kn_time_bins){0, to->rise.time_s + n, to->rise.value + n, to->rise.weight + n, to->rise.line + n};
    average(&to->hold, curve, &hold);
    return true;
}

static bool take(kn_relaxation_fit *r, int curves, const kn_curve *curve, char *error, size_t size)
{
    bool moduli = false;
    r->scale = KN_RELAXATION_BOUND;
    for (int c = 0; c < curves; c++) {
        kn_relaxation_curve *to = &r->curve[r->curves++];
        snprintf(error, size, "out of memory");
        if (!take_curve(to, &curve[c])) return false;
        if (to->rises) r->scale = KN_RELAXATION_RISE;
        moduli |= !(to->ramp.strain > 0);
        const size_t count = (size_t)(to->rise.count + to->hold.count);
        to->fit_pa = calloc(2 * count + 1, sizeof *to->fit_pa);
        if (!to->fit_pa) return false;
        to->residual = to->fit_pa + count;
        r->readings += (int)count;
        snprintf(error, size, "%s: %d reading%s of the hold, expected 8 or more", curve[c].file, to->hold.count,
                 to->hold.count == 1 ? "" : "s");
        if (to->hold.count < 8) return false;
    }
    // If any curve lacks a strain, all values are moduli.
    if (moduli) r->scale = KN_RELAXATION_MODULUS;
    return true;
}

// Check that all files or no file have a strain, and that all stresses are positive, since their logarithms are fitted.
// If not, write an error to `error` and return false. With constant noise, only the first mean of a hold must be
// positive, since every model has a positive stress there.
static bool check(const kn_relaxation_fit *r, bool constant_noise, char *error, size_t size)
{
    for (int c = 0; c < r->curves; c++) {
        const kn_relaxation_curve *k = &r->curve[c];
        if (r->scale == KN_RELAXATION_MODULUS && k->ramp.strain > 0) {
            snprintf(error, size,
                     "%s: has a strain, but another file has none, expected one in all files or in none, or --strain",
                     k->curve->file);
            return false;
        }
        for (int i = 0; i < k->hold.count; i++) {
            if (k->hold.value[i] > 0 || (constant_noise && i > 0)) continue;
            snprintf(error, size, "%s:%d:1: a stress of %.4g Pa on average, expected one above 0%s", k->curve->file,
                     k->hold.line[i], k->hold.value[i], i > 0 ? ", or --noise constant" : "");
            return false;
        }
    }
    return true;
}

// Return the mean stress of the first or last quarter of a hold's bins.
static double quarter(const kn_time_bins *b, bool last)
{
    const int n = b->count / 4 > 0 ? b->count / 4 : 1, from = last ? b->count - n : 0;
    double sum = 0;
    for (int i = from; i < from + n; i++) sum += b->value[i] / n;
    return sum;
}

// Check that the stress of every hold falls. If not, write an error to `error` and return false. A stress that does not
// fall has no relaxation time, so the search would run to ever larger values.
static bool check_falls(const kn_relaxation_fit *r, char *error, size_t size)
{
    for (int c = 0; c < r->curves; c++) {
        const kn_time_bins *b = &r->curve[c].hold;
        const double before = quarter(b, false), after = quarter(b, true);
        if (after < FALLS * before) continue;
        snprintf(error, size,
                 "%s:%d:1: the stress does not fall while the strain is held, %.4g Pa at first and %.4g Pa at last, "
                 "expected a relaxation",
                 r->curve[c].curve->file, b->line[0], before, after);
        return false;
    }
    return true;
}

bool kn_relaxation_take(kn_relaxation_fit *r, int curves, const kn_curve *curve, bool constant_noise, char *error,
                        size_t error_size)
{
    return take(r, curves, curve, error, error_size) && check(r, constant_noise, error, error_size) &&
           check_falls(r, error, error_size);
}
