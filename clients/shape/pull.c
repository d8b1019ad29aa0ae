#include "clients/shape/pull.h"
#include "clients/identify/curve.h"
#include "core/order.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double exact = 0.005; // possible error of the computed force, as a share of the largest measured force
// LEAST: least number of readings of the force. AROUND: number of neighbours on either side with which a possible stray
// is compared. MIDDLE: number of neighbours on either side in a median. DENSE: in a series of at least this many
// readings, a single high reading cannot be the true peak of a press.
enum { LEAST = 10, AROUND = 3, MIDDLE = 2, DENSE = 100 };

void kn_pull_free(kn_pull *p)
{
    free(p->time_s);
    free(p->force_n);
    free(p->bin);
    memset(p, 0, sizeof *p);
}

// Assign the readings to spans of time, number the spans that hold readings, and compute the mean and sigma of each
// span.
static void fill_bins(kn_pull *p)
{
    const double first_s = p->time_s[0], all_s = p->time_s[p->count - 1] - first_s;
    int last = -1, readings[KN_PULL_BINS] = {0};
    for (int i = 0; i < p->count; i++) {
        const int span = (int)fmin(KN_PULL_BINS * sqrt((p->time_s[i] - first_s) / all_s), KN_PULL_BINS - 1);
        if (span != last) p->bins++;
        last = span;
        const int b = p->bin[i] = p->bins - 1;
        readings[b]++;
        p->bin_n[b] += p->force_n[i];
        p->bin_s[b] += p->time_s[i];
    }
    for (int b = 0; b < p->bins; b++) {
        p->bin_n[b] /= readings[b];
        p->bin_s[b] /= readings[b];
        p->bin_sigma_n[b] = hypot(p->noise_n / sqrt(readings[b]), exact * p->most_n);
    }
}

// Keep the readings within the press. Return false if a reading is not a number or the times do not rise.
static bool keep(kn_pull *p, const kn_press *press, int count, char *error, size_t error_size)
{
    for (int i = 0; i < count; i++) {
        const bool sound = isfinite(p->time_s[i]) && isfinite(p->force_n[i]);
        if (!sound || (i > 0 && p->time_s[i] < p->time_s[i - 1])) {
            snprintf(error, error_size, "reading %d %s", i + 1,
                     sound ? "is earlier than the one before, expected times that rise" : "is no number");
            return false;
        }
    }
    for (int i = 0; i < count; i++) {
        if (p->time_s[i] < press->time_s[0] || p->time_s[i] > press->hold_end_s) continue;
        p->time_s[p->count] = p->time_s[i];
        p->force_n[p->count++] = p->force_n[i];
    }
    return true;
}

// Sort the readings up to `reach` on either side of a reading; near an end the window is shifted inwards. `itself`:
// whether the reading itself is included.
static int around(const kn_pull *p, int reading, int reach, bool itself, double sorted[2 * AROUND + 1])
{
    const int first = (int)fmin(fmax(reading - reach, 0), p->count - 1 - 2 * reach);
    int n = 0;
    for (int i = first; i <= first + 2 * reach; i++)
        if (itself || i != reading) sorted[n++] = p->force_n[i];
    qsort(sorted, (size_t)n, sizeof *sorted, kn_ascending);
    return n;
}

// Return whether a reading is a stray. A stray differs from the median of its six neighbours by more than the largest
// force plus four times their spread, which is taken without the highest and the lowest. In a short series one reading
// may be the true peak of a press, so a stray must differ by more than 20 times the largest force.
static bool is_stray(const kn_pull *p, int reading)
{
    double sorted[2 * AROUND + 1];
    const int n = around(p, reading, AROUND, false, sorted);
    const double off_n = fabs(p->force_n[reading] - 0.5 * (sorted[n / 2 - 1] + sorted[n / 2]));
    return off_n > (p->count < DENSE ? 20 : 1) * p->most_n + 4 * (sorted[n - 2] - sorted[1]);
}

// Find the largest force, leave out the strays and make compression positive. Return false if memory runs out.
static bool leave_out_strays(kn_pull *p)
{
    double sum_n = 0, sorted[2 * AROUND + 1];
    int kept = 0;
    bool *stray = calloc((size_t)p->count, sizeof *stray);
    if (!stray) return false;
    for (int i = 0; i < p->count; i++) {
        const int n = around(p, i, MIDDLE, true, sorted);
        p->most_n = fmax(p->most_n, fabs(sorted[n / 2]));
    }
    for (int i = 0; i < p->count; i++) stray[i] = is_stray(p, i);
    for (int i = 0; i < p->count; i++) {
        if (stray[i] && p->strays++ == 0) p->stray_s = p->time_s[i], p->stray_n = p->force_n[i];
        if (stray[i]) continue;
        p->time_s[kept] = p->time_s[i];
        p->force_n[kept++] = p->force_n[i];
        sum_n += p->force_n[kept - 1];
    }
    free(stray);
    p->count = kept;
    p->turned = sum_n < 0;
    for (int i = 0; i < p->count && p->turned; i++) p->force_n[i] = -p->force_n[i];
    return true;
}

// Check that there are enough readings, that some force is among them, and that few were left out.
static bool are_enough(const kn_pull *p, const kn_press *press, char *error, size_t error_size)
{
    const bool many = p->count >= LEAST && p->time_s[p->count - 1] > p->time_s[0];
    if (many && p->most_n > 0 && p->strays <= p->count / 20 + 2) return true;
    if (many && p->most_n > 0)
        snprintf(
            error, error_size,
            "%d of %d readings are far from their neighbours, the first of them %.4g N at %.4g s, expected a force "
            "that changes steadily",
            p->strays, p->strays + p->count, p->stray_n, p->stray_s);
    else
        snprintf(error, error_size,
                 "%d readings between %.3g s, where the press begins, and %.3g s, the end of its hold, "
                 "expected %d or more%s",
                 p->count, press->time_s[0], press->hold_end_s, LEAST, many ? ", and a force in them" : "");
    return false;
}

bool kn_pull_make(kn_pull *p, const kn_press *press, int count, double *time_s, double *force_n, char *error,
                  size_t error_size)
{
    *p = (kn_pull){.time_s = time_s, .force_n = force_n};
    bool ok = keep(p, press, count, error, error_size);
    if (ok && p->count >= LEAST && !leave_out_strays(p)) snprintf(error, error_size, "out of memory"), ok = false;
    ok = ok && are_enough(p, press, error, error_size);
    if (ok) p->bin = calloc((size_t)p->count, sizeof *p->bin);
    if (ok && !p->bin) snprintf(error, error_size, "out of memory"), ok = false;
    if (!ok) {
        kn_pull_free(p);
        return false;
    }
    p->noise_n = kn_curve_noise(p->count, p->time_s, p->force_n);
    fill_bins(p);
    return true;
}

void kn_pull_compare(const kn_pull *p, const kn_press *press, const kn_pressed *pressed, double *residual,
                     double *model_n)
{
    double sum_n[KN_PULL_BINS] = {0};
    int readings[KN_PULL_BINS] = {0};
    int64_t after = 1;
    // Interpolate the model's force at the time of each reading and average over the span.
    for (int i = 0; i < p->count; i++) {
        while (after + 1 < pressed->ticks && press->time_s[after] < p->time_s[i]) after++;
        const double from_s = press->time_s[after - 1], to_s = press->time_s[after];
        const double share = fmin(fmax((p->time_s[i] - from_s) / (to_s - from_s), 0), 1);
        sum_n[p->bin[i]] += (1 - share) * pressed->force_n[after - 1] + share * pressed->force_n[after];
        readings[p->bin[i]]++;
    }
    for (int b = 0; b < p->bins; b++) {
        const double mean_n = sum_n[b] / readings[b];
        residual[b] = (mean_n - p->bin_n[b]) / p->bin_sigma_n[b];
        if (model_n) model_n[b] = mean_n;
    }
}
