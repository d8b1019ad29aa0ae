// The hand behind a pointer, with kneadd's own servo on dough. No action of a visitor's mouse may trip a guard or
// make the pose jump.
// gate in release: arithmetic, ten times slower with the sanitizers
#include "clients/hand/tool_height.h"
#include "clients/hand/pointer_hand.h"
#include "core/surface.h"
#include "server/servo.h"
#include "tests/check.h"

enum { PLATE, FINGER };

static struct {
    kn_scene *scene;
    kn_model *model;
    kn_backend backend;
    kn_servo servo;
    kn_surface *surface;
    kn_mesh mesh;
    uint8_t *top;
    int probe;
    const kn_probe_def *tool;
    double height_m; // of the object at rest
    kn_pointer_hand pointer;
    kn_pointer_hand_wish wish;
    kn_hand_force force;
    bool answered, deaf; // answered: force is on its way; deaf: kneadd hears nothing
    kn_tick_out out;
    int64_t tick;
    double peak_n, lowest_m, slip_m, fastest_m_s;
    int sent, faults, contact_ms;
    // the second hand of a grip, which moves probe 1 while grips is true
    bool grips, second_answered;
    kn_pointer_hand second;
    kn_pointer_hand_wish second_wish;
    kn_hand_force second_force;
} b;

static void look(void)
{
    kn_surface_positions(b.surface, b.model, b.backend.state(b.backend.self), b.mesh.positions_m);
}

// Note how far a hand's pose jumped, and its speed. before: the pose of the tick before.
static void watch(const kn_hand_out *hand, const kn_tool_path_point *before)
{
    for (int k = 0; hand->send && k < 3; k++) {
        const double v_m_s = hand->point.velocity_m_s[k], way_m = hand->point.position_m[k] - before->position_m[k];
        b.slip_m = fmax(b.slip_m, fabs(way_m - 1e-3 * v_m_s));
        b.fastest_m_s = fmax(b.fastest_m_s, fabs(v_m_s));
    }
}

// Give a hand's pose to kneadd.
static void send(int probe, const kn_hand_out *hand, kn_tick_in *in)
{
    static kn_pose last[2]; // the last poses of the sessions
    kn_pose *pose = &last[probe];
    if (hand->send) {
        *pose = (kn_pose){.session = hand->session, .seq = hand->seq};
        memcpy(pose->orientation_wxyz, hand->point.orientation_wxyz, sizeof pose->orientation_wxyz);
        memcpy(pose->position_m, hand->point.position_m, sizeof pose->position_m);
        memcpy(pose->velocity_m_s, hand->point.velocity_m_s, sizeof pose->velocity_m_s);
    }
    if (b.sent > 0 && !b.deaf) in->pose[probe] = pose;
    in->fresh[probe] = hand->send && !b.deaf;
}

// Take kneadd's answer to a hand.
static bool hear(const kn_force *f, kn_hand_force *force)
{
    *force = (kn_hand_force){.session = f->session,
                             .seq = f->seq,
                             .tick = b.out.tick,
                             .flags = f->flags,
                             .fault = f->fault,
                             .contacts = f->contacts};
    memcpy(force->force_n, f->force_n, sizeof force->force_n);
    b.peak_n = fmax(b.peak_n, hypot(hypot(f->force_n[0], f->force_n[1]), f->force_n[2]));
    b.faults += f->fault != 0;
    b.contact_ms += f->contacts > 0;
    return f->live;
}

static void run(int ms)
{
    for (int i = 0; i < ms; i++) {
        kn_tool_path_point before = b.pointer.point;
        kn_hand_out hand = kn_pointer_hand_tick(&b.pointer, &b.wish, b.answered ? &b.force : NULL, 1);
        if (b.sent > 0) watch(&hand, &before);
        if (hand.send) {
            b.sent++;
            b.lowest_m = fmin(b.lowest_m, hand.point.position_m[2]);
        }
        kn_tick_in in = {.tick = b.tick++};
        send(b.probe, &hand, &in);
        if (b.grips) {
            const bool placed = b.second.placed;
            before = b.second.point;
            hand = kn_pointer_hand_tick(&b.second, &b.second_wish, b.second_answered ? &b.second_force : NULL, 1);
            if (placed) watch(&hand, &before);
            send(1, &hand, &in);
        }
        kn_servo_tick(&b.servo, &in, &b.out);
        b.answered = hear(&b.out.force[b.probe], &b.force);
        if (b.grips) b.second_answered = hear(&b.out.force[1], &b.second_force);
    }
}

// Serve a scene to the pointer of this probe, and let it hover for so many ms.
static void begin(const char *scene, int probe, int ms)
{
    int vertices;
    if (b.scene) {
        free(b.mesh.positions_m);
        free(b.top);
        kn_surface_destroy(b.surface);
        b.backend.destroy(b.backend.self);
        kn_model_destroy(b.model);
        kn_scene_destroy(b.scene);
    }
    memset(&b, 0, sizeof b);
    b.scene = load_scene(scene, NULL, 0);
    b.model = build(&b.scene->model);
    kn_backend_cpu(&b.backend, b.model);
    kn_servo_init(&b.servo, b.scene, b.model, &b.backend);
    b.surface = kn_surface_create(b.model);
    b.top = kn_tool_height_top(&b.scene->model, &vertices);
    b.mesh = (kn_mesh){.whole = true,
                       .vertex_count = vertices,
                       .triangle_count = b.surface->triangle_count,
                       .triangles = b.surface->triangle,
                       .positions_m = calloc((size_t)vertices, 3 * sizeof(float))};
    look();
    b.probe = probe;
    b.tool = &b.model->def.probe[probe];
    kn_pointer_hand_init(&b.pointer, b.tool->shape, 7);
    b.height_m = b.model->def.spacing_m * (b.model->def.nodes[2] - 1);
    b.wish = (kn_pointer_hand_wish){.held = true, .hover_z_m = b.height_m + b.tool->radius_m + 0.004};
    b.lowest_m = 1;
    run(ms);
}

static void press(double x_m, double y_m, double depth_m, int ms)
{
    look();
    b.wish.at_m[0] = x_m;
    b.wish.at_m[1] = y_m;
    CHECK(kn_tool_height_touch(&b.mesh, b.top, b.model->def.spacing_m, b.tool, x_m, y_m, &b.wish.touch_z_m,
                               &b.wish.flush_z_m));
    b.wish.depth_m = fmin(depth_m, fmax(0, b.wish.touch_z_m - b.tool->radius_m - 0.5 * b.height_m));
    b.wish.pressed = true;
    run(ms);
}

static void stroke(double x_m, double y_m, int ms) // as a page does, only after the object was met
{
    if (!(b.pointer.news.depth_m > 0)) return;
    b.wish.at_m[0] = x_m;
    b.wish.at_m[1] = y_m;
    run(ms);
}

static void let_go(int ms)
{
    b.wish.pressed = false;
    run(ms);
}

static double dent(void) // depth in the middle below the rest height, m
{
    double z_m = NAN;
    look();
    kn_tool_height_object(&b.mesh, 0, 0, &z_m);
    return b.height_m - z_m;
}

TEST("a press reaches the requested depth, gives a force, and leaves a dent after release")
{
    begin("dough.yaml", FINGER, 600);
    CHECK(b.pointer.news.flags & KN_FLAG_ENGAGED);
    CHECK(b.peak_n == 0);
    press(0, 0, 0.006, 1200);
    CHECK_NEAR(b.pointer.news.depth_m, 0.006, 1e-6);
    CHECK(b.pointer.news.contact && b.peak_n > 1);
    CHECK_NEAR(b.lowest_m, b.wish.touch_z_m - 0.006, 1e-6);
    let_go(600);
    CHECK(!b.pointer.news.contact && b.pointer.news.force_n == 0);
    CHECK_NEAR(b.pointer.point.position_m[2], b.wish.hover_z_m, 1e-4);
    CHECK(dent() > 0.003);
    CHECK(b.faults == 0);
}

TEST("a tool dragged during a press keeps its depth, moves at press speed and leaves a furrow")
{
    begin("dough.yaml", FINGER, 600);
    press(-0.01, 0, 0.004, 1000);
    double z_m = b.pointer.point.position_m[2];
    b.fastest_m_s = 0;
    stroke(0.01, 0, 1500);
    CHECK_NEAR(b.pointer.point.position_m[0], 0.01, 1e-5);
    CHECK_NEAR(b.pointer.point.position_m[2], z_m, 1e-6);
    CHECK(b.fastest_m_s > 0.02 && b.fastest_m_s < 0.031);
    CHECK(b.pointer.news.contact && b.pointer.news.depth_m > 0.0039);
    let_go(600);
    CHECK(!b.pointer.news.contact);
    CHECK(dent() > 0.002); // half the way remains
    CHECK(b.faults == 0);
    CHECK(b.servo.safety[FINGER].guards == 0);
}

TEST("a button released and pressed again between two ticks lifts the tool before it presses elsewhere")
{
    begin("dough.yaml", FINGER, 600);
    press(-0.01, 0, 0.005, 600);
    CHECK(b.pointer.news.contact);
    const double there_m = b.pointer.point.position_m[0];
    b.wish.press++;
    press(0.01, 0, 0.005, 1);
    for (int i = 0; i < 2000 && b.pointer.point.position_m[2] < b.wish.hover_z_m - 0.001; i++) {
        CHECK(fabs(b.pointer.point.position_m[0] - there_m) < 1e-4); // the tool draws no furrow on its way
        run(1);
    }
    run(1200);
    CHECK(b.pointer.news.contact && fabs(b.pointer.point.position_m[0] - 0.01) < 1e-4);
    CHECK(b.faults == 0);
}

TEST("random mouse input with any tool on dough, jelly and clay makes no pose jump and trips no guard")
{
    static const char *const scenes[] = {"dough.yaml", "jelly.yaml", "clay.yaml"};
    const int presses = KN_LENGTH(8, 8, 16);
    for (int s = 0; s < 3; s++)
        for (int probe = 0; probe < 2; probe++) {
            begin(scenes[s], 0, 0);
            if (probe >= b.model->def.probe_count) continue;
            begin(scenes[s], probe, 0);
            uint32_t random = 1;
            for (int i = 0; i < presses; i++) {
                random = random * 1664525 + 1013904223;
                double x_m = 0.02 * ((random >> 8 & 255) / 127.5 - 1), y_m = 0.02 * ((random >> 16 & 255) / 127.5 - 1);
                if (i % 3 == 0) x_m = y_m = 0; // again and again into the same dent
                press(x_m, y_m, 0.001 + 0.00003 * (random >> 24), i % 6 == 3 ? 2500 : 60 + (int)(random >> 20) % 500);
                if (i % 2) b.wish.depth_m *= 0.5, run(100); // the wheel turns back and forth
                if (i % 2) b.wish.depth_m *= 2, run(100);
                stroke(0.02 * ((random >> 4 & 255) / 127.5 - 1), y_m, (int)(random >> 14) % 700);
                let_go((int)(random >> 12) % 400);
                double highest_m = 0;
                look();
                for (int v = 0; v < b.mesh.vertex_count; v++)
                    highest_m = fmax(highest_m, b.mesh.positions_m[3 * v + 2]);
                b.wish.hover_z_m = highest_m + b.tool->radius_m + 0.004;
            }
            CHECK(b.faults == 0);
            CHECK(b.servo.safety[probe].guards == 0);
            CHECK(b.slip_m < 5e-5);
            CHECK(b.fastest_m_s < 0.5);
            CHECK(b.peak_n > 0.1);
            CHECK(16 * b.contact_ms > 1000 * presses);
        }
}

TEST("when the page closes the tool lifts and stops sending poses, and the next page starts a new session")
{
    begin("dough-small.yaml", 0, 600);
    press(0, 0, 0.003, 2500);
    CHECK(b.pointer.news.contact);
    b.wish.held = false; // the tab was closed while the button was down
    run(800);
    CHECK(b.pointer.mode == KN_POINTER_HAND_ABSENT && b.pointer.news.force_n == 0);
    int sent = b.sent;
    run(100);
    CHECK(b.sent == sent && kn_pointer_hand_tick(&b.pointer, &b.wish, NULL, 1).leaves);
    int64_t session = b.pointer.session;
    b.wish.pressed = false, b.wish.held = true;
    run(1);
    CHECK(b.pointer.mode == KN_POINTER_HAND_FOLLOW && b.sent > sent && b.pointer.session == session + 1);
    CHECK(!kn_pointer_hand_tick(&b.pointer, &b.wish, NULL, 1).leaves);
}

TEST("if kneadd falls silent the force is 0 N within 21 ms, and the next press needs a button release")
{
    begin("dough.yaml", FINGER, 600);
    press(0, 0, 0.005, 600);
    int64_t session = b.pointer.session;
    CHECK(b.pointer.news.force_n > 0);
    b.deaf = true;
    b.answered = false;
    for (int i = 0; i < 21; i++) kn_pointer_hand_tick(&b.pointer, &b.wish, NULL, 1);
    CHECK(b.pointer.news.force_n == 0);
    CHECK(b.pointer.mode == KN_POINTER_HAND_LET_GO && !b.pointer.news.released);
    run(1000);
    b.deaf = false;
    run(2500);
    CHECK(b.pointer.session > session);
    CHECK(b.pointer.mode == KN_POINTER_HAND_FOLLOW && (b.pointer.news.flags & KN_FLAG_ENGAGED));
    CHECK(!b.pointer.news.contact); // the button is still down, so the tool keeps clear
    let_go(50);
    press(0, 0, 0.005, 600);
    CHECK(b.pointer.news.contact);
}

TEST("a stale wish releases the tool, and it presses again only after the button is released")
{
    begin("dough.yaml", FINGER, 600);
    press(0, 0, 0.005, 600);
    CHECK(b.pointer.news.contact);
    b.wish.stale = true;
    run(500);
    CHECK(!b.pointer.news.contact && b.pointer.news.force_n == 0);
    b.wish.stale = false;
    run(500);
    CHECK(!b.pointer.news.contact && !b.pointer.news.released);
    let_go(50);
    press(0, 0, 0.005, 600);
    CHECK(b.pointer.news.contact);
}

TEST("a NaN force counts as 0 N, and repeated NaN forces release the tool")
{
    begin("dough-small.yaml", 0, 600);
    b.force.force_n[2] = NAN;
    kn_pointer_hand_tick(&b.pointer, &b.wish, &b.force, 1);
    CHECK(b.pointer.news.force_n == 0);
    for (int i = 0; i < 25; i++) kn_pointer_hand_tick(&b.pointer, &b.wish, &b.force, 1);
    CHECK(b.pointer.mode == KN_POINTER_HAND_LET_GO);
}

TEST("the newest answered event is reported with the tick that answered it")
{
    begin("dough-small.yaml", 0, 500);
    b.wish.event = 5;
    int64_t tick = b.tick;
    run(3);
    CHECK(b.pointer.news.event == 5 && b.pointer.news.tick == tick);
}

// Grip as the page does, with two fingers that the eye sees at x and -x and at height z_m, from the front.
static void grip(kn_pointer_hand_grip *g, double x_m, double z_m, int ms)
{
    const float eye[3] = {0, -0.3f, (float)z_m}, sight[2][3] = {{(float)-x_m, 0.3f, 0}, {(float)x_m, 0.3f, 0}};
    kn_pointer_hand_reach reach[2];
    for (int i = 0; i < 2; i++) CHECK(kn_pointer_hand_reach_open(&reach[i], &b.scene->model, &b.scene->model.probe[i]));
    for (int i = 0; i < ms; i += 50) {
        look();
        kn_pointer_hand_reach_hover(&reach[0], &b.mesh, &b.wish);
        kn_pointer_hand_reach_hover(&reach[1], &b.mesh, &b.second_wish);
        if (!b.wish.pressed) CHECK(kn_pointer_hand_grip_begin(g, &b.mesh, sight));
        b.wish.pressed = b.second_wish.pressed = b.second_wish.held = true;
        kn_pointer_hand_grip_aim(g, (const kn_pointer_hand_reach *[]){&reach[0], &reach[1]}, &b.mesh, eye, sight,
                                 (kn_pointer_hand_wish *[]){&b.wish, &b.second_wish});
        run(50);
        g->closes = g->closes || (b.pointer.news.there && b.second.news.there);
    }
    for (int i = 0; i < 2; i++) kn_pointer_hand_reach_close(&reach[i]);
}

static double bottom_m(void)
{
    double low_m = 1;
    look();
    for (int v = 0; v < b.mesh.vertex_count; v++) low_m = fmin(low_m, b.mesh.positions_m[3 * v + 2]);
    return low_m;
}

// deadline: limit on the work of each step; 1: every step is the shortest one, as on a machine that is too slow
static void lift(int64_t deadline)
{
    begin("pinch.yaml", 0, 600);
    b.servo.deadline = deadline;
    b.grips = true;
    kn_pointer_hand_init(&b.second, b.tool->shape, 70);
    kn_pointer_hand_grip g;
    grip(&g, 0.03, 0.015, 3000);
    CHECK(g.closes && !b.pointer.news.contact && !b.second.news.contact);
    for (int i = 0; i < 20; i++) grip(&g, 0.03 - 0.013 * i / 19, 0.015, 50);
    grip(&g, 0.017, 0.015, 300);
    CHECK(b.pointer.news.contact && b.second.news.contact);
    for (int i = 0; i < 40; i++) grip(&g, 0.017, 0.015 + 0.03 * i / 39, 50);
    const double lifted_m = bottom_m();
    printf("     lifted by %.1f mm, at most %.2f N\n", 1e3 * lifted_m, b.peak_n);
    CHECK(lifted_m > 0.02 && b.faults == 0 && b.peak_n < 3);
    b.wish.pressed = b.second_wish.pressed = b.second_wish.held = false;
    for (int i = 0; i < 3000 && b.second.mode != KN_POINTER_HAND_ABSENT; i++) run(1);
    CHECK(b.second.mode == KN_POINTER_HAND_ABSENT && b.faults == 0);
    run(1500);
    CHECK(bottom_m() < 0.001 && b.pointer.tilt == 0 && b.second.tilt == 0 && b.pointer.news.force_n == 0);
    CHECK(b.fastest_m_s < 0.41 && b.slip_m < 2e-5);
}

TEST("two hands lie down beside the dough, lift it off the table, drop it, and stand up again") { lift(0); }

TEST("they do so on a processor that is too slow for more than the shortest steps") { lift(1); }

TEST("a grip keeps half of the object's width between its tips, stays below its top, and refuses a steep view")
{
    begin("pinch.yaml", 0, 600);
    b.grips = true;
    kn_pointer_hand_init(&b.second, b.tool->shape, 70);
    kn_pointer_hand_grip g;
    grip(&g, 0.03, 0.015, 2000);
    grip(&g, 0.001, 0.5, 50);
    const double gap_m = fabs(b.wish.at_m[0] - b.second_wish.at_m[0]) - 2 * b.tool->radius_m;
    CHECK_NEAR(gap_m, 0.015, 1e-9);
    CHECK(b.wish.hover_z_m - b.wish.depth_m < 0.031);
    g.lowest_m[0] = 0.02; // where the first tool has touched the object
    grip(&g, 0.02, 0, 50);
    CHECK_NEAR(b.wish.hover_z_m - b.wish.depth_m, 0.02, 1e-9);
    CHECK_NEAR(b.second_wish.hover_z_m - b.second_wish.depth_m, b.tool->radius_m + 0.001, 1e-9);
    // Before the tools close, they come down beside the object, below its top. A line past the plane changes nothing.
    const kn_pointer_hand_wish old = b.wish;
    const float up[3] = {0, -0.3f, 0.5f}, away[2][3] = {{-0.02f, -1, 0}, {0.02f, -1, 0}};
    kn_pointer_hand_reach reach;
    CHECK(kn_pointer_hand_reach_open(&reach, &b.scene->model, b.tool));
    const kn_pointer_hand_reach *both[] = {&reach, &reach};
    kn_pointer_hand_grip_aim(&g, both, &b.mesh, up, away, (kn_pointer_hand_wish *[]){&b.wish, &b.second_wish});
    CHECK(memcmp(&old, &b.wish, sizeof old) == 0);
    const float ahead[2][3] = {{-0.02f, 0.3f, 0}, {0.02f, 0.3f, 0}};
    CHECK(kn_pointer_hand_grip_begin(&g, &b.mesh, ahead));
    kn_pointer_hand_grip_aim(&g, both, &b.mesh, up, ahead, (kn_pointer_hand_wish *[]){&b.wish, &b.second_wish});
    CHECK(b.wish.hover_z_m - b.wish.depth_m < b.height_m - b.tool->radius_m + 0.001);
    CHECK(fabs(b.wish.at_m[0]) > 0.015 + b.tool->radius_m && fabs(b.second_wish.at_m[0]) > 0.015 + b.tool->radius_m);
    kn_pointer_hand_reach_close(&reach);
    CHECK(!kn_pointer_hand_grip_begin(&g, &b.mesh, (const float[2][3]){{0, 0, -1}, {0.1f, 0, -1}}));
    CHECK(!kn_pointer_hand_grip_begin(&g, &b.mesh, (const float[2][3]){{0}, {0, 1, 0}}));
}

TESTS_MAIN
