// The first paper's structures: diagonals, and gas in the cells or in the object, in a block and in a flat object.
// Against Runge-Kutta: test_oracle.c. Their symmetries: test_invariance.c.
#include "tests/lattice.h"

static kn_model_def flat(kn_model_def def)
{
    def.nodes[1] = 1;
    def.thickness_m = 0.05;
    return def;
}

static kn_model_def with_gas(kn_model_def def, kn_pressure pressure, double diagonal)
{
    def.pressure = pressure;
    def.diagonal_stiffness = diagonal;
    return def;
}

typedef struct shape {
    double peak_n, dip_n; // dip: largest fall of the force while the plate goes down
    double bulge_m[2];    // largest outward displacement of a side along x, y
    double grown, least;  // relative change of the object's volume; smallest V/V0 of a cell seen
    bool stayed;          // the object stayed in its plane
} shape;

static void measure_cells(const lattice *l, const kn_cell *cells, int count, shape *s)
{
    const kn_grid *g = &l->model->grid;
    double v0 = g->spacing_m * g->spacing_m * g->depth_m, sum = 0;
    for (int c = 0; c < count; c++) {
        double corner[8][3] = {{0}}, gradient[8][3];
        for (int i = 0; i < 8 && cells[c].corner[i] >= 0; i++)
            kn_state_position(l->model, l->state, cells[c].corner[i], corner[i]);
        double volume = kn_cell_volume(g, (const double(*)[3])corner, gradient);
        s->least = fmin(s->least, volume / v0);
        sum += volume;
    }
    s->grown = sum / (v0 * count) - 1;
}

// Press down by 1 cm at 1 cm/s and hold.
static shape press_shape(kn_model_def def, double hold_s)
{
    const press p = {.depth_m = 0.01, .hold_s = hold_s};
    LATTICE l = lattice_of(def);
    const kn_grid *g = &l.model->grid;
    int count = kn_grid_cells(g, NULL), ticks = (int)lround(press_up_s(&p) * 1000);
    kn_cell *cells = malloc((size_t)count * sizeof *cells);
    kn_grid_cells(g, cells);
    shape s = {.least = 1, .stayed = true};
    for (int i = 1; i <= ticks; i++) {
        press_step(&l, &p);
        double force = l.out.probe[0].force_n[2];
        s.peak_n = fmax(s.peak_n, force);
        if (i * 1e-3 < press_down_s(&p) - PRESS_RAMP) s.dip_n = fmax(s.dip_n, s.peak_n - force);
        if (i % 50 == 0 || i == ticks) measure_cells(&l, cells, count, &s);
    }
    for (int i = 0; i < l.model->node_count; i++) {
        double u[3];
        displacement(l.model, l.state, i, u);
        s.stayed &= u[1] == 0;
        for (int k = 0; k < 2; k++) {
            double rest = l.model->rest_m[i][k], half = 0.5 * (g->n[k] - 1) * g->spacing_m;
            if (half > 0 && fabs(rest) > half - 1e-9) s.bulge_m[k] = fmax(s.bulge_m[k], rest > 0 ? u[k] : -u[k]);
        }
    }
    free(cells);
    printf("     peak %.2f N, dip %.3f N; out by %.2f and %.2f mm; volume %+.2f %%, least V/V0 %.2f\n", s.peak_n,
           s.dip_n, 1e3 * s.bulge_m[0], 1e3 * s.bulge_m[1], 100 * s.grown, s.least);
    return s;
}

NIGHT_TEST("pressed 1 cm and held for 30 s (847 nodes), gas bulges the sides and keeps the volume, and no cell inverts")
{
    shape a = press_shape(press_def(2), 30);
    shape b = press_shape(with_gas(press_def(2), KN_PRESSURE_CELLS, 0.02), 30);
    shape c = press_shape(with_gas(press_def(2), KN_PRESSURE_CELLS, 1), 30);
    for (int k = 0; k < 2; k++) CHECK(b.bulge_m[k] >= 3 * a.bulge_m[k] && c.bulge_m[k] >= 2 * a.bulge_m[k]);
    CHECK(fabs(b.grown) <= 0.015 && fabs(c.grown) <= 0.03 && a.grown < -0.08);
    CHECK(b.dip_n <= 0.01 * b.peak_n && c.dip_n <= 0.01 * c.peak_n);
    CHECK(b.least > 0.5 && c.least > 0.5);
    CHECK(c.peak_n > 23 && c.peak_n < 27);
    // The purpose of the gas: without gas, cells beside the plate turn inside out and the force falls on the way
    // down.
    CHECK(a.least < 0 && a.dip_n > 0.3 * a.peak_n);
}

TEST("one pressure for the whole object keeps its volume, but not the volume of the cells beside the plate")
{
    shape a = press_shape(press_def(1), 10);
    shape s = press_shape(with_gas(press_def(1), KN_PRESSURE_OBJECT, 1), 10);
    CHECK(fabs(s.grown) < 0.03 && fabs(s.grown) < 0.25 * fabs(a.grown));
    CHECK(s.least < 0.5);
}

TEST("a flat object bulges like a block, stays in its plane, and doubles its force at twice the thickness")
{
    shape a = press_shape(flat(press_def(2)), 5);
    shape b = press_shape(with_gas(flat(press_def(2)), KN_PRESSURE_CELLS, 0.02), 5);
    shape c = press_shape(with_gas(flat(press_def(2)), KN_PRESSURE_CELLS, 1), 5);
    CHECK(b.bulge_m[0] >= 3 * a.bulge_m[0] && c.bulge_m[0] >= 2 * a.bulge_m[0]);
    CHECK(fabs(b.grown) <= 0.03 && fabs(c.grown) <= 0.05 && b.least > 0.5 && c.least > 0.5);
    CHECK(a.stayed && b.stayed && c.stayed);
    // Roots of 2 are rounded. With a wide tolerance a rounding may decide whether a step takes one more iteration.
    kn_model_def thin = tight(with_gas(flat(press_def(2)), KN_PRESSURE_CELLS, 1), 1e-9), thick = thin;
    thick.thickness_m *= 2;
    shape d = press_shape(thick, 5), e = press_shape(thin, 5);
    CHECK_NEAR(d.peak_n, 2 * e.peak_n, 1e-6 * d.peak_n);
    CHECK_NEAR(d.bulge_m[0], e.bulge_m[0], 1e-6 * e.bulge_m[0]);
}

// Return the force of a disc of 1.5 cm radius that presses the middle 5 mm deep at 1 cm/s. The hand is aside_m off the
// plane.
enum { TICKS = 700 };
static void press_disc(double thickness_m, double aside_m, double force_n[TICKS])
{
    const press p = {.depth_m = 0.005, .hold_s = 0.2};
    kn_model_def def = flat(ball_def(2));
    def.thickness_m = thickness_m;
    def.probe[0].radius_m = 0.015;
    LATTICE l = lattice_of(def);
    for (int i = 0; i < TICKS; i++) {
        l.in = press_input(l.model, &p, (i + 1) * 1e-3);
        double *at = l.in.probe[0].position_m;
        at[1] = aside_m;
        if (i == 0) CHECK_NEAR(kn_clearance(l.model, l.state, 0, at, (const double[]){1, 0, 0, 0}), 0, 1e-9);
        step(&l);
        force_n[i] = l.out.probe[0].force_n[2];
        CHECK(l.out.probe[0].force_n[1] == 0 && force_n[i] >= 0);
    }
}

TEST("a ball acts on a flat object as a disc: its y position has no effect, and twice the thickness doubles the force")
{
    static double thin[TICKS], thick[TICKS], aside[TICKS];
    double peak = 0, sum = 0;
    press_disc(0.01, 0, thin), press_disc(0.02, 0, thick), press_disc(0.01, 0.05, aside);
    for (int i = 0; i < TICKS; i++) peak = fmax(peak, thin[i]), sum += fabs(thin[i] - (i ? thin[i - 1] : 0));
    printf("     peak %.3f N, total variation %.2f of it\n", peak, sum / peak);
    CHECK(peak > 0.3 && sum < 2.2 * peak);
    for (int i = 0; i < TICKS; i++) {
        CHECK_NEAR(thick[i], 2 * thin[i], 2e-4 * peak);
        CHECK_NEAR(aside[i], thin[i], 0);
    }
}

TEST("an object with gas that nobody touches stays unchanged to the bit")
{
    for (int t = 0; t < 4; t++) {
        kn_model_def def = with_gas(press_def(2), t & 1 ? KN_PRESSURE_OBJECT : KN_PRESSURE_CELLS, 1);
        LATTICE l = lattice_of(t & 2 ? flat(def) : def);
        uint64_t hash = hash_of(&l);
        steps(&l, 20);
        CHECK(hash_of(&l) == hash);
    }
}

// Return the mean number of CG iterations in which a step reaches 1e-4 of its initial residual.
static double iterations(kn_model_def def)
{
    const press p = {.depth_m = 0.01, .hold_s = 1};
    def = tight(def, 1e-4);
    def.solver.iterations = 1;
    LATTICE l = lattice_of(def);
    double sum = 0;
    for (int i = 0; i < 1500; i++) {
        l.state->residual_scale = 0; // scale of this step alone
        press_step(&l, &p);
        sum += l.out.iterations;
    }
    return sum / 1500;
}

TEST("gas with full diagonals needs about as many CG iterations as no gas, and over three times as many without "
     "diagonals")
{
    kn_model_def sides = with_gas(press_def(1), KN_PRESSURE_CELLS, 1);
    double without = iterations(press_def(1)), full = iterations(sides);
    double weak = iterations(with_gas(press_def(1), KN_PRESSURE_CELLS, 0.02));
    sides.structure = KN_STRUCTURE_AXIS;
    double none = iterations(sides);
    printf("     without gas %.1f, with it %.1f; diagonals of 2 %% %.1f, none %.1f\n", without, full, weak, none);
    CHECK(full < 1.1 * without && weak < 2 * without && none > 3 * without);
}
