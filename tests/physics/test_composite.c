// Two resolutions in one block: the loads that their border transmits exactly, the loads that it does not, and the
// force of a press.
#include "core/algebra/algebra.h"
#include "core/lattice/lattice.h"
#include "core/solve/solver.h"
#include "tests/lattice.h"

// Make a block of dough, 2 `pairs` cells of `h` across and 12 deep, with a fine box of half its width and half its
// depth.
static kn_model_def local(int pairs, double h, bool fine)
{
    kn_model_def def = press_def(1);
    const int n = 2 * pairs, low = pairs / 4 * 2;
    def.spacing_m = h;
    def.nodes[0] = def.nodes[1] = n + 1;
    def.nodes[2] = 13;
    def.probe[0] = (kn_probe_def){.name = "plate", .shape = KN_PROBE_PLATE, .size_m = {0.01, 0.01}};
    if (!fine) return def;
    memcpy(def.fine, (int[2][3]){{low, low, 6}, {n - low, n - low, 12}}, sizeof def.fine);
    return def;
}

typedef struct balance {
    double boundary, inside, corners, sum[3]; // largest force on a node of the outside, inside, at a corner of the box
} balance;

// Return the net forces on the nodes of an elastic block that follows the strain u = e x.
static balance strain(const double e[3][3])
{
    kn_model_def def = tight(local(8, 0.005, true), 1e-9);
    def.material = jelly();
    def.support = KN_SUPPORT_NONE;
    LATTICE l = lattice_of(def);
    const kn_model *m = l.model;
    balance b = {0};
    for (int i = 0; i < m->node_count; i++)
        for (size_t k = 0; k < 3; k++)
            kn_real_set(m, l.state->displacement, m->offset[i] + k * m->stride, kn_dot(e[k], m->rest_m[i]));
    m->kernels->edge(m, l.state, &l.scratch->work, KN_LINEARIZATION_SECANT, false);
    for (int i = 0; i < m->node_count; i++) {
        const double *x = m->rest_m[i], h = def.spacing_m, half = 8 * h;
        double size = 0, f;
        if (m->support[i]) continue; // tied nodes
        bool outside = fabs(x[0]) > half - h / 2 || fabs(x[1]) > half - h / 2 || x[2] < h / 2 || x[2] > 11.5 * h;
        bool corner =
            fabs(fabs(x[0]) - half / 2) < h / 2 && fabs(fabs(x[1]) - half / 2) < h / 2 && fabs(x[2] - 6 * h) < h / 2;
        for (size_t k = 0; k < 3; k++) {
            f = kn_real_get(m, l.scratch->work.r, m->offset[i] + k * m->stride);
            b.sum[k] += f;
            size = fmax(size, fabs(f));
        }
        double *kind = outside ? &b.boundary : corner ? &b.corners : &b.inside;
        *kind = fmax(*kind, size);
    }
    return b;
}

TEST("uniform stretch balances through every face, edge and corner of the fine box, and shear everywhere but at its "
     "corners")
{
    static const double stretch[3][3] = {{1e-6, 0, 0}, {0, -2e-6, 0}, {0, 0, 3e-6}}, shear[3][3] = {{0, 1e-6, 0}},
                        mixed[3][3] = {{1e-6, 0, 5e-7}, {0, 0, 1e-6}, {0, 0, -1e-6}};
    balance a = strain(stretch), b = strain(shear), c = strain(mixed);
    printf(
        "     of the largest boundary force: stretch %.1e, shear %.1e and %.3f at the corners, mixed %.1e and %.3f\n",
        fmax(a.inside, a.corners) / a.boundary, b.inside / b.boundary, b.corners / b.boundary, c.inside / c.boundary,
        c.corners / c.boundary);
    CHECK(fmax(a.inside, a.corners) < 1e-5 * a.boundary); // lengths are not linear in the strain
    CHECK(b.inside < 1e-5 * b.boundary && c.inside < 1e-5 * c.boundary);
    CHECK(b.corners < 0.12 * b.boundary && c.corners < 0.12 * c.boundary);
    for (int k = 0; k < 3; k++) CHECK(fabs(a.sum[k]) + fabs(b.sum[k]) + fabs(c.sum[k]) < 1e-10 * a.boundary);
}

TEST("the mass and the spread load equal the uniform block's, and the number of nodes matches the definition")
{
    kn_model_def coarse = local(8, 0.005, true), even = local(8, 0.005, false);
    OWN(kn_model) *m = build(&coarse), *u = build(&even);
    double share = 0;
    for (int t = 0; t < m->top_count; t++) share += m->top_share[t];
    CHECK(fabs(kn_model_mass(m) / kn_model_mass(u) - 1) < 1e-12 && fabs(share - 1) < 1e-12);
    CHECK(kn_composite_tied(m) > 0 && m->node_count < u->node_count);
    CHECK(m->node_count == kn_composite_nodes(&coarse));
}

// Return how far the middle of the top has gone down after 2 s under a load, with a sliding base.
static double creep(kn_model_def def)
{
    def.support = KN_SUPPORT_FRICTIONLESS;
    def.probe_count = 0;
    LATTICE l = lattice_of(tight(def, 1e-9));
    double u[3];
    l.in.top_load_n = 20 * GF_CM2 * pow(16 * 0.005, 2);
    steps(&l, 400);
    kn_composite_displacement(l.model, l.state, (int[3]){8, 8, 12}, u);
    return u[2];
}

TEST("under a spread load a block with a fine box creeps like the uniform block")
{
    double own = creep(local(8, 0.005, true)), uniform = creep(local(8, 0.005, false));
    printf("     %.6g mm, uniform %.6g mm\n", 1e3 * own, 1e3 * uniform);
    CHECK(uniform < -1e-4 && fabs(own / uniform - 1) < 1e-4);
}

enum { TICKS = 900 };

// Press down at 1 cm/s to 6 mm, hold for 100 ms, and lift.
static run play(const kn_model_def *def, double x_m, double y_m, double slide_m_s)
{
    LATTICE l = lattice_of(*def);
    const kn_grid *g = &l.model->grid;
    run r = {.samples = TICKS, .nodes = g->nodes};
    r.force_n = calloc(TICKS, sizeof *r.force_n);
    r.shape_m = calloc((size_t)r.nodes, sizeof *r.shape_m);
    const press p = {.depth_m = 0.006, .hold_s = 0.1};
    for (int i = 0; i < TICKS; i++) {
        l.in = press_input(l.model, &p, (i + 1) * 1e-3);
        l.in.probe[0].position_m[0] = x_m + i * 1e-3 * slide_m_s;
        l.in.probe[0].position_m[1] = y_m;
        l.in.probe[0].velocity_m_s[0] = slide_m_s;
        step(&l);
        memcpy(r.force_n[i], l.out.probe[0].force_n, sizeof *r.force_n);
    }
    for (int i = 0; i < g->nodes; i++) {
        int at[3];
        kn_grid_coords(g, i, at);
        kn_composite_displacement(l.model, l.state, at, r.shape_m[i]);
    }
    return r;
}

TEST("a press at two places over the fine box is within 1 % of the uniform block's force and 2 % of its shape")
{
    static const double at[2][2] = {{0, 0}, {0.002, -0.001}};
    for (int ball = 0; ball < 2; ball++)
        for (int t = 0; t < 2; t++) {
            kn_model_def def[2] = {local(12, 0.0025, true), local(12, 0.0025, false)};
            for (int i = 0; i < 2 && ball; i++)
                def[i].probe[0] = (kn_probe_def){.name = "ball", .shape = KN_PROBE_SPHERE, .radius_m = 0.005};
            AT_END(run_free) run own = play(&def[0], at[t][0], at[t][1], 0);
            AT_END(run_free) run even = play(&def[1], at[t][0], at[t][1], 0);
            double force = force_error(&own, &even), shape = shape_error(&own, &even);
            printf("     %s at %g, %g mm: force %.2f %%, shape %.2f %%\n", ball ? "ball" : "plate", 1e3 * at[t][0],
                   1e3 * at[t][1], 100 * force, 100 * shape);
            CHECK(force < 0.01 && shape < 0.02);
        }
}

NIGHT_TEST("a ball that slides over the border of the fine box gets at most twice the force jump of the uniform block")
{
    // Slide at 6 cm/s through 54 mm from the middle: over the border at 15 mm, deep in the dough from 650 ms to 750
    // ms.
    double jump[2] = {0};
    for (int i = 0; i < 2; i++) {
        kn_model_def def = local(12, 0.0025, i == 0);
        def.probe[0] = (kn_probe_def){.name = "ball", .shape = KN_PROBE_SPHERE, .radius_m = 0.01};
        AT_END(run_free) run r = play(&def, -0.025, 0, 0.06);
        for (int t = 400; t < 750; t++)
            for (int k = 0; k < 3; k++) jump[i] = fmax(jump[i], fabs(r.force_n[t][k] - r.force_n[t - 1][k]));
    }
    printf("     most in a millisecond: %.3f N, on the uniform block %.3f N\n", jump[0], jump[1]);
    CHECK(jump[0] < 2 * jump[1]);
}

TEST("an invalid fine box is refused with the reason")
{
    static const int bad[][2] = {{1, 8}, {8, 8}, {2, 18}};
    kn_model_def def = local(8, 0.005, true);
    for (int t = 0; t < COUNT(bad); t++) {
        def.fine[0][0] = bad[t][0], def.fine[1][0] = bad[t][1];
        refused(def, "a fine box needs corners at even cells of the block, the first below the second");
    }
    def = local(8, 0.005, true);
    def.pressure = KN_PRESSURE_CELLS;
    refused(def, "a fine box needs pressure: none");
    def = local(8, 0.005, true);
    memcpy(def.fine, (int[2][3]){{0, 0, 0}, {16, 16, 12}}, sizeof def.fine);
    refused(def, "a fine box needs coarse cells around it");
}
