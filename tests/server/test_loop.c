#include "clients/knead_mesh.h"
#include "core/solve/step_effort.h"
#include "core/solve/kernel.h"
#include "server/served_object.h"
#include "tests/server/loop_fixture.h"

// A loop, the mesh that its screen received, and a hand over the plate. One call is one tick.
typedef struct rig {
    kn_loop_fixture f;
    kn_mesh mesh;
    kn_pose pose;
} rig;

static void on_mesh(const lcm_recv_buf_t *buf, const char *channel, void *self)
{
    rig *r = self;
    if (!strcmp(channel, "KNEAD_MESH_INIT")) kn_mesh_init(&r->mesh, buf->data, buf->data_size);
    else kn_mesh_update(&r->mesh, buf->data, buf->data_size);
}

static rig *rig_open(const char *set)
{
    rig *r = calloc(1, sizeof *r);
    kn_loop_fixture_open(&r->f, set);
    lcm_subscribe(r->f.skin.lcm, "KNEAD_MESH_.*", on_mesh, r);
    r->pose = (kn_pose){.session = 1, .orientation_wxyz = {1}, .position_m = {0, 0, 0.031}};
    return r;
}

static void rig_close(rig *r)
{
    kn_mesh_free(&r->mesh);
    kn_loop_fixture_close(&r->f);
    free(r);
}

OWNS(rig, rig_close)
OWNS(kn_scene_change, kn_scene_change_destroy)

static void move(rig *r, double vz_m_s)
{
    kn_loop_fixture_tick(&r->f, 0, &r->pose, r->pose.position_m[2] + 1e-3 * vz_m_s);
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

static int64_t order(rig *r, kn_order order) { return kn_orders_give(&r->f.loop.orders, order, 0); }

static double given_n(const rig *r) { return r->f.out.force[0].force_n[2]; }
static bool flag(const rig *r, int32_t of) { return r->f.out.force[0].flags & of; }

// Run for so many ms. The force never rises, falls by at most the slope a ms, and is 0 from the 17th ms on.
static void fades(rig *r, int ms)
{
    double last = given_n(r), slope = kn_safety_slope(&r->f.loop.servo.safety[0].limits);
    CHECK(last > 1.0);
    for (int n = 1; n <= ms; n++) {
        move(r, 0.0);
        CHECK(last - given_n(r) <= slope + 1e-9 && given_n(r) <= last && (n < 17 || given_n(r) == 0.0));
        last = given_n(r);
    }
}

// Return the lowest height of the object's top under the middle of the plate, as the screen shows it.
static double dent_m(rig *r)
{
    kn_skin_publish_topology(&r->f.skin, 0);
    kn_skin_publish(&r->f.skin, 0);
    while (lcm_handle_timeout(r->f.skin.lcm, 0) > 0) {
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
    const kn_model *model = r->f.loop.servo.model;
    kn_backend *backend = r->f.loop.servo.backend;
    double *value = calloc((size_t)model->node_count, sizeof *value), most = 0, wrong = 0;
    kn_gauge *gauge = kn_gauge_create(model);
    if (told && value && gauge) kn_gauge_read(gauge, backend->state(backend->self), what, value);
    for (int v = 0; told && v < r->f.skin.surface->vertex_count; v++) {
        const double is = value[r->f.skin.surface->node[v]];
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
    r->f.skin.next_tick = 0;
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
        OWN(rig) *r = rig_open(asked[i].set);
        press(r);
        show_now(r);
        CHECK(r->mesh.whole && r->mesh.tick == r->f.tick - 1);
        CHECK(asked[i].stress ? tells(r, r->mesh.stress_pa, KN_MEASURE_STRESS) : !r->mesh.stress_pa);
        CHECK(asked[i].residual ? tells(r, r->mesh.residual_strain, KN_MEASURE_RESIDUAL) : !r->mesh.residual_strain);
    }
}

TEST("after a change of the material meshes carry its stress, and the skin knows which model it showed last")
{
    const char *sets[] = {"mesh.measures=both", "material.k1=2000 gf/cm^3"};
    char error[300];
    OWN(kn_scene_change) *change = NULL;
    OWN(rig) *r = rig_open(sets[0]);
    kn_loop *loop = &r->f.loop;
    press(r);
    show_now(r);
    change = kn_scene_change_create(load_scene("dough-small.yaml", sets, 2), r->f.scene, r->f.model, false, error,
                                    sizeof error);
    CHECK(change);
    if (!change) return;
    loop->orders.change = change;
    loop->deadline = 1000000000; // this change has no deadline of its own
    order(r, KN_ORDER_CHANGE);
    move(r, 0.0);
    CHECK(loop->servo.model == change->model && loop->deadline == 1000000000);
    for (int shown = 0; shown < 2; shown++) {
        CHECK(kn_skin_follows(&r->f.skin, r->f.model) == !shown && kn_skin_follows(&r->f.skin, change->model) == shown);
        show_now(r);
    }
    CHECK(tells(r, r->mesh.stress_pa, KN_MEASURE_STRESS) && tells(r, r->mesh.residual_strain, KN_MEASURE_RESIDUAL));
}

TEST("the deadline follows the processor with events: down after three long steps that take too long, slowly up again")
{
    OWN(rig) *r = rig_open(NULL);
    kn_time time = {.now_ns = 1000000000};
    kn_clock_hand(&time);
    kn_loop *loop = &r->f.loop;
    // every step uses half of this deadline
    const int64_t least = kn_deadline_least(r->f.model), given = 3 * least / 2;
    const struct {
        double share; // of the budget that each tick takes
        int ticks;
        int64_t deadline;
        int events; // so far; 0: not known
    } steps[] = {{0, 1, given, 1},
                 {0.9, 2, given, 1},
                 {0, 1, given, 1}, // two long steps are not enough
                 {0.9, 4, (int64_t)((double)given * KN_STEP_SHARE / 0.9), 2},
                 {0.9, 40, least, 0}, // the deadline never goes lower
                 {0.64, KN_LOOP_FAST_STEPS + 1, (int64_t)(1.125 * (double)least), 0},
                 {0.64, 8 * KN_LOOP_FAST_STEPS, given, 0}}; // the deadline never goes higher
    loop->deadline = loop->measured_deadline = given;
    for (size_t i = 0; i < sizeof steps / sizeof *steps; i++) {
        r->f.took_ns = (int64_t)(steps[i].share * 1e9 * r->f.scene->budget_s);
        hover(r, steps[i].ticks);
        CHECK(loop->servo.deadline == steps[i].deadline);
        CHECK(!steps[i].events || r->f.kinds[KNEAD_EVENT_T_KIND_DEADLINE] == steps[i].events);
    }
    CHECK(loop->deadline == given);
    kn_clock_hand(NULL);
}

TEST(
    "several resets between two ticks make one reset in the next tick, with the hash of the untouched object. The "
    "force fades, and the tool is blocked until it is lifted; meshes have a new generation and show the object at rest")
{
    OWN(rig) *r = rig_open(NULL);
    double first = 0, rest = 0;
    uint64_t hash = kn_loop_fixture_hash(&r->f);
    for (int n = 1; n <= 3; n++) {
        hover(r, 20);
        if (n == 1) rest = dent_m(r);
        int32_t before = r->mesh.generation;
        press(r);
        CHECK(flag(r, KN_FLAG_ENGAGED) && r->f.kinds[KNEAD_EVENT_T_KIND_RESET] == n - 1);
        if (n == 1) first = given_n(r);
        CHECK_NEAR(given_n(r) / first, 1.0, 1e-9); // new dough
        CHECK(dent_m(r) < rest - 0.004 && r->mesh.generation == before);
        for (int i = 0; i < 5; i++) kn_orders_give(&r->f.loop.orders, KN_ORDER_RESET, 0);
        int64_t tick = r->f.tick;
        fades(r, 300);
        const kn_event *reset = &r->f.last[KNEAD_EVENT_T_KIND_RESET];
        CHECK(reset->tick == tick && reset->state_hash == hash && flag(r, KN_FLAG_REENGAGE_LIFT));
        CHECK(r->f.kinds[KNEAD_EVENT_T_KIND_RESET] == n && r->f.kinds[KNEAD_EVENT_T_KIND_DETACH] == n);
        CHECK(dent_m(r) == rest && r->mesh.generation == before + 1);
    }
    CHECK(r->f.loop.servo.safety[0].faults == 0);
}

TEST("an emergency stop fades every force and blocks every session until a recover, and each command knows its tick")
{
    OWN(rig) *r = rig_open(NULL);
    kn_loop *loop = &r->f.loop;
    press(r);
    int64_t tick = -1, number = order(r, KN_ORDER_ESTOP), next = r->f.tick;
    CHECK(!kn_orders_obeyed(&loop->orders, number, &tick));
    fades(r, 100);
    CHECK(kn_orders_obeyed(&loop->orders, number, &tick) && tick == next);
    CHECK(r->f.kinds[KNEAD_EVENT_T_KIND_ESTOP] == 1 && r->f.kinds[KNEAD_EVENT_T_KIND_FAULT] >= 1);
    r->pose.session++; // another hand, in air
    r->pose.position_m[2] = 0.05;
    hover(r, 500);
    CHECK(r->f.out.force[0].fault == KN_FAULT_ESTOP && given_n(r) == 0.0 && !flag(r, KN_FLAG_ENGAGED));
    CHECK(kn_loop_estopped(loop));
    CHECK(order(r, KN_ORDER_RECOVER) == number + 1 && kn_loop_estopped(loop));
    hover(r, 500);
    CHECK(!kn_loop_estopped(loop) && r->f.kinds[KNEAD_EVENT_T_KIND_RECOVER] == 1);
    CHECK(r->f.out.force[0].fault == KN_FAULT_NONE && flag(r, KN_FLAG_ENGAGED));
    for (int stop = 0; stop < 2; stop++) { // two orders before the same tick: the later one counts
        order(r, stop ? KN_ORDER_RECOVER : KN_ORDER_ESTOP);
        CHECK(stop || kn_loop_estopped(loop));
        order(r, stop ? KN_ORDER_ESTOP : KN_ORDER_RECOVER);
        hover(r, 1);
        CHECK(kn_loop_estopped(loop) == stop);
        CHECK(r->f.out.force[0].fault == (stop ? KN_FAULT_ESTOP : KN_FAULT_NONE));
    }
}

TEST("a recover during the fade of an emergency stop restores no force before the tool is lifted")
{
    OWN(rig) *r = rig_open(NULL);
    press(r);
    order(r, KN_ORDER_ESTOP);
    move(r, 0.0);
    order(r, KN_ORDER_RECOVER);
    fades(r, 400);
    CHECK(flag(r, KN_FLAG_REENGAGE_LIFT));
}

TEST("the contact patch of a tool is published every 4 ms on request and changes no bit of the force")
{
    OWN(rig) *told = rig_open(NULL), *plain = rig_open(NULL);
    kn_ring *touches = &told->f.loop.touches;
    CHECK(kn_loop_touch(&told->f.loop));
    press(told);
    press(plain);
    while (kn_ring_front(touches)) kn_ring_pop(touches);
    int count = 0;
    for (int i = 0; i < 40; i++) {
        hover(told, 1);
        hover(plain, 1);
        CHECK(memcmp(&told->f.out.force, &plain->f.out.force, sizeof told->f.out.force) == 0);
        const kn_touch_patch *touched = kn_ring_front(touches);
        if (!touched) continue;
        const kn_force *f = &told->f.out.force[0];
        const double *size = told->f.scene->model.probe[0].size_m;
        double sum = 0;
        for (int c = 0; c < 64; c++) sum += touched->touch.pressure_pa[c / 8][c % 8];
        CHECK_NEAR(sum * size[0] * size[1] / 64, f->contact_force_n[2], 1e-9 * f->contact_force_n[2]);
        CHECK(touched->probe == 0 && touched->session == f->session && touched->pose_seq == f->seq);
        kn_ring_pop(touches);
        count++;
    }
    CHECK(count == 10 && plain->f.loop.touches.capacity == 0);
}

static void count_wake(void *arg) { ++*(int *)arg; }

TEST("the main thread is woken for every force and every event at once, and otherwise in every 16th tick")
{
    OWN(rig) *r = rig_open(NULL);
    int woken = 0;
    r->f.loop.notify = count_wake;
    r->f.loop.notify_arg = &woken;
    hover(r, 40);
    CHECK(woken == 40);
    r->pose.session = 0;
    hover(r, 1); // the session ends with an event
    const int left = woken;
    hover(r, 160);
    CHECK(left == 41 && woken == left + 10);
    order(r, KN_ORDER_ESTOP);
    hover(r, 1);
    CHECK(woken == left + 11);
    atomic_store(&r->f.loop.paused, true);
    hover(r, 2);
    CHECK(woken == left + 13);
}

TEST("checkpoints report stored energy, work and dissipation, and created energy is counted and reported")
{
    OWN(rig) *r = rig_open("material=jelly");
    kn_account *account = &r->f.loop.account;
    const double *audit = r->f.last[KNEAD_EVENT_T_KIND_CHECKPOINT].arg;
    knead_status_t status = {0};
    knead_health_t health = {0};
    press(r);
    double work_j = kn_loop_fixture_state(&r->f)->probe[0].work_j;
    for (double v = -0.01; v < 0; v += 0.0002) move(r, v); // comes to rest there
    hover(r, 3000);
    CHECK(r->f.kinds[KNEAD_EVENT_T_KIND_CHECKPOINT] >= 4);
    CHECK(audit[2] >= work_j && work_j > 0);
    CHECK(audit[1] > 0 && audit[1] < audit[2]);
    CHECK(audit[3] > -1e-9 && audit[4] == 0);
    kn_account_status(account, &status);
    CHECK(!(status.current_errors & KNEAD_STATUS_T_ERROR_PASSIVITY));
    kn_account_health(account, &health);
    CHECK(health.audited_s >= 3 && health.trips[KNEAD_HEALTH_T_TRIP_PASSIVITY] == 0);
    double balance_mj = health.energy_balance_mj;
    CHECK(balance_mj > 0 && balance_mj < 1e3 * audit[2]); // the balance of a jelly, with some energy dissipated

    kn_state *state = (kn_state *)(uintptr_t)kn_loop_fixture_state(&r->f);
    kn_model *m = r->f.model;
    for (int n = 0; n < m->node_count; n++) { // increase the displacements by half, without any work
        size_t z = m->offset[n] + 2 * m->stride;
        kn_real_set(m, state->displacement, z, 1.5 * kn_real_get(m, state->displacement, z));
    }
    hover(r, 3000);
    CHECK(audit[4] == 1);
    kn_account_status(account, &status);
    CHECK(status.current_errors & status.last_errors & KNEAD_STATUS_T_ERROR_PASSIVITY);
    kn_account_health(account, &health);
    CHECK(health.trips[KNEAD_HEALTH_T_TRIP_PASSIVITY] == 1 && health.energy_balance_mj < balance_mj);
}

TESTS_MAIN
