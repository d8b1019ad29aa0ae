#include "core/cell.h"
#include "tests/check.h"
#include "tests/dice.h"

typedef struct body { // a lattice with cells of 1 cm, and the positions of its nodes
    kn_grid g;
    kn_cell cell[40];
    int count;
    double x[64][3];
} body;

// Return the lattice at rest, with each node moved a little at random: all nodes, or only the inner ones.
static body crumpled(const int n[3], double thickness_m, double by_m, uint64_t seed, bool inner_only)
{
    body b;
    kn_grid_init(&b.g, n, 0.01, thickness_m, 1);
    b.count = kn_grid_cells(&b.g, NULL);
    CHECK(b.count <= COUNT(b.cell) && b.g.nodes <= COUNT(b.x) && kn_grid_cells(&b.g, b.cell) == b.count);
    for (int i = 0; i < b.g.nodes; i++) {
        kn_grid_rest(&b.g, i, b.x[i]);
        for (int k = 0; k < 3 && (!inner_only || kn_grid_share(&b.g, i) == 1); k++)
            b.x[i][k] += b.g.flat && k == 1 ? 0 : by_m * kn_dice_in(&seed, -1, 1);
    }
    return b;
}

static void corners_of(const body *b, int c, double corner[8][3])
{
    memset(corner, 0, 8 * sizeof corner[0]);
    for (int i = 0; i < 8 && b->cell[c].corner[i] >= 0; i++)
        memcpy(corner[i], b->x[b->cell[c].corner[i]], sizeof corner[i]);
}

static double volume_of(const body *b, const double corner[8][3])
{
    double gradient[8][3];
    return kn_cell_volume(&b->g, corner, gradient);
}
#define AS_CONST (const double(*)[3])

static const struct {
    int n[3], cells;
    double thickness_m, volume;
} objects[3] = {{{4, 3, 5}, 24, 0, 24e-6}, {{6, 1, 4}, 15, 0.02, 15 * 2e-6}, {{2, 2, 2}, 1, 0, 1e-6}};

TEST("at rest all cells have the same volume, and their number matches the lattice")
{
    for (int t = 0; t < 3; t++) {
        body b = crumpled(objects[t].n, objects[t].thickness_m, 0, 1, false);
        CHECK(b.count == objects[t].cells);
        for (int c = 0; c < b.count; c++) {
            double corner[8][3];
            corners_of(&b, c, corner);
            CHECK_NEAR(volume_of(&b, AS_CONST corner), objects[t].volume / b.count, 1e-18);
        }
    }
}

TEST("the gradient of a deformed cell is the derivative of its volume, and its sum over the corners is 0")
{
    for (int t = 0; t < 3; t++) {
        body b = crumpled(objects[t].n, objects[t].thickness_m, 0.003, 5, false);
        const double step = 1e-5;
        double corner[8][3], gradient[8][3];
        corners_of(&b, 0, corner);
        kn_cell_volume(&b.g, AS_CONST corner, gradient);
        for (int k = 0; k < 3; k++) {
            double sum = 0;
            for (int i = 0; i < (b.g.flat ? 4 : 8); i++) {
                corner[i][k] += step;
                double more = volume_of(&b, AS_CONST corner);
                corner[i][k] -= 2 * step;
                double less = volume_of(&b, AS_CONST corner);
                corner[i][k] += step;
                // The volume is linear in every single coordinate, so the difference quotient is exact.
                CHECK_NEAR((more - less) / (2 * step), gradient[i][k], 1e-14);
                sum += gradient[i][k];
            }
            CHECK_NEAR(sum, 0, 1e-18);
        }
    }
}

TEST("cells share their faces: moving the inner nodes does not change the total volume")
{
    body b = crumpled((const int[]){4, 4, 4}, 0, 0.004, 3, true);
    double sum = 0, corner[8][3];
    for (int c = 0; c < b.count; c++) corners_of(&b, c, corner), sum += volume_of(&b, AS_CONST corner);
    CHECK_NEAR(sum, 27e-6, 1e-18);
}

TEST("a cell turned inside out has the negative volume; a rotated and moved cell keeps its volume")
{
    body b = crumpled((const int[]){2, 2, 2}, 0, 0.002, 9, false);
    double corner[8][3], turned[8][3];
    corners_of(&b, 0, corner);
    double volume = volume_of(&b, AS_CONST corner);
    for (int i = 0; i < 8; i++) { // swap axes x -> y -> z -> x, then move 10 m away
        for (int k = 0; k < 3; k++) turned[i][(k + 1) % 3] = corner[i][k];
        turned[i][0] += 10;
        corner[i][2] = -corner[i][2];
    }
    CHECK_NEAR(volume_of(&b, AS_CONST turned), volume, 1e-15 * volume / 1e-6 + 1e-19);
    CHECK_NEAR(volume_of(&b, AS_CONST corner), -volume, 1e-18);
}

TEST("the gas obeys Boyle's law down to a tenth of its volume; below, the pressure is linear with the same slope")
{
    double slope, unused;
    CHECK_NEAR(kn_cell_pressure(1, &slope), 0, 0);
    CHECK_NEAR(slope, 1, 0);
    for (double j = 0.11; j < 3; j += 0.17) {
        CHECK_NEAR(kn_cell_pressure(j, &slope), 1 / j - 1, 1e-12);
        CHECK_NEAR((kn_cell_pressure(j - 1e-6, &unused) - kn_cell_pressure(j + 1e-6, &unused)) / 2e-6, slope,
                   1e-6 * slope);
    }
    CHECK_NEAR(kn_cell_pressure(0.1, &slope), 9, 1e-12);
    CHECK_NEAR(kn_cell_pressure(0, &slope), 19, 1e-12);
    CHECK_NEAR(kn_cell_pressure(-1, &slope), 119, 1e-12);
    CHECK_NEAR(slope, 100, 1e-12);
}
