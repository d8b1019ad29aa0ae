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
    double sum_n[2][3]; // sum of each hand's forces while the hand is high
    int high[2];        // ticks while high
} p;

// Serve this scene, with settings up to a NULL. Stop the server that ran before.
static void serve(const char *scene, const char *const *sets, bool local_model)
{
    char path[256];
    kn_served_object_def def = {.scene_path = path, .sets = sets, .local_model = local_model};
    kn_rig_close(&p.rig);
    memset(&p, 0, sizeof p);
    snprintf(path, sizeof path, "%s/core/scenes/%s", KN_SOURCE_DIR, scene);
    while (sets[def.set_count]) def.set_count++;
    kn_rig_serve(&p.rig, &def);
}

static void notice(kn_rig_end *e, knead_contact_force_t *f)
{
    int n = (int)(e - p.rig.end);
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
    kn_hand_def hand = {.path = path, .clear_z_m = 0.1, .session = 100 * (n + 1), .tries = 1};
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

// Serve the scene and play the path with a device. Return true if it was calm and played to its end.
static bool feel(const char *scene, const char *const *sets, const kn_tool_path *path, kn_closed_loop_hand_def def)
{
    serve(scene, sets, def.render.local);
    join("finger", path, &def);
    play();
    const kn_closed_loop_hand_news *n = &p.grasp.news;
    bool done = p.player[0].hand.mode == KN_HAND_DONE;
    printf(
        "     %s, %d ms: %.2f N at most, buzz %.3f N, %d turns, %.2f mJ given, damped for %lld ms, %lld models, %s\n",
        scene, def.delay_ms, p.rig.end[0].served.largest_n, n->loudest_n, n->turns, 1e3 * n->given_j,
        (long long)n->acted, (long long)p.grasp.render.model.taken,
        !done                    ? "spoilt"
        : n->buzzes || n->drives ? "not calm"
                                 : "calm");
    return done && !n->buzzes && !n->drives;
}

TEST("without delay a device on dough is calm, and a light grip on jelly also with 5 ms delay and 20 % loss and with "
     "one "
     "axis; 20 ms away the forces on dough are refused, held forces shake the device, and the local model is calm")
{
    static const char *const touch[] = {"device=touch", NULL}, *const scaled[] = {
                                                                   "device={profile: touch, force_scale: 0.25}", NULL};
    static const kn_closed_loop_hand_def light = {.grip = KN_GRIP_LIGHT};
    OWN(kn_tool_path) *on_jelly =
        kn_tool_path_press(&(kn_tool_path_def){.touch_z_m = 0.075, .depth_m = 0.01, .hold_s = 2}),
                      *jelly_sine = kn_tool_path_sine(&(kn_tool_path_def){.touch_z_m = 0.075, .hold_s = 2}),
                      *press =
                          kn_tool_path_press(&(kn_tool_path_def){.touch_z_m = 0.045, .depth_m = 0.01, .hold_s = 2}),
                      *sine = kn_tool_path_sine(&(kn_tool_path_def){.touch_z_m = 0.045, .hold_s = 2});
    CHECK(feel("jelly.yaml", scaled, on_jelly, light));
    CHECK(feel("jelly.yaml", scaled, on_jelly,
               (kn_closed_loop_hand_def){.grip = KN_GRIP_LIGHT, .delay_ms = 5, .loss = 0.2, .render.held = true}));
    CHECK(feel("jelly.yaml", scaled, jelly_sine, (kn_closed_loop_hand_def){.grip = KN_GRIP_LIGHT, .axes = 1}));
    CHECK(feel("dough-small.yaml", touch, press, (kn_closed_loop_hand_def){.grip = KN_GRIP_FIRM}));
    CHECK(p.rig.end[0].served.largest_n > 0.5);
    CHECK(feel("dough-small.yaml", touch, sine, light));
    CHECK(feel("dough-small.yaml", touch, sine, (kn_closed_loop_hand_def){.grip = KN_GRIP_NONE}));
    CHECK(!feel("dough-small.yaml", touch, sine, (kn_closed_loop_hand_def){.grip = KN_GRIP_LIGHT, .delay_ms = 20}));
    const kn_trip *trip = &p.player[0].hand.trip[0];
    CHECK(p.player[0].hand.trips == 1 && !strcmp(trip->piece, "engage") && p.grasp.render.largest_n == 0);
    CHECK_STR(trip->refusal, kn_haptic_render_why(KN_HAPTIC_RENDER_FAR));
    CHECK(feel("dough-small.yaml", touch, press,
               (kn_closed_loop_hand_def){.grip = KN_GRIP_LIGHT, .delay_ms = 20, .render.local = true}));
    CHECK(p.grasp.news.given_j < 1e-3 && p.grasp.render.model.taken > 2500);
    CHECK(!feel("dough-small.yaml", touch, press,
                (kn_closed_loop_hand_def){.grip = KN_GRIP_LIGHT, .delay_ms = 20, .render.held = true}));
    CHECK(p.player[0].hand.mode == KN_HAND_GAVE_UP || p.grasp.news.acted > 100);
}

TEST("two fingers lift a piece of dough and carry half of its weight each, with equal squeezing forces")
{
    char error[256];
    OWN(kn_tool_path) *thumb = kn_tool_path_load(KN_SOURCE_DIR "/clients/examples/thumb.csv", error, sizeof error);
    OWN(kn_tool_path) *index = kn_tool_path_load(KN_SOURCE_DIR "/clients/examples/index.csv", error, sizeof error);
    serve("pinch.yaml", (const char *const[]){NULL}, false);
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
