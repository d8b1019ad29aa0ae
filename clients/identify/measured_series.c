#include "clients/identify/measured_curve_parts.h"
#include "core/algebra/algebra.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { ARRAYS = 5 }; // number of arrays of doubles in a kn_curve

static double *array_of(const kn_curve *c, int i)
{
    return (double *[ARRAYS]){c->time_s, c->value, c->other, c->load, c->weight}[i];
}

static void move(kn_curve *c, int to, int from)
{
    for (int i = 0; i < ARRAYS; i++)
        if (array_of(c, i)) array_of(c, i)[to] = array_of(c, i)[from];
    c->line[to] = c->line[from];
}

int kn_curve_compact(kn_curve *c, int *first_line)
{
    int kept = 0;
    for (int i = 0; i < c->count; i++) {
        if (isfinite(c->time_s[i]) && isfinite(c->value[i]) && (!c->other || isfinite(c->other[i])) &&
            (!c->load || isfinite(c->load[i])))
            move(c, kept++, i);
        else if (kept == i) *first_line = c->line[i];
    }
    int out = c->count - kept;
    c->count = kept;
    return out;
}

void kn_curve_skip(kn_curve *c, int count)
{
    for (int i = count; i < c->count; i++) move(c, i - count, i);
    c->count -= count;
}

typedef struct place {
    double time_s;
    int index;
} place;

static int by_time(const void *a, const void *b)
{
    const place *p = a, *q = b;
    if (p->time_s != q->time_s) return p->time_s < q->time_s ? -1 : 1;
    return (p->index > q->index) - (p->index < q->index);
}

bool kn_curve_sort(kn_curve *c)
{
    place *order = malloc((size_t)c->count * sizeof *order + 1);
    double *room = malloc((size_t)c->count * sizeof *room + 1);
    const bool enough = order && room;
    for (int i = 0; i < c->count && enough; i++) order[i] = (place){c->time_s[i], i};
    if (enough) qsort(order, (size_t)c->count, sizeof *order, by_time);
    for (int k = 0; k < ARRAYS && enough; k++) {
        double *values = array_of(c, k);
        for (int i = 0; values && i < c->count; i++) room[i] = values[order[i].index];
        if (values) memcpy(values, room, (size_t)c->count * sizeof *values);
    }
    int *lines = (int *)room; // the memory for doubles also serves for line numbers
    for (int i = 0; i < c->count && enough; i++) lines[i] = c->line[order[i].index];
    if (enough) memcpy(c->line, lines, (size_t)c->count * sizeof *lines);
    free(order);
    free(room);
    return enough;
}

// Replace the readings with the indices `from` to `end` - 1 by their mean, and store the mean at the index `to`. Return
// the variance of the times of these readings.
static double average(kn_curve *c, int to, int from, int end)
{
    double n = 0, time = 0, square = 0, value = 0, other = 0;
    const double begin = c->time_s[from];
    if (end - from == 1) {
        move(c, to, from);
        return 0;
    }
    for (int i = from; i < end; i++) {
        const double w = c->weight[i], t = c->time_s[i] - begin;
        n += w;
        time += w * t;
        square += w * t * t;
        value += w * c->value[i];
        if (c->other) other += w * c->other[i];
    }
    c->time_s[to] = begin + time / n;
    c->value[to] = value / n;
    if (c->other) c->other[to] = other / n;
    if (c->load) c->load[to] = c->load[from];
    c->weight[to] = n;
    c->line[to] = c->line[from];
    return fmax(0, square / n - (time / n) * (time / n));
}

static double range(const kn_curve *c)
{
    double low = INFINITY, high = -INFINITY;
    for (int i = 0; i < c->count; i++) low = fmin(low, c->value[i]), high = fmax(high, c->value[i]);
    return high - low;
}

// Return whether reading i has the same time and the same load as the reading before it, and a value that differs from
// the value of that reading by at most `jump`.
static bool is_twin(const kn_curve *c, int i, double jump)
{
    return c->time_s[i - 1] == c->time_s[i] && (!c->load || c->load[i - 1] == c->load[i]) &&
           fabs(c->value[i] - c->value[i - 1]) <= jump;
}

int kn_curve_merge(kn_curve *c)
{
    const double jump = 0.25 * range(c);
    int kept = 0;
    for (int i = 0, end; i < c->count; i = end) {
        for (end = i + 1; end < c->count && is_twin(c, end, jump);) end++;
        average(c, kept++, i, end);
    }
    int out = c->count - kept;
    c->count = kept;
    return out;
}

// ---- thinning the readings

typedef struct piece { // readings between two successive changes of load
    int begin, end;
    double from_s;
} piece;

// Return the index of the first reading in begin..end-1 whose time is at least time_s, or `end` if there is none. The
// method is bisection.
static int first_from(const kn_curve *c, int begin, int end, double time_s)
{
    while (begin < end) {
        int middle = begin + (end - begin) / 2;
        if (c->time_s[middle] < time_s) begin = middle + 1;
        else end = middle;
    }
    return begin;
}

// Return the end of the group of readings that begins at `begin`. Within a group, the latest time since the last change
// of load is less than `factor` times the earliest.
static int group_end(const kn_curve *c, const piece *p, int begin, double factor)
{
    int end = first_from(c, begin, p->end, p->from_s + factor * (c->time_s[begin] - p->from_s));
    return end > begin ? end : begin + 1;
}

// Count the groups of a piece. Stop counting when there are more than `enough`.
static int groups(const kn_curve *c, const piece *p, double factor, int enough)
{
    int n = 0;
    for (int i = p->begin; i < p->end && n <= enough; n++) i = group_end(c, p, i, factor);
    return n;
}

// Find the smallest factor for which the piece has at most `most` groups. The logarithm of the factor is found by
// bisection.
static double choose_factor(const kn_curve *c, const piece *p, int most)
{
    double low = 0, high = log(2);
    while (groups(c, p, exp(high), most) > most && high < 100) high *= 2;
    for (int i = 0; i < 40; i++) {
        double middle = 0.5 * (low + high);
        if (groups(c, p, exp(middle), most) > most) low = middle;
        else high = middle;
    }
    return exp(high);
}

// Correct the means for curvature. On a bent curve, a mean of readings differs from the value at their mean time by
// half the curvature times the variance of the times. This error is small compared with the noise of one reading, but
// not compared with the noise of a mean of ten thousand readings.
static void straighten(kn_curve *c, int begin, int end, const double *variance)
{
    double before = c->value[begin], bend = 0;
    for (int i = begin + 1; i < end - 1; i++) {
        const double *t = c->time_s + i, *y = c->value + i, here = *y;
        const double left = t[0] - t[-1], right = t[1] - t[0];
        if (left > 0 && right > 0) bend = 2 * ((y[1] - here) / right - (here - before) / left) / (left + right);
        c->value[i] -= 0.5 * bend * variance[i];
        before = here;
    }
    // the last mean has a neighbour on one side only, so use the curvature at the mean before it
    c->value[end - 1] -= 0.5 * bend * variance[end - 1];
}

// Thin one piece, and store the means from the index `to` on. Return the index after the last mean.
static int thin_piece(kn_curve *c, const piece *p, int most, int to, double *variance)
{
    const int begin = to;
    const double factor = p->end - p->begin > most ? choose_factor(c, p, most) : 1;
    for (int i = p->begin, end; i < p->end; i = end, to++) {
        end = group_end(c, p, i, factor);
        variance[to] = average(c, to, i, end);
    }
    if (factor > 1 && to - begin > 2) straighten(c, begin, to, variance);
    return to;
}

bool kn_curve_thin(kn_curve *c, int most, int changes, const double *change_s)
{
    if (3 * c->count <= 4 * most) return true;
    double *variance = malloc((size_t)c->count * sizeof *variance);
    if (!variance) return false;
    int to = 0, pieces = 1;
    // A change of load before the first reading or after the last one begins no piece. Each piece gets an equal share
    // of `most`.
    for (int i = 0; i < changes; i++) pieces += change_s[i] > c->time_s[0] && change_s[i] <= c->time_s[c->count - 1];
    piece p = {.from_s = c->time_s[0]};
    for (int i = 0; i <= changes; i++) {
        p.end = i < changes ? first_from(c, p.begin, c->count, change_s[i]) : c->count;
        to = thin_piece(c, &p, most / pieces, to, variance);
        p.begin = p.end;
        if (i < changes) p.from_s = change_s[i];
    }
    c->count = to;
    free(variance);
    return true;
}

// ---- largest values

double kn_largest_magnitude(int count, const double *value)
{
    double most = 0;
    for (int i = 0; i < count; i++) most = fmax(most, fabs(value[i]));
    return most;
}

int kn_curve_peak(const kn_curve *c)
{
    int peak = 0;
    for (int i = 0; i < c->count; i++)
        if (c->value[i] > c->value[peak]) peak = i;
    return peak;
}

double kn_curve_largest(const kn_curve *c) { return c->count > 0 ? fmax(0, c->value[kn_curve_peak(c)]) : 0; }
