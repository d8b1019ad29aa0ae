// Pressure in the elements of a net, one at a time. This file is part of kernel_net.c, which includes it.
// core/cell.h has the equations. A volume is the product of an element's three sides. A side is its rest vector
// plus its change, as for edges.
#include "core/cell.h"

typedef struct element { // one cell in its present shape
    real slope[4][3];    // dV/dx of its corners, m^2
    real j;              // J = V/V0, volume relative to the volume at rest
} element;

// Set a corner's slope to factor (a x b) and subtract it from the first corner's. `factor`: 1/6, or half the thickness
// of a flat element.
LANES_INLINE void add_slope(element *x, int corner, const real a[3], const real b[3], real factor)
{
    for (int k = 0; k < 3; k++) {
        int u = (k + 1) % 3, v = (k + 2) % 3;
        x->slope[corner][k] = factor * (a[u] * b[v] - a[v] * b[u]);
        x->slope[0][k] -= x->slope[corner][k];
    }
}

// Compute J = V/V0 of one cell and its derivatives (slopes) by the corners' positions.
LANES_INLINE element element_of(const tables *t, const real *displacement, int cell)
{
    // third side of a flat element, along -y, because its corners 0, 1, 2 turn from x to z
    static const real across[3] = {0, -1, 0};
    const int *corner = t->corner[cell];
    real side[3][3];
    element x = {.slope = {{0}}};
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            side[i][k] = t->flat && i == 2 ? across[k]
                                           : t->side[9 * cell + 3 * i + k] + displacement[3 * corner[i + 1] + k] -
                                                 displacement[3 * corner[0] + k];
    add_slope(&x, 1, side[1], side[2], t->sixth);
    add_slope(&x, 2, side[2], side[0], t->sixth);
    if (!t->flat) add_slope(&x, 3, side[0], side[1], t->sixth);
    real volume = 0;
    for (int k = 0; k < 3; k++) volume += side[0][k] * x.slope[1][k];
    x.j = volume * t->inverse_volume[cell];
    return x;
}

// Compute (P - P0)/P0 at the end of the step, and its slope -d(P/P0)/dJ.
static void gas(const tables *t, real j, real rate, real *over, real *slope)
{
    real held = j > (real)KN_CELL_LEAST ? j : (real)KN_CELL_LEAST;
    *slope = 1 / (held * held);
    *over = (1 - held) / held + (held - j) * *slope - t->law.dt * rate * *slope;
}

// Push the corners of every cell by the pressure at the end of the step, and add the slope to their
// blocks. Keep g for the products.
static void cells_add(const kn_work *work, const tables *t, const real *displacement)
{
    real *r = work->r, *p = work->p, *kept = work->cell;
    const real *guess = work->guess;
    for (int c = 0; c < t->cells; c++) {
        element x = element_of(t, displacement, c);
        real rate = 0, over, slope;
        for (int i = 0; i <= t->sides; i++)
            for (int k = 0; k < 3; k++) rate += x.slope[i][k] * guess[3 * t->corner[c][i] + k];
        gas(t, x.j, rate * t->inverse_volume[c], &over, &slope);
        real root = (real)sqrt((double)(t->law.dt * t->outside * slope * t->inverse_volume[c]));
        for (int i = 0; i <= t->sides; i++) {
            real *g = kept + 12 * c + 3 * i;
            for (int k = 0; k < 3; k++) {
                g[k] = root * x.slope[i][k];
                r[3 * t->corner[c][i] + k] += t->outside * over * x.slope[i][k];
            }
            block_add(p + 6 * t->corner[c][i], g);
        }
    }
}

// Like cells_add, but with one pressure in the whole object. Volumes and gradients are summed first, [nodes][3] in
// work->cell.
static void object_add(const kn_work *work, const tables *t, const real *displacement)
{
    real *r = work->r, *p = work->p, *kept = work->cell;
    const real *guess = work->guess;
    double volume = 0, rate = 0;
    real over, slope;
    memset(kept, 0, 3 * (size_t)t->nodes * sizeof *kept);
    for (int c = 0; c < t->cells; c++) {
        element x = element_of(t, displacement, c);
        volume += (double)x.j / (double)t->inverse_volume[c];
        for (int i = 0; i <= t->sides; i++)
            for (int k = 0; k < 3; k++) kept[3 * t->corner[c][i] + k] += x.slope[i][k];
    }
    // rate: dV/dt at the guessed velocities
    for (int i = 0; i < 3 * t->nodes; i++) rate += (double)(kept[i] * guess[i]);
    gas(t, (real)(volume / t->volume), (real)(rate / t->volume), &over, &slope);
    real root = (real)sqrt((double)(t->law.dt * t->outside * slope) / t->volume);
    for (int i = 0; i < 3 * t->nodes; i++) {
        r[i] += t->outside * over * kept[i];
        kept[i] *= root;
    }
    for (int i = 0; i < t->nodes; i++) block_add(p + 6 * i, kept + 3 * i);
}

// Add g (g.d) of every cell to q. Return the cells' share of d.q.
static double cells_product(const kn_work *work, const tables *t)
{
    const real *d = work->d, *kept = work->cell;
    real *q = work->q;
    double sum = 0;
    for (int c = 0; c < t->cells; c++) {
        const real *g = kept + 12 * c;
        real rate = 0;
        for (int i = 0; i <= t->sides; i++)
            for (int k = 0; k < 3; k++) rate += g[3 * i + k] * d[3 * t->corner[c][i] + k];
        for (int i = 0; i <= t->sides; i++)
            for (int k = 0; k < 3; k++) q[3 * t->corner[c][i] + k] += g[3 * i + k] * rate;
        sum += (double)rate * (double)rate;
    }
    return sum;
}

// Like cells_product, but with one pressure in the whole object.
static double object_product(const kn_work *work, const tables *t)
{
    const real *d = work->d, *kept = work->cell;
    real *q = work->q;
    double rate = 0;
    for (int i = 0; i < 3 * t->nodes; i++) rate += (double)(kept[i] * d[i]);
    for (int i = 0; i < 3 * t->nodes; i++) q[i] += kept[i] * (real)rate;
    return rate * rate;
}
