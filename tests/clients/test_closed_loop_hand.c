// Feedback of kneadd to a simulated device in a hand, near and with a delay, and to two hands together. All runs in
// virtual time, on the device of `knead probe`.
// gate in release: arithmetic, ten times slower with the sanitizers
#include "clients/hand/tool_height.h"
#include "clients/hand/closed_loop_hand.h"
#include "clients/hand/tool_path.h"
#include "tests/check.h"
#include "tests/rig.h"

OWNS(kn_tool_path, kn_tool_path_destroy)

static struct {
    kn_rig rig;
    kn_virtual_device device[2];
    kn_hand_player player[2];
    kn_closed_loop_hand grasp;
    double contact_n, sum_n[2][3]; // largest contact force; sum of each hand's forces while the hand is high
    int high[2], wild;             // ticks while high; forces still to be replaced by 60 N
} p;

// Serve this scene. Stop the server that ran before.
static void serve(const char *scene, const char *const *sets, int count, bool local_model)
{
    char path[256];
    kn_rig_close(&p.rig);
    memset(&p, 0, sizeof p);
    snprintf(path, sizeof path, "%s/core/scenes/%s", KN_SOURCE_DIR, scene);
    kn_rig_serve(&p.rig, &(kn_served_object_def){
                             .scene_path = path, .sets = sets, .set_count = count, .local_model = local_model});
}

static void notice(kn_rig_end *e, knead_contact_force_t *f)
{
    int n = (int)(e - p.rig.end);
    p.contact_n = fmax(p.contact_n, kn_rules_between(f->contact_force_n, (double[3]){0}));
    if (p.wild > 0 && f->force_n[2] > 0.1) f->force_n[2] = 60, p.wild--;
    if (p.player[n].hand.mode != KN_HAND_PLAY || p.player[n].hand.point.position_m[2] < 0.0449) return;
    for (int i = 0; i < 3; i++) p.sum_n[n][i] += f->force_n[i];
    p.high[n]++;
}

// Join a hand to that tool; it plays a path. def: a device in the hand, or NULL.
static void join(const char *probe, const kn_tool_path *path, const kn_closed_loop_hand_def *def)
{
    char error[256] = "";
    int n = p.rig.ends, tool = 0;
    const kn_scene *s = p.rig.on.scene;
    while (strcmp(s->model.probe[tool].name, probe)) tool++;
    const kn_probe_def *t = &s->model.probe[tool];
    kn_hand_def hand = {.path = path, .clear_z_m = 0.1, .session = 100 * (n + 1), .tries = p.wild > 0 ? 2 : 1};
    kn_virtual_device_hand *tick = kn_hand_player_tick;
    void *self = &p.player[n];
    if (def && def->render.local)
        hand.hold_ms = KN_HAPTIC_RENDER_LOCAL_HOLD_MS, hand.zero_ms = KN_HAPTIC_RENDER_LOCAL_ZERO_MS;
    kn_hand_player_init(&p.player[n], &hand);
    if (def) {
        kn_closed_loop_hand_def g = *def;
        g.render.device = s->device;
        g.render.coupling_n_m = t->coupling_n_m, g.render.coupling_n_s_m = t->coupling_n_s_m;
        g.render.radius_m = t->radius_m;
        g.render.guard_n_per_ms = s->limits.guard_n_per_ms;
        CHECK(t->coupling_n_m > 0);
        kn_closed_loop_hand_init(&p.grasp, &g, &p.player[n]);
        tick = kn_closed_loop_hand_tick, self = &p.grasp;
    }
    kn_rig_end *e = kn_rig_join(&p.rig, &(kn_link_fault){0}, 0, 370000 + 340000 * n);
    e->device = &p.device[n];
    e->sent = notice;
    bool opened = kn_virtual_device_join(e->device, tick, self, KN_MEMORY_URL, probe, error, sizeof error);
    kn_rig_joined(e, opened, kn_bus_client_memory(e->device->bus), error);
}

static void play(void) // run until every hand has ended
{
    for (bool plays = true; plays;) {
        plays = false;
        kn_rig_run(&p.rig, 100);
        for (int i = 0; i < p.rig.ends; i++) plays |= p.rig.end[i].due_ns != INT64_MAX;
    }
    for (int i = 0; i < p.rig.ends; i++) CHECK(kn_rules_broken(&p.rig.end[i].served) == 0);
}

// Play the path with a device. Return true if it was calm and played to its end.
static bool feel(const char *name, const kn_tool_path *path, kn_closed_loop_hand_def def)
{
    join("finger", path, &def);
    play();
    const kn_closed_loop_hand_news *n = &p.grasp.news;
    bool done = p.player[0].hand.mode == KN_HAND_DONE;
    printf("     %s: %.2f N at most, buzz %.3f N, %d turns, %.2f mJ given, damped for %lld ms, %lld models, %s\n", name,
           p.rig.end[0].served.largest_n, n->loudest_n, n->turns, 1e3 * n->given_j, (long long)n->acted,
           (long long)p.grasp.render.model.taken,
           !done                    ? "spoilt"
           : n->buzzes || n->drives ? "not calm"
                                    : "calm");
    return done && !n->buzzes && !n->drives;
}

static double ramp(double t, double from, double to) { return t < from ? 0 : t > to ? 1 : (t - from) / (to - from); }

// Return the hand's path: press, slide 5 mm, lift, tap twice. Because of the grip the device goes some mm less deep.
static kn_tool_path *way(void)
{
    enum { POINTS = 451 };
    static kn_tool_path_point point[POINTS];
    static double time_s[POINTS];
    for (int i = 0; i < POINTS; i++) {
        double t = time_s[i] = 0.01 * i, tap = t < 3.2 || t > 4.2 ? 0 : 0.006 * (1 - cos(12.566 * (t - 3.2)));
        double down_m = 0.014 * (ramp(t, 0.3, 0.8) - ramp(t, 2.4, 2.8)) + tap;
        double along_m = 0.005 * (ramp(t, 1.4, 2.2) - ramp(t, 2.8, 3.2));
        point[i] = (kn_tool_path_point){.position_m = {along_m, 0, 0.051 - down_m}, .orientation_wxyz = {1}};
    }
    return kn_tool_path_through(POINTS, time_s, point);
}

TEST("pressing, sliding and tapping jelly with 0 to 30 ms delay, the local model is calm and returns under 1 mJ")
{
    static const char *const jelly[] = {"material={variant: viscoelastic, k1: 21.7 kPa, c1: 225 Pa s, damper: none}",
                                        "density=1.02 g/cm^3", "device=omega", "probes.finger.coupling=800 N/m",
                                        "probes.finger.damping=2 N*s/m"};
    static const int delay_ms[] = {0, 5, 30, 20};
    OWN(kn_tool_path) *path = way();
    serve("dough-small.yaml", jelly, 5, true);
    feel("no link", path, (kn_closed_loop_hand_def){.grip = KN_GRIP_NORMAL});
    double near_n = p.grasp.news.loudest_n;
    int64_t acted = 0;
    for (int i = 0; i < 4; i++) {
        serve("dough-small.yaml", jelly, 5, true);
        CHECK(feel("local model", path,
                   (kn_closed_loop_hand_def){.grip = KN_GRIP_NORMAL,
                                             .delay_ms = delay_ms[i],
                                             .loss = delay_ms[i] == 30 ? 0.2 : 0,
                                             .render.local = true}));
        CHECK(p.grasp.news.loudest_n < 1.5 * near_n + 0.02 && p.grasp.news.given_j < 1e-3);
        CHECK(p.grasp.render.model.taken > 2500);
        acted = p.grasp.news.acted;
    }
    serve("dough-small.yaml", jelly, 5, true);
    if (feel("20 ms, held", path,
             (kn_closed_loop_hand_def){.grip = KN_GRIP_NORMAL, .delay_ms = 20, .render.held = true}))
        CHECK(p.grasp.news.acted > 100 + 3 * acted); // calm only because of the controller's damping
}

TEST("without delay a device on dough is calm; 20 ms away its forces are refused, and held forces shake it")
{
    static const char *const touch[] = {"device=touch"};
    OWN(kn_tool_path) *press =
        kn_tool_path_press(&(kn_tool_path_def){.touch_z_m = 0.045, .depth_m = 0.01, .hold_s = 2}),
                      *sine = kn_tool_path_sine(&(kn_tool_path_def){.touch_z_m = 0.045, .hold_s = 2});
    serve("dough-small.yaml", touch, 1, false);
    CHECK(feel("firm", press, (kn_closed_loop_hand_def){.grip = KN_GRIP_FIRM}) && p.rig.end[0].served.largest_n > 0.5);
    serve("dough-small.yaml", touch, 1, false);
    CHECK(feel("swing", sine, (kn_closed_loop_hand_def){.grip = KN_GRIP_LIGHT}));
    serve("dough-small.yaml", touch, 1, false);
    CHECK(feel("left alone", sine, (kn_closed_loop_hand_def){.grip = KN_GRIP_NONE}));
    serve("dough-small.yaml", touch, 1, false);
    CHECK(!feel("20 ms", sine, (kn_closed_loop_hand_def){.grip = KN_GRIP_LIGHT, .delay_ms = 20}));
    const kn_trip *trip = &p.player[0].hand.trip[0];
    CHECK(p.player[0].hand.trips == 1 && !strcmp(trip->piece, "engage") && p.grasp.render.largest_n == 0);
    CHECK_STR(trip->refusal, kn_haptic_render_why(KN_HAPTIC_RENDER_FAR));
    serve("dough-small.yaml", touch, 1, false);
    CHECK(!feel("20 ms, held", press,
                (kn_closed_loop_hand_def){.grip = KN_GRIP_LIGHT, .delay_ms = 20, .render.held = true}));
    CHECK(p.player[0].hand.mode == KN_HAND_GAVE_UP || p.grasp.news.acted > 100);
}

TEST("a light grip on jelly is calm, also with 5 ms delay and 20 % loss, and also with one axis")
{
    static const char *const scaled[] = {"device={profile: touch, force_scale: 0.25}"};
    static const kn_closed_loop_hand_def hands[] = {
        {.grip = KN_GRIP_LIGHT},
        {.grip = KN_GRIP_LIGHT, .delay_ms = 5, .loss = 0.2, .render.held = true},
        {.grip = KN_GRIP_LIGHT, .axes = 1}};
    OWN(kn_tool_path) *press =
        kn_tool_path_press(&(kn_tool_path_def){.touch_z_m = 0.075, .depth_m = 0.01, .hold_s = 2}),
                      *sine = kn_tool_path_sine(&(kn_tool_path_def){.touch_z_m = 0.075, .hold_s = 2});
    for (int i = 0; i < 3; i++) {
        serve("jelly.yaml", scaled, 1, false);
        CHECK(feel("jelly", i < 2 ? press : sine, hands[i]));
    }
}

TEST("a forged force of 60 N trips the reflex guard of a held device; the hand lifts and tries again")
{
    static const char *const device[] = {"device=unknown"};
    OWN(kn_tool_path) *poke = kn_tool_path_poke(&(kn_tool_path_def){.touch_z_m = 0.045});
    serve("dough-small.yaml", device, 1, false);
    p.wild = 20;
    CHECK(feel("wild", poke, (kn_closed_loop_hand_def){.grip = KN_GRIP_LIGHT}));
    const kn_hand *h = &p.player[0].hand;
    CHECK(h->trips == 1 && h->tries == 2 && p.wild < 20);
    CHECK_STR(h->trip[0].refusal, kn_haptic_render_why(KN_HAPTIC_RENDER_REFLEX));
}

TEST("in the paper's press with force scale 0.25 the device gives a quarter of the contact force and stays below 3.3 N")
{
    static const char *const scaled[] = {"device={profile: touch, force_scale: 0.25}"};
    OWN(kn_tool_path) *press = kn_tool_path_press(&(kn_tool_path_def){.touch_z_m = 0.03, .depth_m = 0.01, .hold_s = 1});
    serve("dough.yaml", scaled, 1, false);
    join("plate", press, NULL);
    play();
    double given_n = p.rig.end[0].served.largest_n;
    printf("     the object gives %.2f N, the hand is given %.2f N\n", p.contact_n, given_n);
    CHECK(p.player[0].hand.mode == KN_HAND_DONE && p.contact_n > 11 && given_n > 2.8 && given_n < 3.3);
    CHECK_NEAR(given_n, 0.25 * p.contact_n, 1e-9);
}

TEST("a hand that ends during a press leaves no fault, and another hand takes the tool after 100 ms")
{
    const double time_s[] = {0, 0.8, 1.2};
    kn_tool_path_point point[] = {{{0, 0, 0.06}, {0}, {1}}, {{0, 0, 0.045}, {0}, {1}}, {{0, 0, 0.042}, {0}, {1}}};
    OWN(kn_tool_path) *press = kn_tool_path_through(3, time_s, point),
                      *poke = kn_tool_path_poke(&(kn_tool_path_def){.touch_z_m = 0.045});
    serve("dough-small.yaml", NULL, 0, false);
    join("finger", press, NULL);
    play();
    kn_rig_run(&p.rig, 100);
    const kn_force *f = &p.rig.exchange.force[1];
    CHECK(p.contact_n > 0.3 && !f->live && f->gain == 0 && p.rig.loop.servo.safety[1].faults == 0);
    CHECK(p.rig.exchange.receiver.source[1].last.session == 0);
    join("finger", poke, NULL);
    play();
    CHECK(p.player[1].hand.mode == KN_HAND_DONE && p.player[1].hand.trips == 0);
}

TEST("after a kill of kneadd in a press a device gives 0 N by 20 ms, and by 300 ms with the local model")
{
    static const char *const touch[] = {"device=touch"};
    kn_tool_path *press = kn_tool_path_press(&(kn_tool_path_def){.touch_z_m = 0.045, .depth_m = 0.01, .hold_s = 2});
    for (int local = 0; local < 2; local++) {
        const int silent_ms = local ? 300 : 20;
        serve("dough-small.yaml", touch, 1, local);
        join("finger", press, &(kn_closed_loop_hand_def){.grip = KN_GRIP_FIRM, .render.local = local});
        kn_rig_run(&p.rig, 3500);
        const double *given_n = p.grasp.render.given_n, none_n[3] = {0};
        const double held_n = kn_rules_between(given_n, none_n);
        double before_n[3], step_n = 0;
        int last_ms = 0;
        kn_rig_kill(&p.rig);
        for (int ms = 1; ms <= 500; ms++) {
            memcpy(before_n, given_n, sizeof before_n);
            kn_rig_run(&p.rig, 1);
            step_n = fmax(step_n, kn_rules_between(given_n, before_n));
            if (kn_rules_between(given_n, none_n) > 0) last_ms = ms;
        }
        printf("     %s: %.2f N, %.2f N/ms at most, 0 N after %d ms\n", local ? "local" : "forces", held_n, step_n,
               last_ms);
        CHECK(held_n > 0.3 && last_ms > silent_ms / 3 && last_ms <= silent_ms);
        CHECK(step_n <= 0.5);
        CHECK(p.player[0].hand.trips == 1);
        kn_rig_close(&p.rig);
    }
    kn_tool_path_destroy(press);
}

TEST("two fingers lift a piece of dough and carry half of its weight each, with equal squeezing forces")
{
    char error[256];
    OWN(kn_tool_path) *thumb = kn_tool_path_load(KN_SOURCE_DIR "/clients/examples/thumb.csv", error, sizeof error);
    OWN(kn_tool_path) *index = kn_tool_path_load(KN_SOURCE_DIR "/clients/examples/index.csv", error, sizeof error);
    serve("pinch.yaml", NULL, 0, false);
    join("thumb", thumb, NULL);
    join("index", index, NULL);
    play();
    double mean_n[2][3], weight_n = 9.81 * kn_model_mass(p.rig.on.model);
    for (int i = 0; i < 6; i++) mean_n[i / 3][i % 3] = p.sum_n[i / 3][i % 3] / p.high[i / 3];
    printf("     thumb %.3f N along x, %.3f along z; index %.3f, %.3f; weight %.3f N\n", mean_n[0][0], mean_n[0][2],
           mean_n[1][0], mean_n[1][2], weight_n);
    CHECK(p.player[0].hand.mode == KN_HAND_DONE && p.player[1].hand.mode == KN_HAND_DONE);
    CHECK(p.high[0] > 500 && p.high[1] > 500);
    CHECK_NEAR(-mean_n[0][2] - mean_n[1][2], weight_n, 0.03 * weight_n);
    CHECK_NEAR(-mean_n[0][2], 0.5 * weight_n, 0.1 * weight_n);
    CHECK_NEAR(-mean_n[0][0], mean_n[1][0], 0.05 * fabs(mean_n[1][0]));
}

TESTS_MAIN
