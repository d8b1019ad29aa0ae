#include "clients/shape/measurement.h"
#include "clients/identify/measured_curve.h"
#include "core/algebra/algebra.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double exact = 0.005; // assumed error of the computed force, as a share of the largest measured force
// LEAST: smallest number of readings that is accepted. AROUND: number of neighbours on either side with which a
// possible outlier is compared. MIDDLE: number of neighbours on either side in a median. DENSE: if a series has at
// least this many readings, a single high reading cannot be the true peak of a press.
enum { LEAST = 10, AROUND = 3, MIDDLE = 2, DENSE = 100 };

void kn_force_residual_free(kn_force_residual *p)
{
    free(p->time_s);
    free(p->force_n);
    free(p->span);
    memset(p, 0, sizeof *p);
}

// Assign the readings to spans of time, number the spans that hold readings, and compute the mean and sigma of each
// span.
static void fill_spans(kn_force_residual *p)
{
    const double first_s = p->time_s[0], all_s = p->time_s[p->count - 1] - first_s;
    int last = -1, readings[KN_FORCE_SPANS] = {0};
    for (int i = 0; i < p->count; i++) {
        const int span = (int)fmin(KN_FORCE_SPANS * sqrt((p->time_s[i] - first_s) / all_s), KN_FORCE_SPANS - 1);
        if (span != last) p->spans++;
        last = span;
        const int b = p->span[i] = p->spans - 1;
        readings[b]++;
        p->span_n[b] += p->force_n[i];
        p->span_s[b] += p->time_s[i];
    }
    for (int b = 0; b < p->spans; b++) {
        p->span_n[b] /= readings[b];
        p->span_s[b] /= readings[b];
        p->span_sigma_n[b] = hypot(p->noise_n / sqrt(readings[b]), exact * p->most_n);
    }
}

// Keep the readings from the start of the press to the end of the hold. Return false if a reading is not a number or
// the times do not rise.
static bool keep(kn_force_residual *p, const kn_press *press, char *error, size_t error_size)
{
    const int count = p->count;
    for (int i = 0; i < count; i++) {
        const bool sound = isfinite(p->time_s[i]) && isfinite(p->force_n[i]);
        if (sound && (i == 0 || p->time_s[i] >= p->time_s[i - 1])) continue;
        snprintf(error, error_size, "reading %d %s", i + 1,
                 sound ? "is earlier than the one before, expected times that rise" : "is no number");
        return false;
    }
    p->count = 0;
    for (int i = 0; i < count; i++) {
        if (p->time_s[i] < press->time_s[0] || p->time_s[i] > press->hold_end_s) continue;
        p->time_s[p->count] = p->time_s[i];
        p->force_n[p->count++] = p->force_n[i];
    }
    return true;
}

// Sort the readings around the reading of index `reading`: normally `reach` readings before it and `reach` after it.
// Near an end of the series the window is shifted inwards. If `itself` is false, leave out the reading of index
// `reading`. Return the number of sorted readings.
static int around(const kn_force_residual *p, int reading, int reach, bool itself, double sorted[2 * AROUND + 1])
{
    const int first = (int)fmin(fmax(reading - reach, 0), p->count - 1 - 2 * reach);
    int n = 0;
    for (int i = first; i <= first + 2 * reach; i++)
        if (itself || i != reading) sorted[n++] = p->force_n[i];
    qsort(sorted, (size_t)n, sizeof *sorted, kn_ascending);
    return n;
}

// Return whether a reading is an outlier. An outlier differs from the median of its six neighbours by more than a
// limit. The limit is the largest force (most_n) plus four times the spread of the neighbours. The spread ignores the
// highest and the lowest neighbour. If the series has fewer than DENSE readings, one reading may be the true peak of a
// press. For these series the limit is larger: 20 times the largest force plus four times the spread.
static bool is_outlier(const kn_force_residual *p, int reading)
{
    double sorted[2 * AROUND + 1];
    const int n = around(p, reading, AROUND, false, sorted);
    const double off_n = fabs(p->force_n[reading] - 0.5 * (sorted[n / 2 - 1] + sorted[n / 2]));
    return off_n > (p->count < DENSE ? 20 : 1) * p->most_n + 4 * (sorted[n - 2] - sorted[1]);
}

// Find the largest median of five readings (most_n), leave out the outliers and make compression positive. Return false
// if memory runs out.
static bool leave_out_outliers(kn_force_residual *p)
{
    double sum_n = 0, sorted[2 * AROUND + 1];
    int kept = 0;
    bool *outlier = calloc((size_t)p->count, sizeof *outlier);
    if (!outlier) return false;
    for (int i = 0; i < p->count; i++) {
        const int n = around(p, i, MIDDLE, true, sorted);
        p->most_n = fmax(p->most_n, fabs(sorted[n / 2]));
    }
    for (int i = 0; i < p->count; i++) outlier[i] = is_outlier(p, i);
    for (int i = 0; i < p->count; i++) {
        if (outlier[i] && p->outliers++ == 0) p->outlier_s = p->time_s[i], p->outlier_n = p->force_n[i];
        if (outlier[i]) continue;
        p->time_s[kept] = p->time_s[i];
        p->force_n[kept++] = p->force_n[i];
        sum_n += p->force_n[kept - 1];
    }
    free(outlier);
    p->count = kept;
    p->turned = sum_n < 0;
    for (int i = 0; i < p->count && p->turned; i++) p->force_n[i] = -p->force_n[i];
    return true;
}

// Check that there are enough readings, that not all forces are 0, and that few readings were outliers. If not, write
// an error to `error` and return false.
static bool are_enough(const kn_force_residual *p, const kn_press *press, char *error, size_t error_size)
{
    const bool many = p->count >= LEAST && p->time_s[p->count - 1] > p->time_s[0];
    if (many && p->most_n > 0 && p->outliers <= p->count / 20 + 2) return true;
    if (many && p->most_n > 0)
        snprintf(error, error_size,
                 "%d of %d readings are far from their neighbours, the first of them %.4g N at %.4g s, "
                 "expected a force that changes steadily",
                 p->outliers, p->outliers + p->count, p->outlier_n, p->outlier_s);
    else
        snprintf(error, error_size,
                 "%d readings between %.3g s, where the press begins, and %.3g s, the end of its hold, "
                 "expected %d or more%s",
                 p->count, press->time_s[0], press->hold_end_s, LEAST, many ? ", not all of them 0 N" : "");
    return false;
}

bool kn_force_residual_make(kn_force_residual *p, const kn_press *press, char *error, size_t error_size)
{
    bool memory = true, ok = keep(p, press, error, error_size);
    if (ok && p->count >= LEAST) memory = leave_out_outliers(p);
    ok = ok && memory && are_enough(p, press, error, error_size);
    if (ok) memory = (p->span = calloc((size_t)p->count, sizeof *p->span));
    if (!memory) snprintf(error, error_size, "out of memory");
    if (!ok || !memory) {
        kn_force_residual_free(p);
        return false;
    }
    p->noise_n = kn_curve_noise(p->count, p->time_s, p->force_n);
    fill_spans(p);
    return true;
}

void kn_force_residual_compare(const kn_force_residual *p, const kn_press *press, const kn_pressed *pressed,
                               double *residual, double *model_n)
{
    double sum_n[KN_FORCE_SPANS] = {0};
    int readings[KN_FORCE_SPANS] = {0};
    int64_t after = 1;
    // Interpolate the model's force at the time of each reading, and average these forces over each span.
    for (int i = 0; i < p->count; i++) {
        while (after + 1 < pressed->ticks && press->time_s[after] < p->time_s[i]) after++;
        const double from_s = press->time_s[after - 1], to_s = press->time_s[after];
        const double share = fmin(fmax((p->time_s[i] - from_s) / (to_s - from_s), 0), 1);
        sum_n[p->span[i]] += (1 - share) * pressed->force_n[after - 1] + share * pressed->force_n[after];
        readings[p->span[i]]++;
    }
    for (int b = 0; b < p->spans; b++) {
        const double mean_n = sum_n[b] / readings[b];
        residual[b] = (mean_n - p->span_n[b]) / p->span_sigma_n[b];
        if (model_n) model_n[b] = mean_n;
    }
}

// ---- all measurements of one press

void kn_measurement_close(kn_measurement *m)
{
    m->readings = m->has_force ? m->force.spans : 0;
    m->until_s = m->has_force ? m->press.hold_end_s : m->press.time_s[0];
    for (int i = 0; i < m->surfaces; i++) {
        m->readings += m->surface[i].readings;
        m->until_s = fmax(m->until_s, m->moment_s[i]);
    }
}

void kn_measurement_free(kn_measurement *m)
{
    kn_press_free(&m->press);
    for (int i = 0; i < m->surfaces; i++) kn_surface_residual_free(&m->surface[i]);
    if (m->has_force) kn_force_residual_free(&m->force);
    memset(m, 0, sizeof *m);
}

// Compute the residuals of the surfaces, without those of the force. Return a pointer past the last residual, or NULL
// if memory runs out.
static double *compare_surfaces(const kn_measurement *m, const kn_model_surface *model, const kn_pressed *pressed,
                                const double shift_m[2], double *residual, kn_surface_misfit *misfit)
{
    for (int i = 0; i < m->surfaces; residual += m->surface[i++].readings)
        if (!kn_surface_residual_compare(&m->surface[i], shift_m, model, (const float(*)[3])pressed->shape_m[i],
                                         residual, misfit ? &misfit[i] : NULL))
            return NULL;
    return residual;
}

// Improve the shift of the images by one Gauss-Newton step. To get the slopes, compute the residuals with the images
// shifted by one more pixel to either side. Return false if memory runs out.
static bool align(const kn_measurement *m, const kn_model_surface *model, const kn_pressed *pressed, double shift_m[2])
{
    const double h = m->surface[0].frame.pixel_m;
    double normal[2][2] = {{0}}, right[2] = {0};
    int n = m->readings;
    double *r = calloc(5 * (size_t)n, sizeof *r);
    bool ok = r && compare_surfaces(m, model, pressed, shift_m, r, NULL);
    for (int k = 0; k < 4 && ok; k++) {
        double there_m[2] = {shift_m[0], shift_m[1]};
        there_m[k / 2] += k % 2 ? h : -h;
        ok = compare_surfaces(m, model, pressed, there_m, r + (k + 1) * n, NULL);
    }
    for (int i = 0; ok && i < n; i++) {
        // Compute the slopes by central differences, and sum up the normal equations.
        const double slope[2] = {(r[2 * n + i] - r[n + i]) / (2 * h), (r[4 * n + i] - r[3 * n + i]) / (2 * h)};
        for (int a = 0; a < 2; a++) {
            right[a] -= slope[a] * r[i];
            for (int b = 0; b < 2; b++) normal[a][b] += slope[a] * slope[b];
        }
    }
    free(r);
    // Solve the normal equations. A step is limited to ten pixels.
    const double det = normal[0][0] * normal[1][1] - normal[0][1] * normal[1][0];
    if (!ok || !(det > 1e-12 * normal[0][0] * normal[1][1])) return ok;
    shift_m[0] += fmin(fmax((normal[1][1] * right[0] - normal[0][1] * right[1]) / det, -10 * h), 10 * h);
    shift_m[1] += fmin(fmax((normal[0][0] * right[1] - normal[1][0] * right[0]) / det, -10 * h), 10 * h);
    return true;
}

bool kn_measurement_compare(const kn_measurement *m, const kn_model_surface *model, const kn_pressed *pressed,
                            double shift_m[2], double *residual, kn_surface_misfit misfit[KN_PRESS_MOMENTS])
{
    enum { STEPS = 3 };
    for (int i = 0; i < STEPS && m->align; i++)
        if (!align(m, model, pressed, shift_m)) return false;
    double *end = compare_surfaces(m, model, pressed, shift_m, residual, misfit);
    if (end && m->has_force) kn_force_residual_compare(&m->force, &m->press, pressed, end, NULL);
    return end;
}

// Return the number of independent readings of one series, n (1 - c)/(1 + c). c is the correlation of
// successive residuals. A negative correlation counts as 0.
static double independent(int count, const double *r)
{
    double mean = 0, whole = 0, next = 0;
    for (int i = 0; i < count; i++) mean += r[i] / count;
    for (int i = 0; i < count; i++) whole += (r[i] - mean) * (r[i] - mean);
    for (int i = 0; i + 1 < count; i++) next += (r[i] - mean) * (r[i + 1] - mean);
    const double c = whole > 0 ? fmin(fmax(next / whole, 0), 0.99) : 0;
    return count * (1 - c) / (1 + c);
}

double kn_measurement_independent(const kn_measurement *m, const double *residual)
{
    double sum = 0;
    for (int i = 0; i < m->surfaces; i++) {
        const kn_surface_residual *r = &m->surface[i];
        if (r->points > 0) sum += independent(r->points, residual);
        else sum += independent(r->rays, residual) + independent(r->patches, residual + r->rays);
        residual += r->readings;
    }
    return sum + (m->has_force ? independent(m->force.spans, residual) : 0);
}
