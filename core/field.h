#ifndef KN_CORE_FIELD_H
#define KN_CORE_FIELD_H
// Signed distance of a closed surface of triangles, as a grid: what makes a tool of any file (shape.h).
//
// At the grid's points the distance is exact: to the nearest triangle, negative where a row of points has entered the
// surface more often than left it, so that surfaces which pass through themselves have an inside, too. Between them a
// quadratic B-spline, whose value and gradient are one polynomial with continuous slopes: a tool that slides does not
// feel the cells. Its coefficients are c = d - (sum of second differences)/8, which is exact for quadratics, the second
// term cut to an eighth of a cell: an edge stays as round as the spline makes it.
//
// Error: less than one cell s anywhere, since no distance changes faster than its place and the spline's points are at
// most 0.87 s away in the mean; where the surface has a radius of curvature r > 4 s, less than s^3/(4 r^2). Beyond the
// grid, which is two cells wider than the surface, the point of it that is nearest to the grid's rim counts.
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define KN_FIELD_POINTS_MAX (1 << 21)    // 8 MiB
#define KN_FIELD_TRIANGLES_MAX (1 << 17) // some seconds

typedef struct kn_field {
    int n[3];
    double low_m[3], cell_m;
    float *value;                     // [n[2]][n[1]][n[0]] coefficients, m
    double box_m[2][3];               // around the surface
    double ball_m;                    // radius of the ball around it in the middle of the box
    double bound_m;                   // no point of it is farther from the origin
    double fine_m;                    // radius of the largest ball inside of it, to a cell
    int vertex_count, triangle_count; // for drawing
    double (*x_m)[3];
    int (*triangle)[3];
    uint64_t hash; // of the triangles
    int holders;   // who keeps it, in one thread
} kn_field;

// Points of the grid around a surface of that extent.
double kn_field_points(const double extent_m[3], double cell_m);

// Closed and wound one way, see scene/shell.h; inside out is the same. At most the points and triangles above. One
// holder. NULL: no memory, or rounding left a row of points inside at its end.
kn_field *kn_field_build(int vertex_count, const double (*x_m)[3], int triangle_count, const int (*triangle)[3],
                         double cell_m);

// As kn_shape_distance, and as real-time safe.
double kn_field_distance(const kn_field *field, const double at[3], double gradient[3]);

// No less than it reaches that way, see kn_shape_support: by the smaller of the box around it and the ball around that.
double kn_field_support(const kn_field *field, const double way[3]);

void kn_field_drop(kn_field *field); // one holder less; the last one frees it. NULL is fine

#endif
