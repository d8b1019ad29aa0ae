// Properties without influence: the direction of the axes, the place, the side of a mirror, the order of memory.
#include "tests/check.h"
#include "tests/dice.h"
#include "tests/physics/press.h"

TEST("a press on a block turned by 90 degrees about z gives the same force, although the memory order differs")
{
    press p = {.depth_m = 0.004, .hold_s = 0.1};
    kn_model_def along = press_def(1), across = press_def(1);
    along.nodes[0] = 7, along.nodes[1] = 5;
    along.probe[0].size_m[0] = 0.01, along.probe[0].size_m[1] = 0.04;
    across.nodes[0] = 5, across.nodes[1] = 7;
    across.probe[0].size_m[0] = 0.04, across.probe[0].size_m[1] = 0.01;
    for (int precision = 0; precision < 2; precision++) {
        along.solver.precision = across.solver.precision = (kn_precision)precision;
        if (precision) { // otherwise a rounding may decide whether a step takes one more iteration
            along.solver.tolerance = across.solver.tolerance = 1e-12;
            along.solver.iterations_max = across.solver.iterations_max = 400;
        }
        AT_END(run_free) run a = press_run(&along, &p, 1, 1e-3), b = press_run(&across, &p, 1, 1e-3);
        CHECK(peak_n(&a) > 1);
        CHECK_NEAR(force_error(&a, &b), 0, precision ? 1e-9 : 1e-4);
    }
}

// Squeeze a free block with two balls from both sides along one axis. Record the force of the first ball along that
// axis.
static void squeeze(int axis, double *force_n, int steps)
{
    static const int sides[3] = {7, 6, 5}; // nodes along the squeeze, and along the next two axes
    kn_model_def def = press_def(2);
    def.support = KN_SUPPORT_NONE;
    for (int k = 0; k < 3; k++) def.nodes[(axis + k) % 3] = sides[k];
    def.solver.precision = KN_PRECISION_F64;
    def.solver.tolerance = 1e-10;
    def.solver.iterations_max = 400;
    def.probe_count = 2;
    for (int b = 0; b < 2; b++) {
        def.probe[b] = (kn_probe_def){.shape = KN_PROBE_SPHERE, .radius_m = 0.01};
        snprintf(def.probe[b].name, sizeof def.probe[b].name, "ball%d", b);
    }
    OWN(kn_model) *model = build(&def);
    OWN(kn_state) *state = kn_state_create(model);
    double half = 0.5 * (sides[0] - 1) * def.spacing_m, centre[3] = {0, 0, 0.5 * (def.nodes[2] - 1) * def.spacing_m};
    for (int i = 0; i < steps; i++) {
        kn_input in = {0};
        kn_output out;
        for (int b = 0; b < 2; b++) {
            double way = b ? -1 : 1, depth = 0.01 * i * 1e-3 - 1e-4; // 1 cm/s from 0.1 mm away
            memcpy(in.probe[b].position_m, centre, sizeof centre);
            in.probe[b].attached = true;
            in.probe[b].position_m[axis] += way * (half + 0.01 - depth);
            in.probe[b].velocity_m_s[axis] = -way * 0.01;
        }
        CHECK(kn_step(model, state, &in, &out) == KN_OK);
        force_n[i] = out.probe[0].force_n[axis];
        CHECK_NEAR(out.probe[1].force_n[axis], -force_n[i], 1e-6 + 1e-6 * fabs(force_n[i]));
        for (int k = 1; k < 3; k++) // the face is symmetric about the ball, so no force pushes the ball aside
            CHECK_NEAR(out.probe[0].force_n[(axis + k) % 3], 0, 1e-6 + 1e-6 * fabs(force_n[i]));
    }
}

TEST("a free block squeezed between two balls gives the same force along x, y and z, and both forces balance")
{
    enum { STEPS = 400 };
    static double force[3][STEPS];
    for (int axis = 0; axis < 3; axis++) squeeze(axis, force[axis], STEPS);
    CHECK(force[0][STEPS - 1] > 0.5);
    for (int axis = 1; axis < 3; axis++)
        for (int i = 0; i < STEPS; i++) CHECK_NEAR(force[axis][i], force[0][i], 1e-6 * force[0][STEPS - 1]);
}

TEST("a press in the middle leaves a mirror-symmetric dent")
{
    press p = {.depth_m = 0.004, .hold_s = 0.1};
    for (int precision = 0; precision < 2; precision++) {
        kn_model_def def = press_def(1);
        def.solver.precision = (kn_precision)precision;
        kn_grid g;
        kn_grid_init(&g, def.nodes, def.spacing_m, 0, 1);
        AT_END(run_free) run r = press_run(&def, &p, 1, 1e-3);
        double worst = 0;
        for (int i = 0; i < r.nodes; i++) {
            int c[3];
            kn_grid_coords(&g, i, c);
            int mx = kn_grid_node(&g, 5 - c[0], c[1], c[2]), my = kn_grid_node(&g, c[0], 5 - c[1], c[2]);
            for (int k = 0; k < 3; k++) {
                worst = fmax(worst, fabs(r.shape_m[i][k] - (k == 0 ? -1 : 1) * r.shape_m[mx][k]));
                worst = fmax(worst, fabs(r.shape_m[i][k] - (k == 1 ? -1 : 1) * r.shape_m[my][k]));
            }
        }
        for (int i = 0; i < r.samples; i++)
            for (int k = 0; k < 2; k++) CHECK_NEAR(r.force_n[i][k], 0, (precision ? 1e-9 : 1e-4) * peak_n(&r));
        CHECK_NEAR(worst, 0, precision ? 1e-12 : 1e-7); // m
    }
}

static size_t component(const kn_model *model, int node, int k)
{
    return kn_grid_offset(&model->grid, node) + (size_t)k * kn_grid_stride(&model->grid);
}

static void momentum(const kn_model *model, const kn_state *state, double linear[3], double angular[3], double *size)
{
    *size = 0;
    for (int k = 0; k < 3; k++) linear[k] = angular[k] = 0;
    for (int i = 0; i < model->grid.nodes; i++) {
        double x[3], v[3], m = model->node_mass_kg[i];
        kn_state_position(model, state, i, x);
        kn_state_velocity(model, state, i, v);
        for (int k = 0; k < 3; k++) {
            linear[k] += m * v[k];
            angular[k] += m * (x[(k + 1) % 3] * v[(k + 2) % 3] - x[(k + 2) % 3] * v[(k + 1) % 3]);
            *size += m * fabs(v[k]);
        }
    }
}

TEST("internal forces sum to zero: a free body keeps its linear and angular momentum to 1e-6 in 200 steps")
{
    kn_model_def def = press_def(1);
    def.support = KN_SUPPORT_NONE;
    def.probe_count = 0;
    def.solver.precision = KN_PRECISION_F64;
    def.solver.tolerance = 1e-12;
    def.solver.iterations_max = 500;
    OWN(kn_model) *model = build(&def);
    OWN(kn_state) *state = kn_state_create(model);
    uint64_t seed = 7;
    for (int i = 0; i < model->grid.nodes; i++)
        for (int k = 0; k < 3; k++)
            ((double *)state->velocity)[component(model, i, k)] = 0.05 * kn_dice_in(&seed, -1, 1);
    double p0[3], l0[3], p1[3], l1[3], size, ignored;
    momentum(model, state, p0, l0, &size);
    kn_input in = {0};
    kn_output out;
    for (int i = 0; i < 200; i++) kn_step(model, state, &in, &out);
    momentum(model, state, p1, l1, &ignored);
    for (int k = 0; k < 3; k++) {
        CHECK_NEAR(p1[k], p0[k], 1e-6 * size);
        CHECK_NEAR(l1[k], l0[k], 1e-6 * size * 0.05); // arm of 5 cm
    }
}

TEST("a free body moved by 5 cm gives a ball the same force as at its old place")
{
    static double force[2][300];
    for (int away = 0; away < 2; away++) {
        kn_model_def def = ball_def(1);
        def.support = KN_SUPPORT_NONE;
        def.density_kg_m3 = 1e5; // heavy enough to stay in place while it is dented
        def.solver.precision = KN_PRECISION_F64;
        OWN(kn_model) *model = build(&def);
        OWN(kn_state) *state = kn_state_create(model);
        double shift[3] = {away * 0.05, away * -0.03, away * 0.02};
        for (int i = 0; i < model->grid.nodes; i++)
            for (int k = 0; k < 3; k++) ((double *)state->displacement)[component(model, i, k)] = shift[k];
        press p = {.depth_m = 0.01, .hold_s = 1};
        for (int i = 0; i < 300; i++) {
            kn_input in = press_input(model, &p, (i + 1) * 1e-3);
            kn_output out;
            for (int k = 0; k < 3; k++) in.probe[0].position_m[k] += shift[k];
            CHECK(kn_step(model, state, &in, &out) == KN_OK);
            force[away][i] = out.probe[0].force_n[2];
        }
    }
    CHECK(force[0][299] > 0.05);
    for (int i = 0; i < 300; i++) CHECK_NEAR(force[1][i], force[0][i], 1e-6 * force[0][299]);
}

TESTS_MAIN
