// One edge of dough compared with its one-dimensional element, and a lattice of edges compared with the same curve.
#include "tests/check.h"
#include "tests/physics/press.h"

// A bar of two nodes, 1 cm long and 1 cm^2 thick: the lattice's law without its geometry.
static kn_model_def bar_def(kn_material material, kn_precision precision)
{
    kn_model_def def = kn_model_def_default();
    def.material = material;
    def.density_kg_m3 = 1200;
    def.nodes[0] = def.nodes[1] = 1;
    def.nodes[2] = 2;
    def.spacing_m = 0.01;
    def.structure = KN_STRUCTURE_AXIS;
    def.support = KN_SUPPORT_BONDED;
    def.probe_count = 0;
    def.solver.precision = precision;
    return def;
}

static double height(const kn_model *model, const kn_state *state)
{
    double x[3];
    kn_state_position(model, state, model->grid.nodes - 1, x);
    return x[2];
}

// The reference: strains of the Voigt element and of the damper as an ODE, Runge-Kutta 4 with step doubling to 1e-9 a
// step. The load spreads over a section that grows as the height falls: P = W h/(S0 h0) (paper 1, eq. 4). The
// reference shares no code with core.
typedef struct element {
    kn_material m;
    double load_pa; // on the initial section
    bool area_grows;
    double voigt, damper; // strains, compression positive
} element;

static double oracle_height(const double y[2]) { return 1 - y[0] - y[1]; }

static double oracle_stress(const element *e, const double y[2])
{
    return e->load_pa * (e->area_grows ? oracle_height(y) : 1);
}

static void oracle_rates(const element *e, const double y[2], double dy[2])
{
    double p = oracle_stress(e, y), inside = p < e->m.p0_pa ? e->m.p0_pa : p > e->m.p1_pa ? e->m.p1_pa : p;
    double c2 = e->m.damper == KN_DAMPER_CONSTANT ? e->m.c2_pa_s : e->m.alpha_pa_s * exp(-e->m.beta_per_pa * inside);
    dy[0] = (p - e->m.k1_pa * y[0]) / e->m.c1_pa_s;
    dy[1] = p / c2;
}

static void oracle_rk4(const element *e, const double y[2], double dt, double out[2])
{
    double k[4][2], at[2];
    oracle_rates(e, y, k[0]);
    for (int s = 1; s < 4; s++) {
        for (int i = 0; i < 2; i++) at[i] = y[i] + (s == 3 ? dt : dt / 2) * k[s - 1][i];
        oracle_rates(e, at, k[s]);
    }
    for (int i = 0; i < 2; i++) out[i] = y[i] + dt / 6 * (k[0][i] + 2 * k[1][i] + 2 * k[2][i] + k[3][i]);
}

static void oracle_advance(element *e, double seconds)
{
    double y[2] = {e->voigt, e->damper}, dt = 1e-3;
    for (double left = seconds; left > 0;) {
        double whole[2], half[2], two[2], h = fmin(dt, left);
        oracle_rk4(e, y, h, whole);
        oracle_rk4(e, y, h / 2, half);
        oracle_rk4(e, half, h / 2, two);
        double error = fabs(two[0] - whole[0]) + fabs(two[1] - whole[1]);
        if (error > 1e-9) {
            dt = h / 2;
            continue;
        }
        memcpy(y, two, sizeof y);
        left -= h;
        if (error < 1e-11) dt = 2 * h;
    }
    e->voigt = y[0];
    e->damper = y[1];
}

typedef struct creep {
    double stress_pa, height_m; // at release
    double final_m;             // after the recovery
} creep;

// Load the bar for 60 s with so many gram-force, then rest for `rest_s`.
static creep bar_creep(double load_gf, kn_precision precision, double dt_s, double rest_s)
{
    kn_model_def def = bar_def(dough, precision);
    def.solver.dt_s = dt_s;
    OWN(kn_model) *model = build(&def);
    OWN(kn_state) *state = kn_state_create(model);
    kn_input in = {0};
    kn_output out;
    for (int i = 0; i < (int)lround(60 / dt_s); i++) { // over 1 cm^2 the load W h/h0 newtons is the stress W h/(S0 h0)
        in.top_load_n = load_gf * GF_N * height(model, state) / 0.01;
        CHECK(kn_step(model, state, &in, &out) == KN_OK);
    }
    creep c = {.stress_pa = load_gf * GF_CM2 * height(model, state) / 0.01, .height_m = height(model, state)};
    in.top_load_n = 0;
    for (int i = 0; i < (int)lround(rest_s / dt_s); i++) kn_step(model, state, &in, &out);
    c.final_m = height(model, state);
    return c;
}

static creep oracle_creep(double load_gf, double rest_s)
{
    element e = {.m = dough, .load_pa = load_gf * GF_CM2, .area_grows = true};
    oracle_advance(&e, 60);
    double y[2] = {e.voigt, e.damper};
    creep c = {.stress_pa = oracle_stress(&e, y), .height_m = 0.01 * oracle_height(y)};
    e.load_pa = 0;
    oracle_advance(&e, rest_s);
    double after[2] = {e.voigt, e.damper};
    c.final_m = 0.01 * oracle_height(after);
    return c;
}

TEST("a 1 cm cube of dough under 50 gf for 60 s is 0.5266 cm high and carries 26.33 gf/cm^2 when released")
{
    // The paper measured 28 gf/cm^2 here. This value comes from the paper's identified model, not from its dough.
    creep oracle = oracle_creep(50, 20);
    CHECK_NEAR(oracle.stress_pa / GF_CM2, 26.33, 0.005);
    CHECK_NEAR(oracle.height_m * 100, 0.5266, 0.00005);
    for (int p = 0; p < 2; p++) {
        creep c = bar_creep(50, p ? KN_PRECISION_F64 : KN_PRECISION_F32, 1e-3, 20);
        printf("     %s: %.4f gf/cm^2, %.5f cm, after 20 s of rest %.5f cm (1-D: %.4f, %.5f, %.5f; measured by the "
               "paper: 28)\n",
               p ? "f64" : "f32", c.stress_pa / GF_CM2, c.height_m * 100, c.final_m * 100, oracle.stress_pa / GF_CM2,
               oracle.height_m * 100, oracle.final_m * 100);
        CHECK_NEAR(c.stress_pa, oracle.stress_pa, 1e-3 * oracle.stress_pa);
        CHECK_NEAR(c.height_m, oracle.height_m, 1e-3 * oracle.height_m);
        CHECK_NEAR(c.final_m, oracle.final_m, 1e-3 * oracle.final_m);
    }
}

TEST("under 10, 30, 70 and 90 gf the bar follows the element, and its residual deformation matches an independent "
     "integration")
{
    static const double load[4] = {10, 30, 70, 90};
    static const double kept_cm[4] = {0.0158, 0.159, 0.594,
                                      0.696}; // an independent integration of the same element, by hand
    for (int i = 0; i < 4; i++) {
        creep oracle = oracle_creep(load[i], 70), c = bar_creep(load[i], KN_PRECISION_F64, 1e-2, 70);
        CHECK_NEAR(c.height_m, oracle.height_m, 1e-3 * oracle.height_m);
        CHECK_NEAR(c.final_m, oracle.final_m, 1e-3 * oracle.final_m);
        CHECK_NEAR(1 - 100 * c.final_m, kept_cm[i], 0.01 * kept_cm[i]);
    }
}

TEST("with a constant damper creep and recovery follow F/k (1 - e^(-kt/c1)) + F t/c2 within 0.1 %")
{
    kn_material m = {.k1_pa = 4e4, .c1_pa_s = 2e4, .damper = KN_DAMPER_CONSTANT, .c2_pa_s = 4e5}; // time constant 0.5 s
    kn_model_def def = bar_def(m, KN_PRECISION_F64);
    OWN(kn_model) *model = build(&def);
    OWN(kn_state) *state = kn_state_create(model);
    kn_input in = {.top_load_n = 0.4}; // 4 kPa
    kn_output out;
    double sigma = 4e3;
    for (int i = 1; i <= 4000; i++) {
        if (i == 2001) in.top_load_n = 0;
        kn_step(model, state, &in, &out);
        double t = i * 1e-3, fast = m.k1_pa / m.c1_pa_s, strain = sigma / m.k1_pa * (1 - exp(-fast * fmin(t, 2)));
        if (t > 2) strain *= exp(-fast * (t - 2));
        strain += sigma / m.c2_pa_s * fmin(t, 2);
        if (i % 100 == 0) CHECK_NEAR(1 - height(model, state) / 0.01, strain, 1e-3 * strain);
    }
}

TEST("a block of dough creeps under a spread load like the element, within 0.1 % in the linear range and 13 % above")
{
    // Moduli times 1000 at the same stresses. The strains are so small that the block keeps its shape, and only the
    // lattice's share of the stress (gamma = 0.46) is compared. At full size the block grows sideways, which the
    // element cannot do.
    // Between 6 and 20 gf/cm^2 only the sides along the load have passed p0, and they carry more than their share of
    // stress. No gamma does better than 8 % there. A c2 that falls steadily with an edge's own force does no better
    // either (a c2 that first rises would). A gamma for each kind of edge brings the worst error to 3 % along the
    // axes, but makes loads along the diagonals creep three times too far.
    enum { LOADS = 9 };
    static const double stress[LOADS] = {3, 5, 8, 10, 14, 20, 28, 50, 70};
    static const double bound[LOADS] = {0.001, 0.04, 0.13, 0.13, 0.12, 0.08, 0.04, 0.08, 0.08};
    for (int t = 0; t < LOADS; t++) {
        kn_model_def def = press_def(1);
        def.nodes[0] = def.nodes[1] = def.nodes[2] = 4;
        def.probe_count = 0;
        def.support = KN_SUPPORT_FRICTIONLESS;
        def.solver.precision = KN_PRECISION_F64;
        def.solver.dt_s = 2e-2;
        def.material.k1_pa *= 1000;
        def.material.c1_pa_s *= 1000;
        def.material.alpha_pa_s *= 1000;
        OWN(kn_model) *model = build(&def);
        OWN(kn_state) *state = kn_state_create(model);
        element e = {.m = def.material, .load_pa = stress[t] * GF_CM2};
        kn_input in = {.top_load_n = stress[t] * 9 * GF_N}; // on 3 x 3 cm
        kn_output out;
        double difference = 0, size = 0;
        for (int i = 1; i <= 4500; i++) { // 60 s loaded, 30 s unloaded
            if (i == 3001) in.top_load_n = e.load_pa = 0;
            kn_step(model, state, &in, &out);
            if (i % 50) continue;
            oracle_advance(&e, 1);
            double strain = 1 - height(model, state) / 0.03, expected = e.voigt + e.damper;
            difference += (strain - expected) * (strain - expected);
            size += expected * expected;
        }
        printf("     %.0f gf/cm^2: %.1f %% apart\n", stress[t], 100 * sqrt(difference / size));
        CHECK_NEAR(sqrt(difference / size), 0, bound[t]);
    }
}

TESTS_MAIN
