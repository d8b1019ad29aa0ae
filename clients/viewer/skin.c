#include "clients/viewer/skin.h"
#include "clients/viewer/vec.h"
#include <stdlib.h>
#include <string.h>

// cosine of 40 degrees, the smallest angle of a crease; a block's edges have 90 degrees, the facets of a 16-sided
// cylinder 22
#define CREASE_COS 0.766f
#define COPLANAR_COS 0.9999f // cosine of 0.8 degrees, the largest angle between two triangles that count as coplanar

typedef struct half_edge { // one side of one triangle
    // vertices of the side in ascending order, so that the half edges of two neighbours compare equal
    int low, high;
    int triangle, corner; // number of the triangle, and of its corner opposite the side
} half_edge;

// Sort by vertices to make neighbours adjacent. The triangle's number makes the order unique.
static int compare(const void *pa, const void *pb)
{
    const half_edge *a = pa, *b = pb;
    if (a->low != b->low) return a->low < b->low ? -1 : 1;
    if (a->high != b->high) return a->high < b->high ? -1 : 1;
    return a->triangle < b->triangle ? -1 : a->triangle > b->triangle;
}

static void face_normal(const int t[3], const float (*xyz)[3], float normal[3])
{
    float u[3], v[3];
    kn_sub(u, xyz[t[1]], xyz[t[0]]);
    kn_sub(v, xyz[t[2]], xyz[t[0]]);
    kn_cross(normal, u, v);
    kn_normalize(normal);
}

// Squared length of the side opposite a corner.
static float side_squared(const int t[3], const float (*xyz)[3], int corner)
{
    float d[3];
    kn_sub(d, xyz[t[(corner + 1) % 3]], xyz[t[(corner + 2) % 3]]);
    return kn_dot(d, d);
}

// Return whether the side opposite this corner is clearly the longest of the triangle.
static bool longest(const int t[3], const float (*xyz)[3], int corner)
{
    float own = 0.999f * side_squared(t, xyz, corner);
    return own > side_squared(t, xyz, (corner + 1) % 3) && own > side_squared(t, xyz, (corner + 2) % 3);
}

// Return the representative of the set that contains `i` (union-find with path halving).
static int root(int *parent, int i)
{
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
}

// Join the corners of a and b at each end of their shared side into one group.
static void join_corners(kn_skin *s, const half_edge *a, const half_edge *b)
{
    for (int i = 1; i < 3; i++) {
        for (int j = 1; j < 3; j++) {
            int corner_a = 3 * a->triangle + (a->corner + i) % 3, corner_b = 3 * b->triangle + (b->corner + j) % 3;
            if (s->triangle[corner_a] == s->triangle[corner_b])
                s->group[root(s->group, corner_a)] = root(s->group, corner_b);
        }
    }
}

// Compare two neighbours at rest: share normals across a smooth side, and hide the diagonal of a quad.
static void meet(kn_skin *s, const float (*rest)[3], const half_edge *a, const half_edge *b)
{
    const int *ta = s->triangle + 3 * a->triangle, *tb = s->triangle + 3 * b->triangle;
    float na[3], nb[3];
    face_normal(ta, rest, na);
    face_normal(tb, rest, nb);
    float cosine = kn_dot(na, nb);
    if (cosine > CREASE_COS) join_corners(s, a, b);
    // The diagonal of a quad is the longest side of both of its triangles.
    if (cosine > COPLANAR_COS && longest(ta, rest, a->corner) && longest(tb, rest, b->corner))
        s->line[3 * a->triangle + a->corner] = s->line[3 * b->triangle + b->corner] = false;
}

// Number the groups of corners that share a normal 0, 1, 2 ..., in the order of their first corner.
static void number_groups(kn_skin *s)
{
    int corners = 3 * s->triangle_count, *number = s->group;
    for (int i = 0; i < corners; i++) number[i] = root(number, i);
    // Every corner now points at the root of its group. A root stores ~n, which is not a valid index, until all other
    // corners of the group have read the number n.
    for (int i = 0; i < corners; i++)
        if (number[i] == i) number[i] = ~s->group_count++;
    for (int i = 0; i < corners; i++)
        if (number[i] >= 0) number[i] = ~number[number[i]];
    for (int i = 0; i < corners; i++)
        if (number[i] < 0) number[i] = ~number[i];
}

// Find the neighbours of all triangles, and determine groups and lines.
static bool find_neighbours(kn_skin *s, const float (*rest)[3])
{
    int count = 3 * s->triangle_count;
    half_edge *edge = malloc((size_t)count * sizeof *edge);
    if (!edge) return false;
    // Each corner starts as a group of its own, and each side as a line.
    for (int i = 0; i < count; i++) {
        const int *t = s->triangle + i - i % 3;
        int p = t[(i + 1) % 3], q = t[(i + 2) % 3];
        edge[i] = (half_edge){p < q ? p : q, p < q ? q : p, i / 3, i % 3};
        s->group[i] = i;
        s->line[i] = true;
    }
    qsort(edge, (size_t)count, sizeof *edge, compare);
    // After sorting, the half edges of a shared side are adjacent.
    for (int i = 0; i + 1 < count; i++)
        if (edge[i].low == edge[i + 1].low && edge[i].high == edge[i + 1].high) meet(s, rest, &edge[i], &edge[i + 1]);
    free(edge);
    number_groups(s);
    return true;
}

static bool fill(kn_skin *s, const float (*rest)[3], const int (*triangle)[3])
{
    size_t corners = 3 * (size_t)s->triangle_count;
    s->triangle = malloc(corners * sizeof *s->triangle);
    s->group = malloc(corners * sizeof *s->group);
    s->line = malloc(corners * sizeof *s->line);
    if (!s->triangle || !s->group || !s->line) return false;
    memcpy(s->triangle, triangle, corners * sizeof *s->triangle);
    if (!find_neighbours(s, rest)) return false;
    s->normal = malloc(3 * (size_t)s->group_count * sizeof *s->normal);
    for (int i = 0; i < 3; i++) {
        s->rest_low[i] = s->rest_high[i] = rest[0][i];
        for (int v = 1; v < s->vertex_count; v++) {
            s->rest_low[i] = fminf(s->rest_low[i], rest[v][i]);
            s->rest_high[i] = fmaxf(s->rest_high[i], rest[v][i]);
        }
    }
    return s->normal != NULL;
}

kn_skin *kn_skin_create(int vertex_count, const float (*rest)[3], int triangle_count, const int (*triangle)[3])
{
    if (vertex_count < 3 || vertex_count > KN_SKIN_VERTICES_MAX) return NULL;
    if (triangle_count < 1 || triangle_count > 2 * KN_SKIN_VERTICES_MAX) return NULL;
    // Triangles may come from the bus, so check their vertex numbers.
    for (int i = 0; i < 3 * triangle_count; i++)
        if (triangle[i / 3][i % 3] < 0 || triangle[i / 3][i % 3] >= vertex_count) return NULL;
    kn_skin *s = calloc(1, sizeof *s);
    if (!s) return NULL;
    s->vertex_count = vertex_count;
    s->triangle_count = triangle_count;
    if (fill(s, rest, triangle)) return s;
    kn_skin_destroy(s);
    return NULL;
}

void kn_skin_destroy(kn_skin *s)
{
    if (!s) return;
    free(s->triangle);
    free(s->group);
    free(s->line);
    free(s->normal);
    free(s);
}

// Angle of a corner. atan2 is accurate for flat and for thin triangles.
static float corner_angle(const int t[3], const float (*xyz)[3], int corner)
{
    float u[3], v[3], c[3];
    kn_sub(u, xyz[t[(corner + 1) % 3]], xyz[t[corner]]);
    kn_sub(v, xyz[t[(corner + 2) % 3]], xyz[t[corner]]);
    kn_cross(c, u, v);
    return atan2f(sqrtf(kn_dot(c, c)), kn_dot(u, v));
}

// Return whether all positions of the triangle are finite.
static bool whole(const int t[3], const float (*xyz)[3])
{
    float sum = 0;
    // the sum stays 0 unless a coordinate is infinite or NaN
    for (int i = 0; i < 9; i++) sum += 0 * xyz[t[i / 3]][i % 3];
    return sum == 0;
}

void kn_skin_corners(kn_skin *s, const float (*xyz)[3], float *out)
{
    // Sum the face normals of each group, weighted by the angle of the corner.
    memset(s->normal, 0, 3 * (size_t)s->group_count * sizeof *s->normal);
    for (int t = 0; t < s->triangle_count; t++) {
        const int *triangle = s->triangle + 3 * t;
        if (!whole(triangle, xyz)) continue;
        float n[3];
        face_normal(triangle, xyz, n);
        for (int corner = 0; corner < 3; corner++) {
            float angle = corner_angle(triangle, xyz, corner), *sum = s->normal + 3 * s->group[3 * t + corner];
            for (int i = 0; i < 3; i++) sum[i] += angle * n[i];
        }
    }
    for (int g = 0; g < s->group_count; g++) kn_normalize(s->normal + 3 * g);
    // Corners of an incomplete triangle all go to one point, so the triangle is not visible.
    for (int i = 0; i < 3 * s->triangle_count; i++) {
        const float *at = whole(s->triangle + i - i % 3, xyz) ? xyz[s->triangle[i]] : s->rest_low;
        memcpy(out + 6 * i, at, 3 * sizeof *out);
        memcpy(out + 6 * i + 3, s->normal + 3 * s->group[i], 3 * sizeof *out);
    }
}
