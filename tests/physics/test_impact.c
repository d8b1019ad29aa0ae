// Impacts, and plates that slow down or are torn away: the result of one step compared with the converged result.
#include "tests/lattice.h"

// Run one step under a plate that arrives from above at a speed. Return the force on the plate.
static double struck(kn_model_def def, double speed_m_s)
{
    LATTICE l = lattice_of(def);
    put(&l, 0, 0, 0, l.model->rest_m[l.model->top[0]][2]);
    move(&l, 0, 0, 0, -speed_m_s, 1);
    return l.out.probe[0].force_n[2];
}

TEST("dough hit at 0.1 to 1 m/s answers in the same millisecond within 5 % of the converged force")
{
    static const double speed[3] = {0.1, 0.3, 1};
    kn_model_def def = press_def(1), best = converged(def);
    best.solver.passes = 100;
    for (int i = 0; i < 3; i++) CHECK_NEAR(struck(def, speed[i]) / struck(best, speed[i]), 1, 0.05);
}

TEST("a plate torn away at 1 m/s takes no node along")
{
    LATTICE l = lattice_of(press_def(1));
    double before[3], after[3];
    int under = l.model->top[l.model->top_count / 2];
    press_until(&l, &(press){.depth_m = 0.002, .hold_s = 1}, 200);
    CHECK(l.out.probe[0].contacts > 0);
    displacement(l.model, l.state, under, before);
    move(&l, 0, 0, 0, 1, 1);
    displacement(l.model, l.state, under, after);
    CHECK(l.out.probe[0].contacts == 0 && l.out.probe[0].force_n[2] == 0);
    CHECK(fabs(after[2] - before[2]) < 1e-4); // a node taken along would move 1 mm
}

TEST("a heavy node accelerated by a plate keeps flying when the plate slows down")
{
    kn_model_def def = press_def(1);
    def.nodes[0] = def.nodes[1] = def.nodes[2] = 1;
    def.structure = KN_STRUCTURE_AXIS;
    def.support = KN_SUPPORT_NONE;
    LATTICE l = lattice_of(def);
    put(&l, 0, 0, 0, 0);
    for (int i = 0; i < 100; i++) // to 0.1 m/s downwards in 50 ms, and to rest in another 50 ms
        move(&l, 0, 0, 0, -0.002 * (i < 50 ? i + 1 : 99 - i), 1);
    double v[3];
    kn_state_velocity(l.model, l.state, 0, v);
    CHECK_NEAR(v[2], -0.1, 3e-3); // the plate lets go one step late
}

TEST("a plate simulated in steps of 0.1 s reaches its pose and does not overshoot")
{
    kn_model_def def = press_def(1);
    def.solver.dt_s = 0.1;
    LATTICE l = lattice_of(def);
    for (int i = 0; i < 20; i++) {
        put(&l, 0, 0, 0, i == 0 ? 0.05 : 0.06); // clear of the block; a jump of 1 cm
        step(&l);
    }
    CHECK_NEAR(l.out.probe[0].position_m[2], 0.06, 1e-12);
}

// Release a block whose upper cells start without any volume. Return the height of the middle of the top after so
// many steps.
static double sprung(kn_model_def def, int count)
{
    LATTICE l = lattice_of(def);
    const kn_model *m = l.model;
    double u[3];
    for (int i = 0; i < m->top_count; i++)
        kn_real_set(m, l.state->displacement, m->offset[m->top[i]] + 2 * m->stride, -def.spacing_m);
    steps(&l, count);
    displacement(m, l.state, m->top[m->top_count / 2], u);
    return u[2];
}

TEST("gas that expands at 1 MPa in steps of 10 ms moves the dough like the converged solution, at once and later")
{
    static const int counts[3] = {1, 5, 40};
    for (int i = 0; i < 6; i++) {
        kn_model_def def = press_def(1);
        memcpy(def.nodes, (int[]){4, 3, 3}, sizeof def.nodes);
        def.probe_count = 0;
        def.pressure = i < 3 ? KN_PRESSURE_OBJECT : KN_PRESSURE_CELLS;
        def.inside_pressure_pa = 1e6;
        def.solver.dt_s = 0.01;
        kn_model_def best = converged(def);
        best.solver.passes = 100;
        // the error was once up to 1 mm
        CHECK_NEAR(sprung(def, counts[i % 3]), sprung(best, counts[i % 3]), 2e-5);
    }
}

// Stroke dough with a ball in steps of dt: 0.8 s down at 1.5 cm/s and sideways. Return the force, and the mean number of
// linearisations of a step in *lines.
static double stroked(kn_model_def def, double dt, double *lines)
{
    def.solver.dt_s = dt;
    LATTICE l = lattice_of(def);
    const int count = (int)lround(0.8 / dt);
    *lines = 0;
    put(&l, 0, 0, 0, 0.046);
    for (int i = 0; i < count; i++) {
        move(&l, 0, i * dt < 0.4 ? 0.01 : -0.01, 0, -0.015, 1);
        *lines += l.out.passes / (double)count;
    }
    return l.out.probe[0].force_n[2];
}

TEST("a long step takes further linearisations on demand: fewer than 1.5, with an error of 3 % in steps of 10 ms and "
     "1.5 % in steps of 5 ms, as with twelve")
{
    double lines;
    kn_model_def def = kn_model_def_default(), many = def;
    many.solver.passes = 12;
    const double exact = stroked(converged(def), 1e-3, &lines);
    for (int ms = 5; ms <= 10; ms += 5) {
        const double force = stroked(def, 1e-3 * ms, &lines);
        printf("     %d ms: %.2f lines, %+.2f %%\n", ms, lines, 100 * (force / exact - 1));
        CHECK(lines < 1.5);
        CHECK_NEAR(force, exact, 0.003 * ms * exact);
        CHECK_NEAR(stroked(many, 1e-3 * ms, &lines), force, 0.005 * exact);
        CHECK(lines > 3);
    }
}

TEST("in a press that comes to rest the solver needs fewer than 60 linearisations and fewer than 5 at the end")
{
    const press p = {.depth_m = 0.002, .hold_s = 1};
    kn_model_def def = converged(press_def(1));
    def.solver.passes = 100;
    def.solver.linearization = KN_LINEARIZATION_BLEND; // the secant converges too slowly
    LATTICE l = lattice_of(def);
    for (int i = 1; i <= 800; i++) {
        press_step(&l, &p);
        CHECK(l.out.passes < (i < 800 ? 60 : 5));
    }
}

TEST("a scene is refused if its sphere is 500 times or its gas 10000 times as stiff as the object, if it has gas with "
     "0.1 s steps, or if the gas hides the sphere's force in f32")
{
    kn_model_def stiff = ball_def(1), slow = press_def(1), hard = press_def(1), soft = ball_def(1);
    stiff.material = hard.material = jelly();
    slow.pressure = hard.pressure = soft.pressure = KN_PRESSURE_CELLS;
    stiff.probe[0].foundation_n_m3 = 1e14;
    slow.solver.dt_s = 0.1;
    hard.inside_pressure_pa = 1e11;
    soft.probe[0].foundation_n_m3 = 500;
    refused(stiff, "500 times as stiff");
    refused(slow, "at most 30 ms");
    refused(hard, "10000 times as stiff");
    refused(soft, "needs precision: f64");
    soft.solver.precision = KN_PRECISION_F64;
    kn_model_destroy(build(&soft));
}
