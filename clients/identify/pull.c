#include "clients/identify/pull.h"
#include "clients/identify/curve.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double exact = 0.005; // of the largest force
enum { LEAST = 10 };

void kn_pull_free(kn_pull *p)
{
    free(p->time_s);
    free(p->force_n);
    free(p->bin);
    memset(p, 0, sizeof *p);
}

// Numbers the spans that hold readings, one after the other.
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

// Those of the press; the times rise. False: one is none.
static bool keep(kn_pull *p, const kn_press *press, int count, char *error, size_t error_size)
{
    double sum_n = 0;
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
        sum_n += p->force_n[i];
    }
    p->turned = sum_n < 0;
    for (int i = 0; i < p->count && p->turned; i++) p->force_n[i] = -p->force_n[i];
    return true;
}

bool kn_pull_make(kn_pull *p, const kn_press *press, int count, double *time_s, double *force_n, char *error,
                  size_t error_size)
{
    *p = (kn_pull){.time_s = time_s, .force_n = force_n};
    bool ok = keep(p, press, count, error, error_size);
    for (int i = 0; ok && i < p->count; i++) p->most_n = fmax(p->most_n, fabs(force_n[i]));
    if (ok && (p->count < LEAST || !(p->time_s[p->count - 1] > p->time_s[0]) || !(p->most_n > 0))) {
        snprintf(error, error_size,
                 "%d readings between %.3g s, where the press begins, and %.3g s, the end of its hold, "
                 "expected %d or more%s",
                 p->count, press->time_s[0], press->hold_end_s, LEAST,
                 p->count >= LEAST ? ", and a force in them" : "");
        ok = false;
    }
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
