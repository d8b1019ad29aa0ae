#include "core/field.h"
#include "core/hash.h"
#include "core/algebra/algebra.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define RIM 2         // number of cells between the surface's bounding box and the boundary of the grid
#define SHARPEN 0.125 // largest correction of a spline coefficient, in cells: see field.h

// --- distance to a triangle -----------------------------------------------------------------------------------------

// Return the square of the distance from p to the line segment between a and a + u.
static double to_segment(const double p[3], const double a[3], const double u[3])
{
    double from[3], uu = kn_dot(u, u);
    for (int k = 0; k < 3; k++) from[k] = p[k] - a[k];
    double t = uu > 0 ? fmin(fmax(kn_dot(from, u) / uu, 0), 1) : 0;
    for (int k = 0; k < 3; k++) from[k] -= t * u[k];
    return kn_dot(from, from);
}

// Return the square of the distance from p to a triangle: to the plane if p is above the inside of the triangle, else
// to the nearest side.
static double to_triangle(const double p[3], const double *const x[3])
{
    double side[3][3], normal[3], from[3], across[3], nearest = INFINITY;
    for (int c = 0; c < 3; c++)
        for (int k = 0; k < 3; k++) side[c][k] = x[(c + 1) % 3][k] - x[c][k];
    kn_cross(side[0], side[1], normal);
    int within = 0;
    for (int c = 0; c < 3; c++) {
        for (int k = 0; k < 3; k++) from[k] = p[k] - x[c][k];
        kn_cross(normal, side[c], across);
        within += kn_dot(across, from) >= 0;
    }
    double area = kn_dot(normal, normal), height = kn_dot(normal, from);
    if (within == 3 && area > 0) return height * height / area;
    for (int c = 0; c < 3; c++) nearest = fmin(nearest, to_segment(p, x[c], side[c]));
    return nearest;
}

// --- distance at all points -----------------------------------------------------------------------------------------

typedef struct filler {
    kn_field *field;
    double (*ball)[4]; // ball around each triangle: centre and radius
    double *distance;  // distance of each candidate's ball from the middle of the present block
} filler;

static size_t place(const kn_field *f, const int at[3])
{
    return ((size_t)at[2] * (size_t)f->n[1] + (size_t)at[1]) * (size_t)f->n[0] + (size_t)at[0];
}

static double to_candidate(const kn_field *f, const double p[3], int candidate)
{
    const int *t = f->triangle[candidate];
    return sqrt(to_triangle(p, (const double *const[3]){f->x_m[t[0]], f->x_m[t[1]], f->x_m[t[2]]}));
}

// Store in `kept` the triangles (candidates) that may be nearest to some point of a block of grid points, and return
// their number. A triangle is dropped if its distance from the block's middle exceeds the least such distance by more
// than the block's diagonal. A first test uses the balls around the triangles, which saves most exact distances. A test
// with balls alone would keep every triangle of a fan of long triangles. `kept` has room for all candidates.
static int keep_near(const filler *fill, const double middle[3], double diagonal, const int *candidate, int count,
                     int *kept)
{
    double nearest = INFINITY;
    int left = 0;
    for (int i = 0; i < count; i++) {
        const double *ball = fill->ball[candidate[i]];
        const double from[3] = {ball[0] - middle[0], ball[1] - middle[1], ball[2] - middle[2]};
        fill->distance[i] = sqrt(kn_dot(from, from)) - ball[3];
        if (fill->distance[i] < nearest) nearest = fmin(nearest, to_candidate(fill->field, middle, candidate[i]));
    }
    // Every point of the block is within half a diagonal of its middle. Both the nearest distance and a candidate's
    // distance therefore change by at most half a diagonal within the block.
    const double most = (nearest + diagonal) * (1 + 1e-12);
    for (int i = 0; i < count; i++)
        if (fill->distance[i] <= most && to_candidate(fill->field, middle, candidate[i]) <= most)
            kept[left++] = candidate[i];
    return left;
}

static double nearest_of(const kn_field *f, const double p[3], const int *candidate, int count)
{
    double nearest = INFINITY;
    for (int i = 0; i < count; i++) nearest = fmin(nearest, to_candidate(f, p, candidate[i]));
    return nearest;
}

// Compute the distances at the grid points from low to high, both ends included. The block of points is split into
// eight parts, and each part has fewer candidates.
static void fill_block(const filler *fill, const int low[3], const int high[3], const int *candidate, int count,
                       int *room)
{
    kn_field *f = fill->field;
    double middle[3], diagonal = 0;
    int cut[3];
    for (int k = 0; k < 3; k++) {
        middle[k] = f->low_m[k] + 0.5 * f->cell_m * (low[k] + high[k]);
        diagonal += (double)(high[k] - low[k]) * (high[k] - low[k]);
        cut[k] = low[k] + (high[k] - low[k]) / 2;
    }
    int kept = keep_near(fill, middle, f->cell_m * sqrt(diagonal), candidate, count, room);
    if (diagonal == 0) {
        f->value[place(f, low)] = (float)nearest_of(f, middle, room, kept);
        return;
    }
    // split into halves along every axis; an axis of a single row is not split
    for (int part = 0; part < 8; part++) {
        int from[3], to[3];
        bool any = true;
        for (int k = 0; k < 3; k++) {
            bool upper = part >> k & 1;
            from[k] = upper ? cut[k] + 1 : low[k];
            to[k] = upper ? high[k] : cut[k];
            any &= from[k] <= to[k];
        }
        if (any) fill_block(fill, from, to, room, kept, room + kept);
    }
}

static void ball_around(const kn_field *f, const int t[3], double ball[4])
{
    ball[3] = 0;
    for (int k = 0; k < 3; k++) ball[k] = (f->x_m[t[0]][k] + f->x_m[t[1]][k] + f->x_m[t[2]][k]) / 3;
    for (int c = 0; c < 3; c++) {
        const double *x = f->x_m[t[c]], from[3] = {x[0] - ball[0], x[1] - ball[1], x[2] - ball[2]};
        ball[3] = fmax(ball[3], sqrt(kn_dot(from, from)));
    }
}

static bool fill_distances(kn_field *f)
{
    enum { LEVELS = 24 }; // largest depth of the recursion: number of times that the longest side is halved
    size_t count = (size_t)f->triangle_count;
    filler fill = {
        .field = f, .ball = malloc(count * sizeof *fill.ball), .distance = malloc(count * sizeof *fill.distance)};
    int *room = malloc((LEVELS + 1) * count * sizeof *room);
    bool ok = fill.ball && fill.distance && room;
    for (int t = 0; ok && t < f->triangle_count; t++) {
        ball_around(f, f->triangle[t], fill.ball[t]);
        room[t] = t;
    }
    const int last[3] = {f->n[0] - 1, f->n[1] - 1, f->n[2] - 1};
    if (ok) fill_block(&fill, (int[]){0, 0, 0}, last, room, f->triangle_count, room + count);
    free(fill.ball);
    free(fill.distance);
    free(room);
    return ok;
}

// --- inside or outside ----------------------------------------------------------------------------------------------

// Return twice the signed area of the triangle a, b, p in the y-z plane. Both triangles at an edge compute this number
// from its ends in the same order, so their results are exactly opposite. A point then cannot lie outside both.
static double beside(const kn_field *f, int a, int b, const double p[2])
{
    bool swap = a > b;
    const double *from = f->x_m[swap ? b : a], *to = f->x_m[swap ? a : b];
    double area = (to[1] - from[1]) * (p[1] - from[2]) - (to[2] - from[2]) * (p[0] - from[1]);
    return swap ? -area : area;
}

// Find the place x_m where the row along x through p crosses triangle t. Return -1 or 1 for the direction of the
// crossing, 0 if there is none.
static int crosses(const kn_field *f, const int t[3], const double p[2], double *x_m)
{
    double area[3], sum = 0;
    int left = 0;
    *x_m = 0;
    for (int c = 0; c < 3; c++) {
        area[c] = beside(f, t[(c + 1) % 3], t[(c + 2) % 3], p);
        // a point on an edge is assigned to exactly one of the edge's two triangles
        left += area[c] > 0 || (area[c] == 0 && t[(c + 1) % 3] < t[(c + 2) % 3]);
        sum += area[c];
    }
    if (left % 3 != 0 || sum == 0) return 0;
    for (int c = 0; c < 3; c++) *x_m += area[c] / sum * f->x_m[t[c]][0];
    return left == 3 ? 1 : -1;
}

// Find the first and the last grid row that may lie between two places on axis k. If first > last, there is none.
static void rows_between(const kn_field *f, int k, double low, double high, int rows[2])
{
    rows[0] = (int)fmax(0, floor((low - f->low_m[k]) / f->cell_m));
    rows[1] = (int)fmin(f->n[k] - 1, ceil((high - f->low_m[k]) / f->cell_m));
}

// Record where grid rows cross triangle t. For each crossing, add to `turns` at the first grid point behind the
// crossing: 1 if the row enters the surface, -1 if it leaves. If the surface is inside out, the signs are opposite.
static void cross_rows(const kn_field *f, const int t[3], int16_t *turns)
{
    // shift the rows by a negligible distance, so that they miss faces and edges that lie along the grid
    const double off[2] = {1.234e-4 * f->cell_m, 5.678e-5 * f->cell_m};
    double x_m;
    int rows[2][2];
    for (int k = 0; k < 2; k++) {
        double a = f->x_m[t[0]][k + 1], b = f->x_m[t[1]][k + 1], c = f->x_m[t[2]][k + 1];
        rows_between(f, k + 1, fmin(a, fmin(b, c)) - off[k], fmax(a, fmax(b, c)), rows[k]);
    }
    for (int z = rows[1][0]; z <= rows[1][1]; z++)
        for (int y = rows[0][0]; y <= rows[0][1]; y++) {
            const double p[2] = {f->low_m[1] + y * f->cell_m + off[0], f->low_m[2] + z * f->cell_m + off[1]};
            int way = crosses(f, t, p, &x_m);
            int first = (int)fmin(fmax(ceil((x_m - f->low_m[0]) / f->cell_m), 0), f->n[0] - 1);
            int16_t *here = &turns[place(f, (int[]){first, y, z})];
            *here = (int16_t)(*here + way);
        }
}

// Make the distances of points inside the surface negative. Follow the row of a point up to the point: the point is
// inside if the row has entered the surface more or fewer times than it has left the surface. Return false if a row
// ends inside, or if memory is short.
static bool sign_distances(kn_field *f)
{
    size_t count = (size_t)f->n[0] * (size_t)f->n[1] * (size_t)f->n[2];
    int16_t *turns = calloc(count, sizeof *turns);
    bool closed = turns != NULL;
    for (int t = 0; turns && t < f->triangle_count; t++) cross_rows(f, f->triangle[t], turns);
    for (size_t i = 0; closed && i < count;) {
        int inside = 0;
        for (int x = 0; x < f->n[0]; x++, i++) {
            inside += turns[i];
            if (inside != 0) f->value[i] = -f->value[i];
            f->fine_m = fmax(f->fine_m, -(double)f->value[i]);
        }
        closed = inside == 0;
    }
    free(turns);
    return closed;
}

// --- coefficients ---------------------------------------------------------------------------------------------------

// Turn the distances d into the coefficients c of the spline (field.h). Points on the grid's boundary keep d.
static bool sharpen(kn_field *f)
{
    const size_t step[3] = {1, (size_t)f->n[0], (size_t)f->n[0] * (size_t)f->n[1]}, count = step[2] * (size_t)f->n[2];
    const double most = SHARPEN * f->cell_m;
    float *d = malloc(count * sizeof *d);
    if (!d) return false;
    memcpy(d, f->value, count * sizeof *d);
    for (int z = 1; z < f->n[2] - 1; z++)
        for (int y = 1; y < f->n[1] - 1; y++)
            for (int x = 1; x < f->n[0] - 1; x++) {
                size_t i = place(f, (int[]){x, y, z});
                double second = 0;
                for (int k = 0; k < 3; k++)
                    second += (double)d[i - step[k]] - 2 * (double)d[i] + (double)d[i + step[k]];
                f->value[i] = (float)((double)d[i] - fmin(fmax(0.125 * second, -most), most));
            }
    free(d);
    return true;
}

// --- building -------------------------------------------------------------------------------------------------------

double kn_field_points(const double extent_m[3], double cell_m)
{
    double points = 1;
    for (int k = 0; k < 3; k++) points *= ceil(extent_m[k] / cell_m) + 2 * RIM + 1;
    return points;
}

// Measure the surface, and place the grid around the surface.
static void measure(kn_field *f)
{
    for (int k = 0; k < 3; k++) f->box_m[0][k] = INFINITY, f->box_m[1][k] = -INFINITY;
    for (int i = 0; i < f->vertex_count; i++) {
        f->bound_m = fmax(f->bound_m, sqrt(kn_dot(f->x_m[i], f->x_m[i])));
        for (int k = 0; k < 3; k++) {
            f->box_m[0][k] = fmin(f->box_m[0][k], f->x_m[i][k]);
            f->box_m[1][k] = fmax(f->box_m[1][k], f->x_m[i][k]);
        }
    }
    for (int k = 0; k < 3; k++) {
        double cells = ceil((f->box_m[1][k] - f->box_m[0][k]) / f->cell_m);
        f->n[k] = (int)cells + 2 * RIM + 1;
        f->low_m[k] = 0.5 * (f->box_m[0][k] + f->box_m[1][k] - (f->n[k] - 1) * f->cell_m);
    }
    for (int i = 0; i < f->vertex_count; i++) {
        double from[3];
        for (int k = 0; k < 3; k++) from[k] = f->x_m[i][k] - 0.5 * (f->box_m[0][k] + f->box_m[1][k]);
        f->ball_m = fmax(f->ball_m, sqrt(kn_dot(from, from)));
    }
}

kn_field *kn_field_build(int vertex_count, const double (*x_m)[3], int triangle_count, const int (*triangle)[3],
                         double cell_m)
{
    size_t corners = (size_t)vertex_count * sizeof *x_m, sides = (size_t)triangle_count * sizeof *triangle;
    kn_field *f = calloc(1, sizeof *f);
    if (!f) return NULL;
    *f = (kn_field){.cell_m = cell_m, .vertex_count = vertex_count, .triangle_count = triangle_count, .holders = 1};
    f->x_m = malloc(corners + 1);
    f->triangle = malloc(sides + 1);
    bool ok = f->x_m && f->triangle;
    if (ok) {
        memcpy(f->x_m, x_m, corners);
        memcpy(f->triangle, triangle, sides);
        f->hash = kn_hash_bytes(kn_hash_bytes(KN_HASH_SEED, x_m, corners), triangle, sides);
        measure(f);
        f->value = malloc((size_t)f->n[0] * (size_t)f->n[1] * (size_t)f->n[2] * sizeof *f->value);
    }
    // compute the exact distances, then their signs, then the coefficients of the spline
    ok = ok && f->value && fill_distances(f) && sign_distances(f) && sharpen(f);
    if (ok) return f;
    kn_field_drop(f);
    return NULL;
}

void kn_field_drop(kn_field *f)
{
    if (!f || --f->holders > 0) return;
    free(f->value);
    free(f->x_m);
    free(f->triangle);
    free(f);
}

// --- evaluation -----------------------------------------------------------------------------------------------------

// Evaluate the spline and its slope at a point u within the grid, counted in cells from the first grid point.
static double look_up(const kn_field *f, const double u[3], double slope[3])
{
    double w[3][3], dw[3][3], sum = 0;
    int at[3];
    // weights of the three points around u along every axis, and their derivatives
    for (int k = 0; k < 3; k++) {
        at[k] = (int)(u[k] + 0.5);
        double t = u[k] - at[k];
        w[k][0] = 0.5 * (0.5 - t) * (0.5 - t), w[k][1] = 0.75 - t * t, w[k][2] = 0.5 * (0.5 + t) * (0.5 + t);
        dw[k][0] = t - 0.5, dw[k][1] = -2 * t, dw[k][2] = t + 0.5;
        slope[k] = 0;
        at[k]--;
    }
    const float *c = f->value + place(f, at);
    const size_t y_step = (size_t)f->n[0], z_step = y_step * (size_t)f->n[1];
    for (size_t z = 0; z < 3; z++)
        for (size_t y = 0; y < 3; y++) {
            const float *row = c + y * y_step + z * z_step;
            double value = w[0][0] * (double)row[0] + w[0][1] * (double)row[1] + w[0][2] * (double)row[2];
            double along = dw[0][0] * (double)row[0] + dw[0][1] * (double)row[1] + dw[0][2] * (double)row[2];
            sum += w[1][y] * w[2][z] * value;
            slope[0] += w[1][y] * w[2][z] * along;
            slope[1] += dw[1][y] * w[2][z] * value;
            slope[2] += w[1][y] * dw[2][z] * value;
        }
    return sum;
}

double kn_field_distance(const kn_field *f, const double at[3], double gradient[3])
{
    double u[3], over[3], beyond = 0;
    // if `at` is outside the grid, evaluate the spline at the nearest point of the grid's boundary
    for (int k = 0; k < 3; k++) {
        double exact = (at[k] - f->low_m[k]) / f->cell_m;
        u[k] = fmin(fmax(exact, 0.75), f->n[k] - 1.75);
        over[k] = f->cell_m * (exact - u[k]);
        beyond += over[k] * over[k];
    }
    double distance = look_up(f, u, gradient), size = sqrt(kn_dot(gradient, gradient));
    for (int k = 0; k < 3; k++) gradient[k] = size > 0 ? gradient[k] / size : k == 2;
    if (beyond == 0) return distance;
    // beyond the grid, return the distance of `at` from the surface point nearest to that grid boundary point
    for (int k = 0; k < 3; k++) gradient[k] = distance * gradient[k] + over[k];
    size = sqrt(kn_dot(gradient, gradient));
    for (int k = 0; k < 3; k++) gradient[k] = size > 0 ? gradient[k] / size : k == 2;
    return size;
}

double kn_field_support(const kn_field *f, const double way[3])
{
    // the bounding box and the bounding ball have the same centre: take the smaller of their extents
    double middle = 0, box = 0;
    for (int k = 0; k < 3; k++) {
        double half = 0.5 * (f->box_m[1][k] - f->box_m[0][k]);
        middle += 0.5 * (f->box_m[0][k] + f->box_m[1][k]) * way[k];
        box += half * fabs(way[k]);
    }
    return middle + fmin(box, f->ball_m);
}
