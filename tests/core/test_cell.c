#include "core/cell.h"
#include "tests/check.h"
#include "tests/dice.h"
#include <stdint.h>

static kn_grid grid_of(int nx, int ny, int nz, double thickness_m)
{
    kn_grid g;
    kn_grid_init(&g, (const int[3]){nx, ny, nz}, 0.01, thickness_m, 1);
    return g;
}

// Return the positions of all nodes of the lattice at rest, each moved a little at random.
static double (*crumpled(const kn_grid *g, double by_m, uint64_t seed))[3]
{
    double(*x)[3] = calloc((size_t)g->nodes, sizeof *x);
    if (!x) abort();
    for (int i = 0; i < g->nodes; i++) {
        kn_grid_rest(g, i, x[i]);
        for (int k = 0; k < 3; k++) x[i][k] += g->flat && k == 1 ? 0 : by_m * kn_dice_in(&seed, -1, 1);
    }
    return x;
}

static void gather(const kn_cell *cell, const double (*x)[3], double corner[8][3])
{
    memset(corner, 0, 8 * sizeof corner[0]);
    for (int i = 0; i < 8 && cell->corner[i] >= 0; i++) memcpy(corner[i], x[cell->corner[i]], sizeof corner[i]);
}

static const struct {
    int n[3];
    double thickness_m, volume;
} objects[3] = {{{4, 3, 5}, 0, 24e-6}, {{6, 1, 4}, 0.02, 15 * 2e-6}, {{2, 2, 2}, 0, 1e-6}};

TEST("at rest all cells have the same volume, and their number matches the lattice")
{
    for (int t = 0; t < 3; t++) {
        kn_grid g = grid_of(objects[t].n[0], objects[t].n[1], objects[t].n[2], objects[t].thickness_m);
        kn_cell cells[40];
        int count = kn_grid_cells(&g, NULL);
        CHECK(count == (t == 0 ? 24 : t == 1 ? 15 : 1) && kn_grid_cells(&g, cells) == count);
        double(*x)[3] = crumpled(&g, 0, 1), corner[8][3], gradient[8][3];
        for (int c = 0; c < count; c++) {
            gather(&cells[c], (const double(*)[3])x, corner);
            CHECK_NEAR(kn_cell_volume(&g, (const double(*)[3])corner, gradient), objects[t].volume / count, 1e-18);
        }
        free(x);
    }
}

TEST("the gradient of a deformed cell is the derivative of its volume, and its sum over the corners is 0")
{
    for (int t = 0; t < 3; t++) {
        kn_grid g = grid_of(objects[t].n[0], objects[t].n[1], objects[t].n[2], objects[t].thickness_m);
        kn_cell cells[40];
        kn_grid_cells(&g, cells);
        double(*x)[3] = crumpled(&g, 0.003, 5), corner[8][3], gradient[8][3], ignored[8][3];
        gather(&cells[0], (const double(*)[3])x, corner);
        kn_cell_volume(&g, (const double(*)[3])corner, gradient);
        for (int k = 0; k < 3; k++) {
            double sum = 0;
            for (int i = 0; i < (g.flat ? 4 : 8); i++) {
                const double step = 1e-5;
                corner[i][k] += step;
                double more = kn_cell_volume(&g, (const double(*)[3])corner, ignored);
                corner[i][k] -= 2 * step;
                double less = kn_cell_volume(&g, (const double(*)[3])corner, ignored);
                corner[i][k] += step;
                // The volume is linear in every single coordinate, so the difference quotient is exact.
                CHECK_NEAR((more - less) / (2 * step), gradient[i][k], 1e-14);
                sum += gradient[i][k];
            }
            CHECK_NEAR(sum, 0, 1e-18);
        }
        free(x);
    }
}

TEST("cells share their faces: moving the inner nodes does not change the total volume")
{
    kn_grid g = grid_of(4, 4, 4, 0);
    kn_cell cells[27];
    int count = kn_grid_cells(&g, cells);
    double(*x)[3] = crumpled(&g, 0, 1), corner[8][3], gradient[8][3], sum = 0;
    uint64_t seed = 3;
    for (int i = 0; i < g.nodes; i++)
        if (kn_grid_share(&g, i) == 1)
            for (int k = 0; k < 3; k++) x[i][k] += 0.004 * kn_dice_in(&seed, -1, 1);
    for (int c = 0; c < count; c++) {
        gather(&cells[c], (const double(*)[3])x, corner);
        sum += kn_cell_volume(&g, (const double(*)[3])corner, gradient);
    }
    CHECK_NEAR(sum, 27e-6, 1e-18);
    free(x);
}

TEST("a cell turned inside out has the negative volume; a rotated and moved cell keeps its volume")
{
    kn_grid g = grid_of(2, 2, 2, 0);
    kn_cell cell;
    kn_grid_cells(&g, &cell);
    double(*x)[3] = crumpled(&g, 0.002, 9), corner[8][3], turned[8][3], gradient[8][3];
    gather(&cell, (const double(*)[3])x, corner);
    double volume = kn_cell_volume(&g, (const double(*)[3])corner, gradient);
    for (int i = 0; i < 8; i++) { // swap axes x -> y -> z -> x, then move 10 m away
        for (int k = 0; k < 3; k++) turned[i][(k + 1) % 3] = corner[i][k];
        turned[i][0] += 10;
    }
    CHECK_NEAR(kn_cell_volume(&g, (const double(*)[3])turned, gradient), volume, 1e-15 * volume / 1e-6 + 1e-19);
    for (int i = 0; i < 8; i++) corner[i][2] = -corner[i][2];
    CHECK_NEAR(kn_cell_volume(&g, (const double(*)[3])corner, gradient), -volume, 1e-18);
    free(x);
}

TEST("the gas obeys Boyle's law down to a tenth of its volume; below, the pressure is linear with the same slope")
{
    double slope, before, after, unused;
    CHECK_NEAR(kn_cell_pressure(1, &slope), 0, 0);
    CHECK_NEAR(slope, 1, 0);
    for (double j = 0.11; j < 3; j += 0.17) {
        CHECK_NEAR(kn_cell_pressure(j, &slope), 1 / j - 1, 1e-12);
        before = kn_cell_pressure(j - 1e-6, &unused);
        after = kn_cell_pressure(j + 1e-6, &unused);
        CHECK_NEAR((before - after) / 2e-6, slope, 1e-6 * slope);
    }
    CHECK_NEAR(kn_cell_pressure(0.1, &slope), 9, 1e-12);
    CHECK_NEAR(kn_cell_pressure(0, &slope), 19, 1e-12);
    CHECK_NEAR(kn_cell_pressure(-1, &slope), 119, 1e-12);
    CHECK_NEAR(slope, 100, 1e-12);
}

TESTS_MAIN
