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
// force[0] on its free sides and force[1] on the plates, > 0: tension. Store the new strains of the edges in `strain`.
static void forces(const kn_affine_block *b, double width, double height, double force[2],
                   double strain[KN_AFFINE_EDGES])
{
    const double k1 = b->material.k1_pa, a = b->law.a_pa_s, dt_s = b->law.dt_s;
    force[0] = force[1] = 0;
    for (int k = 0; k < KN_AFFINE_EDGES; k++) {
        const double rest = sqrt(across[k] + along[k]), length = length_of(k, width, height);
        const double rate = (length - length_of(k, b->width, b->height)) / (dt_s * b->gamma * rest);
        const double stress = kn_law_stress(&b->law, a * rate + k1 * b->strain[k]);
        const double stiffness = number[k] * (across[k] + along[k] > 1 ? b->structure.diagonal : 1);
        const double tension = stress * b->gamma * b->kappa * rest * stiffness / length;
        strain[k] = b->strain[k] + dt_s * (stress - k1 * b->strain[k]) / a;
        force[0] += tension * across[k] * width;
        force[1] += tension * along[k] * height;
    }
    if (!(b->structure.gas_pa > 0)) return;
    double slope;
    const double over_pa = b->structure.gas_pa * kn_cell_pressure(width * width * height, &slope);
    force[0] -= over_pa * 2 * width * height;
    force[1] -= over_pa * width * width;
}

// Residual of the step: force[0] = 0, and force[1] = -stress_pa unless the height is prescribed.
static double residual(const kn_affine_block *b, double width, double height, double stress_pa, double force[2])
{
    double strain[KN_AFFINE_EDGES];
    forces(b, width, height, force, strain);
    if (isnan(stress_pa)) return fabs(force[0]);
    force[1] += stress_pa;
    return hypot(force[0], force[1]);
}

// Solve the step by Newton's method in the logarithms of width and height, with halved steps while the residual rises.
// stress_pa NAN: the height is prescribed.
static bool solve(kn_affine_block *b, double dt_s, double stress_pa, double height)
{
    enum { ITERATIONS = 60, HALVINGS = 20 };
    const double small = 1e-7, most = 0.2; // difference for the slopes; largest change of a logarithm in an iteration
    const bool free = !isnan(stress_pa);
    double width = b->width, f[2], fx[2], fz[2], change = 1;
    if (b->law.dt_s != dt_s) kn_law_init(&b->law, &b->material, dt_s);
    double norm = residual(b, width, height, stress_pa, f);
    for (int i = 0; i < ITERATIONS && change > 1e-10; i++) {
        residual(b, width * (1 + small), height, stress_pa, fx);
        double dx = -f[0] * small / (fx[0] - f[0]), dz = 0;
        if (free) {
            residual(b, width, height * (1 + small), stress_pa, fz);
            const double xx = fx[0] - f[0], zx = fx[1] - f[1], xz = fz[0] - f[0], zz = fz[1] - f[1];
            const double determinant = xx * zz - xz * zx;
            dx = -small * (zz * f[0] - xz * f[1]) / determinant;
            dz = -small * (xx * f[1] - zx * f[0]) / determinant;
        }
        const double limit = fmin(1, most / fmax(fabs(dx), fabs(dz)));
        double step = limit, next = norm;
        for (int h = 0; h < HALVINGS; h++, step *= 0.5) {
            next = residual(b, width * exp(step * dx), height * exp(step * dz), stress_pa, f);
            if (next < norm || next == 0) break;
        }
        if (!isfinite(next)) return false;
        width *= exp(step * dx);
        height *= exp(step * dz);
        norm = next;
        change = fabs(step * dx) + fabs(step * dz);
    }
    double strain[KN_AFFINE_EDGES];
    forces(b, width, height, f, strain);
    for (int k = 0; k < KN_AFFINE_EDGES; k++) b->strain[k] = strain[k];
    b->width = width;
    b->height = height;
    b->stress_pa = -f[1];
    return height > 0.02;
}

bool kn_affine_block_load(kn_affine_block *b, double dt_s, double stress_pa)
{
    return solve(b, dt_s, stress_pa, b->height);
}

bool kn_affine_block_press(kn_affine_block *b, double dt_s, double height) { return solve(b, dt_s, NAN, height); }

// A step is this share of the time since the load changed. Measured for dough: the strain is then within 0.001 of that
// with steps a quarter as long.
static const double step_share = 0.02;

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
