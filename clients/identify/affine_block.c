#include "clients/identify/affine_block.h"
#include "core/cell.h"
#include "core/grid.h"
#include <math.h>

// kinds of edges: their number in a cell, and the squares of their horizontal and vertical extent
static const double number[KN_AFFINE_EDGES] = {1, 2, 4, 2, 4};
static const double across[KN_AFFINE_EDGES] = {0, 1, 1, 2, 2}, along[KN_AFFINE_EDGES] = {1, 0, 1, 0, 1};

void kn_affine_block_init(kn_affine_block *b, const kn_material *material, const kn_affine_structure *structure)
{
    kn_grid grid;
    kn_grid_init(&grid, (const int[3]){2, 2, 2}, 1, 0, structure->diagonal);
    *b = (kn_affine_block){.structure = *structure,
                           .material = *material,
                           .kappa = grid.kappa_m,
                           .gamma = grid.gamma,
                           .width = 1,
                           .height = 1};
}

static double length_of(int k, double width, double height)
{
    return sqrt(across[k] * width * width + along[k] * height * height);
}

// Compute the forces per area at rest with which the block resists at the end of a step to this width and height:
// force[0] on its free sides and force[1] on the plates, > 0: tension. slope[i][j]: derivative of force[i] by width
// (j = 0) or height (j = 1). Store the new strains of the edges in `strain`.
static void forces(const kn_affine_block *b, double width, double height, double force[2], double slope[2][2],
                   double strain[KN_AFFINE_EDGES])
{
    const double k1 = b->material.k1_pa, a = b->law.a_pa_s, dt_s = b->law.dt_s;
    force[0] = force[1] = slope[0][0] = slope[0][1] = slope[1][1] = 0;
    for (int k = 0; k < KN_AFFINE_EDGES; k++) {
        const double rest = sqrt(across[k] + along[k]), length = length_of(k, width, height);
        const double rate = (length - length_of(k, b->width, b->height)) / (dt_s * b->gamma * rest);
        const double stress = kn_law_stress(&b->law, a * rate + k1 * b->strain[k]);
        const double stiffness = number[k] * (across[k] + along[k] > 1 ? b->structure.diagonal : 1) * b->kappa;
        const double tension = stress * b->gamma * rest * stiffness;
        const double tangent = kn_law_slope(&b->law, stress, KN_LINEARIZATION_TANGENT) * a / dt_s * stiffness;
        // x, z: derivatives of the length by width and height
        const double x = across[k] * width / length, z = along[k] * height / length, turn = tension / length;
        strain[k] = b->strain[k] + dt_s * (stress - k1 * b->strain[k]) / a;
        force[0] += tension * x;
        force[1] += tension * z;
        slope[0][0] += (tangent - turn) * x * x + turn * across[k];
        slope[0][1] += (tangent - turn) * x * z;
        slope[1][1] += (tangent - turn) * z * z + turn * along[k];
    }
    if (b->structure.gas_pa > 0) {
        double softer;
        const double over_pa = b->structure.gas_pa * kn_cell_pressure(width * width * height, &softer);
        const double x = 2 * width * height, z = width * width;
        softer *= b->structure.gas_pa;
        force[0] -= over_pa * x;
        force[1] -= over_pa * z;
        slope[0][0] += softer * x * x - over_pa * 2 * height;
        slope[0][1] += softer * x * z - over_pa * 2 * width;
        slope[1][1] += softer * z * z;
    }
    slope[1][0] = slope[0][1];
}

// Residual of the step: force[0] = 0, and force[1] = -stress_pa unless the height is prescribed.
static double residual(const kn_affine_block *b, double width, double height, double stress_pa, double force[2],
                       double slope[2][2], double strain[KN_AFFINE_EDGES])
{
    forces(b, width, height, force, slope, strain);
    if (isnan(stress_pa)) return fabs(force[0]);
    force[1] += stress_pa;
    return hypot(force[0], force[1]);
}

// Solve the step by Newton's method in the logarithms of width and height, with halved steps while the residual rises.
// stress_pa NAN: the height is prescribed.
static bool solve(kn_affine_block *b, double dt_s, double stress_pa, double height)
{
    enum { ITERATIONS = 60, HALVINGS = 20 };
    const double most = 0.2; // largest change of a logarithm in an iteration
    const bool free = !isnan(stress_pa);
    double width = b->width, f[2], slope[2][2], strain[KN_AFFINE_EDGES], change = 1;
    if (b->law.dt_s != dt_s) kn_law_init(&b->law, &b->material, dt_s);
    double norm = residual(b, width, height, stress_pa, f, slope, strain);
    for (int i = 0; i < ITERATIONS && change > 1e-9; i++) {
        const double xx = slope[0][0] * width, xz = slope[0][1] * height;
        const double zx = slope[1][0] * width, zz = slope[1][1] * height, determinant = xx * zz - xz * zx;
        const double dx = free ? (xz * f[1] - zz * f[0]) / determinant : -f[0] / xx;
        const double dz = free ? (zx * f[0] - xx * f[1]) / determinant : 0;
        double step = fmin(1, most / fmax(fabs(dx), fabs(dz))), next = norm, w = width, h = height;
        for (int half = 0; half < HALVINGS; half++, step *= 0.5) {
            w = width * exp(step * dx), h = height * exp(step * dz);
            next = residual(b, w, h, stress_pa, f, slope, strain);
            if (next < norm || next == 0) break;
        }
        if (!isfinite(next)) return false;
        width = w, height = h;
        norm = next;
        change = fabs(step * dx) + fabs(step * dz);
    }
    for (int k = 0; k < KN_AFFINE_EDGES; k++) b->strain[k] = strain[k];
    b->width = width;
    b->height = height;
    b->stress_pa = (free ? stress_pa : 0) - f[1];
    return height > 0.02;
}

bool kn_affine_block_load(kn_affine_block *b, double dt_s, double stress_pa)
{
    return solve(b, dt_s, stress_pa, b->height);
}

bool kn_affine_block_press(kn_affine_block *b, double dt_s, double height) { return solve(b, dt_s, NAN, height); }

// A step is this share of the time since the load changed. Measured for the numbers of dough.yaml under 10 to 90 gf: the
// strain after 60 s is then within 0.0011 of the converged one.
static const double step_share = 0.04;

// Advance a block under a constant weight from *now_s to until_s. The load was applied at since_s.
static bool creep(kn_affine_block *b, double *now_s, double until_s, double since_s, double least_s, double stress_pa)
{
    while (*now_s < until_s) {
        double dt_s = fmax(least_s, step_share * (*now_s - since_s));
        if (*now_s + 1.5 * dt_s > until_s) dt_s = until_s - *now_s;
        if (!kn_affine_block_load(b, dt_s, stress_pa)) return false;
        *now_s = dt_s == until_s - *now_s ? until_s : *now_s + dt_s;
    }
    return true;
}

bool kn_affine_block_creep(const kn_affine_structure *structure, const kn_material *material, const kn_curve *c,
                           int count, const double *time_s, double *strain)
{
    kn_affine_block b;
    if (kn_material_check(material)) return false;
    kn_affine_block_init(&b, material, structure);
    const double least_s = 1e-5 * (time_s[count - 1] - c->step[0].time_s);
    double now_s = c->step[0].time_s, since_s = now_s, stress_pa = 0;
    bool stands = true;
    for (int i = 0, next = 0; i < count; i++) {
        for (; stands && next < c->steps && c->step[next].time_s <= time_s[i]; next++) {
            stands = creep(&b, &now_s, c->step[next].time_s, since_s, least_s, stress_pa);
            stress_pa = c->step[next].stress_pa;
            since_s = c->step[next].time_s;
        }
        stands = stands && creep(&b, &now_s, time_s[i], since_s, least_s, stress_pa);
        strain[i] = stands ? 1 - b.height : 1;
    }
    return true;
}
