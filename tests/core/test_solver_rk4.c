#include "core/solve/solver.h"
#include "tests/lattice.h"

static kn_model_def rk4_def(double dt_s, double mass_scale)
{
    kn_model_def def = press_def(1);
    def.solver.kind = KN_SOLVER_RK4;
    def.solver.precision = KN_PRECISION_F64;
    def.solver.dt_s = dt_s;
    def.solver.mass_scale = mass_scale;
    return def;
}

TEST("dough at rest needs Runge-Kutta steps of 1.9e-7 s (144 nodes) or 4.7e-8 s (847 nodes); 1 kHz is refused with a "
     "message")
{
    static const double limit[3] = {0, 1.87e-7, 4.67e-8}; // 2.785 / lambda_max, computed by hand for the same lattices
    for (int per_cm = 1; per_cm <= 2; per_cm++) {
        kn_model_def def = rk4_def(1e-8, 1);
        memcpy(def.nodes, press_def(per_cm).nodes, sizeof def.nodes);
        def.spacing_m = 0.01 / per_cm;
        OWN(kn_model) *model = build(&def);
        CHECK_NEAR(model->rk4_limit_s, limit[per_cm], 0.02 * limit[per_cm]);
        def.solver.dt_s = 1e-3;
        refused(def, "e-0");
    }
}

TEST("at 2 % below the step limit a small disturbance of a resting lattice decays, and at 2 % above it grows")
{
    for (int above = 0; above < 2; above++) {
        kn_model_def def = rk4_def(1e-8, 1);
        def.material = (kn_material){.k1_pa = 1e3, .c1_pa_s = 2500 * GF_CM2, .damper = KN_DAMPER_NONE};
        def.support = KN_SUPPORT_NONE;
        LATTICE l = lattice_of(def);
        l.model->def.solver.dt_s = l.model->rk4_limit_s * (above ? 1.02 : 0.98);
        double *v = l.state->velocity, energy[2] = {0}; // after 201 and 300 steps
        for (int i = 0; i < l.model->node_count; i++)
            for (size_t k = 0; k < 3; k++) // speeds so small that the lattice stays linear
                v[l.model->offset[i] + k * l.model->stride] = 1e-12 * ((i * 7 + (int)k * 3) % 11 - 5);
        for (int later = 0; later < 2; later++) {
            for (int i = 0; i < (later ? 99 : 201); i++) kn_step(l.model, l.state, l.scratch, &l.in, &l.out);
            for (size_t i = 0; i < kn_grid_field(&l.model->grid, 3); i++) energy[later] += v[i] * v[i];
        }
        CHECK(above ? energy[1] > 100 * energy[0] : energy[1] < energy[0]);
    }
}

// Return the height of a bar of 1 cm after some time under a load. density: of the bar, whose inertia is scaled by 200.
static double loaded_bar(kn_material material, kn_solver kind, double density, double load_n, double dt_s,
                         double seconds)
{
    kn_model_def def = rk4_def(dt_s, 200);
    def.solver.kind = kind;
    def.material = material;
    def.density_kg_m3 = density;
    def.nodes[0] = def.nodes[1] = 1;
    def.nodes[2] = 2;
    def.structure = KN_STRUCTURE_AXIS;
    def.probe_count = 0;
    LATTICE l = lattice_of(def);
    double x[3];
    l.in.top_load_n = load_n;
    steps(&l, (int)lround(seconds / dt_s));
    kn_state_position(l.model, l.state, 1, x);
    return x[2];
}

TEST("Runge-Kutta is of fourth order: half the step, a sixteenth of the error")
{
    // A smooth law (no kink is crossed), and one slow bar: 2 rad/s per step at most.
    const kn_material m = {.k1_pa = 2e4, .c1_pa_s = 20, .damper = KN_DAMPER_CONSTANT, .c2_pa_s = 2e3};
    double end[3];
    for (int i = 0; i < 3; i++) end[i] = loaded_bar(m, KN_SOLVER_RK4, 1e4, 0.5, 4e-3 / (1 << i), 0.2);
    double order = log2((end[0] - end[1]) / (end[1] - end[2]));
    printf("     order %.2f\n", order);
    CHECK_NEAR(order, 4, 0.3);
}

TEST("for no damper, k1 = 0, c1 = 0 and thinning, Runge-Kutta gives the limit to which the implicit solver converges")
{
    kn_material m[5] = {jelly(), clay(), {.k1_pa = 2e4, .damper = KN_DAMPER_CONSTANT, .c2_pa_s = 5e3}, dough, dough};
    m[1].c1_pa_s = m[1].c2_pa_s = 4e3;
    m[4].c1_pa_s = 0;
    for (int t = 0; t < 5; t++) {
        double exact = loaded_bar(m[t], KN_SOLVER_RK4, 1200, 0.3, 2e-5, 0.2);
        double coarse = loaded_bar(m[t], KN_SOLVER_IMPLICIT, 1200, 0.3, 2e-5, 0.2);
        double fine = loaded_bar(m[t], KN_SOLVER_IMPLICIT, 1200, 0.3, 1e-5, 0.2);
        CHECK(exact < 0.01 - 1e-7);
        CHECK_NEAR(2 * fine - coarse, exact, 1e-3 * (0.01 - exact)); // extrapolated to a zero time step
    }
}

TEST("reactions, loads and weight account for every change of the momentum")
{
    enum { NODES = 4 * 3 * 3 };
    kn_model_def def = rk4_def(1e-5, 100);
    def.nodes[0] = 4;
    def.nodes[1] = def.nodes[2] = 3;
    def.support = KN_SUPPORT_NONE;
    def.gravity_m_s2 = 9.81;
    def.probe_count = 0;
    LATTICE l = lattice_of(def);
    const double *mass_kg = l.model->node_mass_kg;
    void *scratch = malloc(kn_rk4_scratch(l.model));
    static uint8_t fixed[NODES];
    static double velocity[NODES][3], force[NODES][3], reaction[NODES][3];
    for (int i = 0; i < NODES; i++) { // hold some nodes in some directions and move them; push all
        fixed[i] = (uint8_t)(i % 5 == 0 ? i % 8 : 0);
        for (int k = 0; k < 3; k++) velocity[i][k] = 1e-3 * (i % 7 - k), force[i][k] = 0.01 * (i % 3 - k);
    }
    kn_boundary b = {.fixed = fixed, .velocity_m_s = velocity, .force_n = force, .reaction_n = reaction};
    double before[3] = {0};
    for (int step = 0; step < 200; step++) {
        kn_rk4_step(l.model, l.state, &b, scratch);
        double after[3] = {0}, sum[3] = {0};
        for (int i = 0; i < NODES; i++) {
            double v[3];
            kn_state_velocity(l.model, l.state, i, v);
            for (int k = 0; k < 3; k++) {
                after[k] += mass_kg[i] * 100 * v[k];
                sum[k] += reaction[i][k] + force[i][k] - (k == 2 ? mass_kg[i] * 9.81 : 0);
                CHECK(fixed[i] >> k & 1 || reaction[i][k] == 0);
                CHECK(!(fixed[i] >> k & 1) || v[k] == velocity[i][k]);
            }
        }
        for (int k = 0; k < 3; k++) {
            CHECK_NEAR((after[k] - before[k]) / 1e-5, sum[k], 1e-6 * (fabs(sum[k]) + 1));
            before[k] = after[k];
        }
    }
    free(scratch);
}
