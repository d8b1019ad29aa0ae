#include "clients/identify/onset.h"
#include <math.h>
#include <stdbool.h>

static const double sure = 4; // a difference of more than this many standard deviations of the noise counts as certain
// least number of readings in a fitted line; with three readings, residuals show a stray reading
enum { LEAST = 3 };

typedef struct level {
    double strain, variance;
} level;

// Return the initial level: the mean of the first readings if they are flat, else 0.
static level level_of(int count, const double *strain, double noise)
{
    double low = INFINITY, high = -INFINITY, sum = 0;
    for (int i = 0; i < LEAST && i < count; i++) {
        low = fmin(low, strain[i]);
        high = fmax(high, strain[i]);
        sum += strain[i];
    }
    if (count < LEAST || !(high - low <= sure * noise)) return (level){0, 0};
    return (level){sum / LEAST, noise * noise / LEAST};
}

// Find where the line through n readings meets the level, and the standard deviation of that moment. Return false if
// the noise hides the slope.
static bool meets(int n, const double *t, const double *x, level from, double noise, double *at_s, double *error_s)
{
    double time = 0, strain = 0, tt = 0, tx = 0, left = 0;
    for (int i = 0; i < n; i++) time += t[i] / n, strain += x[i] / n;
    for (int i = 0; i < n; i++) {
        tt += (t[i] - time) * (t[i] - time);
        tx += (t[i] - time) * (x[i] - strain);
    }
    const double slope = tx / tt;
    for (int i = 0; i < n; i++) left += pow(x[i] - strain - slope * (t[i] - time), 2) / (n - 2);
    // Use the larger of two variances: that of the known noise and that of the residuals of the line.
    const double variance = fmax(noise * noise, left);
    if (!(slope > sure * sqrt(variance / tt))) return false;
    *at_s = time - (strain - from.strain) / slope;
    *error_s = sqrt(variance * (1.0 / n + pow(*at_s - time, 2) / tt) + from.variance) / slope;
    return true;
}

double kn_onset(int count, const double *t, const double *x, double noise, double *least_s)
{
    const level from = level_of(count, x, noise);
    double most = 0, best_s = -INFINITY, at_s, error_s;
    int begin = 0;
    *least_s = -INFINITY;
    for (int i = 0; i < count; i++) most = fmax(most, x[i] - from.strain);
    // the first strain is clearly below the level, so the gauge was not set to 0
    if (count < LEAST || x[0] - from.strain < -sure * noise) return best_s;
    // Skip the readings that are still at the level. Then try lines of 3, 6, 12, ... readings up to half of the strain.
    // Keep the line whose lower limit of the time (the meeting time minus four standard deviations) is the latest.
    while (begin < count && x[begin] - from.strain <= fmax(sure * noise, 1e-3 * most)) begin++;
    for (int n = LEAST; begin + n <= count && x[begin + n - 1] - from.strain < 0.5 * most; n *= 2) {
        if (!meets(n, t + begin, x + begin, from, noise, &at_s, &error_s) || at_s - sure * error_s <= *least_s)
            continue;
        *least_s = at_s - sure * error_s;
        best_s = at_s;
    }
    return best_s;
}
