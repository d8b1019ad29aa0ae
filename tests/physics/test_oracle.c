// The fast step compared with the papers' own method: explicit Runge-Kutta in f64, with the mass scaled for
// stability.
#include "tests/lattice.h"
#include "tests/physics/bcc.h"

typedef enum body { BLOCK, FLAT, NET } body;
typedef struct comparison {
    const char *name;
    bool at_night, ball;
    body body;
    kn_pressure pressure;
    double diagonal, depth_m, hold_s, seconds;
} comparison;

// Factor of the mass; steps of Runge-Kutta, just below its limit of stability, and of the fast step; time of a sample.
typedef struct method {
    double mass, exact_s, dt_s, sample_s;
} method;

static const comparison table[] = {
    {"plate", true, false, BLOCK, KN_PRESSURE_NONE, 1, 0.001, 0.05, 0.225},
    {"ball", false, true, BLOCK, KN_PRESSURE_NONE, 1, 0.001, 0.03, 0.18},
    {"flat, gas in each cell", false, false, FLAT, KN_PRESSURE_CELLS, 1, 0.002, 0.03, 0.33},
    {"gas in each cell", true, false, BLOCK, KN_PRESSURE_CELLS, 1, 0.002, 0.03, 0.33},
    {"flat, one pressure", true, false, FLAT, KN_PRESSURE_OBJECT, 1, 0.002, 0.03, 0.33},
    {"one pressure", true, false, BLOCK, KN_PRESSURE_OBJECT, 1, 0.002, 0.03, 0.33},
    {"gas in each cell, weak diagonals", true, false, BLOCK, KN_PRESSURE_CELLS, 0.1, 0.002, 0.03, 0.33},
    {"mesh, plate", false, false, NET, KN_PRESSURE_NONE, 1, 0.001, 0.03, 0.16},
    {"mesh, ball", false, true, NET, KN_PRESSURE_NONE, 1, 0.001, 0.03, 0.16},
    {"mesh, gas in each element", true, false, NET, KN_PRESSURE_CELLS, 1, 0.001, 0.03, 0.16},
    {"mesh, one pressure", true, false, NET, KN_PRESSURE_OBJECT, 1, 0.001, 0.03, 0.16},
};

static void compare(const comparison *c)
{
    const method how = c->body == NET ? (method){1000, 4e-5, 5e-4, 1e-2}
                       : c->pressure  ? (method){300, 2.6e-5, 2.5e-4, 9e-3}
                                      : (method){100, 1.8e-5, 2.5e-4, 9e-3};
    const press p = {.depth_m = c->depth_m, .hold_s = c->hold_s};
    OWN(kn_simplices) *mesh = c->body == NET ? bcc_block((const int[3]){5, 5, 3}, 0.01) : NULL;
    kn_model_def def = c->ball ? ball_def(1) : press_def(1), rk4;
    def.mesh = mesh;
    def.pressure = c->pressure;
    def.diagonal_stiffness = c->diagonal;
    if (c->body == FLAT) def.nodes[1] = 1, def.thickness_m = 0.05;
    def.solver.mass_scale = how.mass;
    rk4 = def;
    rk4.solver.kind = KN_SOLVER_RK4, rk4.solver.precision = KN_PRECISION_F64, rk4.solver.dt_s = how.exact_s;
    def.solver.dt_s = how.dt_s;
    kn_model_def best = converged(def), open = def;
    open.pressure = KN_PRESSURE_NONE;
    AT_END(run_free) run oracle = press_run(&rk4, &p, c->seconds, how.sample_s);
    AT_END(run_free) run a = press_run(&best, &p, c->seconds, how.sample_s);
    CHECK(oracle.status == KN_OK && a.status == KN_OK && peak_n(&oracle) > 0.1);
    printf("     %s: peak %.4f N, Runge-Kutta %.4f N; force %.3f %%, dent %.3f %% apart\n", c->name, peak_n(&a),
           peak_n(&oracle), 100 * force_error(&a, &oracle), 100 * shape_error(&a, &oracle));
    CHECK_NEAR(force_error(&a, &oracle), 0, 0.01);
    CHECK_NEAR(shape_error(&a, &oracle), 0, 0.01);
    if (c->body == NET || !c->pressure) return;
    AT_END(run_free) run fast = press_run(&def, &p, c->seconds, how.sample_s);
    AT_END(run_free) run loose = press_run(&open, &p, c->seconds, how.sample_s);
    CHECK(fast.status == KN_OK && peak_n(&oracle) > 1.05 * peak_n(&loose));
    CHECK_NEAR(force_error(&fast, &oracle), 0, 0.02);
}

TEST("force and dent of the implicit step agree with Runge-Kutta within 1 %: under a ball, with gas, and of a mesh")
{
    for (int i = 0; i < COUNT(table); i++)
        if (!table[i].at_night) compare(&table[i]);
}

NIGHT_TEST("they agree under a plate, with gas in each cell or one pressure, with weak diagonals and in meshes, too")
{
    for (int i = 0; i < COUNT(table); i++)
        if (table[i].at_night) compare(&table[i]);
}
