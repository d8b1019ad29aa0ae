#include "core/lattice/measure.h"
#include "core/solve/kernel.h"
#include "core/scene/scene.h"
#include "tests/physics/press.h"
#include "tests/check.h"

OWNS(kn_audit, kn_audit_destroy)

typedef struct played { // result of an audited press
    kn_audit_news news;
    double work_j, either_j;
    double least_lost; // smallest energy lost in any window, J
} played;

static played play(const kn_model_def *def, const press *p, double seconds)
{
    OWN(kn_model) *model = build(def);
    OWN(kn_state) *state = kn_state_create(model);
    OWN(kn_audit) *audit = kn_audit_create(model);
    played r = {.least_lost = INFINITY};
    int64_t windows = 0;
    for (int i = 1; i <= (int)lround(seconds * 1000); i++) {
        kn_input in = press_input(model, p, i * 1e-3);
        kn_output out;
        double before = state->probe[0].work_j;
        CHECK(kn_step(model, state, &in, &out) == KN_OK);
        r.either_j += fabs(state->probe[0].work_j - before);
        kn_audit_tick(audit, state);
        r.news = *kn_audit_read(audit);
        if (r.news.windows > windows) r.least_lost = fmin(r.least_lost, r.news.lost_j);
        windows = r.news.windows;
    }
    r.work_j = state->probe[0].work_j;
    return r;
}

static const press paced = {.depth_m = 0.004, .hold_s = 1, .pace = 1};

TEST("in a press of dough, jelly and clay with the fast settings, no audit window creates energy")
{
    const kn_material materials[] = {dough, jelly(), clay()};
    for (int m = 0; m < 3; m++)
        for (int gas = 0; gas < 2; gas++) {
            kn_model_def def = press_def(1);
            def.material = materials[m];
            def.pressure = gas ? KN_PRESSURE_CELLS : KN_PRESSURE_NONE;
            played r = play(&def, &paced, 4);
            printf("     %s, %s: %.4f mJ of work, least lost in a window %.2e J, %lld windows\n",
                   (const char *[]){"dough", "jelly", "clay"}[m], gas ? "gas" : "open", 1e3 * r.work_j, r.least_lost,
                   (long long)r.news.windows);
            CHECK(r.news.windows >= 2);
            CHECK(r.news.created == 0);
        }
}

TEST("no audit window creates energy with balls that are rough, sticky, coupled or on a table")
{
    for (int c = 0; c < 5; c++) {
        kn_model_def def = ball_def(1);
        def.material = c == 4 ? jelly() : dough;
        if (c >= 1) def.probe[0].friction = 0.8, def.probe[0].adhesion_pa = 500;
        if (c >= 2) def.probe[0].coupling_n_m = 600, def.probe[0].coupling_n_s_m = 1.5;
        if (c >= 3) def.support = KN_SUPPORT_FRICTION, def.support_friction = 0.4, def.gravity_m_s2 = 9.81;
        played r = play(&def, &paced, 4);
        printf("     case %d: %.4f mJ of work, least lost %.2e J\n", c, 1e3 * r.work_j, r.least_lost);
        CHECK(r.news.windows >= 2 && r.news.created == 0 && r.work_j > 1e-4);
    }
}

TEST("a tool that starts inside the object grows into contact, and its work is counted")
{
    kn_model_def def = ball_def(1);
    def.material = jelly();
    def.probe[0].coupling_n_m = 600, def.probe[0].coupling_n_s_m = 1.5;
    OWN(kn_model) *model = build(&def);
    OWN(kn_state) *state = kn_state_create(model);
    OWN(kn_audit) *audit = kn_audit_create(model);
    kn_input in = {.probe[0] = {.attached = true, .position_m = {0, 0, 0.036}, .orientation_wxyz = {1}}};
    kn_output out;
    for (int i = 0; i < 4000; i++) {
        kn_step(model, state, &in, &out);
        kn_audit_tick(audit, state);
    }
    const kn_audit_news *news = kn_audit_read(audit);
    CHECK(out.probe[0].force_n[2] > 0.1 && state->tool[0].relief_m == 0);
    printf("     %.4f mJ of work, %.4f mJ stored\n", 1e3 * news->work_j, 1e3 * news->stored.elastic);
    CHECK(news->work_j > news->stored.elastic && news->stored.elastic > 0);
    CHECK(news->windows >= 2 && news->created == 0);
}

static kn_scene *scene_of(const char *name, double damper_pa_s)
{
    kn_scene *scene = load_scene(name, NULL, 0);
    scene->model.gravity_m_s2 = 9.81;
    scene->model.material = jelly();
    if (damper_pa_s > 0) scene->model.material.damper = KN_DAMPER_CONSTANT, scene->model.material.c2_pa_s = damper_pa_s;
    return scene;
}

// Return the energy after 0.3 s under the scene's first tool.
static kn_energy pressed(const kn_scene *scene)
{
    OWN(kn_model) *model = build(&scene->model);
    OWN(kn_state) *state = kn_state_create(model);
    const press p = {.depth_m = 0.002, .hold_s = 1};
    kn_energy energy = {0};
    kn_output out;
    for (int i = 1; i <= 300; i++) {
        kn_input in = press_input(model, &p, i * 1e-3);
        CHECK(kn_step(model, state, &in, &out) == KN_OK);
    }
    CHECK(kn_energy_of(model, state, &energy));
    return energy;
}

static const char *const scenes[] = {"dough.yaml", "dough-pressure.yaml", "dough-fine.yaml", "bun.yaml"};

TEST("an almost rigid damper stores the energy of no damper: energy counts strain, in blocks, composites and meshes")
{
    for (int c = 0; c < 4; c++) {
        OWN(kn_scene) *elastic = scene_of(scenes[c], 0), *stiff = scene_of(scenes[c], 1e8);
        kn_energy a = pressed(elastic), b = pressed(stiff);
        printf("     %s: %.6g and %.6g mJ, gas %.4g mJ\n", scenes[c], 1e3 * a.elastic, 1e3 * b.elastic, 1e3 * a.gas);
        CHECK(a.elastic > 1e-6);
        CHECK_NEAR(b.elastic / a.elastic, 1, 1e-3);
        CHECK((a.gas > 0) == (elastic->model.pressure != KN_PRESSURE_NONE));
    }
}

TEST("a lifted block, composite or mesh has the energy of its weight times the height and no other")
{
    for (int c = 0; c < 4; c++) {
        OWN(kn_scene) *scene = scene_of(scenes[c], 1e8);
        OWN(kn_model) *m = build(&scene->model);
        OWN(kn_state) *state = kn_state_create(m);
        kn_energy energy;
        CHECK(kn_energy_of(m, state, &energy));
        CHECK_NEAR(kn_energy_sum(&energy), 0, 1e-20);
        for (int i = 0; i < m->node_count; i++) kn_real_set(m, state->displacement, m->offset[i] + 2 * m->stride, 0.01);
        CHECK(kn_energy_of(m, state, &energy));
        CHECK_NEAR(energy.height, kn_model_mass(m) * 9.81 * 0.01, 1e-6 * energy.height);
        CHECK_NEAR(energy.elastic + energy.gas, 0, 1e-7 * energy.height);
    }
}

typedef struct rig { // jelly under a plate, audited
    kn_model *model;
    kn_state *state;
    kn_audit *audit;
} rig;

static rig rig_open(void)
{
    kn_model_def def = press_def(1);
    def.material = jelly();
    kn_model *model = build(&def);
    return (rig){model, kn_state_create(model), kn_audit_create(model)};
}

static void rig_step(rig *r, const kn_input *in)
{
    kn_output out;
    CHECK(kn_step(r->model, r->state, in, &out) == KN_OK);
    kn_audit_tick(r->audit, r->state);
}

static void rig_close(rig *r)
{
    kn_audit_destroy(r->audit);
    kn_state_destroy(r->state);
    kn_model_destroy(r->model);
}

TEST("a tool that detaches and attaches again keeps the work of both presses")
{
    AT_END(rig_close) rig r = rig_open();
    const press p = {.depth_m = 0.004, .hold_s = 1};
    double work_j = 0;
    for (int i = 1; i <= 6000; i++) { // two presses of 3 s, each lifted at the end
        kn_input in = press_input(r.model, &p, i % 3000 * 1e-3);
        in.probe[0].attached = i % 3000 > 10;
        rig_step(&r, &in);
        if (i == 2999) work_j = r.state->probe[0].work_j;
    }
    for (int i = 0; i < 1000; i++) rig_step(&r, &(kn_input){0});
    CHECK(work_j > 1e-5 && kn_audit_read(r.audit)->created == 0);
    CHECK_NEAR(kn_audit_read(r.audit)->work_j, 2 * work_j, 0.01 * work_j);
}

TEST("energy from nowhere is reported, and a reset is not mistaken for it")
{
    AT_END(rig_close) rig r = rig_open();
    const press p = {.depth_m = 0.004, .hold_s = 30};
    for (int i = 1; i <= 9000; i++) {
        kn_input in = press_input(r.model, &p, i * 1e-3);
        if (i == 5500) kn_state_reset(r.model, r.state);
        if (i == 2400) // stretch the object by a tenth without any work
            for (int n = 0; n < r.model->node_count; n++) {
                size_t z = r.model->offset[n] + 2 * r.model->stride;
                kn_real_set(r.model, r.state->displacement, z, 1.1 * kn_real_get(r.model, r.state->displacement, z));
            }
        rig_step(&r, &in);
        if (i == 2300) CHECK(kn_audit_read(r.audit)->created == 0);
    }
    CHECK(kn_audit_read(r.audit)->created == 1);
    CHECK(kn_audit_read(r.audit)->windows >= 6);
}

TEST("a diverged object creates no energy, and the audit restarts with the next object")
{
    AT_END(rig_close) rig r = rig_open();
    const press p = {.depth_m = 0.004, .hold_s = 30};
    int64_t windows = 0;
    for (int i = 1; i <= 9000; i++) {
        kn_input in = press_input(r.model, &p, i * 1e-3);
        if (i == 2400) kn_real_set(r.model, r.state->displacement, r.model->offset[7], NAN);
        if (i == 6400) kn_state_reset(r.model, r.state);
        kn_output out;
        kn_status status = kn_step(r.model, r.state, &in, &out);
        CHECK((status == KN_OK) == (i < 2400 || i >= 6400));
        kn_audit_tick(r.audit, r.state);
        const kn_audit_news *news = kn_audit_read(r.audit);
        CHECK(isfinite(kn_energy_sum(&news->stored)) && isfinite(news->balance_j) && isfinite(news->lost_j));
        if (i == 6399) windows = news->windows;
    }
    CHECK(kn_audit_read(r.audit)->created == 0);
    CHECK(windows >= 1 && windows <= 2); // only windows before the object went bad
    CHECK(kn_audit_read(r.audit)->windows > windows);
}

TESTS_MAIN
