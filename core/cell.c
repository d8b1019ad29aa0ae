#include "core/cell.h"

#include <math.h>
#include <string.h>

int kn_grid_cells(const kn_grid *g, kn_cell *out)
{
    const int *n = g->n, layers = g->flat ? 1 : n[1] - 1;
    int count = 0;
    for (int z = 0; z + 1 < n[2]; z++)
        for (int y = 0; y < layers; y++)
            for (int x = 0; x + 1 < n[0]; x++, count++) {
                if (!out) continue;
                for (int i = 0; i < 8; i++) {
                    int up = g->flat ? i >> 1 : i >> 2, back = g->flat ? 0 : i >> 1 & 1;
                    out[count].corner[i] = up > 1 ? -1 : kn_grid_node(g, x + (i & 1), y + back, z + up);
                }
            }
    return count;
}

// Return the volume of the tetrahedron between the origin and a triangle, 1/6 det(a, b, c). Add its derivatives with
// respect to a, b and c to da, db and dc.
static double add_triangle(const double a[3], const double b[3], const double c[3], double da[3], double db[3],
                           double dc[3])
{
    double volume = 0;
    for (int k = 0; k < 3; k++) {
        int u = (k + 1) % 3, v = (k + 2) % 3;
        double across = (b[u] * c[v] - b[v] * c[u]) / 6;
        volume += a[k] * across;
        da[k] += across;
        db[k] += (c[u] * a[v] - c[v] * a[u]) / 6;
        dc[k] += (a[u] * b[v] - a[v] * b[u]) / 6;
    }
    return volume;
}

// Return the volume of a solid cell from four triangles per face. Add the derivatives with respect to the corners'
// positions to `d`.
static double block_volume(const double x[8][3], double d[8][3])
{
    // corners of the faces, counter-clockwise from outside
    static const int face[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
    double volume = 0;
    for (int f = 0; f < 6; f++) {
        double centre[3] = {0}, pull[3] = {0};
        for (int i = 0; i < 4; i++)
            for (int k = 0; k < 3; k++) centre[k] += 0.25 * x[face[f][i]][k];
        for (int i = 0; i < 4; i++) {
            int a = face[f][i], b = face[f][(i + 1) % 4];
            volume += add_triangle(centre, x[a], x[b], pull, d[a], d[b]);
        }
        // the centre of a face is the mean of its four corners, so each corner gets a fourth of the centre's gradient
        for (int i = 0; i < 4; i++)
            for (int k = 0; k < 3; k++) d[face[f][i]][k] += 0.25 * pull[k];
    }
    return volume;
}

// Return the volume of a flat cell: the thickness times the area of the quadrilateral with the corners 0 1 3 2.
static double flat_volume(double depth_m, const double x[8][3], double d[8][3])
{
    static const int ring[4] = {0, 1, 3, 2};
    double area = 0;
    for (int i = 0; i < 4; i++) {
        const double *before = x[ring[(i + 3) % 4]], *here = x[ring[i]], *after = x[ring[(i + 1) % 4]];
        area += 0.5 * (here[0] * after[2] - after[0] * here[2]);
        d[ring[i]][0] = 0.5 * depth_m * (after[2] - before[2]);
        d[ring[i]][2] = -0.5 * depth_m * (after[0] - before[0]);
    }
    return area * depth_m;
}

double kn_cell_volume(const kn_grid *g, const double corner_m[8][3], double gradient_m2[8][3])
{
    memset(gradient_m2, 0, 8 * sizeof gradient_m2[0]);
    if (g->flat) return flat_volume(g->depth_m, corner_m, gradient_m2);
    double near_origin[8][3]; // corners relative to the first one, so that no digits are lost far from the origin
    for (int i = 0; i < 8; i++)
        for (int k = 0; k < 3; k++) near_origin[i][k] = corner_m[i][k] - corner_m[0][k];
    return block_volume((const double(*)[3])near_origin, gradient_m2);
}

double kn_simplex_volume(double depth_m, const double x[8][3], double d[8][3])
{
    double side[3][3] = {{0}};
    memset(d, 0, 8 * sizeof d[0]);
    for (int i = 0; i < (depth_m > 0 ? 2 : 3); i++)
        for (int k = 0; k < 3; k++) side[i][k] = x[i + 1][k] - x[0][k];
    // The area of a triangle times the thickness is a sixth of the triple product of two sides and a third vector. The
    // third vector is three times the thickness long. It points along -y, because the corners turn from x to z.
    if (depth_m > 0) side[2][1] = -3 * depth_m;
    double volume = 0;
    // the gradient at a corner is a sixth of the cross product of the other two sides
    for (int i = 0; i < (depth_m > 0 ? 2 : 3); i++)
        for (int k = 0; k < 3; k++) {
            const double *a = side[(i + 1) % 3], *b = side[(i + 2) % 3];
            d[i + 1][k] = (a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3]) / 6;
            d[0][k] -= d[i + 1][k];
            if (i == 0) volume += side[0][k] * d[1][k];
        }
    return volume;
}

double kn_cell_pressure(double j, double *slope)
{
    // if the volume ratio J is below KN_CELL_LEAST, follow the tangent of the pressure law at KN_CELL_LEAST
    double held = fmax(j, KN_CELL_LEAST);
    *slope = 1 / (held * held);
    return (1 - held) / held + (held - j) / (held * held);
}
