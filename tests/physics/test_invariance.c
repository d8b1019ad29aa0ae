// Properties without influence: the direction of the axes, the place, the side of a mirror, the order of memory. And a
// free body's motion, which no inner force changes.
#include "core/algebra/algebra.h"
#include "core/solve/kernel.h"
#include "tests/dice.h"
#include "tests/lattice.h"
#include "tests/physics/bcc.h"

static const press paced = {.depth_m = 0.004, .hold_s = 0.1};

TEST("a press on a block turned by 90 degrees about z gives the same force, with gas too, although the memory order "
     "differs")
{
    for (int i = 0; i < 3; i++) { // in f32, in f64, with gas
        kn_model_def def[2] = {press_def(1), press_def(1)};
        for (int across = 0; across < 2; across++) {
            kn_model_def *d = &def[across];
            d->nodes[across] = 7, d->nodes[!across] = 5;
            d->probe[0].size_m[across] = 0.01, d->probe[0].size_m[!across] = 0.04;
            if (i == 2) d->pressure = KN_PRESSURE_CELLS, d->diagonal_stiffness = 0.1;
            // in f64 a rounding may decide whether a step takes one more iteration
            if (i) *d = tight(*d, 1e-12);
        }
        AT_END(run_free) run a = press_run(&def[0], &paced, 1, 1e-3), b = press_run(&def[1], &paced, 1, 1e-3);
        CHECK(peak_n(&a) > 1);
        CHECK_NEAR(force_error(&a, &b), 0, i ? 1e-9 : 1e-4);
    }
}

// Squeeze a free block with two balls from both sides along one axis. Record the force of the first ball along that
// axis.
static void squeeze(int axis, double *force_n, int count)
{
    static const int sides[3] = {7, 6, 5}; // nodes along the squeeze, and along the next two axes
    kn_model_def def = tight(press_def(2), 1e-10);
    def.support = KN_SUPPORT_NONE;
    for (int k = 0; k < 3; k++) def.nodes[(axis + k) % 3] = sides[k];
    def.probe_count = 2;
    def.probe[0] = def.probe[1] = ball_def(1).probe[0];
    LATTICE l = lattice_of(def);
    for (int i = 0; i < count; i++) {
        for (int b = 0; b < 2; b++) {
            double way = b ? -1 : 1, depth = 0.01 * i * 1e-3 - 1e-4; // 1 cm/s from 0.1 mm away
            put(&l, b, 0, 0, 0.5 * (def.nodes[2] - 1) * def.spacing_m);
            l.in.probe[b].position_m[axis] += way * (0.5 * (sides[0] - 1) * def.spacing_m + 0.01 - depth);
            l.in.probe[b].velocity_m_s[axis] = -way * 0.01;
        }
        step(&l);
        force_n[i] = l.out.probe[0].force_n[axis];
        CHECK_NEAR(l.out.probe[1].force_n[axis], -force_n[i], 1e-6 + 1e-6 * fabs(force_n[i]));
        for (int k = 1; k < 3; k++) // the face is symmetric about the ball, so no force pushes the ball aside
            CHECK_NEAR(l.out.probe[0].force_n[(axis + k) % 3], 0, 1e-6 + 1e-6 * fabs(force_n[i]));
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
    for (int precision = 0; precision < 2; precision++) {
        kn_model_def def = press_def(1);
        def.solver.precision = (kn_precision)precision;
        kn_grid g;
        kn_grid_init(&g, def.nodes, def.spacing_m, 0, 1);
        AT_END(run_free) run r = press_run(&def, &paced, 1, 1e-3);
        double worst = 0;
        for (int i = 0; i < r.nodes; i++) {
            int c[3];
            kn_grid_coords(&g, i, c);
            int mirrored[2] = {kn_grid_node(&g, 5 - c[0], c[1], c[2]), kn_grid_node(&g, c[0], 5 - c[1], c[2])};
            for (int k = 0; k < 6; k++) {
                double other = r.shape_m[mirrored[k / 3]][k % 3];
                worst = fmax(worst, fabs(r.shape_m[i][k % 3] - (k == 0 || k == 4 ? -other : other)));
            }
        }
        for (int i = 0; i < r.samples; i++)
            for (int k = 0; k < 2; k++) CHECK_NEAR(r.force_n[i][k], 0, (precision ? 1e-9 : 1e-4) * peak_n(&r));
        CHECK_NEAR(worst, 0, precision ? 1e-12 : 1e-7); // m
    }
}

static void set(lattice *l, void *field, int node, const double v[3])
{
    for (size_t k = 0; k < 3; k++) kn_real_set(l->model, field, l->model->offset[node] + k * l->model->stride, v[k]);
}

typedef struct momentum {
    double linear[3], angular[3], size;
} momentum;

static momentum momentum_of(const lattice *l)
{
    momentum p = {.size = 0};
    for (int i = 0; i < l->model->node_count; i++) {
        double x[3], v[3], turn[3], m = l->model->node_mass_kg[i];
        kn_state_position(l->model, l->state, i, x);
        kn_state_velocity(l->model, l->state, i, v);
        kn_cross(x, v, turn);
        for (int k = 0; k < 3; k++) p.linear[k] += m * v[k], p.angular[k] += m * turn[k], p.size += m * fabs(v[k]);
    }
    return p;
}

static kn_model_def free_body(kn_model_def def)
{
    def = tight(def, 1e-15); // otherwise a rounding may decide whether a step takes one more iteration
    def.support = KN_SUPPORT_NONE;
    def.probe_count = 0;
    return def;
}

TEST("internal forces sum to zero: a free block, also with gas, and a free mesh keep both momenta to 1e-6 in 200 steps")
{
    // a block; with gas in each cell; with one pressure; a mesh; a block in steps of 10 ms
    for (int i = 0; i < 5; i++) {
        OWN(kn_simplices) *mesh = i == 3 ? bcc_block((const int[3]){5, 5, 3}, 0.01) : NULL;
        kn_model_def def = free_body(press_def(1));
        def.mesh = mesh;
        if (i == 4) def.solver.dt_s = 0.01;
        if (i == 1 || i == 2) def.pressure = (kn_pressure)i, def.diagonal_stiffness = 0.3;
        LATTICE l = lattice_of(def);
        uint64_t seed = 7;
        for (int n = 0; n < l.model->node_count; n++) {
            double v[3];
            for (int k = 0; k < 3; k++) v[k] = (def.pressure ? 0.2 : 0.05) * kn_dice_in(&seed, -1, 1);
            set(&l, l.state->velocity, n, v);
        }
        momentum before = momentum_of(&l);
        steps(&l, 200);
        momentum after = momentum_of(&l);
        for (int k = 0; k < 3; k++) {
            CHECK_NEAR(after.linear[k], before.linear[k], 1e-6 * before.size);
            CHECK_NEAR(after.angular[k], before.angular[k], 1e-6 * before.size * 0.05); // arm of 5 cm
        }
    }
}

TEST("a factor on the forces and on the mass changes no shape, and multiplies the forces of blocks with gas, of two "
     "resolutions, with rk4, and of a mesh")
{
    OWN(kn_simplices) *mesh = bcc_block((const int[3]){5, 5, 3}, 0.01);
    for (int i = 0; i < 5; i++) {
        kn_model_def one = press_def(1);
        one.diagonal_stiffness = 0.3;
        if (i < 2) one.pressure = i ? KN_PRESSURE_OBJECT : KN_PRESSURE_CELLS;
        if (i == 2) memcpy(one.fine, (int[2][3]){{0, 0, 2}, {4, 4, 4}}, sizeof one.fine);
        if (i == 2) one.nodes[0] = one.nodes[1] = one.nodes[2] = 5;
        if (i == 3) one.solver.kind = KN_SOLVER_RK4, one.solver.mass_scale = 5000;
        if (i == 4) one.mesh = mesh;
        one.solver.precision = KN_PRECISION_F64;
        kn_model_def half = one;
        half.force_factor = 0.5, half.density_kg_m3 *= 0.5;
        AT_END(run_free) run a = press_run(&one, &paced, 1, 1e-3), b = press_run(&half, &paced, 1, 1e-3);
        CHECK(peak_n(&a) > 0.3);
        for (int k = 0; k < a.samples; k++) CHECK_NEAR(b.force_n[k][2], 0.5 * a.force_n[k][2], 1e-9 * peak_n(&a));
        for (int n = 0; n < a.nodes; n++) CHECK_NEAR(b.shape_m[n][2], a.shape_m[n][2], 1e-12);
    }
}

// Apply a general rotation, by Rodrigues about (1, 2, 3).
static void rotate(const double x[3], double out[3])
{
    const double angle = 0.7, axis[3] = {1 / sqrt(14), 2 / sqrt(14), 3 / sqrt(14)}, along = kn_dot(axis, x);
    double across[3];
    kn_cross(axis, x, across);
    for (int k = 0; k < 3; k++)
        out[k] = cos(angle) * x[k] + sin(angle) * across[k] + (1 - cos(angle)) * along * axis[k];
}

TEST("a rotated block with gas moves like the original block, rotated, to 1e-10 m")
{
    for (kn_pressure pressure = KN_PRESSURE_CELLS; pressure <= KN_PRESSURE_OBJECT; pressure++) {
        kn_model_def def = free_body(press_def(1));
        def.pressure = pressure, def.diagonal_stiffness = 0.3;
        def.nodes[0] = 5, def.nodes[1] = 4, def.nodes[2] = 6;
        LATTICE a = lattice_of(def), b = lattice_of(def);
        uint64_t seed = 11;
        double worst = 0, farthest = 0, v[3], x[3], u[3], turned[3];
        for (int i = 0; i < a.model->node_count; i++) {
            for (int k = 0; k < 3; k++) v[k] = 0.1 * kn_dice_in(&seed, -1, 1);
            set(&a, a.state->velocity, i, v);
            rotate(v, turned);
            set(&b, b.state->velocity, i, turned);
            rotate(b.model->rest_m[i], turned);
            for (int k = 0; k < 3; k++) turned[k] -= b.model->rest_m[i][k];
            set(&b, b.state->displacement, i, turned);
        }
        steps(&a, 300), steps(&b, 300);
        for (int i = 0; i < a.model->node_count; i++) {
            kn_state_position(a.model, a.state, i, x);
            displacement(a.model, a.state, i, u);
            rotate(x, turned);
            kn_state_position(b.model, b.state, i, x);
            for (int k = 0; k < 3; k++)
                worst = fmax(worst, fabs(turned[k] - x[k])), farthest = fmax(farthest, fabs(u[k]));
        }
        printf("     moved by %.2f mm, apart by %.1e m\n", 1e3 * farthest, worst);
        CHECK(farthest > 1e-4 && worst < 1e-10);
    }
}

TEST("a free body moved by 5 cm gives a ball the same force as at its old place")
{
    static double force[2][300];
    const press p = {.depth_m = 0.01, .hold_s = 1};
    for (int away = 0; away < 2; away++) {
        kn_model_def def = ball_def(1);
        def.support = KN_SUPPORT_NONE;
        def.density_kg_m3 = 1e5; // heavy enough to stay in place while it is dented
        def.solver.precision = KN_PRECISION_F64;
        LATTICE l = lattice_of(def);
        double shift[3] = {away * 0.05, away * -0.03, away * 0.02};
        for (int i = 0; i < l.model->node_count; i++) set(&l, l.state->displacement, i, shift);
        for (int i = 0; i < 300; i++) {
            l.in = press_input(l.model, &p, (i + 1) * 1e-3);
            for (int k = 0; k < 3; k++) l.in.probe[0].position_m[k] += shift[k];
            step(&l);
            force[away][i] = l.out.probe[0].force_n[2];
        }
    }
    CHECK(force[0][299] > 0.05);
    for (int i = 0; i < 300; i++) CHECK_NEAR(force[1][i], force[0][i], 1e-6 * force[0][299]);
}
