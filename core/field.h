#ifndef KN_CORE_FIELD_H
#define KN_CORE_FIELD_H
// Signed distance of a closed surface of triangles, stored as a grid. With such a grid, any surface file can be a tool
// (shape.h).
//
// At the grid's points, the distance to the nearest triangle is exact. To find its sign, each row of grid points is
// followed from one end to the other. A point lies inside if the row has entered the surface more or fewer times than
// it has left the surface. So a surface may be inside out (its normals point inwards) or pass through itself. Inside,
// the distance is negative. Between the points, the distance is a quadratic B-spline. Its value and gradient come from
// one polynomial with continuous slopes, so a tool that slides does not feel the cells. The coefficients are c = d -
// (sum of second differences)/8, which is exact for quadratics. The correction of a coefficient is limited to an eighth
// of a cell, so it cannot undo the rounding of an edge by the spline.
//
// The error is nowhere larger than the side s of a cell. The spline gives a weighted mean of the distances at grid
// points nearby. The mean distance of these points is at most 0.87 s, and along a path of length a the distance to the
// surface changes by at most a. Where the surface has a radius of curvature r > 4 s, the error is below s^3/(4 r^2). On
// every side the grid reaches two cells beyond the surface. For a point beyond the grid, take the nearest point of the
// grid's boundary, and the surface point nearest to this boundary point. The result is the distance to that surface
// point.
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define KN_FIELD_POINTS_MAX (1 << 21)    // largest number of grid points; they take 8 MiB
#define KN_FIELD_TRIANGLES_MAX (1 << 17) // largest number of triangles; building the grid takes some seconds

typedef struct kn_field {
    int n[3];                         // number of grid points along x, y, z
    double low_m[3], cell_m;          // low_m: position of the first grid point; cell_m: side of a cell
    float *value;                     // [n[2]][n[1]][n[0]] coefficients of the spline, m
    double box_m[2][3];               // lowest and highest corner of the box around the surface
    double ball_m;                    // radius of the smallest ball around the box's centre that contains the surface
    double bound_m;                   // largest distance of a point of the surface from the origin
    double fine_m;                    // radius of the largest ball inside the surface; the error is at most a cell
    int vertex_count, triangle_count; // size of the copy of the surface, which is kept for drawing
    double (*x_m)[3];                 // [vertex_count] positions
    int (*triangle)[3];               // [triangle_count] vertices of each triangle
    uint64_t hash;                    // hash of vertices and triangles
    int holders;                      // reference count; all holders must be in one thread
} kn_field;

// Return the number of grid points that the field of a surface needs. `extent_m`: sides of the box around the surface;
// `cell_m`: side of a cell, > 0.
double kn_field_points(const double extent_m[3], double cell_m);

// Build the grid of a closed surface whose triangles all run the same way round (scene/mesh_file.h). The field copies
// the surface. An inside-out surface is allowed. Points and triangles must not exceed KN_FIELD_POINTS_MAX and
// KN_FIELD_TRIANGLES_MAX. The new field has one holder. Return NULL if memory is short, or if rounding errors make a
// row of grid points end inside the surface.
kn_field *kn_field_build(int vertex_count, const double (*x_m)[3], int triangle_count, const int (*triangle)[3],
                         double cell_m);

// Return the signed distance of the point `at` in the frame of the surface, m; < 0: inside. Store its gradient, a unit
// vector. Real-time safe.
double kn_field_distance(const kn_field *field, const double at[3], double gradient[3]);

// Return an upper bound of how far the surface reaches from the origin in the direction `way`, a unit vector, m. The
// bound is the smaller of the extents of the box and the ball around the surface. Real-time safe.
double kn_field_support(const kn_field *field, const double way[3]);

// Release one reference to the field. The last release frees the field. Does nothing if `field` is NULL.
void kn_field_drop(kn_field *field);

#endif
