#ifndef KN_TESTS_CORE_SURFACE_OF_H
#define KN_TESTS_CORE_SURFACE_OF_H
// Closed surfaces of known shape, as they are read from the files of tools.
#include "core/field.h"
#include "core/shape.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static inline kn_shape shape_of_part(kn_solid part)
{
    kn_shape shape = {0};
    if (!kn_shape_add(&shape, &part)) exit(70);
    return shape;
}

typedef struct surface_of {
    int vertices, triangles;
    double (*x_m)[3];
    int (*triangle)[3];
} surface_of;

// Make the surface of the cube [-1, 1]^3 from 6 n^2 squares of two triangles each. Callers then deform the cube.
static inline surface_of surface_cube(int n)
{
    surface_of s = {.x_m = malloc(6 * (size_t)(n + 1) * (size_t)(n + 1) * sizeof *s.x_m),
                    .triangle = malloc(12 * (size_t)n * (size_t)n * sizeof *s.triangle)};
    for (int face = 0; face < 6; face++) {
        int axis = face / 2, u = (axis + 1) % 3, v = (axis + 2) % 3, first = s.vertices;
        for (int j = 0; j <= n; j++)
            for (int i = 0; i <= n; i++) {
                double *x = s.x_m[s.vertices++];
                x[axis] = face % 2 ? 1 : -1, x[u] = 2.0 * i / n - 1, x[v] = 2.0 * j / n - 1;
            }
        for (int j = 0; j < n; j++)
            for (int i = 0; i < n; i++) {
                int a = first + j * (n + 1) + i, b = a + 1, c = a + n + 2, d = a + n + 1;
                int faces[2][3] = {{a, b, c}, {a, c, d}}, back[2][3] = {{a, c, b}, {a, d, c}};
                memcpy(s.triangle[s.triangles], face % 2 ? faces : back, sizeof faces);
                s.triangles += 2;
            }
    }
    return s;
}

// stands on its origin, as kn_solid_box does
static inline surface_of surface_box(const double size_m[3], double edge_m, int n)
{
    surface_of s = surface_cube(n);
    for (int i = 0; i < s.vertices; i++) {
        double from[3], length = 0; // offset from the nearest point of the smaller box
        for (int k = 0; k < 3; k++) {
            double half = 0.5 * size_m[k], at = half * s.x_m[i][k];
            from[k] = at - fmin(fmax(at, edge_m - half), half - edge_m);
            s.x_m[i][k] = at - from[k] + (k == 2 ? half : 0);
            length += from[k] * from[k];
        }
        for (int k = 0; k < 3 && edge_m > 0; k++) s.x_m[i][k] += from[k] * edge_m / sqrt(length);
    }
    return s;
}

static inline surface_of surface_ball(double radius_m, int n)
{
    surface_of s = surface_cube(n);
    for (int i = 0; i < s.vertices; i++) { // squares of about equal size on the ball
        double x[3], length = 0;
        for (int k = 0; k < 3; k++) x[k] = tan(0.7853981633974483 * s.x_m[i][k]), length += x[k] * x[k];
        for (int k = 0; k < 3; k++) s.x_m[i][k] = radius_m * x[k] / sqrt(length);
    }
    return s;
}

static inline kn_field *surface_field(surface_of s, double cell_m) // takes ownership of the surface
{
    kn_field *f =
        kn_field_build(s.vertices, (const double(*)[3])s.x_m, s.triangles, (const int(*)[3])s.triangle, cell_m);
    free(s.x_m);
    free(s.triangle);
    if (!f) exit(70);
    return f;
}

#endif
