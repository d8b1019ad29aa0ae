#include "clients/identify/relaxation_readings.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { RISE_LEAST = 5 };
#define FALLS 0.98
// Readings of the rise below this share of the largest stress are left out, since their logarithms are mostly noise.
#define LEAST_RISE 0.05

// Return whether a reading is beside the corner between rise and hold, where the stress jumps within a sample.
static bool beside_corner(const kn_curve *c, int i, double end_s)
{
    const double before = i > 0 ? c->time_s[i - 1] : -INFINITY;
    const double after = i + 1 < c->count ? c->time_s[i + 1] : INFINITY;
    return before < end_s && after > end_s;
}

// Copy the readings, without those beside the corner, to a separate curve. The caller frees the returned block, which
// holds all its arrays.
static double *without_corner(const kn_curve *from, double end_s, kn_curve *to)
{
    double *room = calloc(4 * (size_t)from->count + 4, sizeof *room);
    *to = *from;
    to->count = 0;
    if (!room) return NULL;
    to->time_s = room;
    to->value = room + from->count;
    to->weight = to->value + from->count;
    to->line = (int *)(void *)(to->weight + from->count);
    for (int i = 0; i < from->count; i++) {
        if (beside_corner(from, i, end_s)) continue;
        to->time_s[to->count] = from->time_s[i];
        to->value[to->count] = from->value[i];
        to->weight[to->count] = from->weight[i];
        to->line[to->count++] = from->line[i];
    }
    return room;
}

// Average the rise over equal times. Stresses near 0 are skipped, since they are mostly noise.
static bool take_rise(kn_time_bins *b, const kn_curve *c, const kn_strain_ramp *ramp)
{
    double most = 0;
    *b = (kn_time_bins){.time_s = calloc(3 * KN_RELAXATION_RISE_BINS, sizeof *b->time_s),
                        .line = calloc(KN_RELAXATION_RISE_BINS, sizeof *b->line)};
    if (!b->time_s || !b->line) return false;
    b->value = b->time_s + KN_RELAXATION_RISE_BINS;
    b->weight = b->value + KN_RELAXATION_RISE_BINS;
    for (int i = 0; i < c->count; i++) most = fmax(most, c->value[i]);
    int last = -1;
    for (int i = 0; i < c->count; i++) {
        const double share = (c->time_s[i] - ramp->start_s) / (ramp->end_s - ramp->start_s), w = c->weight[i];
        if (!(share > 0 && share < 1) || c->value[i] < LEAST_RISE * most) continue;
        const int bin = (int)(share * KN_RELAXATION_RISE_BINS);
        if (bin > last) b->line[b->count++] = c->line[i];
        last = bin;
        b->time_s[b->count - 1] += w * (c->time_s[i] - ramp->end_s);
        b->value[b->count - 1] += w * c->value[i];
        b->weight[b->count - 1] += w;
    }
    for (int k = 0; k < b->count; k++) b->time_s[k] /= b->weight[k], b->value[k] /= b->weight[k];
    return true;
}

// Split one curve. A rise with too few means is dropped.
static bool take_curve(kn_relaxation_curve *to, const kn_curve *curve)
{
    char none[120];
    kn_curve clean;
    to->curve = curve;
    const bool known = kn_strain_ramp_of(&to->ramp, curve, none, sizeof none);
    if (!known) to->ramp.strain = curve->strain;
    to->rises = known && to->ramp.end_s > to->ramp.start_s;
    if (!to->rises) return kn_time_bins_make(&to->hold, curve, curve->begin_s);
    double *room = without_corner(curve, to->ramp.end_s, &clean);
    const bool ok =
        room && take_rise(&to->rise, &clean, &to->ramp) && kn_time_bins_make(&to->hold, &clean, to->ramp.end_s);
    free(room);
    to->rises = to->rise.count >= RISE_LEAST;
    if (!to->rises) to->rise.count = 0;
    return ok;
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

// Return whether all files or no file have a strain, and whether all stresses are positive, as their logarithms
// require. If not, write an error to `error`. With constant noise only the first mean of a hold must be positive, since
// the stress of every model is positive there.
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

// Return whether the stress of every hold falls; if not, write an error to `error`. A stress that does not fall has no
// relaxation time, so the search would run to ever larger values.
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
