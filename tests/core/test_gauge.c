// gate in release: arithmetic, ten times slower with the sanitizers
#include "core/algebra/algebra.h"
#include "core/lattice/measure.h"
#include "core/lattice/lattice.h"
#include "core/solve/kernel.h"
#include "core/scene/scene.h"
#include "tests/lattice.h"

OWNS(kn_gauge, kn_gauge_destroy)

static double measured[4000]; // of the nodes

static void measure(const lattice *l, kn_gauge *gauge, kn_measure what)
{
    CHECK(l->model->node_count <= COUNT(measured));
    kn_gauge_read(gauge, l->state, what, measured);
}

// Displace all nodes by a uniform strain, then turn by an angle about z.
static void stretch(lattice *l, const double strain[3], double angle)
{
    const kn_model *m = l->model;
    const double c = cos(angle), s = sin(angle);
    for (int i = 0; i < m->node_count; i++) {
        double x[3];
        for (int k = 0; k < 3; k++) x[k] = (1 + strain[k]) * m->rest_m[i][k];
        double at[3] = {c * x[0] - s * x[1], s * x[0] + c * x[1], x[2]};
        for (size_t k = 0; k < 3; k++)
            kn_real_set(m, l->state->displacement, m->offset[i] + k * m->stride, at[k] - m->rest_m[i][k]);
    }
}

static double elastic(lattice *l, double ex, double ey, double ez)
{
    kn_energy energy;
    stretch(l, (double[]){ex, ey, ez}, 0);
    CHECK(kn_energy_of(l->model, l->state, &energy));
    return energy.elastic * l->model->def.density_kg_m3 / kn_model_mass(l->model);
}

// Check the von Mises stress of a uniform stretch e along an axis with held sides. Theory gives (C_aa - C_ab) e. The
// constants come from the lattice's energies alone: W(e, 0, 0) = C_aa e^2/2; W(e, e, 0) = (C_aa + C_bb + 2 C_ab)
// e^2/2.
static void check_uniform(kn_model_def def, const char *what)
{
    const double e = 1e-4;
    LATTICE l = lattice_of(def);
    OWN(kn_gauge) *gauge = kn_gauge_create(l.model);
    CHECK(!l.model->composite == !kn_composite_is(&def));
    double c11 = 2 * elastic(&l, e, 0, 0) / (e * e), c22 = 2 * elastic(&l, 0, e, 0) / (e * e);
    double c12 = elastic(&l, e, e, 0) / (e * e) - 0.5 * (c11 + c22), theory = (c11 - c12) * e;
    printf("     %s: (C11 - C12) e = %.4f Pa\n", what, theory);
    for (int turned = 0; turned < 2; turned++) {
        stretch(&l, (double[]){e, 0, 0}, turned ? M_PI / 6 : 0);
        measure(&l, gauge, KN_MEASURE_STRESS);
        for (int i = 0; i < l.model->node_count; i++) CHECK_NEAR(measured[i], theory, (turned ? 4e-3 : 2e-3) * theory);
    }
    stretch(&l, (double[]){e, e, e}, 0);
    measure(&l, gauge, KN_MEASURE_STRESS);
    for (int i = 0; i < l.model->node_count; i++) CHECK(measured[i] < 2e-3 * theory);
    measure(&l, gauge, KN_MEASURE_DISPLACEMENT);
    for (int i = 0; i < l.model->node_count; i++) {
        const double *x = l.model->rest_m[i];
        CHECK_NEAR(measured[i], e * sqrt(kn_dot(x, x)), 1e-9);
    }
}

TEST("under a uniform strain the von Mises stress is the continuum's at every node, corners included")
{
    kn_model_def def = press_def(1);
    def.material = jelly();
    def.solver.precision = KN_PRECISION_F64;
    check_uniform(def, "block");
    def.diagonal_stiffness = 3.0 / 11;
    check_uniform(def, "isotropic block");
    for (int k = 0; k < 3; k++) {
        def.nodes[k] = k < 2 ? 11 : 7;
        def.fine[0][k] = 2, def.fine[1][k] = k < 2 ? 8 : 6;
    }
    check_uniform(def, "block of two resolutions");
}

typedef struct marks { // largest value of any node
    double stress_pa, residual;
} marks;

// Return the marks after so many seconds of a press.
static marks after(kn_model_def def, const press *p, double seconds)
{
    LATTICE l = lattice_of(def);
    OWN(kn_gauge) *gauge = kn_gauge_create(l.model);
    marks r = {0};
    press_until(&l, p, (int)lround(seconds / def.solver.dt_s));
    measure(&l, gauge, KN_MEASURE_STRESS);
    for (int i = 0; i < l.model->node_count; i++) r.stress_pa = fmax(r.stress_pa, measured[i]);
    measure(&l, gauge, KN_MEASURE_RESIDUAL);
    for (int i = 0; i < l.model->node_count; i++) r.residual = fmax(r.residual, measured[i]);
    printf("     after %.2f s %.1f Pa, %.4f\n", seconds, r.stress_pa, r.residual);
    return r;
}

static const press paced = {.depth_m = 0.004, .hold_s = 2, .pace = 1};

TEST("held dough loses stress while its residual deformation grows; after lifting, the residual deformation stays")
{
    kn_model_def def = press_def(1);
    marks pressed = after(def, &paced, 0.4), held = after(def, &paced, 2.3), lifted = after(def, &paced, 6);
    CHECK(held.stress_pa < 0.5 * pressed.stress_pa && held.residual > pressed.residual);
    CHECK(lifted.stress_pa < 0.3 * pressed.stress_pa && lifted.residual > 0.8 * held.residual && held.residual > 0.05);
}

TEST("after lifting, jelly has almost no residual deformation and clay keeps more than 5 %")
{
    kn_model_def def = press_def(1);
    def.material = jelly();
    marks jelly_pressed = after(def, &paced, 0.4), jelly_lifted = after(def, &paced, 6);
    def.material = clay();
    marks clay_lifted = after(def, &paced, 6);
    CHECK(jelly_pressed.stress_pa > 100);
    CHECK(jelly_lifted.stress_pa < 0.05 * jelly_pressed.stress_pa && jelly_lifted.residual < 0.02);
    CHECK(clay_lifted.residual > 0.05);
}

TEST("the implicit and the fixed-point solver give the same stress within 10 % and residual within 5 %")
{
    kn_model_def def = press_def(1);
    marks implicit = after(def, &paced, 1);
    def.solver.kind = KN_SOLVER_FIXED;
    def.solver.precision = KN_PRECISION_F64;
    def.solver.passes = 4, def.solver.iterations = 8;
    marks fixed = after(def, &paced, 1);
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
    kn_model_def exact = def, free_def = converged(def);
    exact.solver.kind = KN_SOLVER_RK4;
    exact.solver.precision = KN_PRECISION_F64;
    exact.solver.dt_s = 1.8e-5; // just below the stability limit
    free_def.material.stroke[0] = free_def.material.stroke[1] = 0;
    marks implicit = after(converged(def), &p, 0.12), rk4 = after(exact, &p, 0.12), without = after(free_def, &p, 0.12);
    CHECK(without.residual > 1.2 * implicit.residual); // the stops are reached
    CHECK(implicit.residual < 0.51 / 0.5 - 1 + 1e-6 && rk4.residual < 0.51 / 0.5 - 1 + 1e-6);
    CHECK_NEAR(rk4.stress_pa, implicit.stress_pa, 0.02 * implicit.stress_pa);
    CHECK_NEAR(rk4.residual, implicit.residual, 0.02 * implicit.residual);
}
