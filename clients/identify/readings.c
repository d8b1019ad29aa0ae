#include "clients/identify/readings.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

void kn_readings_free(kn_readings *r)
{
    free(r->time_s);
    free(r->value);
    free(r->other);
    free(r->load);
    free(r->weight);
    free(r->line);
    memset(r, 0, sizeof *r);
}

static void move(kn_readings *r, int to, int from)
{
    double *const all[] = {r->time_s, r->value, r->other, r->load, r->weight};
    for (int i = 0; i < 5; i++)
        if (all[i]) all[i][to] = all[i][from];
    r->line[to] = r->line[from];
}

int kn_readings_compact(kn_readings *r, int *first_line)
{
    int kept = 0;
    for (int i = 0; i < r->count; i++) {
        if (isfinite(r->time_s[i]) && isfinite(r->value[i]) && (!r->other || isfinite(r->other[i])) &&
            (!r->load || isfinite(r->load[i])))
            move(r, kept++, i);
        else if (kept == i) *first_line = r->line[i];
    }
    int out = r->count - kept;
    r->count = kept;
    return out;
}

void kn_readings_skip(kn_readings *r, int count)
{
    for (int i = count; i < r->count; i++) move(r, i - count, i);
    r->count -= count;
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

static bool permute(double *values, const place *order, int count, double *room)
{
    if (!values) return true;
    for (int i = 0; i < count; i++) room[i] = values[order[i].index];
    memcpy(values, room, (size_t)count * sizeof *values);
    return true;
}

// Return the length of the longest series of readings that are in order already. The other readings are the ones out of
// place. If one of four hundred readings was moved to the end, one reading is out of place, not all the readings after
// its proper place. `last` is scratch for `count` numbers.
static int longest_in_order(const place *order, int count, int *last)
{
    int longest = 0;
    for (int i = 0; i < count; i++) {
        int low = 0, high = longest;
        while (low < high) {
            const int middle = low + (high - low) / 2;
            if (last[middle] < order[i].index) low = middle + 1;
            else high = middle;
        }
        last[low] = order[i].index; // last[i]: the smallest last index of all ordered series of length i + 1
        longest += low == longest;
    }
    return longest;
}

int kn_readings_sort(kn_readings *r)
{
    bool sorted = true;
    for (int i = 1; i < r->count && sorted; i++) sorted = r->time_s[i - 1] <= r->time_s[i];
    if (sorted) return 0;
    place *order = malloc((size_t)r->count * sizeof *order);
    double *room = malloc((size_t)r->count * sizeof *room);
    int moved = -1;
    if (order && room) {
        for (int i = 0; i < r->count; i++) order[i] = (place){r->time_s[i], i};
        qsort(order, (size_t)r->count, sizeof *order, by_time);
        // The scratch memory for doubles is also used for line numbers.
        moved = r->count - longest_in_order(order, r->count, (int *)room);
        double *const all[] = {r->time_s, r->value, r->other, r->load, r->weight};
        for (int i = 0; i < 5; i++) permute(all[i], order, r->count, room);
        int *lines = (int *)room;
        for (int i = 0; i < r->count; i++) lines[i] = r->line[order[i].index];
        memcpy(r->line, lines, (size_t)r->count * sizeof *lines);
    }
    free(order);
    free(room);
    return moved;
}

static double weight(const kn_readings *r, int i) { return r->weight ? r->weight[i] : 1; }

// Replace readings from..end-1 by one mean at `to`. Return the variance of their times.
static double average(kn_readings *r, int to, int from, int end)
{
    double n = 0, time = 0, square = 0, value = 0, other = 0;
    const double begin = r->time_s[from];
    for (int i = from; i < end; i++) {
        const double w = weight(r, i), t = r->time_s[i] - begin;
        n += w;
        time += w * t;
        square += w * t * t;
        value += w * r->value[i];
        if (r->other) other += w * r->other[i];
    }
    r->time_s[to] = end - from == 1 ? begin : begin + time / n;
    r->value[to] = end - from == 1 ? r->value[from] : value / n;
    if (r->other) r->other[to] = end - from == 1 ? r->other[from] : other / n;
    if (r->load) r->load[to] = r->load[from];
    if (r->weight) r->weight[to] = n;
    r->line[to] = r->line[from];
    return fmax(0, square / n - (time / n) * (time / n));
}

// Give every reading a weight of 1, if there are no weights yet.
static bool weigh(kn_readings *r)
{
    if (r->weight) return true;
    r->weight = malloc((size_t)(r->count ? r->count : 1) * sizeof *r->weight);
    for (int i = 0; r->weight && i < r->count; i++) r->weight[i] = 1;
    return r->weight;
}

static double range(const kn_readings *r)
{
    double low = INFINITY, high = -INFINITY;
    for (int i = 0; i < r->count; i++) low = fmin(low, r->value[i]), high = fmax(high, r->value[i]);
    return high - low;
}

// Return whether reading i has the time and load of the one before and no jump between them.
static bool is_twin(const kn_readings *r, int i, double jump)
{
    return r->time_s[i - 1] == r->time_s[i] && (!r->load || r->load[i - 1] == r->load[i]) &&
           fabs(r->value[i] - r->value[i - 1]) <= jump;
}

int kn_readings_merge(kn_readings *r)
{
    const double jump = 0.25 * range(r);
    int twin = 1, kept = 0;
    while (twin < r->count && !is_twin(r, twin, jump)) twin++;
    if (twin >= r->count) return 0;
    if (!weigh(r)) return -1;
    for (int i = 0, end; i < r->count; i = end) {
        for (end = i + 1; end < r->count && is_twin(r, end, jump);) end++;
        average(r, kept++, i, end);
    }
    int out = r->count - kept;
    r->count = kept;
    return out;
}

// ---- thinning

typedef struct piece { // readings between two changes of load
    int begin, end;
    double from_s;
} piece;

// Return the first of begin..end-1 that is not before time_s, by bisection.
static int first_from(const kn_readings *r, int begin, int end, double time_s)
{
    while (begin < end) {
        int middle = begin + (end - begin) / 2;
        if (r->time_s[middle] < time_s) begin = middle + 1;
        else end = middle;
    }
    return begin;
}

// Return the end of the group that begins at `begin`: times since the change grow by less than the factor.
static int group_end(const kn_readings *r, const piece *p, int begin, double factor)
{
    int end = first_from(r, begin, p->end, p->from_s + factor * (r->time_s[begin] - p->from_s));
    return end > begin ? end : begin + 1;
}

// Count the groups of a piece. Stop counting above `enough`.
static int groups(const kn_readings *r, const piece *p, double factor, int enough)
{
    int n = 0;
    for (int i = p->begin; i < p->end && n <= enough; n++) i = group_end(r, p, i, factor);
    return n;
}

// Find the smallest factor that leaves at most `most` groups, by bisection of its logarithm.
static double choose_factor(const kn_readings *r, const piece *p, int most)
{
    double low = 0, high = log(2);
    while (groups(r, p, exp(high), most) > most && high < 100) high *= 2;
    for (int i = 0; i < 40; i++) {
        double middle = 0.5 * (low + high);
        if (groups(r, p, exp(middle), most) > most) low = middle;
        else high = middle;
    }
    return exp(high);
}

// Correct the means for curvature. The mean of a bent curve differs from its value at the mean time by half the
// curvature times the variance of the times. The error is small beside the noise of one reading, but not beside that of
// the mean of ten thousand.
static void straighten(kn_readings *r, int begin, int end, const double *variance)
{
    double before = r->value[begin], bend = 0;
    for (int i = begin + 1; i < end - 1; i++) {
        const double *t = r->time_s + i, *y = r->value + i, here = *y;
        const double left = t[0] - t[-1], right = t[1] - t[0];
        if (left > 0 && right > 0) bend = 2 * ((y[1] - here) / right - (here - before) / left) / (left + right);
        r->value[i] -= 0.5 * bend * variance[i];
        before = here;
    }
    // the last mean has a neighbour on one side only, so the curvature of the mean before is used
    r->value[end - 1] -= 0.5 * bend * variance[end - 1];
}

// Thin one piece into the readings from `to` on. Return the end of the new readings.
static int thin_piece(kn_readings *r, const piece *p, int most, int to, double *variance)
{
    const int begin = to;
    const double factor = p->end - p->begin > most ? choose_factor(r, p, most) : 1;
    for (int i = p->begin, end; i < p->end; i = end, to++) {
        end = group_end(r, p, i, factor);
        variance[to] = average(r, to, i, end);
    }
    if (factor > 1 && to - begin > 2) straighten(r, begin, to, variance);
    return to;
}

bool kn_readings_thin(kn_readings *r, int most, int changes, const double *change_s)
{
    if (!weigh(r)) return false;
    if (3 * r->count <= 4 * most) return true;
    double *variance = malloc((size_t)r->count * sizeof *variance);
    if (!variance) return false;
    int to = 0, pieces = 1;
    // Changes outside the time of the readings do not begin a piece. Each piece gets an equal share of `most`.
    for (int i = 0; i < changes; i++) pieces += change_s[i] > r->time_s[0] && change_s[i] <= r->time_s[r->count - 1];
    piece p = {.from_s = r->time_s[0]};
    for (int i = 0; i <= changes; i++) {
        p.end = i < changes ? first_from(r, p.begin, r->count, change_s[i]) : r->count;
        to = thin_piece(r, &p, most / pieces, to, variance);
        p.begin = p.end;
        if (i < changes) p.from_s = change_s[i];
    }
    r->count = to;
    free(variance);
    return true;
}
