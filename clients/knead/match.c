#include "clients/knead/match.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

// Two positions at rest count as equal up to this distance, m. The positions have single precision.
#define SAME_M 1e-6
// Largest allowed distance at rest between two matched vertices, as a share of the longest triangle side. Each point of
// an equilateral triangle, or of a square of two triangles, is closer to a corner than this share.
#define COARSE 0.6

// A vertex in a list that is sorted by x, for the search of the nearest vertex.
typedef struct spot {
    float x[3];
    int vertex;
} spot;

static int by_x(const void *a, const void *b)
{
    const spot *p = a, *q = b;
    if (p->x[0] != q->x[0]) return p->x[0] < q->x[0] ? -1 : 1;
    return (p->vertex > q->vertex) - (p->vertex < q->vertex);
}

static float squared(const float a[3], const float b[3])
{
    const float d[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
    return d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
}

// Compare one vertex with the nearest vertex found so far. Return false if its distance along x alone is larger than
// the distance of the nearest vertex.
static bool nearer(const spot *s, const float x[3], const spot **best, float *least)
{
    const float across = s->x[0] - x[0], d = squared(s->x, x);
    if (across * across > *least) return false; // all vertices further along x are further away as well
    if (d < *least || !*best) *least = d, *best = s;
    return true;
}

// Find the nearest vertex in a list that is sorted by x. The search starts at x and goes to both sides, until the
// distance along x alone exceeds the distance of the nearest vertex found.
static const spot *nearest(const spot *s, int count, const float x[3])
{
    const spot *best = NULL;
    float least = INFINITY;
    int low = 0, high = count;
    // Find by binary search the first vertex whose x coordinate is not below that of the given point.
    while (low < high) {
        const int middle = low + (high - low) / 2;
        if (s[middle].x[0] < x[0]) low = middle + 1;
        else high = middle;
    }
    for (int i = low; i < count && nearer(&s[i], x, &best, &least); i++) continue;
    for (int i = low - 1; i >= 0 && nearer(&s[i], x, &best, &least); i--) continue;
    return best;
}

// Return the length of the longest triangle side of a still at rest.
static double longest_side(const kn_still *s)
{
    float most = 0;
    for (int t = 0; t < s->triangle_count; t++)
        for (int i = 0; i < 3; i++)
            most = fmaxf(most, squared(s->rest[s->triangle[t][i]], s->rest[s->triangle[t][(i + 1) % 3]]));
    return sqrt(most);
}

// Return the vertices of a still, sorted by their x coordinate at rest. Return NULL if out of memory.
static spot *sorted(const kn_still *s)
{
    spot *out = malloc(((size_t)s->vertex_count + 1) * sizeof *out);
    for (int v = 0; out && v < s->vertex_count; v++) out[v] = (spot){{s->rest[v][0], s->rest[v][1], s->rest[v][2]}, v};
    if (out) qsort(out, (size_t)s->vertex_count, sizeof *out, by_x);
    return out;
}

// Find the nearest vertex of `from` for each vertex of `to`. Raise `*apart_m` to the largest of their distances.
static bool find_nearest(const kn_still *from, const kn_still *to, int *vertex, double *apart_m)
{
    spot *s = sorted(from);
    for (int v = 0; s && v < to->vertex_count; v++) {
        const spot *beside = nearest(s, from->vertex_count, to->rest[v]);
        if (vertex) vertex[v] = beside->vertex;
        *apart_m = fmax(*apart_m, sqrt(squared(beside->x, to->rest[v])));
    }
    const bool found = s != NULL;
    free(s);
    return found;
}

bool kn_match_make(kn_match *m, const kn_still *first, const kn_still *second, char *error, size_t error_size)
{
    *m = (kn_match){.count = second->vertex_count};
    m->first = malloc(((size_t)m->count + 1) * sizeof *m->first);
    snprintf(error, error_size, "out of memory");
    // Search in both directions, because a part that only one of the objects has must be detected.
    bool ok = m->first && first->vertex_count > 0 && m->count > 0 &&
              find_nearest(first, second, m->first, &m->apart_m) && find_nearest(second, first, NULL, &m->apart_m);
    m->same = ok && first->vertex_count == second->vertex_count && m->apart_m < SAME_M;
    if (ok && m->apart_m > COARSE * fmax(longest_side(first), longest_side(second))) {
        snprintf(error, error_size,
                 "at rest the two are up to %.3g mm apart, expected objects of the same shape, "
                 "because points are compared that coincide at rest",
                 1e3 * m->apart_m);
        ok = false;
    }
    if (!ok) kn_match_free(m);
    return ok;
}

// Check the number of vertices and the range of the indices, because the meshes may have changed since the match.
bool kn_match_fits(const kn_match *m, const kn_still *first, const kn_still *second)
{
    if (m->count != second->vertex_count || !m->first) return false;
    for (int v = 0; v < m->count; v++)
        if (m->first[v] >= first->vertex_count) return false;
    return true;
}

// Compare displacements and not positions, because two matched vertices may have different positions at rest.
void kn_match_distance(const kn_match *m, const kn_still *first, const kn_still *second, float *value)
{
    for (int v = 0; v < m->count; v++) {
        const int u = m->first[v];
        float moved[2][3];
        for (int i = 0; i < 3; i++) {
            moved[0][i] = first->now[u][i] - first->rest[u][i];
            moved[1][i] = second->now[v][i] - second->rest[v][i];
        }
        value[v] = sqrtf(squared(moved[0], moved[1]));
    }
}

void kn_match_free(kn_match *m)
{
    free(m->first);
    *m = (kn_match){0};
}
