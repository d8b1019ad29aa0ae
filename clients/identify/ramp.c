#include "clients/identify/ramp.h"
#include "clients/identify/least_squares.h"
#include "core/order.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

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

// Return the strain of the two lines at time t.
static double follow(const kn_strain_ramp *r, double t)
{
    if (t <= r->start_s) return 0;
    return t >= r->end_s ? r->strain : r->strain * (t - r->start_s) / (r->end_s - r->start_s);
}

// Use the strain column itself up to the held strain, with at most as many readings as fit into step[].
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

bool kn_strain_ramp_of(kn_strain_ramp *r, const kn_curve *c, char *error, unsigned long error_size)
{
    *r = (kn_strain_ramp){.strain = c->other ? held(c) : NAN, .straight = true};
    snprintf(error, error_size, "has no column of strain that rises above 0 and is held");
    if (!(r->strain > 0)) return false;
    int low = 0, high = 0, end = 0;
    // The rise is fitted between 10 % and 90 % of the held strain: readings low..high-1. If the rise has fewer than
    // three readings, the line goes through the readings at its two ends.
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
    r->start_s = mean_s - mean / rate; // where the line reaches strain 0
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
