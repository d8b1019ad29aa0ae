#include "core/lattice/measure.h"
#include "tests/lattice.h"

OWNS(kn_audit, kn_audit_destroy)

// Step an audited lattice with the input as it stands, and return the audit's news.
static const kn_audit_news *audited_step(lattice *l, kn_audit *audit)
{
    step(l);
    kn_audit_tick(audit, l->state, l->scratch);
    return kn_audit_read(audit);
}

static const kn_audit_news *audited_press(lattice *l, kn_audit *audit, const press *p, double t)
{
    l->in = press_input(l->model, p, t);
    return audited_step(l, audit);
}

TEST(
    "no audit window creates energy: dough, jelly and clay, with gas, under a plate, and rough, sticky, coupled balls, "
    "also on a table")
{
    static const char *const names[] = {"dough", "jelly", "clay"};
    const kn_material materials[] = {dough, jelly(), clay()};
    const press paced = {.depth_m = 0.004, .hold_s = 1};
    for (int c = 0; c < 11; c++) { // 0 to 5: plates; from 6 on: balls
        const int ball = c - 6;
        kn_model_def def = c < 6 ? press_def(1) : ball_def(1);
        kn_probe_def *tool = &def.probe[0];
        def.material = materials[c < 6 ? c / 2 : ball == 4];
        if (c < 6 && c % 2) def.pressure = KN_PRESSURE_CELLS;
        if (ball >= 1) tool->friction = 0.8, tool->adhesion_pa = 500;
        if (ball >= 2) tool->coupling_n_m = 600, tool->coupling_n_s_m = 1.5;
        if (ball >= 3) def.support = KN_SUPPORT_FRICTION, def.support_friction = 0.4, def.gravity_m_s2 = 9.81;
        LATTICE l = lattice_of(def);
        OWN(kn_audit) *audit = kn_audit_create(l.model);
        for (int i = 1; i <= 4000; i++) audited_press(&l, audit, &paced, i * 1e-3);
        const kn_audit_news *news = kn_audit_read(audit);
        printf("     case %d, %s: %.4f mJ of work, %lld windows\n", c, names[c < 6 ? c / 2 : ball == 4],
               1e3 * l.state->probe[0].work_j, (long long)news->windows);
        CHECK(news->windows >= 2 && news->created == 0 && l.state->probe[0].work_j > 1e-4);
    }
}

TEST("a tool that starts inside the object grows into contact gently, and its work is counted")
{
    kn_model_def def = ball_def(1);
    def.material = jelly();
    def.probe[0].friction = 0.3, def.probe[0].coupling_n_m = 600, def.probe[0].coupling_n_s_m = 1.5;
    LATTICE l = lattice_of(def);
    OWN(kn_audit) *audit = kn_audit_create(l.model);
    put(&l, 0, 0, 0, 0.03 + 0.01 - 0.004);
    for (int i = 0; i < 4000; i++) {
        double last_n = l.out.probe[0].force_n[2];
        audited_step(&l, audit);
        CHECK(fabs(l.out.probe[0].force_n[2] - last_n) < 0.05);
    }
    const kn_audit_news *news = kn_audit_read(audit);
    CHECK(l.out.probe[0].force_n[2] > 0.2 && l.state->tool[0].relief_m == 0);
    printf("     %.4f mJ of work, %.4f mJ stored\n", 1e3 * news->work_j, 1e3 * news->stored.elastic);
    CHECK(news->work_j > news->stored.elastic && news->stored.elastic > 0);
    CHECK(news->windows >= 2 && news->created == 0);
}

static const char *const scenes[] = {"dough-diagonals.yaml", "dough.yaml", "dough-fine.yaml", "bun.yaml"};

static lattice jelly_scene(const char *name, double damper_pa_s)
{
    kn_scene *scene = load_scene(name, NULL, 0);
    scene->model.gravity_m_s2 = 9.81;
    scene->model.material = jelly();
    if (damper_pa_s > 0) scene->model.material.damper = KN_DAMPER_CONSTANT, scene->model.material.c2_pa_s = damper_pa_s;
    return lattice_of_scene(scene);
}

TEST("an almost rigid damper stores the energy of no damper: energy counts strain, in blocks, composites and meshes")
{
    for (int c = 0; c < 4; c++) {
        LATTICE elastic = jelly_scene(scenes[c], 0), stiff = jelly_scene(scenes[c], 1e8);
        const press p = {.depth_m = 0.002, .hold_s = 1};
        kn_energy a, b;
        press_until(&elastic, &p, 300), press_until(&stiff, &p, 300);
        CHECK(kn_energy_of(elastic.model, elastic.state, &a) && kn_energy_of(stiff.model, stiff.state, &b));
        printf("     %s: %.6g and %.6g mJ, gas %.4g mJ\n", scenes[c], 1e3 * a.elastic, 1e3 * b.elastic, 1e3 * a.gas);
        CHECK(a.elastic > 1e-6);
        CHECK_NEAR(b.elastic / a.elastic, 1, 1e-3);
        CHECK((a.gas > 0) == (elastic.model->def.pressure != KN_PRESSURE_NONE));
    }
}

TEST("a lifted block, composite or mesh has the energy of its weight times the height and no other")
{
    for (int c = 0; c < 4; c++) {
        LATTICE l = jelly_scene(scenes[c], 1e8);
        const kn_model *m = l.model;
        kn_energy energy;
        CHECK(kn_energy_of(m, l.state, &energy));
        CHECK_NEAR(kn_energy_sum(&energy), 0, 1e-20);
        for (int i = 0; i < m->node_count; i++)
            kn_real_set(m, l.state->displacement, m->offset[i] + 2 * m->stride, 0.01);
        CHECK(kn_energy_of(m, l.state, &energy));
        CHECK_NEAR(energy.height, kn_model_mass(m) * 9.81 * 0.01, 1e-6 * energy.height);
        CHECK_NEAR(energy.elastic + energy.gas, 0, 1e-7 * energy.height);
    }
}

static lattice jelly_under_plate(void)
{
    kn_model_def def = press_def(1);
    def.material = jelly();
    return lattice_of(def);
}

TEST("a tool that detaches and attaches again keeps the work of both presses")
{
    LATTICE l = jelly_under_plate();
    OWN(kn_audit) *audit = kn_audit_create(l.model);
    const press p = {.depth_m = 0.004, .hold_s = 1};
    double work_j = 0;
    for (int i = 1; i <= 7000; i++) { // two presses of 3 s, each lifted at the end, and a second of rest
        l.in = press_input(l.model, &p, i % 3000 * 1e-3);
        l.in.probe[0].attached = i <= 6000 && i % 3000 > 10;
        audited_step(&l, audit);
        if (i == 2999) work_j = l.state->probe[0].work_j;
    }
    CHECK(work_j > 1e-5 && kn_audit_read(audit)->created == 0);
    CHECK_NEAR(kn_audit_read(audit)->work_j, 2 * work_j, 0.01 * work_j);
}

static const press endless = {.depth_m = 0.004, .hold_s = 30};

TEST("energy from nowhere is reported, and a reset is not mistaken for it")
{
    LATTICE l = jelly_under_plate();
    OWN(kn_audit) *audit = kn_audit_create(l.model);
    const kn_audit_news *news = NULL;
    for (int i = 1; i <= 9000; i++) {
        if (i == 5500) kn_state_reset(l.model, l.state);
        if (i == 2400) // stretch the object by a tenth without any work
            for (int n = 0; n < l.model->node_count; n++) {
                size_t z = l.model->offset[n] + 2 * l.model->stride;
                kn_real_set(l.model, l.state->displacement, z, 1.1 * kn_real_get(l.model, l.state->displacement, z));
            }
        news = audited_press(&l, audit, &endless, i * 1e-3);
        if (i == 2300) CHECK(news->created == 0);
    }
    CHECK(news->created == 1 && news->windows >= 6);
}

TEST("a diverged object creates no energy, and the audit restarts with the next object")
{
    LATTICE l = jelly_under_plate();
    OWN(kn_audit) *audit = kn_audit_create(l.model);
    const kn_audit_news *news = kn_audit_read(audit);
    int64_t windows = 0;
    for (int i = 1; i <= 9000; i++) {
        l.in = press_input(l.model, &endless, i * 1e-3);
        if (i == 2400) kn_real_set(l.model, l.state->displacement, l.model->offset[7], NAN);
        if (i == 6400) windows = news->windows, kn_state_reset(l.model, l.state);
        CHECK((kn_step(l.model, l.state, l.scratch, &l.in, &l.out) == KN_OK) == (i < 2400 || i >= 6400));
        kn_audit_tick(audit, l.state, l.scratch);
        news = kn_audit_read(audit);
        CHECK(isfinite(kn_energy_sum(&news->stored)) && isfinite(news->balance_j) && isfinite(news->lost_j));
    }
    CHECK(windows >= 1 && windows <= 2); // only windows before the object went bad
    CHECK(news->created == 0 && news->windows > windows);
}
