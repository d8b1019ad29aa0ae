#include "core/solve/contact.h"
#include "core/solve/solver.h"
#include "tests/lattice.h"

static const double level[4] = {1, 0, 0, 0};

static lattice dough_with_skin(kn_skin_form skin) // 5 x 5 x 3 cm, 5 mm spacing, with a plate and a sphere
{
    kn_model_def def = press_def(2);
    def.skin = skin;
    def.probe_count = 2;
    def.probe[0].size_m[1] = 0.06;
    def.probe[1] = (kn_probe_def){.name = "ball", .shape = KN_PROBE_SPHERE, .radius_m = 0.012};
    return lattice_of(def);
}

static lattice dough_block(void) { return dough_with_skin(KN_SKIN_SPLINE); }

static kn_contact *find(lattice *l)
{
    kn_contact *contact = &l->scratch->contact;
    kn_contact_find(l->model, l->state, &l->in, contact);
    return contact;
}

TEST("the clearance is the distance between tool and object, and it is negative inside the object")
{
    LATTICE l = dough_block();
    double high[3] = {0.001, 0.002, 0.034}, low[3] = {0.001, 0.002, 0.028}, aside[3] = {0.05, 0, 0.01};
    CHECK_NEAR(kn_clearance(l.model, l.state, 0, high, level), 0.004, 1e-12);
    CHECK_NEAR(kn_clearance(l.model, l.state, 0, low, level), -0.002, 1e-12);
    CHECK(kn_clearance(l.model, l.state, 0, aside, level) > 1); // no object under the plate
    high[2] += 0.012;
    CHECK_NEAR(kn_clearance(l.model, l.state, 1, high, level), 0.004, 2e-4); // the skin is sampled every half spacing
    CHECK(kn_clearance(l.model, l.state, 1, low, level) < -0.012);           // the centre is under the skin
    CHECK_NEAR(kn_clearance(l.model, l.state, 1, aside, level), 0.05 - 0.025 - 0.012, 2e-4);
}

TEST("a plate holds the top nodes that it reaches and no others; a node touched within a step moves for its rest")
{
    LATTICE l = dough_block();
    put(&l, 0, 0, 0, 0.031);
    CHECK(find(&l)->hold_count == 0);
    for (int moving = 0; moving < 2; moving++) {
        l.in.probe[0].attached = false;
        find(&l);
        put(&l, 0, 0, 0, moving ? 0.030004 : 0.0299); // 4 um above the top, moving by 10 um in this step
        l.in.probe[0].velocity_m_s[2] = moving ? -0.01 : 0;
        kn_contact *contact = find(&l);
        CHECK(contact->hold_count == 3 * 11); // a strip 1 cm wide of 5 mm cells, across the whole block
        if (moving) CHECK_NEAR(contact->hold[0].velocity_m_s[2], -0.006, 1e-9);
        for (int i = 0; i < contact->hold_count; i++) {
            const double *x = l.model->rest_m[contact->hold[i].node];
            CHECK(fabs(x[0]) < 0.0051 && fabs(x[2] - 0.03) < 1e-12);
        }
    }
}

TEST("two plates in the same place hold each node once, and the first plate takes the whole force")
{
    kn_model_def def = press_def(1);
    def.probe_count = 2;
    def.probe[0].size_m[0] = def.probe[0].size_m[1] = 0.2;
    def.probe[1] = def.probe[0];
    LATTICE l = lattice_of(def);
    put(&l, 0, 0, 0, 0.0299), put(&l, 1, 0, 0, 0.0299);
    step(&l);
    CHECK(l.scratch->contact.hold_count == 36);
    CHECK(l.out.probe[0].force_n[2] > 0 && l.out.probe[1].force_n[2] == 0);
}

TEST("a block much lighter than its viscosity is still solved in f32, because held rows keep their blocks")
{
    double force[2];
    for (int heavy = 0; heavy < 2; heavy++) {
        kn_model_def def = press_def(1);
        def.material = (kn_material){.k1_pa = 1000, .c1_pa_s = 10, .damper = KN_DAMPER_NONE};
        def.spacing_m = 1e-4, def.density_kg_m3 = heavy ? 1200 : 30;
        def.probe[0].size_m[0] = 1e-4, def.probe[0].size_m[1] = 1e-3;
        LATTICE l = lattice_of(def);
        put(&l, 0, 0, 0, 3e-4);
        move(&l, 0, 0, 0, -1e-4, 200);
        force[heavy] = l.out.probe[0].force_n[2];
    }
    CHECK(force[1] > 0);
    CHECK_NEAR(force[0], force[1], 0.02 * force[1]);
}

// Store the place of a sample, and return the sum of its weights.
static double place_of(const lattice *l, const kn_sample *s, double at[3])
{
    double sum = 0, x[3];
    memset(at, 0, 3 * sizeof *at);
    for (int a = 0; a < 9; a++) {
        kn_state_position(l->model, l->state, s->patch->node[a], x);
        sum += s->weight[a];
        for (int k = 0; k < 3; k++) at[k] += s->weight[a] * x[k];
    }
    return sum;
}

TEST("under a sphere the skin of a flat block is flat: the weights sum to 1 and all samples lie in the top plane; the "
     "skin ends at the block's edge")
{
    for (int skin = 0; skin < 2; skin++)
        for (int over_rim = 0; over_rim < 2; over_rim++) {
            LATTICE l = dough_with_skin((kn_skin_form)skin);
            const double c[3] = {over_rim ? 0.025 : 0.0013, over_rim ? 0 : -0.0021, 0.03 + 0.012 - 0.001};
            put(&l, 1, c[0], c[1], c[2]);
            kn_contact *contact = find(&l);
            CHECK(contact->sample_count > (over_rim ? 0 : 20) && contact->samples_lost == 0);
            double inside = 0, at[3];
            for (const kn_sample *s = contact->sample; s < contact->sample + contact->sample_count; s++) {
                CHECK_NEAR(place_of(&l, s, at), 1, 1e-12);
                CHECK(at[0] <= 0.025 + 1e-12);
                if (over_rim) continue;
                CHECK_NEAR(at[2], 0.03, 1e-12);
                double gap = sqrt(pow(at[0] - c[0], 2) + pow(at[1] - c[1], 2) + pow(at[2] - c[2], 2));
                CHECK_NEAR(s->depth_m, 0.012 - gap, 1e-12);
                if (s->depth_m > 0) inside += s->foundation_n_m / KN_FOUNDATION_N_M3; // area of the sample
            }
            // area of the circle in which the plane cuts the ball
            const double cap = 3.14159265 * (2 * 0.012 * 0.001 - 0.001 * 0.001);
            if (!over_rim) CHECK_NEAR(inside, cap, 0.1 * cap);
        }
}

TEST("a frictionless sphere is pushed out along the normal, without a torque about its centre")
{
    LATTICE l = dough_block();
    put(&l, 1, 0.002, 0.001, 0.0425);
    move(&l, 1, 0, 0, -0.01, 150);
    const kn_probe_output *ball = &l.out.probe[1];
    CHECK(ball->contacts > 10 && ball->force_n[2] > 0.05 && ball->work_j > 0);
    for (int k = 0; k < 3; k++) CHECK_NEAR(ball->torque_n_m[k], 0, 1e-6 * ball->force_n[2]); // frictionless
}

TEST("a velocity that is NaN, or a NaN in the state, sets the force to zero until the object is reset")
{
    for (int in_state = 0; in_state < 2; in_state++) {
        LATTICE l = dough_block();
        put(&l, 0, 0, 0, 0.0299);
        move(&l, 0, 0, 0, -0.01, 1);
        CHECK(l.out.probe[0].force_n[2] > 0);
        if (in_state) kn_real_set(l.model, l.state->velocity, l.model->offset[l.model->node_count - 1], NAN);
        else l.in.probe[0].velocity_m_s[2] = NAN;
        for (int i = 0; i < 3; i++) {
            kn_status status = kn_step(l.model, l.state, l.scratch, &l.in, &l.out);
            CHECK((in_state && i == 0) || (status == KN_DIVERGED && l.state->bad));
            put(&l, 0, 0, 0, 0.0299);
        }
        for (int k = 0; k < 3; k++) CHECK(l.out.probe[0].force_n[k] == 0);
        kn_state_reset(l.model, l.state);
        step(&l);
        CHECK(l.out.probe[0].force_n[2] > 0);
    }
}
