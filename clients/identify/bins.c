#include "clients/identify/bins.h"
#include <math.h>
#include <stdlib.h>

// Sums over the readings of one bin.
typedef struct sums {
    double weight, time, value, ln_value, least;
} sums;

// Store the means of the current bin. The value is a geometric mean, or an arithmetic mean if the values of the bin
// differ too much.
static void close_bin(kn_time_bins *b, const sums *s)
{
    if (!(s->weight > 0)) return;
    const int k = b->count - 1;
    const double mean = s->value / s->weight;
    b->time_s[k] = s->time / s->weight;
    // Readings near 0 have no useful logarithm, so use the arithmetic mean for them.
    b->value[k] = s->least > 0.5 * mean ? exp(s->ln_value / s->weight) : mean;
    b->weight[k] = s->weight;
}

bool kn_time_bins_make(kn_time_bins *b, const kn_curve *c, double begin_s)
{
    const size_t n = (size_t)c->count + 1;
    *b = (kn_time_bins){.time_s = calloc(3 * n, sizeof *b->time_s), .line = calloc(n, sizeof *b->line)};
    if (!b->time_s || !b->line) return kn_time_bins_free(b), false;
    b->value = b->time_s + n;
    b->weight = b->value + n;
    sums s = {0};
    double last = -INFINITY;
    for (int i = 0; i < c->count; i++) {
        const double t = c->time_s[i] - begin_s, w = c->weight[i], bin = floor(KN_TIME_BINS_PER_DECADE * log10(t));
        if (!(t > 0)) continue;
        if (bin > last) {
            close_bin(b, &s);
            s = (sums){.least = INFINITY};
            b->line[b->count++] = c->line[i];
        }
        last = bin;
        s.weight += w;
        s.time += w * t;
        s.value += w * c->value[i];
        s.ln_value += w * log(fmax(c->value[i], 1e-300));
        s.least = fmin(s.least, c->value[i]);
    }
    close_bin(b, &s);
    return true;
}

void kn_time_bins_free(kn_time_bins *b)
{
    free(b->time_s);
    free(b->line);
    *b = (kn_time_bins){0};
}
