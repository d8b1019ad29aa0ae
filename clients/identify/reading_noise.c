// What the noise of readings leaves sure: their noise, and the moment from which a strain rises.
#include "clients/identify/measured_curve_parts.h"
#include "core/algebra/algebra.h"
#include <math.h>
#include <stdlib.h>

// ---- noise of the readings

// largest number of triples of neighbouring readings from which the noise is estimated; so many triples suffice for a
// file of ten million readings, and are sorted quickly
enum { SAMPLES = 100000 };

// Return the smallest difference between two unequal neighbouring readings, which is one step of the gauge.
static double gauge(int count, const double *value)
{
    double least = INFINITY;
    for (int i = 1; i < count; i++)
        if (value[i] != value[i - 1]) least = fmin(least, fabs(value[i] - value[i - 1]));
    return isfinite(least) ? least : 0;
}

static double share(const double *weight, int i) { return weight ? 1 / weight[i] : 1; }

// Return the distance of the middle value from the line through its two neighbours, scaled to the noise of one reading.
// If each value has independent noise of variance 1, the distance has the variance 1 + a^2 + b^2, where a and b are the
// shares of the neighbours in the line. The distance is divided by the root of this variance.
static double bend(const double *t, const double *y, const double *weight)
{
    const double span = t[2] - t[0];
    if (!(span > 0)) return NAN;
    const double b = (t[1] - t[0]) / span, a = 1 - b;
    return fabs(y[1] - a * y[0] - b * y[2]) /
           sqrt(share(weight, 1) + a * a * share(weight, 0) + b * b * share(weight, 2));
}

// Return the noise as kn_curve_noise does. Each value is the mean of one or more
// readings. `weight`: number of readings in each mean; NULL: one.
static double noise_of(int count, const double *time_s, const double *value, const double *weight)
{
    // median of |x| if x is normally distributed with standard deviation 1
    static const double median_of_normal = 0.674489750196082;
    const double floor = 1e-6 * kn_largest_magnitude(count, value);
    const int step = count / SAMPLES + 1;
    double *sizes = malloc((size_t)(count > 2 ? count / step + 1 : 1) * sizeof *sizes), noise = 0;
    int n = 0, same = 0, pairs = 0;
    for (int i = 0; sizes && i + 2 < count; i += step) {
        const double size = bend(time_s + i, value + i, weight ? weight + i : NULL);
        same += value[i] == value[i + 1];
        pairs++;
        if (isfinite(size)) sizes[n++] = size;
    }
    // Under a coarse gauge, neighbouring readings are often equal. The noise is then the standard deviation of rounding
    // to the steps of the gauge.
    if (2 * same > pairs) {
        noise = gauge(count, value) / sqrt(12);
    } else if (n > 0) {
        qsort(sizes, (size_t)n, sizeof *sizes, kn_ascending);
        noise = 0.5 * (sizes[(n - 1) / 2] + sizes[n / 2]) / median_of_normal;
    }
    free(sizes);
    return fmax(noise, floor > 0 ? floor : 1e-300);
}

double kn_curve_noise(int count, const double *time_s, const double *value)
{
    return noise_of(count, time_s, value, NULL);
}

// Return the noise of a sweep: the root mean square of the noise of ln G' and the noise of ln G''.
static double noise_of_sweep(const kn_curve *c)
{
    double *log_hz = malloc(3 * (size_t)c->count * sizeof *log_hz);
    if (!log_hz) return 1e-6;
    double *storage = log_hz + c->count, *loss = storage + c->count;
    for (int i = 0; i < c->count; i++) {
        log_hz[i] = log(c->time_s[i]);
        storage[i] = log(c->value[i]);
        loss[i] = log(c->other[i]);
    }
    const double first = noise_of(c->count, log_hz, storage, c->weight),
                 second = noise_of(c->count, log_hz, loss, c->weight);
    free(log_hz);
    return hypot(first, second) / sqrt(2);
}

void kn_curve_take_noise(kn_curve *c)
{
    c->noise = c->kind == KN_CURVE_SWEEP ? noise_of_sweep(c) : noise_of(c->count, c->time_s, c->value, c->weight);
}

// ---- the onset of the strain

// a difference counts as certain if it exceeds this many standard deviations of the noise
static const double sure = 4;
// least number of readings through which a line is fitted; a line through two readings leaves no residual, so a stray
// reading would not show
enum { LEAST = 3 };

typedef struct level {
    double strain, variance;
} level;

// Return the initial level of the strain. If the first readings agree within the noise, the level is their mean;
// otherwise it is 0.
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

// Find the time at which the line through n readings meets the initial level, and the standard deviation of this time.
// Return false if the noise hides the slope of the line.
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
    // Use the larger of two variances: that of the known noise, and that of the residuals of the line.
    const double variance = fmax(noise * noise, left);
    if (!(slope > sure * sqrt(variance / tt))) return false;
    *at_s = time - (strain - from.strain) / slope;
    *error_s = sqrt(variance * (1.0 / n + pow(*at_s - time, 2) / tt) + from.variance) / slope;
    return true;
}

double kn_strain_onset(int count, const double *t, const double *x, double noise, double *least_s)
{
    const level from = level_of(count, x, noise);
    double most = 0, best_s = -INFINITY, at_s, error_s;
    int begin = 0;
    *least_s = -INFINITY;
    for (int i = 0; i < count; i++) most = fmax(most, x[i] - from.strain);
    // The first strain is clearly below the initial level, so the gauge was not set to 0 and no onset can be found.
    if (count < LEAST || x[0] - from.strain < -sure * noise) return best_s;
    // Skip the readings that are still at the initial level. Then fit lines through 3, 6, 12, ... readings, up to half
    // of the largest strain. Each line gives the time at which it meets the level, and a lower limit four standard
    // deviations earlier. Keep the line with the latest lower limit.
    while (begin < count && x[begin] - from.strain <= fmax(sure * noise, 1e-3 * most)) begin++;
    for (int n = LEAST; begin + n <= count && x[begin + n - 1] - from.strain < 0.5 * most; n *= 2) {
        if (!meets(n, t + begin, x + begin, from, noise, &at_s, &error_s) || at_s - sure * error_s <= *least_s)
            continue;
        *least_s = at_s - sure * error_s;
        best_s = at_s;
    }
    return best_s;
}

double kn_slope_jump(const kn_curve *c, int begin, int end, double early_s, double late_s, double noise)
{
    const double *t = c->time_s + begin, *x = c->value + begin, middle = 0.5 * (early_s + late_s);
    if (begin < 2 || begin + 2 >= end || !isfinite(x[-1]) || !isfinite(x[-2]) || t[-1] != early_s) return middle;
    const double before = (x[-1] - x[-2]) / (t[-1] - t[-2]), next = (x[1] - x[0]) / (t[1] - t[0]);
    // extrapolate the slope to the moment of the change from the next two intervals, since the slope falls after the
    // change
    const double after = 2 * next - (x[2] - x[1]) / (t[2] - t[1]);
    const double jump = after - before, meet = t[0] - (x[0] - x[-1] - before * (t[0] - t[-1])) / jump;
    // Use the time at which both lines meet only if its noise is below a quarter of the time between the two readings.
    if (!(4 * noise < 0.25 * fabs(jump) * (late_s - early_s))) return middle;
    return fmin(fmax(meet, early_s), late_s);
}
