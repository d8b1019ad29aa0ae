#include "server/loop.h"
#include "clients/knead_mesh.h"
#include "proto/knead_contact_force_t.h"
#include "proto/knead_event_t.h"
#include "tests/check.h"
#include "tests/server/lent.h"

// A loop, what its screen has been told, and a hand over the plate; one call per tick.
typedef struct rig {
    kn_lent lent;
    kn_mesh mesh;
    kn_pose pose;
    int64_t tick;
    kn_tick_out out;
    int kinds[16]; // events seen so far
} rig;

static void on_mesh(const lcm_recv_buf_t *buf, const char *channel, void *self)
{
    rig *r = self;
    if (!strcmp(channel, "KNEAD_MESH_INIT"))
        kn_mesh_init(&r->mesh, buf->data, buf->data_size);
    else
        kn_mesh_update(&r->mesh, buf->data, buf->data_size);
}

static void rig_open(rig *r)
{
    memset(r, 0, sizeof *r);
    kn_lent_open(&r->lent, NULL);
    lcm_subscribe(r->lent.skin.lcm, "KNEAD_MESH_.*", on_mesh, r);
    r->pose = (kn_pose){.session = 1, .orientation_wxyz = {1}, .position_m = {0, 0, 0.031}};
}

static void rig_close(rig *r)
{
    kn_mesh_free(&r->mesh);
    kn_lent_close(&r->lent);
}

static void move(rig *r, double vz_m_s)
{
    r->pose.seq++;
    r->pose.position_m[2] += 1e-3 * vz_m_s;
    r->pose.velocity_m_s[2] = vz_m_s;
    kn_loop_post(&r->lent.loop, 0, &r->pose);
    kn_wake wake = {.tick = r->tick++, .now_ns = kn_now_ns()};
    kn_loop_tick(&r->lent.loop, &wake);
    for (const kn_record *record; (record = kn_ring_front(&r->lent.loop.records)); kn_ring_pop(&r->lent.loop.records)) {
        r->out = record->out;
        for (int i = 0; i < r->out.event_count; i++) r->kinds[r->out.event[i].kind]++;
    }
}

static void hover(rig *r, int ms)
{
    for (int i = 0; i < ms; i++) move(r, 0.0);
}

// Engages in air, touches at rest, goes 5 mm deep at 1 cm/s.
static void press(rig *r)
{
    r->pose.position_m[2] = 0.031;
    hover(r, 401);
    r->pose.position_m[2] = 0.03;
    hover(r, 300);
    for (double v = 0.0; r->pose.position_m[2] > 0.025; v = fmax(v - 0.0002, -0.01)) move(r, v);
}

static double given_n(const rig *r)
{
    return r->out.force[0].force_n[2];
}

// Lowest of the object's upper side under the middle of the plate, as the screen has it.
static double dent_m(rig *r)
{
    kn_skin_publish_topology(&r->lent.skin, 0);
    kn_skin_publish(&r->lent.skin, 0);
    while (lcm_handle_timeout(r->lent.skin.lcm, 0) > 0) {
    }
    double lowest = INFINITY;
    for (int v = 0; v < r->mesh.vertex_count; v++) {
        const float *x = r->mesh.positions_m + 3 * v;
        if (fabsf(x[0]) < 0.006f && fabsf(x[1]) < 0.006f && x[2] > 0.01f) lowest = fmin(lowest, (double)x[2]);
    }
    return lowest;
}

TEST("resets asked for between two ticks are one, in the next one, and an event tells the untouched object's hash")
{
    static rig r;
    rig_open(&r);
    uint64_t rest = kn_state_hash(r.lent.model, r.lent.backend.state(r.lent.backend.self));
    press(&r);
    CHECK(given_n(&r) > 1.0 && r.kinds[KNEAD_EVENT_T_KIND_RESET] == 0);
    for (int i = 0; i < 5; i++) atomic_store(&r.lent.loop.reset, true);
    move(&r, 0.0);
    CHECK(r.kinds[KNEAD_EVENT_T_KIND_RESET] == 1 && r.kinds[KNEAD_EVENT_T_KIND_DETACH] == 1);
    CHECK(r.out.event[0].kind == KNEAD_EVENT_T_KIND_RESET && r.out.event[0].tick == r.tick - 1);
    CHECK(r.out.event[0].state_hash == rest);
    hover(&r, 5);
    CHECK(r.kinds[KNEAD_EVENT_T_KIND_RESET] == 1);
    rig_close(&r);
}

TEST("a reset under a hand fades what it felt, keeps it out until it is lifted, and then it feels new dough")
{
    static rig r;
    rig_open(&r);
    press(&r);
    double first = given_n(&r), slope = kn_safety_slope(&r.lent.loop.servo.safety[0].limits), last = first;
    atomic_store(&r.lent.loop.reset, true);
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
    CHECK(r.lent.loop.servo.safety[0].faults == 0);
    rig_close(&r);
}

TEST("meshes after a reset are of another generation, and the object at rest")
{
    static rig r;
    rig_open(&r);
    hover(&r, 20);
    double rest = dent_m(&r);
    int32_t before = r.mesh.generation;
    press(&r);
    hover(&r, 20);
    CHECK(dent_m(&r) < rest - 0.004 && r.mesh.generation == before);
    for (int i = 1; i <= 3; i++) {
        atomic_store(&r.lent.loop.reset, true);
        hover(&r, 20);
        CHECK(dent_m(&r) == rest && r.mesh.generation == before + i);
    }
    rig_close(&r);
}

TESTS_MAIN
