#include "clients/identify/bins.h"
#include <math.h>
#include <stdlib.h>

bool kn_bins_make(kn_bins *b, const kn_curve *c, double begin_s)
{
    const size_t n = (size_t)c->count + 1;
    *b = (kn_bins){.time_s = calloc(3 * n, sizeof *b->time_s), .line = calloc(n, sizeof *b->line)};
    if (!b->time_s || !b->line) return kn_bins_free(b), false;
    b->value = b->time_s + n;
    b->weight = b->value + n;
    double last = -INFINITY;
    for (int i = 0; i < c->count; i++) {
        const double t = c->time_s[i] - begin_s, w = c->weight[i], bin = floor(KN_BINS_PER_DECADE * log10(t));
        if (!(t > 0)) continue;
        if (bin > last) b->line[b->count++] = c->line[i];
        const int k = b->count - 1;
        b->time_s[k] += w * log(t);
        b->value[k] += w * c->value[i];
        b->weight[k] += w;
        last = bin;
    }
    for (int k = 0; k < b->count; k++) {
        b->time_s[k] = exp(b->time_s[k] / b->weight[k]);
        b->value[k] /= b->weight[k];
    }
    return true;
}

void kn_bins_free(kn_bins *b)
{
    free(b->time_s);
    free(b->line);
    *b = (kn_bins){0};
}
