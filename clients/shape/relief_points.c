#include "clients/shape/relief_points.h"
#include "core/vec.h"
#include <math.h>
#include <stdbool.h>

static double length2(const double a[3]) { return kn_dot(a, a); }

// Find the point of the side from a to b that is nearest to p.
static void to_side(const double p[3], const double a[3], const double b[3], double near[3])
{
    double along[3], from[3];
    for (int k = 0; k < 3; k++) along[k] = b[k] - a[k], from[k] = p[k] - a[k];
    const double share = fmin(fmax(kn_dot(from, along) / fmax(length2(along), 1e-30), 0), 1);
    for (int k = 0; k < 3; k++) near[k] = a[k] + share * along[k];
}

// Find the nearest point of a triangle: the foot of p on its plane if that is inside, else the nearest point of its
// sides. normal is not normalised.
static void to_triangle(const double p[3], const double corner[3][3], const double normal[3], double near[3])
{
    double from[3], foot[3], best = INFINITY;
    for (int k = 0; k < 3; k++) from[k] = p[k] - corner[0][k];
    const double height = kn_dot(from, normal) / fmax(length2(normal), 1e-30);
    bool inside = true;
    for (int k = 0; k < 3; k++) foot[k] = p[k] - height * normal[k];
    for (int e = 0; e < 3; e++) {
        const double *a = corner[e], *b = corner[(e + 1) % 3];
        double along[3], to[3], turn[3];
        for (int k = 0; k < 3; k++) along[k] = b[k] - a[k], to[k] = foot[k] - a[k];
        kn_cross(along, to, turn);
        inside &= kn_dot(turn, normal) >= 0;
    }
    for (int k = 0; inside && k < 3; k++) near[k] = foot[k];
    for (int e = 0; !inside && e < 3; e++) {
        double here[3], away[3];
        to_side(p, corner[e], corner[(e + 1) % 3], here);
        for (int k = 0; k < 3; k++) away[k] = p[k] - here[k];
        if (length2(away) >= best) continue;
        best = length2(away);
        for (int k = 0; k < 3; k++) near[k] = here[k];
    }
}

double kn_relief_distance(const double p[3], const float (*now_m)[3], int triangles, const int (*triangle)[3])
{
    double best2 = INFINITY, square = 0, sign = 1;
    for (int t = 0; t < triangles; t++) {
        double corner[3][3], u[3], v[3], normal[3], near[3] = {0}, away[3];
        for (int c = 0; c < 3; c++)
            for (int k = 0; k < 3; k++) corner[c][k] = now_m[triangle[t][c]][k];
        for (int k = 0; k < 3; k++) u[k] = corner[1][k] - corner[0][k], v[k] = corner[2][k] - corner[0][k];
        kn_cross(u, v, normal);
        to_triangle(p, (const double(*)[3])corner, normal, near);
        for (int k = 0; k < 3; k++) away[k] = p[k] - near[k];
        const double far2 = length2(away), over = kn_dot(away, normal) / sqrt(fmax(length2(normal), 1e-60));
        const bool nearer = far2 < best2 * (1 - 1e-9), as_near = far2 <= best2 * (1 + 1e-9) && fabs(over) > square;
        if (!(nearer || as_near)) continue;
        best2 = fmin(far2, best2);
        square = fabs(over);
        sign = over < 0 ? -1 : 1;
    }
    return sign * sqrt(best2);
}
