// gate in release: arithmetic, ten times slower with the sanitizers
#include "clients/hand/haptic_loop.h"
#include "core/contact_fit.h"
#include "core/local/patch.h"
#include "tests/check.h"
#include "tests/dice.h"
#include <stdbool.h>

// Units that are identified in the real lattice, compared with the later forces of that lattice.

#define LAG 30 // ms between a pose and the unit that answers it
#define TOP_M 0.030
#define RADIUS_M 0.015
#define K_VC 800.0
#define B_VC 2.0

static kn_model_def block(bool jelly)
{
    kn_model_def def = kn_model_def_default(); // the default material is dough
    def.nodes[0] = def.nodes[1] = 11;
    def.nodes[2] = 7;
    def.spacing_m = 0.005;
    if (jelly) {
        def.material = (kn_material){.k1_pa = 21700, .c1_pa_s = 225}; // a firm jelly, at rest after half a second
        def.density_kg_m3 = 1020;
    }
    def.probe_count = 1;
    def.probe[0] = (kn_probe_def){
        .name = "finger", .shape = KN_PROBE_SPHERE, .radius_m = RADIUS_M, .coupling_n_m = K_VC, .coupling_n_s_m = B_VC};
    return def;
}

typedef struct rig {
    kn_model *model;
    kn_state *state;
    kn_contact_fit *fit;
    kn_contact_model client;
    kn_contact_unit unit[LAG + 1]; // units on their way to the client
    kn_input in;
    kn_output out;
    int64_t tick, heard; // heard: newest pose that reached the server
    double loss;         // loss rate of poses and of units; losses come in bursts of three on average
    bool lost[2];
    uint64_t random;
} rig;

static rig rig_of(kn_model_def def)
{
    rig r = {.model = build(&def)};
    r.state = kn_state_create(r.model);
    r.fit = kn_contact_fit_create(r.model, (kn_coupling){K_VC, B_VC});
    kn_contact_model_init(
        &r.client,
        &(kn_contact_model_def){
            .session = 7, .radius_m = RADIUS_M, .force_limit_n = 20, .stiffness_n_m = K_VC, .damping_n_s_m = B_VC});
    r.in.probe[0].attached = true;
    return r;
}

static rig rig_make(bool jelly) { return rig_of(block(jelly)); }

static void rig_free(rig *r)
{
    kn_contact_fit_destroy(r->fit);
    kn_state_destroy(r->state);
    kn_model_destroy(r->model);
}

static bool lose(rig *r, int way)
{
    return r->lost[way] = kn_dice(&r->random) < (r->lost[way] ? 2.0 / 3.0 : r->loss / (1 - r->loss) / 3.0);
}

// Run one tick of the server and one of the client. The client takes the unit of LAG ms before and renders the force
// of now.
static void step(rig *r, const double x[3], const double v[3], double rendered_n[3])
{
    if (r->tick == 0 || !lose(r, 0)) { // on loss the last pose stays in use
        memcpy(r->in.probe[0].position_m, x, 3 * sizeof *x);
        memcpy(r->in.probe[0].velocity_m_s, v, 3 * sizeof *v);
        r->heard = r->tick;
    }
    CHECK(kn_step(r->model, r->state, &r->in, &r->out) == KN_OK);
    kn_contact_fit_step(r->fit, r->state, &r->in, &r->out);
    kn_contact_fit_iterate(r->fit, r->state);
    kn_contact_unit *unit = &r->unit[r->tick % (LAG + 1)];
    kn_contact_fit_units(r->fit, 0, 1, unit);
    unit->session = lose(r, 1) ? 0 : 7; // session 0 belongs to nobody, so the client refuses the unit
    unit->utime = r->tick;
    unit->pose_seq = r->heard;
    unit->flags = KN_CONTACT_ENGAGED;
    kn_contact_model_pose(&r->client, r->tick, x, v);
    if (r->tick >= LAG) kn_contact_model_take(&r->client, &r->unit[(r->tick - LAG) % (LAG + 1)]);
    kn_contact_model_render(&r->client, 1e-3, x, v, rendered_n);
    r->tick++;
}

typedef enum gesture { PRESS, TAP, SLIDE } gesture;

// Return the position of the tool's centre at time t, starting above the untouched top, and its velocity.
static void follow(gesture what, double t, double x[3], double v[3])
{
    double down = fmin(0.005, fmax(0, 0.02 * (t - 0.5))), up = fmin(0.008, fmax(0, 0.02 * (t - 2.2))), turn = 12.566;
    memset(x, 0, 3 * sizeof *x);
    memset(v, 0, 3 * sizeof *v);
    x[2] = TOP_M + RADIUS_M + 0.003 - down + (what == PRESS ? up : 0);
    if (down > 0 && down < 0.005) v[2] = -0.02;
    if (what == PRESS && up > 0 && up < 0.008) v[2] = 0.02;
    if (what == TAP) {
        x[2] = TOP_M + RADIUS_M + 0.003 * cos(turn * fmax(0, t - 0.5));
        v[2] = t > 0.5 ? -0.003 * turn * sin(turn * (t - 0.5)) : 0;
    }
    if (what == SLIDE) {
        x[0] = 0.010 * fmax(0, t - 1) - 0.01;
        v[0] = t > 1 ? 0.010 : 0;
    }
}

TEST("a contact unit 30 ms old renders the force within 2 to 12 %, with at most 0.3 of the error of a held force")
{
    // measured errors: 2.0 5.7 1.3 %, 1.7 8.4 1.1 %
    static const double bound[2][3] = {{0.03, 0.08, 0.02}, {0.025, 0.12, 0.02}};
    for (int jelly = 0; jelly < 2; jelly++)
        for (int what = PRESS; what <= SLIDE; what++) {
            if ((jelly + what) % KN_LENGTH(2, 1, 1)) continue;
            AT_END(rig_free) rig r = rig_make(jelly);
            double past[LAG] = {0}, off = 0, held = 0, all = 0, x[3], v[3], force[3];
            for (int n = 0; n < 3000; n++) {
                follow((gesture)what, 1e-3 * n, x, v);
                step(&r, x, v, force);
                double now = r.out.probe[0].force_n[2];
                off += pow(force[2] - now, 2);
                held += pow(past[n % LAG] - now, 2);
                all += now * now;
                past[n % LAG] = now;
            }
            if (!(sqrt(off / all) <= bound[jelly][what]) || !(off <= 0.3 * 0.3 * held))
                KN_TEST_FAIL("%s, %d: %.4f, the last force held %.4f", jelly ? "jelly" : "dough", what, sqrt(off / all),
                             sqrt(held / all));
        }
}

TEST("behind the coupling of a virtual hand, 50 kN/m, the rendered force of pressing dough errs by at most 12 %")
{
    kn_model_def def = block(false);
    def.probe[0].coupling_n_m = 5e4;
    def.probe[0].coupling_n_s_m = 50;
    AT_END(rig_free) rig r = rig_of(def);
    kn_contact_model_init(
        &r.client,
        &(kn_contact_model_def){
            .session = 7, .radius_m = RADIUS_M, .force_limit_n = 20, .stiffness_n_m = 5e4, .damping_n_s_m = 50});
    double off = 0, all = 0, x[3], v[3], force[3];
    for (int n = 0; n < 2500; n++) {
        follow(PRESS, 1e-3 * n, x, v);
        step(&r, x, v, force);
        off += pow(force[2] - r.out.probe[0].force_n[2], 2);
        all += pow(r.out.probe[0].force_n[2], 2);
    }
    if (!(sqrt(off / all) <= 0.12)) KN_TEST_FAIL("%.3f", sqrt(off / all));
}

typedef struct loop {
    // force above 10 Hz; largest energy returned beyond the energy put in; force at the end
    double buzz_n, given_mj, force_n;
    double error;  // error relative to the lattice's force for the device's path, rms
    double jump_n; // largest change in 1 ms after the first 300 ms
} loop;

// A second lattice whose tool follows the device rigidly.
typedef struct bare {
    kn_model *model;
    kn_state *state;
    kn_input in;
    double away, whole;
} bare;

static bare bare_make(bool jelly)
{
    kn_model_def def = block(jelly);
    def.probe[0].coupling_n_m = def.probe[0].coupling_n_s_m = 0;
    bare b = {.model = build(&def)};
    b.state = kn_state_create(b.model);
    b.in.probe[0].attached = true;
    return b;
}

static void bare_step(bare *b, const kn_held_device *arm, const double rendered_n[3])
{
    kn_output out;
    memcpy(b->in.probe[0].position_m, arm->x_m, sizeof arm->x_m);
    memcpy(b->in.probe[0].velocity_m_s, arm->v_m_s, sizeof arm->v_m_s);
    CHECK(kn_step(b->model, b->state, &b->in, &out) == KN_OK);
    for (int k = 0; k < 3; k++) {
        b->away += pow(rendered_n[k] - out.probe[0].force_n[k], 2);
        b->whole += pow(out.probe[0].force_n[k], 2);
    }
}

// Close the loop of a simulated device in a hand and the lattice. Either directly, or through a client 30 ms away
// that loses a fifth of all poses and units.
static loop close_loop(bool jelly, bool far, gesture what)
{
    AT_END(rig_free) rig r = rig_make(jelly);
    r.loss = far ? 0.2 : 0;
    kn_held_device arm;
    kn_held_device_def def = {
        .mass_kg = 0.1, .damping_n_s_m = 0.2, .encoder_m = 20e-6, .force_limit_n = 12, .grip = KN_GRIP_NORMAL};
    double force[3] = {0}, path[3], rate[3], work = 0, last_n = 0;
    bare b = bare_make(jelly);
    loop l = {0};
    kn_buzz buzz;
    follow(what, 0, path, rate);
    kn_held_device_init(&arm, &def, path);
    kn_buzz_init(&buzz, 1e-3, 0);
    for (int n = 0; n < 2500; n++) {
        step(&r, arm.position_m, arm.velocity_m_s, force);
        if (!far) memcpy(force, r.out.probe[0].force_n, sizeof force);
        bare_step(&b, &arm, force);
        if (n > 300) l.jump_n = fmax(l.jump_n, fabs(force[2] - last_n));
        last_n = force[2];
        double before[3];
        memcpy(before, arm.position_m, sizeof before);
        follow(what, 1e-3 * n, path, rate);
        // go 6 mm deeper once the gain is up, since the grip is compliant
        double deeper = fmin(1, fmax(0, 5 * (1e-3 * n - 0.3)));
        path[2] -= 0.006 * deeper;
        rate[2] -= deeper > 0 && deeper < 1 ? 0.030 : 0;
        kn_held_device_tick(&arm, force, path, rate);
        for (int k = 0; k < 3; k++) work -= 1e3 * arm.force_n[k] * (arm.position_m[k] - before[k]);
        l.given_mj = fmax(l.given_mj, -work);
        kn_buzz_add(&buzz, force[2]);
    }
    l.buzz_n = kn_buzz_rms(&buzz);
    l.force_n = force[2];
    l.error = sqrt(b.away / b.whole);
    kn_state_destroy(b.state);
    kn_model_destroy(b.model);
    return l;
}

NIGHT_TEST("30 ms away with a fifth lost, the error grows by at most 2 points, the buzz by 30 %, the returned energy "
           "by 0.5 mJ")
{
    for (int jelly = 0; jelly < 2; jelly++)
        for (int what = PRESS; what <= SLIDE; what++) {
            if ((jelly + what) % KN_LENGTH(2, 1, 1)) continue;
            loop near = close_loop(jelly, false, (gesture)what), far = close_loop(jelly, true, (gesture)what);
            if (!(far.buzz_n <= 1.3 * near.buzz_n + 0.01) || !(far.given_mj <= near.given_mj + 0.5))
                KN_TEST_FAIL("%s, %d: %.4f N above 10 Hz beside %.4f, %.3f mJ beside %.3f", jelly ? "jelly" : "dough",
                             what, far.buzz_n, near.buzz_n, far.given_mj, near.given_mj);
            CHECK_NEAR(far.force_n, near.force_n, 0.02 + 0.05 * near.force_n);
            if (!(far.error <= near.error + 0.02) || !(far.jump_n <= 0.1)) // measured: 0.2 points, 0.04 and 0.07 N/ms
                KN_TEST_FAIL("%s, %d: error %.4f beside %.4f, %.3f N/ms beside %.3f", jelly ? "jelly" : "dough", what,
                             far.error, near.error, far.jump_n, near.jump_n);
        }
}

// A plate follows its pose rigidly. No device is stable with such a plate on dough, with or without a link.
TEST("a rigid plate's unit covers all nodes ahead; 30 ms away the plate returns no energy, and on dough the unit "
     "expires within 10 ms")
{
    for (int jelly = 0; jelly < 2; jelly++) {
        kn_model_def def = block(jelly);
        def.probe[0] = (kn_probe_def){.name = "plate", .shape = KN_PROBE_PLATE, .size_m = {0.010, 0.060}};
        AT_END(rig_free) rig r = rig_of(def);
        r.loss = 0.2;
        kn_held_device arm;
        kn_held_device_def device = {
            .mass_kg = 0.1, .damping_n_s_m = 0.2, .encoder_m = 20e-6, .force_limit_n = 12, .grip = KN_GRIP_NORMAL};
        kn_held_device_init(&arm, &device, (double[]){0, 0, TOP_M + 0.003});
        kn_contact_unit ahead = {0}, pressed = {0};
        double force[3] = {0}, work = 0, given_mj = 0;
        for (int n = 0; n < 2000; n++) {
            step(&r, arm.position_m, arm.velocity_m_s, force);
            kn_contact_unit *now = &r.unit[(r.tick - 1) % (LAG + 1)];
            if (now->force_n > 0) pressed = *now;
            else if (!(pressed.force_n > 0)) ahead = *now;
            double before = arm.position_m[2], down = fmin(0.010, fmax(0, 0.02 * (1e-3 * n - 0.3)));
            double path[3] = {0, 0, TOP_M + 0.003 - down}, rate[3] = {0, 0, down > 0 && down < 0.010 ? -0.02 : 0};
            kn_held_device_tick(&arm, force, path, rate);
            work -= 1e3 * arm.force_n[2] * (arm.position_m[2] - before);
            given_mj = fmax(given_mj, -work);
        }
        // without the model: 750, 450
        if (!(given_mj <= 0.5)) KN_TEST_FAIL("%s: %.1f mJ", jelly ? "jelly" : "dough", given_mj);
        CHECK_NEAR(ahead.a_n_s_per_m, pressed.a_n_s_per_m, 0.2 * pressed.a_n_s_per_m);
        CHECK(ahead.k_vc_n_per_m == 0 && pressed.k_vc_n_per_m == 0);
        CHECK(jelly ? pressed.valid_ms == 100 : pressed.valid_ms < 10);
        CHECK(!jelly || force[2] > 0.5);
    }
}

TEST("a contact fit that observes the lattice does not change a bit of its state")
{
    AT_END(rig_free) rig watched = rig_make(false), alone = rig_make(false);
    double x[3], v[3], force[3];
    for (int n = 0; n < 900; n++) {
        follow(PRESS, 1e-3 * n, x, v);
        step(&watched, x, v, force);
        memcpy(alone.in.probe[0].position_m, x, sizeof x);
        memcpy(alone.in.probe[0].velocity_m_s, v, sizeof v);
        kn_step(alone.model, alone.state, &alone.in, &alone.out);
    }
    CHECK(memcmp(&watched.out, &alone.out, sizeof alone.out) == 0);
    CHECK(kn_state_hash(watched.model, watched.state) == kn_state_hash(alone.model, alone.state));
}

TEST("a column without diagonals under a uniform load has the resistance A times area over height, in f32 and f64")
{
    kn_model_def def = kn_model_def_default();
    def.structure = KN_STRUCTURE_AXIS;
    def.nodes[0] = def.nodes[1] = 2;
    def.nodes[2] = 5;
    def.probe_count = 1;
    def.probe[0] = (kn_probe_def){.name = "finger", .shape = KN_PROBE_SPHERE, .radius_m = 0.02};
    for (int precision = KN_PRECISION_F32; precision <= KN_PRECISION_F64; precision++) {
        def.solver.precision = (kn_precision)precision;
        OWN(kn_model) *model = build(&def);
        kn_mobility *m = kn_mobility_create(model);
        double a = 0, push[3] = {0, 0, -0.25}; // the column is 1 cm by 1 cm by 4 cm
        for (int round = 0; round < 4; round++) {
            kn_mobility_begin(m, 0);
            for (int t = 0; t < model->top_count; t++) kn_mobility_load(m, model->offset[model->top[t]], push);
            kn_mobility_start(m);
            while (!kn_mobility_iterate(m, &a)) {
            }
            CHECK_NEAR(a, model->law.a_pa_s * 1e-4 / 0.04, 0.003 * a); // the margin covers a little inertia
        }
        kn_mobility_destroy(m);
    }
}

TEST("a tool near the surface gets the plane ahead; a distant or detached tool gets no contact")
{
    AT_END(rig_free) rig r = rig_make(false);
    double x[3] = {0.003, -0.002, TOP_M + RADIUS_M + 0.050}, v[3] = {0}, force[3];
    for (int n = 0; n < 5; n++) step(&r, x, v, force);
    CHECK(r.unit[4].contact_count == 0);
    x[2] = TOP_M + RADIUS_M + 0.010;
    for (int n = 0; n < 60; n++) step(&r, x, v, force);
    const kn_contact_unit *u = &r.unit[(r.tick - 1) % (LAG + 1)];
    CHECK(u->contact_count == 1 && u->force_n == 0);
    CHECK(u->normal[2] > 0.998); // the nearest sample is not exactly below the tool
    CHECK_NEAR(u->proxy_m[2], TOP_M + RADIUS_M, 2e-4);
    CHECK(u->a_n_s_per_m > 100 && u->c2_n_s_per_m > u->a_n_s_per_m);
    r.in.probe[0].attached = false;
    step(&r, x, v, force);
    CHECK(r.unit[(r.tick - 1) % (LAG + 1)].contact_count == 0);
}
TESTS_MAIN
