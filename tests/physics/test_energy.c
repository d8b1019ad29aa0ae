// Work, stored energy and dissipation. The audit keeps strains of its own, computed from the positions alone.
#include "core/algebra/algebra.h"
#include "core/lattice/measure.h"
#include "tests/lattice.h"

typedef struct audit {
    kn_law law;
    kn_edge *edges;
    int count;
    double *strain, *length;
    double dissipated_j;
    double least_w;           // smallest dissipation of an edge in a step
    double shortest, longest; // length that an edge would relax to, over its rest length
    int stopped;              // edges whose damper was at a stop in the last step
} audit;

static double edge_length(const lattice *l, const kn_edge *e)
{
    double i[3], j[3];
    kn_state_position(l->model, l->state, e->i, i);
    kn_state_position(l->model, l->state, e->j, j);
    return sqrt(pow(j[0] - i[0], 2) + pow(j[1] - i[1], 2) + pow(j[2] - i[2], 2));
}

static audit audit_start(const lattice *l)
{
    audit a = {.count = kn_grid_edges(&l->model->grid, NULL), .shortest = 1, .longest = 1};
    a.edges = malloc((size_t)a.count * sizeof *a.edges);
    a.strain = calloc((size_t)a.count, sizeof *a.strain);
    a.length = malloc((size_t)a.count * sizeof *a.length);
    if (!a.edges || !a.strain || !a.length) abort();
    kn_grid_edges(&l->model->grid, a.edges);
    kn_law_build(&a.law, &l->model->def.material, l->model->def.solver.dt_s, true);
    for (int e = 0; e < a.count; e++) a.length[e] = edge_length(l, &a.edges[e]);
    return a;
}

static void audit_free(audit *a)
{
    free(a->edges);
    free(a->strain);
    free(a->length);
}

// Account for one step: D += dt (c1 u'^2 + s (w - u')) over all edges. gamma^2 kappa weight L0^2 turns (stress x
// strain) of an edge into joules.
static void audit_step(audit *a, const lattice *l)
{
    const double dt = a->law.dt_s, gamma = l->model->grid.gamma, k1 = a->law.mat.k1_pa;
    a->stopped = 0;
    for (int e = 0; e < a->count; e++) {
        const kn_edge *edge = &a->edges[e];
        double now = edge_length(l, edge), w = (now - a->length[e]) / (dt * gamma * edge->rest_m);
        double b = a->law.a_pa_s * w + k1 * a->strain[e], s = kn_law_stress(&a->law, b), free_s = s;
        // length with the Voigt element relaxed
        double left = 1 + (a->length[e] - edge->rest_m) / edge->rest_m - gamma * a->strain[e];
        if (a->law.stroke)
            s = kn_law_stop(&a->law, s, b, (left - 1 - a->law.in) / gamma, (a->law.out - left + 1) / gamma);
        a->stopped += s != free_s;
        double rate = (s - k1 * a->strain[e]) / a->law.a_pa_s;
        double lost_w = pow(gamma * edge->rest_m, 2) * l->model->grid.kappa_m * edge->weight *
                        (a->law.mat.c1_pa_s * rate * rate + s * (w - rate));
        a->dissipated_j += dt * lost_w;
        a->strain[e] += dt * rate;
        a->length[e] = now;
        left = now / edge->rest_m - gamma * a->strain[e];
        a->least_w = fmin(a->least_w, lost_w);
        a->shortest = fmin(a->shortest, left);
        a->longest = fmax(a->longest, left);
    }
}

static const press at_once = {.depth_m = 0.003, .hold_s = 0.1, .pace = 1};

// Press, hold and lift off. Return (W - E - D)/W at the end. E is the energy that the server's audit reads.
static double imbalance(kn_model_def def, double dt, press p)
{
    def.solver.dt_s = dt;
    LATTICE l = lattice_of(def);
    AT_END(audit_free) audit a = audit_start(&l);
    const kn_probe_output *tool = &l.out.probe[0];
    double work = 0;
    for (int i = 1; i <= (int)lround((press_up_s(&p) + 0.15) / p.pace / dt); i++) {
        press_step(&l, &p);
        audit_step(&a, &l);
        work -= kn_dot(tool->force_n, l.state->probe[0].velocity_m_s) * dt;
    }
    CHECK_NEAR(tool->work_j, work, 1e-3 * work);
    kn_energy stored;
    CHECK(kn_energy_of(l.model, l.state, &stored));
    CHECK_NEAR(stored.height, 0, 0);
    double result = (tool->work_j - kn_energy_sum(&stored) - a.dissipated_j) / work;
    printf("     dt %.2f ms: work %.4f mJ = stored %.4f + dissipated %.4f + %.2e of it\n", dt * 1e3, 1e3 * tool->work_j,
           1e3 * kn_energy_sum(&stored), 1e3 * a.dissipated_j, result);
    CHECK(a.least_w >= 0);
    if (!a.law.stroke) return result;
    CHECK(a.stopped > 10);
    CHECK(a.shortest >= 1 + a.law.in - 1e-9 && a.longest <= 1 + a.law.out + 1e-9);
    return result;
}

// Check that at 1 ms at most 5e-4 of the work is missing, at half the step half as much, and that none is created.
static void balances(kn_model_def def, press p)
{
    double whole = imbalance(def, 1e-3, p), half = imbalance(def, 5e-4, p);
    CHECK(whole >= -1e-5 && whole <= 5e-4 && half >= -1e-5);
    CHECK_NEAR(whole / half, 2, 0.2);
}

TEST("the work of the plate is stored or dissipated, also with dampers at their stops, which no edge goes beyond")
{
    kn_model_def def = converged(press_def(1));
    balances(def, at_once);
    def.material.ratio = 0.5;
    def.material.stroke[0] = 0.495;
    def.material.stroke[1] = 0.51; // 2 % shorter to 1 % longer
    balances(def, at_once);
}

NIGHT_TEST("the work of a slow press is stored or dissipated with gas in the cells, too")
{
    kn_model_def def = converged(press_def(1));
    def.pressure = KN_PRESSURE_CELLS;
    balances(def, (press){.depth_m = 0.0055, .hold_s = 0.1, .pace = 0.5});
}

TEST("with the fast settings (f32, blend, one pass) no more than 1e-3 of the work is missing or created")
{
    CHECK_NEAR(imbalance(press_def(1), 1e-3, at_once), 0, 1e-3);
}

TEST("while the hand is still, the stored energy falls and the force relaxes at every step in all three materials")
{
    const kn_material materials[3] = {dough, jelly(), clay()};
    const press p = {.depth_m = 0.001, .hold_s = 5};
    for (int m = 0; m < 3; m++) {
        kn_model_def def = converged(press_def(1));
        def.material = materials[m];
        LATTICE l = lattice_of(def);
        double before = INFINITY, force = INFINITY;
        press_until(&l, &p, (int)lround(press_down_s(&p) * 1000) + 20); // the impact of the last braking is over
        for (int i = 0; i < 200; i++) {
            kn_energy now;
            press_step(&l, &p);
            CHECK(kn_energy_of(l.model, l.state, &now));
            CHECK(kn_energy_sum(&now) <= before * (1 + 1e-9) + 1e-15);
            CHECK(l.out.probe[0].force_n[2] <= force * (1 + 1e-6) + 1e-9);
            before = kn_energy_sum(&now), force = l.out.probe[0].force_n[2];
        }
        CHECK(force >= -1e-6);
    }
}

TEST("a plate does not pull by more than 1 % of its peak force, a ball not at all, and both let go when lifted, at "
     "every "
     "precision and material")
{
    const kn_material materials[3] = {dough, jelly(), clay()};
    const press p = {.depth_m = 0.004, .hold_s = 0.1};
    for (int t = 0; t < 12; t++) {
        const bool ball = t >= 6;
        kn_model_def def = ball ? ball_def(1) : press_def(1);
        def.material = materials[t / 2 % 3];
        def.solver.precision = (kn_precision)(t % 2);
        AT_END(run_free) run r = press_run(&def, &p, press_up_s(&p) + 1.5, 1e-3);
        for (int i = 0; i < r.samples; i++) CHECK(r.force_n[i][2] >= (ball ? 0 : -0.01 * peak_n(&r)));
        CHECK(peak_n(&r) > 0.2);
        for (int k = 0; k < 3; k++) CHECK_NEAR(r.force_n[r.samples - 1][k], 0, 0);
    }
}
