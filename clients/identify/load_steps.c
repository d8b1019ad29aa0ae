#include "clients/identify/load_steps.h"
#include <math.h>

static const double near = 0.04,
                    zero = 0.02; // of the largest load: a load cell's noise is below, a weight's step above

static double largest(int count, const double *load)
{
    double most = 0;
    for (int i = 0; i < count; i++) most = fmax(most, fabs(load[i]));
    return most;
}

// From the first reading of a value on: past its last one, with its mean; single strangers within it are skipped.
static int plateau(int count, const double *load, int begin, double tolerance, double *mean)
{
    double sum = 0;
    int n = 0, i = begin;
    for (; i < count; i++) {
        const bool here = n == 0 || fabs(load[i] - sum / n) <= tolerance;
        if (!here && !(i + 1 < count && fabs(load[i + 1] - sum / n) <= tolerance)) break;
        if (here) sum += load[i], n++;
    }
    *mean = sum / n;
    return i;
}

static bool confirmed(int count, const double *load, int i, double tolerance)
{
    return i == 0 || i + 1 == count || fabs(load[i + 1] - load[i]) <= tolerance;
}

void kn_load_steps_find(kn_load_steps *s, kn_readings *r)
{
    const double most = largest(r->count, r->load), tolerance = near * most;
    *s = (kn_load_steps){0};
    for (int i = 0; i < r->count;) {
        if (!confirmed(r->count, r->load, i, tolerance)) {
            r->value[i++] = NAN;
            s->between++;
            continue;
        }
        if (s->count == KN_LOAD_STEPS) {
            s->count = 0;
            return;
        }
        kn_load_step *step = &s->step[s->count++];
        step->begin = i;
        step->end = i = plateau(r->count, r->load, i, tolerance, &step->load);
        for (int k = step->begin; k < step->end; k++) {
            if (fabs(r->load[k] - step->load) <= tolerance) continue;
            r->value[k] = NAN;
            s->between++;
        }
        step->late_s = r->time_s[step->begin];
        step->early_s = s->count > 1 ? r->time_s[step[-1].end - 1] : step->late_s;
        if (fabs(step->load) <= zero * most) step->load = 0;
        for (int k = step->begin; k < step->end; k++) r->load[k] = step->load;
    }
}

// In how many pieces, and the sum of squares about their means.
static int pieces(int count, const double *load, double *scatter)
{
    const double tolerance = near * largest(count, load);
    int n = 0;
    double mean;
    *scatter = 0;
    for (int i = 0, end; i < count; i = end, n++) {
        end = plateau(count, load, i, tolerance, &mean);
        for (int k = i; k < end; k++)
            if (fabs(load[k] - mean) <= tolerance) *scatter += (load[k] - mean) * (load[k] - mean);
    }
    return n;
}

bool kn_load_steps_flat(const kn_readings *r, const double *a, const double *b)
{
    double of_a, of_b;
    const int more = pieces(r->count, a, &of_a) - pieces(r->count, b, &of_b);
    return more < 0 || (more == 0 && of_a < 0.5 * of_b);
}
