#include "clients/identify/load_steps.h"
#include <math.h>

// Limits as shares of the largest load: loads closer than `near` count as one load, loads below `zero` as no load. The
// noise of a load cell is below these limits, a change of load by a weight is above.
static const double near = 0.04, zero = 0.02;

static double largest(int count, const double *load)
{
    double most = 0;
    for (int i = 0; i < count; i++) most = fmax(most, fabs(load[i]));
    return most;
}

// Return the end of the plateau of the load that begins at the reading `begin`, and set *mean to the mean load of the
// plateau. Single readings off the plateau are skipped.
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

// Return whether the next reading confirms the load of reading i.
static bool confirmed(int count, const double *load, int i, double tolerance)
{
    return i == 0 || i + 1 == count || fabs(load[i + 1] - load[i]) <= tolerance;
}

void kn_load_steps_find(kn_load_steps *s, kn_readings *r)
{
    const double most = largest(r->count, r->load), tolerance = near * most;
    *s = (kn_load_steps){0};
    for (int i = 0; i < r->count;) {
        // A reading that the next one does not confirm belongs to no step.
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
        // Readings off the plateau belong to no step.
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

// Count the plateaus. Set *scatter to the sum of squared differences from their means.
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
