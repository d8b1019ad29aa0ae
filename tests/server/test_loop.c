#include "server/loop.h"
#include "clients/knead_mesh.h"
#include "core/solve/step_effort.h"
#include "core/solve/kernel.h"
#include "proto/knead_contact_force_t.h"
#include "proto/knead_event_t.h"
#include "server/served_object.h"
#include "tests/check.h"
#include "tests/server/loop_fixture.h"

// A loop, the mesh that its screen received, and a hand over the plate. One call is one tick.
typedef struct rig {
    kn_loop_fixture fixture;
    kn_mesh mesh;
    kn_pose pose;
    int64_t tick, took_ns; // took_ns: apparent duration of a tick
    kn_tick_out out;
    int kinds[KNEAD_EVENT_T_KIND_OVERLOAD + 1]; // events seen so far
    double audit[5];                            // arguments of the last checkpoint
} rig;

static void on_mesh(const lcm_recv_buf_t *buf, const char *channel, void *self)
{
    rig *r = self;
    if (!strcmp(channel, "KNEAD_MESH_INIT")) kn_mesh_init(&r->mesh, buf->data, buf->data_size);
    else kn_mesh_update(&r->mesh, buf->data, buf->data_size);
}

static void rig_open(rig *r, const char *set)
{
    memset(r, 0, sizeof *r);
    kn_loop_fixture_open(&r->fixture, set);
    lcm_subscribe(r->fixture.skin.lcm, "KNEAD_MESH_.*", on_mesh, r);
    r->pose = (kn_pose){.session = 1, .orientation_wxyz = {1}, .position_m = {0, 0, 0.031}};
}

static void rig_close(rig *r)
{
    kn_mesh_free(&r->mesh);
    kn_loop_fixture_close(&r->fixture);
}

static void move(rig *r, double vz_m_s)
{
    r->pose.seq++;
    r->pose.position_m[2] += 1e-3 * vz_m_s;
    r->pose.velocity_m_s[2] = vz_m_s;
    kn_loop_post(&r->fixture.loop, 0, &r->pose);
    kn_wake wake = {.tick = r->tick++, .now_ns = kn_now_ns() - r->took_ns};
    kn_loop_tick(&r->fixture.loop, &wake);
    r->fixture.loop.execution_ns = 0; // a slow machine would report an overload
    for (const kn_tick_record *record; (record = kn_ring_front(&r->fixture.loop.records));
         kn_ring_pop(&r->fixture.loop.records)) {
        r->out = record->out;
        for (int i = 0; i < r->out.event_count; i++) {
            r->kinds[r->out.event[i].kind]++;
            if (r->out.event[i].kind == KNEAD_EVENT_T_KIND_CHECKPOINT)
                memcpy(r->audit, r->out.event[i].arg, sizeof r->audit);
        }
    }
}

static void hover(rig *r, int ms)
{
    for (int i = 0; i < ms; i++) move(r, 0.0);
}

// Engage in air, rest on the surface, then go 5 mm deep at 1 cm/s.
static void press(rig *r)
{
    r->pose.position_m[2] = 0.031;
    hover(r, 401);
    r->pose.position_m[2] = 0.03;
    hover(r, 300);
    for (double v = 0.0; r->pose.position_m[2] > 0.025; v = fmax(v - 0.0002, -0.01)) move(r, v);
}

static double given_n(const rig *r) { return r->out.force[0].force_n[2]; }

// Return the lowest height of the object's top under the middle of the plate, as the screen shows it.
static double dent_m(rig *r)
{
    kn_skin_publish_topology(&r->fixture.skin, 0);
    kn_skin_publish(&r->fixture.skin, 0);
    while (lcm_handle_timeout(r->fixture.skin.lcm, 0) > 0) {
    }
    double lowest = INFINITY;
    for (int v = 0; v < r->mesh.vertex_count; v++) {
        const float *x = r->mesh.positions_m + 3 * v;
        if (fabsf(x[0]) < 0.006f && fabsf(x[1]) < 0.006f && x[2] > 0.01f) lowest = fmin(lowest, (double)x[2]);
    }
    return lowest;
}

static bool tells(rig *r, const float *told, kn_measure what)
{
    const kn_skin *skin = &r->fixture.skin;
    const kn_model *model = r->fixture.loop.servo.model;
    kn_backend *backend = r->fixture.loop.servo.backend;
    double *value = calloc((size_t)model->node_count, sizeof *value), most = 0, wrong = 0;
    kn_gauge *gauge = kn_gauge_create(model);
    if (told && value && gauge) kn_gauge_read(gauge, backend->state(backend->self), what, value);
    for (int v = 0; told && v < skin->surface->vertex_count; v++) {
        const double is = value[skin->surface->node[v]];
        most = fmax(most, is);
        wrong = fmax(wrong, fabs(is - (double)told[v]));
    }
    kn_gauge_destroy(gauge);
    free(value);
    return told && most > 0 && wrong <= 1e-6 * most;
}

// Publish a mesh of the current state.
static void show_now(rig *r)
{
    r->fixture.skin.next_tick = 0;
    move(r, 0.0);
    dent_m(r);
}

TEST("meshes carry stress and residual strain of their tick if the scene asks for them, and otherwise not")
{
    static const struct {
        const char *set;
        bool stress, residual;
    } asked[] = {{NULL, false, false},
                 {"mesh.measures=none", false, false},
                 {"mesh.measures=stress", true, false},
                 {"mesh.measures=residual", false, true},
                 {"mesh.measures=both", true, true}};
    for (size_t i = 0; i < sizeof asked / sizeof *asked; i++) {
        AT_END(rig_close) rig r = {0};
        rig_open(&r, asked[i].set);
        press(&r);
        show_now(&r);
        CHECK(r.mesh.whole && r.mesh.tick == r.tick - 1);
        CHECK(asked[i].stress ? tells(&r, r.mesh.stress_pa, KN_MEASURE_STRESS) : !r.mesh.stress_pa);
        CHECK(asked[i].residual ? tells(&r, r.mesh.residual_strain, KN_MEASURE_RESIDUAL) : !r.mesh.residual_strain);
    }
}

TEST("after a change of the material meshes carry its stress, and the skin knows which model it showed last")
{
    static rig r;
    char error[300];
    rig_open(&r, "mesh.measures=both");
    press(&r);
    show_now(&r);
    const char *sets[] = {"mesh.measures=both", "material.k1=2000 gf/cm^3"};
    kn_scene *scene = load_scene("dough-small.yaml", sets, 2);
    kn_scene_change *change =
        kn_scene_change_create(scene, r.fixture.scene, r.fixture.model, false, error, sizeof error);
    CHECK(change);
    if (!change) return;
    r.fixture.loop.orders.change = change;
    r.fixture.loop.deadline = 1000000000; // this change has no deadline of its own
    kn_orders_give(&r.fixture.loop.orders, KN_ORDER_CHANGE, 0);
    move(&r, 0.0);
    CHECK(r.fixture.loop.servo.model == change->model && r.fixture.loop.deadline == 1000000000);
    CHECK(kn_skin_follows(&r.fixture.skin, r.fixture.model) && !kn_skin_follows(&r.fixture.skin, change->model));
    show_now(&r);
    CHECK(!kn_skin_follows(&r.fixture.skin, r.fixture.model) && kn_skin_follows(&r.fixture.skin, change->model));
    CHECK(tells(&r, r.mesh.stress_pa, KN_MEASURE_STRESS) && tells(&r, r.mesh.residual_strain, KN_MEASURE_RESIDUAL));
    rig_close(&r);
    kn_scene_change_destroy(change);
}

TEST("the deadline follows the processor with events: down after three long steps that take too long, slowly up again")
{
    AT_END(rig_close) rig r = {0};
    rig_open(&r, NULL);
    kn_time time = {.now_ns = 1000000000};
    kn_clock_hand(&time);
    kn_loop *loop = &r.fixture.loop;
    const double budget_ns = 1e9 * r.fixture.scene->budget_s;
    // every step uses half of this deadline
    const int64_t least = kn_deadline_least(r.fixture.model), given = 3 * least / 2;
    loop->deadline = loop->measured_deadline = given;
    move(&r, 0);
    CHECK(r.kinds[KNEAD_EVENT_T_KIND_DEADLINE] == 1 && loop->servo.deadline == given);
    r.took_ns = (int64_t)(0.9 * budget_ns);
    move(&r, 0), move(&r, 0);
    r.took_ns = 0;
    move(&r, 0);
    CHECK(loop->deadline == given); // two long steps are not enough
    r.took_ns = (int64_t)(0.9 * budget_ns);
    for (int i = 0; i < 4; i++) move(&r, 0);
    CHECK(loop->servo.deadline == (int64_t)((double)given * KN_STEP_SHARE / 0.9) &&
          r.kinds[KNEAD_EVENT_T_KIND_DEADLINE] == 2);
    for (int i = 0; i < 40; i++) move(&r, 0);
    CHECK(loop->servo.deadline == least); // the deadline never goes lower
    r.took_ns = (int64_t)(0.64 * budget_ns);
    for (int i = 0; i < KN_LOOP_FAST_STEPS + 1; i++) move(&r, 0);
    CHECK(loop->servo.deadline == (int64_t)(1.125 * (double)least));
    for (int i = 0; i < 8 * KN_LOOP_FAST_STEPS; i++) move(&r, 0);
    CHECK(loop->servo.deadline == given && loop->deadline == given); // the deadline never goes higher
    kn_clock_hand(NULL);
}

TEST("several resets between two ticks make one reset in the next tick, and its event has the hash of the untouched "
     "object")
{
    AT_END(rig_close) rig r = {0};
    rig_open(&r, NULL);
    uint64_t rest = kn_state_hash(r.fixture.model, r.fixture.backend.state(r.fixture.backend.self));
    press(&r);
    CHECK(given_n(&r) > 1.0 && r.kinds[KNEAD_EVENT_T_KIND_RESET] == 0);
    for (int i = 0; i < 5; i++) kn_orders_give(&r.fixture.loop.orders, KN_ORDER_RESET, 0);
    move(&r, 0.0);
    CHECK(r.kinds[KNEAD_EVENT_T_KIND_RESET] == 1 && r.kinds[KNEAD_EVENT_T_KIND_DETACH] == 1);
    CHECK(r.out.event[0].kind == KNEAD_EVENT_T_KIND_RESET && r.out.event[0].tick == r.tick - 1);
    CHECK(r.out.event[0].state_hash == rest);
    hover(&r, 5);
    CHECK(r.kinds[KNEAD_EVENT_T_KIND_RESET] == 1);
}

TEST("a reset under a hand fades the force and blocks the tool until it is lifted; then the tool feels new dough")
{
    AT_END(rig_close) rig r = {0};
    rig_open(&r, NULL);
    press(&r);
    double first = given_n(&r), slope = kn_safety_slope(&r.fixture.loop.servo.safety[0].limits), last = first;
    kn_orders_give(&r.fixture.loop.orders, KN_ORDER_RESET, 0);
    for (int ms = 1; ms <= 300; ms++) {
        move(&r, 0.0);
        CHECK(last - given_n(&r) <= slope + 1e-9 && given_n(&r) <= last);
        CHECK(ms < 17 || given_n(&r) == 0.0);
        last = given_n(&r);
    }
    CHECK(r.out.force[0].flags & KNEAD_CONTACT_FORCE_T_FLAG_REENGAGE_LIFT);
    press(&r);
    CHECK(r.out.force[0].flags & KNEAD_CONTACT_FORCE_T_FLAG_ENGAGED);
    CHECK_NEAR(given_n(&r) / first, 1.0, 1e-9);
    CHECK(r.fixture.loop.servo.safety[0].faults == 0);
}

TEST("an emergency stop fades every force and blocks every session until a recover, and each command knows its tick")
{
    AT_END(rig_close) rig r = {0};
    rig_open(&r, NULL);
    press(&r);
    double slope = kn_safety_slope(&r.fixture.loop.servo.safety[0].limits), last = given_n(&r);
    int64_t tick = -1, number = kn_orders_give(&r.fixture.loop.orders, KN_ORDER_ESTOP, 0);
    CHECK(!kn_orders_obeyed(&r.fixture.loop.orders, number, &tick));
    for (int ms = 1; ms <= 100; ms++) {
        move(&r, 0.0);
        CHECK(last - given_n(&r) <= slope + 1e-9 && (ms < 17 || given_n(&r) == 0.0));
        last = given_n(&r);
        if (ms == 1) CHECK(kn_orders_obeyed(&r.fixture.loop.orders, number, &tick) && tick == r.tick - 1);
    }
    CHECK(r.kinds[KNEAD_EVENT_T_KIND_ESTOP] == 1 && r.kinds[KNEAD_EVENT_T_KIND_FAULT] >= 1);
    r.pose.session++; // another hand, in air
    r.pose.position_m[2] = 0.05;
    hover(&r, 500);
    CHECK(r.out.force[0].fault == KNEAD_CONTACT_FORCE_T_FAULT_ESTOP && given_n(&r) == 0.0);
    CHECK(!(r.out.force[0].flags & KNEAD_CONTACT_FORCE_T_FLAG_ENGAGED));
    CHECK(kn_loop_estopped(&r.fixture.loop));
    CHECK(kn_orders_give(&r.fixture.loop.orders, KN_ORDER_RECOVER, 0) == number + 1 &&
          kn_loop_estopped(&r.fixture.loop));
    hover(&r, 500);
    CHECK(!kn_loop_estopped(&r.fixture.loop));
    CHECK(r.kinds[KNEAD_EVENT_T_KIND_RECOVER] == 1 && r.out.force[0].fault == KNEAD_CONTACT_FORCE_T_FAULT_NONE);
    CHECK(r.out.force[0].flags & KNEAD_CONTACT_FORCE_T_FLAG_ENGAGED);
    kn_orders_give(&r.fixture.loop.orders, KN_ORDER_ESTOP, 0); // two orders before the same tick: the later one counts
    CHECK(kn_loop_estopped(&r.fixture.loop));
    kn_orders_give(&r.fixture.loop.orders, KN_ORDER_RECOVER, 0);
    hover(&r, 1);
    CHECK(!kn_loop_estopped(&r.fixture.loop) && r.out.force[0].fault == KNEAD_CONTACT_FORCE_T_FAULT_NONE);
    kn_orders_give(&r.fixture.loop.orders, KN_ORDER_RECOVER, 0);
    kn_orders_give(&r.fixture.loop.orders, KN_ORDER_ESTOP, 0);
    hover(&r, 1);
    CHECK(kn_loop_estopped(&r.fixture.loop) && r.out.force[0].fault == KNEAD_CONTACT_FORCE_T_FAULT_ESTOP);
}

TEST("a recover during the fade of an emergency stop restores no force before the tool is lifted")
{
    AT_END(rig_close) rig r = {0};
    rig_open(&r, NULL);
    press(&r);
    kn_orders_give(&r.fixture.loop.orders, KN_ORDER_ESTOP, 0);
    move(&r, 0.0);
    kn_orders_give(&r.fixture.loop.orders, KN_ORDER_RECOVER, 0);
    double last = given_n(&r);
    CHECK(last > 1.0);
    for (int ms = 1; ms <= 400; ms++) {
        move(&r, 0.0);
        CHECK(given_n(&r) <= last && (ms < 17 || given_n(&r) == 0.0));
        last = given_n(&r);
    }
    CHECK(r.out.force[0].flags & KNEAD_CONTACT_FORCE_T_FLAG_REENGAGE_LIFT);
}

TEST("meshes after a reset have a new generation and show the object at rest")
{
    AT_END(rig_close) rig r = {0};
    rig_open(&r, NULL);
    hover(&r, 20);
    double rest = dent_m(&r);
    int32_t before = r.mesh.generation;
    press(&r);
    hover(&r, 20);
    CHECK(dent_m(&r) < rest - 0.004 && r.mesh.generation == before);
    for (int i = 1; i <= 3; i++) {
        kn_orders_give(&r.fixture.loop.orders, KN_ORDER_RESET, 0);
        hover(&r, 20);
        CHECK(dent_m(&r) == rest && r.mesh.generation == before + i);
    }
}

TEST("the contact patch of a tool is published every 4 ms on request and changes no bit of the force")
{
    static rig told, plain;
    rig_open(&told, NULL);
    rig_open(&plain, NULL);
    CHECK(kn_loop_touch(&told.fixture.loop));
    press(&told);
    press(&plain);
    while (kn_ring_front(&told.fixture.loop.touches)) kn_ring_pop(&told.fixture.loop.touches);
    int count = 0;
    for (int i = 0; i < 40; i++) {
        hover(&told, 1);
        hover(&plain, 1);
        CHECK(memcmp(&told.out.force, &plain.out.force, sizeof told.out.force) == 0);
        const kn_touch_patch *touched = kn_ring_front(&told.fixture.loop.touches);
        if (!touched) continue;
        const kn_force *f = &told.out.force[0];
        double sum = 0;
        for (int c = 0; c < 64; c++) sum += touched->touch.pressure_pa[c / 8][c % 8];
        const double *size = told.fixture.scene->model.probe[0].size_m;
        CHECK_NEAR(sum * size[0] * size[1] / 64, f->contact_force_n[2], 1e-9 * f->contact_force_n[2]);
        CHECK(touched->probe == 0 && touched->session == f->session && touched->pose_seq == f->seq);
        kn_ring_pop(&told.fixture.loop.touches);
        count++;
    }
    CHECK(count == 10);
    CHECK(plain.fixture.loop.touches.capacity == 0);
    rig_close(&told);
    rig_close(&plain);
}

TEST("checkpoints report stored energy, work and dissipation, and created energy is counted and reported")
{
    AT_END(rig_close) rig r = {0};
    rig_open(&r, "material=jelly");
    press(&r);
    double work_j = r.fixture.backend.state(r.fixture.backend.self)->probe[0].work_j;
    for (double v = -0.01; v < 0; v += 0.0002) move(&r, v); // comes to rest there
    hover(&r, 3000);
    CHECK(r.kinds[KNEAD_EVENT_T_KIND_CHECKPOINT] >= 4);
    CHECK(r.audit[2] >= work_j && work_j > 0);
    CHECK(r.audit[1] > 0 && r.audit[1] < r.audit[2]);
    CHECK(r.audit[3] > -1e-9 && r.audit[4] == 0);
    knead_status_t status = {0};
    kn_account_status(&r.fixture.loop.account, &status);
    CHECK(!(status.current_errors & KNEAD_STATUS_T_ERROR_PASSIVITY));
    knead_health_t health = {0};
    kn_account_health(&r.fixture.loop.account, &health);
    CHECK(health.audited_s >= 3 && health.trips[KNEAD_HEALTH_T_TRIP_PASSIVITY] == 0);
    CHECK(health.energy_balance_mj > 0 &&
          health.energy_balance_mj < 1e3 * r.audit[2]); // the balance of a jelly, with some energy dissipated

    kn_state *state = (kn_state *)(uintptr_t)r.fixture.backend.state(r.fixture.backend.self);
    kn_model *m = r.fixture.model;
    for (int n = 0; n < m->node_count; n++) { // increase the displacements by half, without any work
        size_t z = m->offset[n] + 2 * m->stride;
        kn_real_set(m, state->displacement, z, 1.5 * kn_real_get(m, state->displacement, z));
    }
    hover(&r, 3000);
    CHECK(r.audit[4] == 1);
    kn_account_status(&r.fixture.loop.account, &status);
    CHECK(status.current_errors & status.last_errors & KNEAD_STATUS_T_ERROR_PASSIVITY);
    double balance_mj = health.energy_balance_mj;
    kn_account_health(&r.fixture.loop.account, &health);
    CHECK(health.trips[KNEAD_HEALTH_T_TRIP_PASSIVITY] == 1 && health.energy_balance_mj < balance_mj);
}

TESTS_MAIN
