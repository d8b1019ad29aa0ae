// The first paper's structures: diagonals, and gas in the cells or in the object, in a block and in a flat object.
#include "tests/check.h"
#include "tests/dice.h"
#include "tests/physics/press.h"

static const double level[4] = {1, 0, 0, 0};

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
    double peak_n, end_n, dip_n; // dip: largest fall of the force while the plate goes down
    double bulge_m[2];           // largest outward displacement of a side along x, y
    double grown, least;         // relative change of the object's volume; smallest V/V0 of a cell seen
    bool stayed;                 // the object stayed in its plane
} shape;

static void measure_cells(const kn_model *m, const kn_state *state, const kn_cell *cells, int count, shape *s)
{
    double v0 = m->grid.spacing_m * m->grid.spacing_m * m->grid.depth_m, sum = 0;
    for (int c = 0; c < count; c++) {
        double corner[8][3] = {{0}}, gradient[8][3];
        for (int i = 0; i < 8 && cells[c].corner[i] >= 0; i++)
            kn_state_position(m, state, cells[c].corner[i], corner[i]);
        double volume = kn_cell_volume(&m->grid, (const double(*)[3])corner, gradient);
        s->least = fmin(s->least, volume / v0);
        sum += volume;
    }
    s->grown = sum / (v0 * count) - 1;
}

static void measure_sides(const kn_model *m, const kn_state *state, shape *s)
{
    s->stayed = true;
    for (int i = 0; i < m->node_count; i++) {
        double u[3];
        displacement(m, state, i, u);
        if (u[1] != 0) s->stayed = false;
        for (int k = 0; k < 2; k++) {
            double rest = m->rest_m[i][k], half = 0.5 * (m->grid.n[k] - 1) * m->grid.spacing_m;
            if (half > 0 && fabs(rest) > half - 1e-9) s->bulge_m[k] = fmax(s->bulge_m[k], rest > 0 ? u[k] : -u[k]);
        }
    }
}

// Press down by 1 cm at 1 cm/s and hold.
static shape press_shape(kn_model_def def, double hold_s)
{
    const press p = {.depth_m = 0.01, .hold_s = hold_s};
    OWN(kn_model) *m = build(&def);
    OWN(kn_state) *state = kn_state_create(m);
    int count = kn_grid_cells(&m->grid, NULL);
    kn_cell *cells = malloc((size_t)count * sizeof *cells);
    if (!state || !cells) abort();
    kn_grid_cells(&m->grid, cells);
    shape s = {.least = 1};
    for (int i = 1; i <= (int)lround(press_up_s(&p) * 1000); i++) {
        kn_input in = press_input(m, &p, i * 1e-3);
        kn_output out;
        CHECK(kn_step(m, state, &in, &out) == KN_OK);
        s.end_n = out.probe[0].force_n[2];
        s.peak_n = fmax(s.peak_n, s.end_n);
        if (i * 1e-3 < press_down_s(&p) - PRESS_RAMP) s.dip_n = fmax(s.dip_n, s.peak_n - s.end_n);
        if (i % 50 == 0) measure_cells(m, state, cells, count, &s);
    }
    measure_cells(m, state, cells, count, &s);
    measure_sides(m, state, &s);
    free(cells);
    printf("     peak %.2f N, end %.2f N, dip %.3f N; out by %.2f and %.2f mm; volume %+.2f %%, least V/V0 %.2f\n",
           s.peak_n, s.end_n, s.dip_n, 1e3 * s.bulge_m[0], 1e3 * s.bulge_m[1], 100 * s.grown, s.least);
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
    kn_model_def thin = with_gas(flat(press_def(2)), KN_PRESSURE_CELLS, 1), thick;
    thin.solver.precision = KN_PRECISION_F64;
    thin.solver.tolerance = 1e-9;
    thin.solver.iterations_max = 400;
    thick = thin;
    thick.thickness_m *= 2;
    shape d = press_shape(thick, 5), e = press_shape(thin, 5);
    CHECK_NEAR(d.peak_n, 2 * e.peak_n, 1e-6 * d.peak_n);
    CHECK_NEAR(d.bulge_m[0], e.bulge_m[0], 1e-6 * e.bulge_m[0]);
}

// Run a disc of 1.5 cm radius that presses the middle 5 mm deep at 1 cm/s. The hand is aside_m off the plane.
static run press_disc(double thickness_m, double aside_m)
{
    kn_model_def def = flat(ball_def(2));
    def.thickness_m = thickness_m;
    def.probe[0].radius_m = 0.015;
    const press p = {.depth_m = 0.005, .hold_s = 0.2};
    OWN(kn_model) *m = build(&def);
    OWN(kn_state) *state = kn_state_create(m);
    run r = {.samples = 700};
    r.force_n = calloc((size_t)r.samples, sizeof *r.force_n);
    if (!state || !r.force_n) abort();
    for (int i = 0; i < r.samples; i++) {
        kn_input in = press_input(m, &p, (i + 1) * 1e-3);
        kn_output out;
        in.probe[0].position_m[1] = aside_m;
        if (i == 0) CHECK_NEAR(kn_clearance(m, state, 0, in.probe[0].position_m, level), 0, 1e-9);
        CHECK(kn_step(m, state, &in, &out) == KN_OK);
        memcpy(r.force_n[i], out.probe[0].force_n, sizeof *r.force_n);
        CHECK(out.probe[0].force_n[1] == 0 && out.probe[0].force_n[2] >= 0);
    }
    return r;
}

TEST("a ball acts on a flat object as a disc: its y position has no effect, and twice the thickness doubles the force")
{
    AT_END(run_free) run thin = press_disc(0.01, 0), thick = press_disc(0.02, 0), aside = press_disc(0.01, 0.05);
    printf("     peak %.3f N, total variation %.2f of it\n", peak_n(&thin), variation(&thin));
    CHECK(peak_n(&thin) > 0.3 && variation(&thin) < 2.2);
    for (int i = 0; i < thin.samples; i++) {
        CHECK_NEAR(thick.force_n[i][2], 2 * thin.force_n[i][2], 1e-4 * peak_n(&thick));
        CHECK_NEAR(aside.force_n[i][2], thin.force_n[i][2], 0);
    }
}

// --- against Runge-Kutta --------------------------------------------------------------------------------------------

static void compare(const char *name, kn_model_def implicit)
{
    const press p = {.depth_m = 0.002, .hold_s = 0.03};
    kn_model_def exact = implicit;
    exact.solver.kind = KN_SOLVER_RK4;
    exact.solver.precision = KN_PRECISION_F64;
    exact.solver.mass_scale = implicit.solver.mass_scale = 300;
    exact.solver.dt_s = 2.6e-5;
    implicit.solver.dt_s = 2.5e-4;
    kn_model_def loose = implicit;
    loose.pressure = KN_PRESSURE_NONE;
    AT_END(run_free) run oracle = press_run(&exact, &p, 0.33, 9e-3), fast = press_run(&implicit, &p, 0.33, 9e-3);
    implicit = converged(implicit);
    AT_END(run_free) run best = press_run(&implicit, &p, 0.33, 9e-3), without = press_run(&loose, &p, 0.33, 9e-3);
    printf("     %s: peak %.3f N, Runge-Kutta %.3f N, without gas %.3f N; force %.2f %% (f32, blend %.2f %%), dent "
           "%.2f %% apart\n",
           name, peak_n(&best), peak_n(&oracle), peak_n(&without), 100 * force_error(&best, &oracle),
           100 * force_error(&fast, &oracle), 100 * shape_error(&best, &oracle));
    CHECK(oracle.status == KN_OK && best.status == KN_OK && fast.status == KN_OK);
    CHECK(peak_n(&oracle) > 1.05 * peak_n(&without));
    CHECK_NEAR(force_error(&best, &oracle), 0, 0.01);
    CHECK_NEAR(shape_error(&best, &oracle), 0, 0.01);
    CHECK_NEAR(force_error(&fast, &oracle), 0, 0.02);
}

TEST("with gas in each cell the implicit step of a flat object agrees with explicit Runge-Kutta within 1 %")
{
    compare("cells, flat", with_gas(flat(press_def(1)), KN_PRESSURE_CELLS, 1));
}

NIGHT_TEST("a block, one pressure for the whole object, and weak diagonals agree with Runge-Kutta within 1 %, too")
{
    compare("cells, block", with_gas(press_def(1), KN_PRESSURE_CELLS, 1));
    compare("object, flat", with_gas(flat(press_def(1)), KN_PRESSURE_OBJECT, 1));
    compare("object, block", with_gas(press_def(1), KN_PRESSURE_OBJECT, 1));
    compare("cells, weak diagonals", with_gas(press_def(1), KN_PRESSURE_CELLS, 0.1));
}

// --- properties without influence
// -----------------------------------------------------------------------------------

static double *component(const kn_model *m, void *field, int node, int k)
{
    return (double *)field + m->offset[node] + (size_t)k * m->stride;
}

static kn_model_def free_body(kn_pressure pressure)
{
    kn_model_def def = with_gas(press_def(1), pressure, 0.3);
    def.support = KN_SUPPORT_NONE;
    def.probe_count = 0;
    def.nodes[0] = 5, def.nodes[1] = 4, def.nodes[2] = 6;
    def.solver.precision = KN_PRECISION_F64;
    def.solver.tolerance = 1e-15; // otherwise a rounding may decide whether a step takes one more iteration
    def.solver.iterations_max = 500;
    return def;
}

TEST("gas adds no net force: a free body keeps its momentum to 1e-6 in 200 steps")
{
    for (kn_pressure pressure = KN_PRESSURE_CELLS; pressure <= KN_PRESSURE_OBJECT; pressure++) {
        kn_model_def def = free_body(pressure);
        OWN(kn_model) *m = build(&def);
        OWN(kn_state) *state = kn_state_create(m);
        uint64_t seed = 7;
        double before[3] = {0}, after[3] = {0}, size = 0;
        for (int i = 0; i < m->node_count; i++)
            for (int k = 0; k < 3; k++) {
                double v = *component(m, state->velocity, i, k) = 0.2 * kn_dice_in(&seed, -1, 1);
                before[k] += m->node_mass_kg[i] * v;
                size += m->node_mass_kg[i] * fabs(v);
            }
        kn_input in = {0};
        kn_output out;
        for (int i = 0; i < 200; i++) kn_step(m, state, &in, &out);
        for (int i = 0; i < m->node_count; i++)
            for (int k = 0; k < 3; k++) after[k] += m->node_mass_kg[i] * *component(m, state->velocity, i, k);
        for (int k = 0; k < 3; k++) CHECK_NEAR(after[k], before[k], 1e-6 * size);
    }
}

// Apply a general rotation, by Rodrigues about (1, 2, 3).
static void rotate(const double x[3], double out[3])
{
    const double angle = 0.7, axis[3] = {1 / sqrt(14), 2 / sqrt(14), 3 / sqrt(14)};
    double along = axis[0] * x[0] + axis[1] * x[1] + axis[2] * x[2];
    for (int k = 0; k < 3; k++) {
        int u = (k + 1) % 3, v = (k + 2) % 3;
        out[k] =
            cos(angle) * x[k] + sin(angle) * (axis[u] * x[v] - axis[v] * x[u]) + (1 - cos(angle)) * along * axis[k];
    }
}

TEST("a rotated block with gas moves like the original block, rotated, to 1e-10 m")
{
    for (kn_pressure pressure = KN_PRESSURE_CELLS; pressure <= KN_PRESSURE_OBJECT; pressure++) {
        kn_model_def def = free_body(pressure);
        OWN(kn_model) *m = build(&def);
        kn_state *state[2] = {kn_state_create(m), kn_state_create(m)};
        uint64_t seed = 11;
        for (int i = 0; i < m->node_count; i++) {
            double v[3], turned[3], place[3];
            for (int k = 0; k < 3; k++) v[k] = 0.1 * kn_dice_in(&seed, -1, 1);
            rotate(v, turned);
            rotate(m->rest_m[i], place);
            for (int k = 0; k < 3; k++) {
                *component(m, state[0]->velocity, i, k) = v[k];
                *component(m, state[1]->velocity, i, k) = turned[k];
                *component(m, state[1]->displacement, i, k) = place[k] - m->rest_m[i][k];
            }
        }
        kn_input in = {0};
        kn_output out;
        for (int i = 0; i < 300; i++)
            for (int s = 0; s < 2; s++) CHECK(kn_step(m, state[s], &in, &out) == KN_OK);
        double worst = 0, farthest = 0;
        for (int i = 0; i < m->node_count; i++) {
            double x[2][3], turned[3];
            for (int s = 0; s < 2; s++) kn_state_position(m, state[s], i, x[s]);
            rotate(x[0], turned);
            for (int k = 0; k < 3; k++) {
                worst = fmax(worst, fabs(turned[k] - x[1][k]));
                farthest = fmax(farthest, fabs(x[0][k] - m->rest_m[i][k]));
            }
        }
        printf("     moved by %.2f mm, apart by %.1e m\n", 1e3 * farthest, worst);
        CHECK(farthest > 1e-4 && worst < 1e-10);
        for (int s = 0; s < 2; s++) kn_state_destroy(state[s]);
    }
}

TEST("an object with gas that nobody touches stays unchanged to the bit")
{
    for (int t = 0; t < 4; t++) {
        kn_model_def def = with_gas(press_def(2), t & 1 ? KN_PRESSURE_OBJECT : KN_PRESSURE_CELLS, 1);
        if (t & 2) def = flat(def);
        OWN(kn_model) *m = build(&def);
        OWN(kn_state) *state = kn_state_create(m);
        uint64_t hash = kn_state_hash(m, state);
        kn_input in = {0};
        kn_output out;
        for (int i = 0; i < 20; i++) kn_step(m, state, &in, &out);
        CHECK(kn_state_hash(m, state) == hash);
    }
}

TEST("with gas every instruction set gives the same bits, in rows of one to three vectors, block and flat")
{
    static const int blocks[][3] = {{6, 5, 4}, {20, 3, 3}, {3, 3, 40}, {6, 1, 5}, {3, 1, 20}, {20, 1, 3}};
    const press p = {.depth_m = 0.003, .hold_s = 0.02};
    for (int t = 0; t < 6 * 2 * 2; t++) {
        kn_model_def def = with_gas(press_def(1), t / 6 % 2 ? KN_PRESSURE_OBJECT : KN_PRESSURE_CELLS, 0.1);
        memcpy(def.nodes, blocks[t % 6], sizeof def.nodes);
        if (def.nodes[1] == 1) def.thickness_m = 0.02;
        def.solver.precision = (kn_precision)(t / 12);
        def.solver.isa = KN_ISA_BASE;
        AT_END(run_free) run base = press_run(&def, &p, 0.1, 1e-3);
        CHECK(base.status == KN_OK && peak_n(&base) > 0.1);
        for (int isa = KN_ISA_AVX2; isa <= KN_ISA_AVX512; isa++) {
            if (!kn_isa_supported((kn_isa)isa)) continue;
            def.solver.isa = (kn_isa)isa;
            AT_END(run_free) run other = press_run(&def, &p, 0.1, 1e-3);
            CHECK(other.hash == base.hash);
        }
    }
}

TEST("with gas a press turned by 90 degrees about z gives the same force, although the memory order differs")
{
    const press p = {.depth_m = 0.004, .hold_s = 0.1};
    kn_model_def along = with_gas(press_def(1), KN_PRESSURE_CELLS, 0.1), across = along;
    along.nodes[0] = 7, along.nodes[1] = 5;
    along.probe[0].size_m[0] = 0.01, along.probe[0].size_m[1] = 0.04;
    across.nodes[0] = 5, across.nodes[1] = 7;
    across.probe[0].size_m[0] = 0.04, across.probe[0].size_m[1] = 0.01;
    along.solver.precision = across.solver.precision = KN_PRECISION_F64;
    along.solver.tolerance = across.solver.tolerance = 1e-12;
    along.solver.iterations_max = across.solver.iterations_max = 400;
    AT_END(run_free) run a = press_run(&along, &p, 1, 1e-3), b = press_run(&across, &p, 1, 1e-3);
    CHECK(peak_n(&a) > 1);
    CHECK_NEAR(force_error(&a, &b), 0, 1e-9);
}

// Return the mean number of CG iterations in which a step reaches 1e-4 of its initial residual.
static double iterations(kn_model_def def)
{
    const press p = {.depth_m = 0.01, .hold_s = 1};
    def.solver.precision = KN_PRECISION_F64;
    def.solver.iterations = 1;
    def.solver.iterations_max = 1000;
    def.solver.tolerance = 1e-4;
    OWN(kn_model) *m = build(&def);
    OWN(kn_state) *state = kn_state_create(m);
    double sum = 0;
    int steps = 1500;
    for (int i = 1; i <= steps; i++) {
        kn_input in = press_input(m, &p, i * 1e-3);
        kn_output out;
        state->residual_scale = 0; // scale of this step alone
        kn_step(m, state, &in, &out);
        sum += out.iterations;
    }
    return sum / steps;
}

TEST("gas with full diagonals needs about as many CG iterations as no gas, and over three times as many without "
     "diagonals")
{
    double without = iterations(press_def(1)), full = iterations(with_gas(press_def(1), KN_PRESSURE_CELLS, 1));
    double weak = iterations(with_gas(press_def(1), KN_PRESSURE_CELLS, 0.02));
    kn_model_def sides = with_gas(press_def(1), KN_PRESSURE_CELLS, 1);
    sides.structure = KN_STRUCTURE_AXIS;
    double none = iterations(sides);
    printf("     without gas %.1f, with it %.1f; diagonals of 2 %% %.1f, none %.1f\n", without, full, weak, none);
    CHECK(full < 1.1 * without && weak < 2 * without && none > 3 * without);
}

TESTS_MAIN
