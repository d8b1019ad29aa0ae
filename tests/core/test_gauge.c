// gate in release: arithmetic, ten times slower with the sanitizers
#include "core/lattice/measure.h"
#include "core/lattice/lattice.h"
#include "core/solve/kernel.h"
#include "core/scene/scene.h"
#include "tests/physics/press.h"
#include "tests/check.h"

OWNS(kn_gauge, kn_gauge_destroy)

// Displace all nodes by a uniform strain, at rest.
static void stretch(const kn_model *m, kn_state *state, const double strain[3])
{
    for (int i = 0; i < m->node_count; i++)
        for (size_t k = 0; k < 3; k++)
            kn_real_set(m, state->displacement, m->offset[i] + k * m->stride, strain[k] * m->rest_m[i][k]);
}

// Stretch by e along x, then turn by 30 degrees.
static void turn(const kn_model *m, kn_state *state, double e)
{
    const double c = cos(M_PI / 6), s = sin(M_PI / 6);
    for (int i = 0; i < m->node_count; i++) {
        const double *x = m->rest_m[i], a = (1 + e) * x[0],
                     u[3] = {c * a - s * x[1] - x[0], s * a + c * x[1] - x[1], 0};
        for (size_t k = 0; k < 3; k++) kn_real_set(m, state->displacement, m->offset[i] + k * m->stride, u[k]);
    }
}

static double volume(const kn_model *m) { return kn_model_mass(m) / m->def.density_kg_m3; }

static double elastic(const kn_model *m, kn_state *state, double ex, double ey, double ez)
{
    kn_energy energy;
    stretch(m, state, (double[]){ex, ey, ez});
    CHECK(kn_energy_of(m, state, &energy));
    return energy.elastic / volume(m);
}

// Check the von Mises stress of a uniform stretch e along an axis with held sides. Theory gives (C_aa - C_ab) e. The
// constants come from the lattice's energies alone: W(e, 0, 0) = C_aa e^2/2; W(e, e, 0) = (C_aa + C_bb + 2 C_ab)
// e^2/2.
static void check_uniform(const kn_model_def *def, const char *what, double share)
{
    const double e = 1e-4;
    OWN(kn_model) *m = build(def);
    OWN(kn_state) *state = kn_state_create(m);
    OWN(kn_gauge) *gauge = kn_gauge_create(m);
    double *value = malloc((size_t)m->node_count * sizeof *value), least = INFINITY, most = 0, most_even = 0;
    CHECK(!m->composite == !kn_composite_is(def));
    double c11 = 2 * elastic(m, state, e, 0, 0) / (e * e), c22 = 2 * elastic(m, state, 0, e, 0) / (e * e);
    double c12 = elastic(m, state, e, e, 0) / (e * e) - 0.5 * (c11 + c22);
    stretch(m, state, (double[]){e, 0, 0});
    kn_gauge_read(gauge, state, KN_MEASURE_STRESS, value);
    for (int i = 0; i < m->node_count; i++) least = fmin(least, value[i]), most = fmax(most, value[i]);
    printf("     %s: von Mises %.4f to %.4f Pa, (C11 - C12) e = %.4f Pa\n", what, least, most, (c11 - c12) * e);
    CHECK_NEAR(least, (c11 - c12) * e, share * (c11 - c12) * e);
    CHECK_NEAR(most, (c11 - c12) * e, share * (c11 - c12) * e);
    turn(m, state, e);
    kn_gauge_read(gauge, state, KN_MEASURE_STRESS, value);
    for (int i = 0; i < m->node_count; i++) CHECK_NEAR(value[i], (c11 - c12) * e, 2 * share * (c11 - c12) * e);
    stretch(m, state, (double[]){e, e, e});
    kn_gauge_read(gauge, state, KN_MEASURE_STRESS, value);
    for (int i = 0; i < m->node_count; i++) most_even = fmax(most_even, value[i]);
    CHECK(most_even < 2e-3 * (c11 - c12) * e);
    kn_gauge_read(gauge, state, KN_MEASURE_DISPLACEMENT, value);
    for (int i = 0; i < m->node_count; i++) {
        const double *x = m->rest_m[i];
        CHECK_NEAR(value[i], e * sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]), 1e-9);
    }
    free(value);
}

TEST("under a uniform strain the von Mises stress is the continuum's at every node, corners included")
{
    kn_model_def def = press_def(1);
    def.material = jelly();
    def.solver.precision = KN_PRECISION_F64;
    check_uniform(&def, "block", 2e-3);
    def.diagonal_stiffness = 3.0 / 11;
    check_uniform(&def, "isotropic block", 2e-3);
    for (int k = 0; k < 3; k++) {
        def.nodes[k] = k < 2 ? 11 : 7;
        def.fine[0][k] = 2, def.fine[1][k] = k < 2 ? 8 : 6;
    }
    check_uniform(&def, "block of two resolutions", 2e-3);
}

typedef struct marks { // largest value of any node
    double stress_pa, residual;
} marks;

static marks look(kn_gauge *gauge, const kn_model *m, const kn_state *state)
{
    double value[4000];
    marks r = {0};
    CHECK(m->node_count <= 4000);
    kn_gauge_read(gauge, state, KN_MEASURE_STRESS, value);
    for (int i = 0; i < m->node_count; i++) r.stress_pa = fmax(r.stress_pa, value[i]);
    kn_gauge_read(gauge, state, KN_MEASURE_RESIDUAL, value);
    for (int i = 0; i < m->node_count; i++) r.residual = fmax(r.residual, value[i]);
    return r;
}

// Return the marks after so many seconds of a press.
static marks after(const kn_model_def *def, const press *p, double seconds)
{
    OWN(kn_model) *m = build(def);
    OWN(kn_state) *state = kn_state_create(m);
    OWN(kn_gauge) *gauge = kn_gauge_create(m);
    kn_output out;
    const double dt = def->solver.dt_s;
    for (int i = 1; i <= (int)lround(seconds / dt); i++) {
        kn_input in = press_input(m, p, i * dt);
        CHECK(kn_step(m, state, &in, &out) == KN_OK);
    }
    marks r = look(gauge, m, state);
    return r;
}

static const press paced = {.depth_m = 0.004, .hold_s = 2, .pace = 1};

TEST("held dough loses stress while its residual deformation grows; after lifting, the residual deformation stays")
{
    kn_model_def def = press_def(1);
    def.material = dough;
    marks pressed = after(&def, &paced, 0.4), held = after(&def, &paced, 2.3), lifted = after(&def, &paced, 6);
    printf("     pressed %.0f Pa, %.3f; held %.0f Pa, %.3f; lifted %.0f Pa, %.3f\n", pressed.stress_pa,
           pressed.residual, held.stress_pa, held.residual, lifted.stress_pa, lifted.residual);
    CHECK(held.stress_pa < 0.5 * pressed.stress_pa && held.residual > pressed.residual);
    CHECK(lifted.stress_pa < 0.3 * pressed.stress_pa && lifted.residual > 0.8 * held.residual && held.residual > 0.05);
}

TEST("after lifting, jelly has almost no residual deformation and clay keeps more than 5 %")
{
    kn_model_def def = press_def(1);
    def.material = jelly();
    marks jelly_pressed = after(&def, &paced, 0.4), jelly_lifted = after(&def, &paced, 6);
    def.material = clay();
    marks clay_lifted = after(&def, &paced, 6);
    printf("     jelly pressed %.0f Pa, %.4f, lifted %.1f Pa, %.4f; clay lifted %.3f\n", jelly_pressed.stress_pa,
           jelly_pressed.residual, jelly_lifted.stress_pa, jelly_lifted.residual, clay_lifted.residual);
    CHECK(jelly_pressed.stress_pa > 100);
    CHECK(jelly_lifted.stress_pa < 0.05 * jelly_pressed.stress_pa && jelly_lifted.residual < 0.02);
    CHECK(clay_lifted.residual > 0.05);
}

TEST("the implicit and the fixed-point solver give the same stress within 10 % and residual within 5 %")
{
    kn_model_def def = press_def(1);
    def.material = dough;
    marks implicit = after(&def, &paced, 1);
    def.solver.kind = KN_SOLVER_FIXED;
    def.solver.precision = KN_PRECISION_F64;
    def.solver.passes = 4, def.solver.iterations = 8;
    marks fixed = after(&def, &paced, 1);
    printf("     implicit %.1f Pa, %.4f; integers %.1f Pa, %.4f\n", implicit.stress_pa, implicit.residual,
           fixed.stress_pa, fixed.residual);
    CHECK_NEAR(fixed.stress_pa, implicit.stress_pa, 0.1 * implicit.stress_pa);
    CHECK_NEAR(fixed.residual, implicit.residual, 0.05 * implicit.residual);
}

NIGHT_TEST(
    "at the stops of the dampers the residual deformation ends, and Runge-Kutta's stress equals the implicit solver's")
{
    const press p = {.depth_m = 0.001, .hold_s = 1};
    kn_model_def def = press_def(1);
    def.material.ratio = 0.5;
    def.material.stroke[0] = 0.495;
    def.material.stroke[1] = 0.51; // 2 % shorter to 1 % longer
    def.solver.mass_scale = 100;
    def.solver.dt_s = 2.5e-4;
    kn_model_def exact = def, free_def = def;
    exact.solver.kind = KN_SOLVER_RK4;
    exact.solver.precision = KN_PRECISION_F64;
    exact.solver.dt_s = 1.8e-5; // just below the stability limit
    def = converged(def);
    free_def = converged(free_def);
    free_def.material.stroke[0] = free_def.material.stroke[1] = 0;
    marks implicit = after(&def, &p, 0.12), rk4 = after(&exact, &p, 0.12), without = after(&free_def, &p, 0.12);
    printf("     implicit %.1f Pa, %.4f; Runge-Kutta %.1f Pa, %.4f; without stops %.1f Pa, %.4f\n", implicit.stress_pa,
           implicit.residual, rk4.stress_pa, rk4.residual, without.stress_pa, without.residual);
    CHECK(without.residual > 1.2 * implicit.residual); // the stops are reached
    CHECK(implicit.residual < 0.51 / 0.5 - 1 + 1e-6 && rk4.residual < 0.51 / 0.5 - 1 + 1e-6);
    CHECK_NEAR(rk4.stress_pa, implicit.stress_pa, 0.02 * implicit.stress_pa);
    CHECK_NEAR(rk4.residual, implicit.residual, 0.02 * implicit.residual);
}

TESTS_MAIN
