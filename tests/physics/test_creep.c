// One edge of dough compared with its one-dimensional element, and a lattice of edges compared with the same curve.
#include "core/network.h"
#include "tests/lattice.h"

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

static double height(const lattice *l)
{
    double x[3];
    kn_state_position(l->model, l->state, l->model->grid.nodes - 1, x);
    return x[2];
}

// The reference: the element on a bench in one dimension, which core/test_network.c compares with closed forms and with
// an independent integration.
typedef struct bench {
    kn_network net;
    kn_network_state state;
} bench;

static bench bench_of(const kn_material *m) { return (bench){.net = kn_network_of(m)}; }

static void follow(bench *b, kn_drive_kind kind, double stress_pa, double seconds)
{
    const kn_drive drive = {.kind = kind, .value = stress_pa};
    CHECK(kn_network_jump(&b->net, &b->state, &drive));
    CHECK(kn_network_advance(&b->net, &b->state, &drive, b->state.time_s + seconds, 1e-9));
}

// Load a 1 cm cube for 60 s with so many gram-force, then rest, as a bar and as the element. The load spreads
// over a section that grows as the height falls: P = W h/(S0 h0) (paper 1, eq. 4).
static void creep(const kn_material *m, double load_gf, kn_precision precision, double dt_s, double rest_s)
{
    kn_model_def def = bar_def(*m, precision);
    def.solver.dt_s = dt_s;
    LATTICE l = lattice_of(def);
    bench b = bench_of(m);
    for (int i = 0; i < (int)lround(60 / dt_s); i++) { // over 1 cm^2 the load W h/h0 newtons is the stress W h/(S0 h0)
        l.in.top_load_n = load_gf * GF_N * height(&l) / 0.01;
        step(&l);
    }
    double stress_pa = load_gf * GF_CM2 * height(&l) / 0.01;
    follow(&b, KN_DRIVE_LOAD, load_gf * GF_CM2, 60);
    printf("     %2.0f gf, f%d: %.4f gf/cm^2, %.5f cm; element %.4f, %.5f\n", load_gf, precision ? 64 : 32,
           stress_pa / GF_CM2, height(&l) * 100, b.state.stress_pa / GF_CM2, 1 - b.state.strain);
    CHECK_NEAR(stress_pa, b.state.stress_pa, 1e-3 * stress_pa);
    CHECK_NEAR(height(&l), 0.01 * (1 - b.state.strain), 1e-3 * height(&l));
    if (m == &dough && load_gf == 50)
        CHECK_NEAR(stress_pa / GF_CM2, 26.33, 0.03); // the paper measured 28 gf/cm^2 on its dough
    l.in.top_load_n = 0;
    steps(&l, (int)lround(rest_s / dt_s));
    follow(&b, KN_DRIVE_STRESS, 0, rest_s);
    CHECK_NEAR(height(&l), 0.01 * (1 - b.state.strain), 1e-3 * height(&l));
}

TEST("a 1 cm cube of dough under 10 to 90 gf, or with a constant damper, creeps and recovers like the element within "
     "0.1 %, in f32 and f64")
{
    const kn_material constant = {.k1_pa = 4e4, .c1_pa_s = 2e4, .damper = KN_DAMPER_CONSTANT, .c2_pa_s = 4e5};
    creep(&dough, 50, KN_PRECISION_F32, 1e-3, 20);
    creep(&constant, 40, KN_PRECISION_F64, 1e-3, 2);
    for (double load_gf = 10; load_gf < 100; load_gf += 20) creep(&dough, load_gf, KN_PRECISION_F64, 1e-2, 70);
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
        LATTICE l = lattice_of(def);
        bench b = bench_of(&def.material);
        double difference = 0, size = 0;
        for (int s = 0; s < 90; s++) { // 60 s loaded, on 3 x 3 cm, and 30 s unloaded
            double load_pa = s < 60 ? stress[t] * GF_CM2 : 0;
            l.in.top_load_n = load_pa * 9e-4;
            steps(&l, 50);
            follow(&b, KN_DRIVE_STRESS, load_pa, 1);
            difference += pow(1 - height(&l) / 0.03 - b.state.strain, 2);
            size += pow(b.state.strain, 2);
        }
        printf("     %.0f gf/cm^2: %.1f %% apart\n", stress[t], 100 * sqrt(difference / size));
        CHECK_NEAR(sqrt(difference / size), 0, bound[t]);
    }
}
