#include "core/solve/contact.h"
#include "core/solve/solver.h"
#include "core/step.h"
#include "tests/check.h"

#include <string.h>

static const double level[4] = {1, 0, 0, 0};

typedef struct bench { // dough, 5 x 5 x 3 cm, 5 mm spacing, with a plate and a sphere
    kn_model *model;
    kn_state *state;
    kn_input input;
    kn_output output;
} bench;

static bench bench_open_with(kn_skin_form skin)
{
    kn_model_def def = kn_model_def_default();
    bench b = {0};
    def.nodes[0] = def.nodes[1] = 11, def.nodes[2] = 7, def.spacing_m = 0.005;
    def.skin = skin;
    def.probe_count = 2;
    def.probe[0] = (kn_probe_def){.name = "plate", .shape = KN_PROBE_PLATE, .size_m = {0.01, 0.06}};
    def.probe[1] = (kn_probe_def){.name = "ball", .shape = KN_PROBE_SPHERE, .radius_m = 0.012};
    b.model = build(&def);
    b.state = kn_state_create(b.model);
    return b;
}

static bench bench_open(void) { return bench_open_with(KN_SKIN_SPLINE); }

static void bench_close(bench *b)
{
    kn_state_destroy(b->state);
    kn_model_destroy(b->model);
}

static void put(bench *b, int p, double x, double y, double z, double vz)
{
    b->input.probe[p] = (kn_probe_input){.attached = true, .position_m = {x, y, z}, .velocity_m_s = {0, 0, vz}};
}

static kn_contact *find(bench *b)
{
    kn_contact *contact = &kn_state_scratch(b->state)->contact;
    kn_contact_find(b->model, b->state, &b->input, contact);
    return contact;
}

TEST("the clearance is the distance between tool and object, and it is negative inside the object")
{
    AT_END(bench_close) bench b = bench_open();
    double high[3] = {0.001, 0.002, 0.034}, low[3] = {0.001, 0.002, 0.028}, aside[3] = {0.05, 0, 0.01};
    CHECK_NEAR(kn_clearance(b.model, b.state, 0, high, level), 0.004, 1e-12);
    CHECK_NEAR(kn_clearance(b.model, b.state, 0, low, level), -0.002, 1e-12);
    CHECK(kn_clearance(b.model, b.state, 0, aside, level) > 1); // no object under the plate
    high[2] += 0.012;
    CHECK_NEAR(kn_clearance(b.model, b.state, 1, high, level), 0.004, 2e-4); // the skin is sampled every half spacing
    CHECK(kn_clearance(b.model, b.state, 1, low, level) < -0.012);           // the centre is under the skin
    CHECK_NEAR(kn_clearance(b.model, b.state, 1, aside, level), 0.05 - 0.025 - 0.012, 2e-4);
}

TEST("the model's probe moves with the reported velocity and closes a gap in 20 ms")
{
    AT_END(bench_close) bench b = bench_open();
    put(&b, 0, 0, 0, 0.05, -0.01);
    find(&b);
    CHECK_NEAR(b.state->probe[0].velocity_m_s[2], -0.01, 1e-15); // the probe enters without a gap
    b.input.probe[0].position_m[2] -= 0.001;
    find(&b);
    CHECK_NEAR(b.state->probe[0].velocity_m_s[2], -0.01 - 0.001 / KN_FOLLOW_S, 1e-12);
    b.input.probe[0].attached = false;
    find(&b);
    CHECK(b.state->probe[0].attached == 0);
}

TEST("a plate holds the top nodes that it reaches and no others")
{
    AT_END(bench_close) bench b = bench_open();
    put(&b, 0, 0, 0, 0.031, 0);
    CHECK(find(&b)->hold_count == 0);
    b.input.probe[0].attached = false;
    find(&b);
    put(&b, 0, 0, 0, 0.0299, 0);
    kn_contact *contact = find(&b);
    CHECK(contact->hold_count == 3 * 11); // a strip 1 cm wide of 5 mm cells, across the whole block
    for (int i = 0; i < contact->hold_count; i++) {
        double x[3];
        kn_grid_rest(&b.model->grid, contact->hold[i].node, x);
        CHECK(fabs(x[0]) < 0.0051 && fabs(x[2] - 0.03) < 1e-12);
    }
}

TEST("two plates in the same place hold each node once, and the first plate takes the whole force")
{
    kn_model_def def = kn_model_def_default();
    AT_END(bench_close) bench b = {0};
    def.probe_count = 2;
    for (int p = 0; p < 2; p++) def.probe[p] = (kn_probe_def){.shape = KN_PROBE_PLATE, .size_m = {0.2, 0.2}};
    b.model = build(&def);
    b.state = kn_state_create(b.model);
    put(&b, 0, 0, 0, 0.0299, 0);
    put(&b, 1, 0, 0, 0.0299, 0);
    CHECK(kn_step(b.model, b.state, &b.input, &b.output) == KN_OK);
    CHECK(kn_state_scratch(b.state)->contact.hold_count == 36);
    CHECK(b.output.probe[0].force_n[2] > 0 && b.output.probe[1].force_n[2] == 0);
}

TEST("a block much lighter than its viscosity is still solved in f32, because held rows keep their blocks")
{
    double force[2];
    for (int heavy = 0; heavy < 2; heavy++) {
        kn_model_def def = kn_model_def_default();
        AT_END(bench_close) bench b = {0};
        def.material = (kn_material){.k1_pa = 1000, .c1_pa_s = 10, .damper = KN_DAMPER_NONE};
        def.spacing_m = 1e-4, def.density_kg_m3 = heavy ? 1200 : 30;
        def.probe_count = 1;
        def.probe[0] = (kn_probe_def){.shape = KN_PROBE_PLATE, .size_m = {1e-4, 1e-3}};
        b.model = build(&def);
        b.state = kn_state_create(b.model);
        put(&b, 0, 0, 0, 3e-4, -1e-4);
        for (int i = 0; i < 200; i++, b.input.probe[0].position_m[2] -= 1e-7)
            CHECK(kn_step(b.model, b.state, &b.input, &b.output) == KN_OK);
        force[heavy] = b.output.probe[0].force_n[2];
    }
    CHECK(force[1] > 0);
    CHECK_NEAR(force[0], force[1], 0.02 * force[1]);
}

TEST("a node touched within a step moves for the rest of the step")
{
    AT_END(bench_close) bench b = bench_open();
    put(&b, 0, 0, 0, 0.030004, -0.01); // 4 um above the top, moving by 10 um in this step
    kn_contact *contact = find(&b);
    CHECK(contact->hold_count == 33);
    CHECK_NEAR(contact->hold[0].velocity_m_s[2], -0.006, 1e-9);
}

static void check_flat(kn_skin_form skin)
{
    AT_END(bench_close) bench b = bench_open_with(skin);
    put(&b, 1, 0.0013, -0.0021, 0.03 + 0.012 - 0.001, 0);
    kn_contact *contact = find(&b);
    CHECK(contact->sample_count > 20 && contact->samples_lost == 0);
    double inside = 0;
    for (int i = 0; i < contact->sample_count; i++) {
        const kn_sample *s = &contact->sample[i];
        double sum = 0, at[3] = {0};
        for (int a = 0; a < 9; a++) {
            double x[3];
            kn_state_position(b.model, b.state, s->node[a], x);
            sum += s->weight[a];
            for (int k = 0; k < 3; k++) at[k] += s->weight[a] * x[k];
        }
        CHECK_NEAR(sum, 1, 1e-12);
        CHECK_NEAR(at[2], 0.03, 1e-12);
        double gap[3] = {at[0] - 0.0013, at[1] + 0.0021, at[2] - 0.041};
        CHECK_NEAR(s->depth_m, 0.012 - sqrt(gap[0] * gap[0] + gap[1] * gap[1] + gap[2] * gap[2]), 1e-12);
        if (s->depth_m > 0) inside += s->foundation_n_m / KN_FOUNDATION_N_M3; // area of the sample
    }
    // area of the circle in which the plane cuts the ball
    double cap = 3.14159265 * (2 * 0.012 * 0.001 - 0.001 * 0.001);
    CHECK_NEAR(inside, cap, 0.1 * cap);
}

TEST("under a sphere the skin of a flat block is flat: the weights sum to 1 and all samples lie in the top plane")
{
    check_flat(KN_SKIN_SPLINE);
    check_flat(KN_SKIN_BILINEAR);
}

TEST("the skin ends at the block's edge: a sphere over the rim has no sample outside")
{
    for (int skin = 0; skin < 2; skin++) {
        AT_END(bench_close) bench b = bench_open_with((kn_skin_form)skin);
        put(&b, 1, 0.025, 0, 0.03 + 0.012 - 0.001, 0);
        kn_contact *contact = find(&b);
        CHECK(contact->sample_count > 0);
        for (int i = 0; i < contact->sample_count; i++) {
            double x = 0, node[3];
            for (int a = 0; a < 9; a++) {
                kn_state_position(b.model, b.state, contact->sample[i].node[a], node);
                x += contact->sample[i].weight[a] * node[0];
            }
            CHECK(x <= 0.025 + 1e-12);
        }
    }
}

TEST("a frictionless sphere is pushed out along the normal, without a torque about its centre")
{
    AT_END(bench_close) bench b = bench_open();
    put(&b, 1, 0.002, 0.001, 0.0425, -0.01);
    for (int i = 0; i < 150; i++, b.input.probe[1].position_m[2] -= 1e-5)
        CHECK(kn_step(b.model, b.state, &b.input, &b.output) == KN_OK);
    const kn_probe_output *ball = &b.output.probe[1];
    CHECK(ball->contacts > 10 && ball->force_n[2] > 0.05);
    for (int k = 0; k < 3; k++) CHECK_NEAR(ball->torque_n_m[k], 0, 1e-6 * ball->force_n[2]); // frictionless
    CHECK(ball->work_j > 0);
}

TEST("a velocity that is NaN sets the force to zero until the object is reset")
{
    AT_END(bench_close) bench b = bench_open();
    put(&b, 0, 0, 0, 0.0299, -0.01);
    CHECK(kn_step(b.model, b.state, &b.input, &b.output) == KN_OK);
    CHECK(b.output.probe[0].force_n[2] > 0);
    b.input.probe[0].velocity_m_s[2] = NAN;
    CHECK(kn_step(b.model, b.state, &b.input, &b.output) == KN_DIVERGED);
    put(&b, 0, 0, 0, 0.0299, 0);
    CHECK(kn_step(b.model, b.state, &b.input, &b.output) == KN_DIVERGED);
    for (int k = 0; k < 3; k++) CHECK(b.output.probe[0].force_n[k] == 0);
    kn_state_reset(b.model, b.state);
    CHECK(kn_step(b.model, b.state, &b.input, &b.output) == KN_OK);
    CHECK(b.output.probe[0].force_n[2] > 0);
}

TESTS_MAIN
