// The forces of kneadd and of the motors of two devices, one of which renders forces and the other the local model.
// The cases are a bad link, a delay, a kill and a freeze, all in virtual time.
#include "clients/hand/haptic_loop.h"
#include "tests/check.h"
#include "tests/dice.h"
#include "tests/rig.h"
#include <fcntl.h>
#include <unistd.h>

#if defined(KN_SANITIZED)
enum { ROW_MS = 1000, KILLS = 5, FREEZES = 1 };
#else
enum { ROW_MS = 2200, KILLS = 8, FREEZES = 1 };
#endif

static struct {
    kn_rig rig;
    kn_bridge bridge[2];
    kn_presser near, far; // far renders the local model
    uint64_t dice;
} p;

static int throw(int from, int to) // a random number of ms
{
    return (int)kn_dice_in(&p.dice, from, to);
}

static int times(const char *name, int of_one, int usual) // the usual number, or the number from the environment
{
    const char *asked = getenv(name);
    return asked ? of_one * atoi(asked) : usual;
}

static void join(kn_presser *presser, const char *probe, double x_m, bool local, const kn_link_fault *fault,
                 double delay_ms)
{
    char error[256] = "";
    int n = p.rig.ends;
    kn_rig_end *e = kn_rig_join(&p.rig, fault, delay_ms, 370000 + 340000 * n);
    kn_bridge_def def = {
        .url = KN_MEMORY_URL, .probe = probe, .session = 1000 * (n + 1), .render = {.radius_m = 0.015, .local = local}};
    CHECK(kn_device_profile_load(&def.render.device, "presser", "touch", NULL, 0) == 0);
    kn_presser_init(presser, x_m, &def.render);
    e->bridge = &p.bridge[n];
    bool opened = kn_bridge_open(e->bridge, &def, &presser->base, error, sizeof error);
    kn_rig_joined(e, opened, kn_bus_client_memory(e->bridge->bus), error);
}

static void begin(void) // end the servers and hands that ran before
{
    kn_rig_close(&p.rig);
    memset(&p, 0, sizeof p);
}

static void serve(bool local_model)
{
    static const char *const coarse = "object={size: [6 cm, 3 cm, 3 cm], spacing: 1.5 cm, structure: diagonals}";
    kn_rig_serve(&p.rig, &(kn_served_object_def){.scene_path = KN_SOURCE_DIR "/tests/e2e/two_fingers.yaml",
                                                 .sets = &coarse,
                                                 .set_count = 1,
                                                 .local_model = local_model});
}

static void start(const kn_link_fault *fault, double delay_ms, kn_auth *auth)
{
    begin();
    p.rig.auth = auth;
    serve(true);
    join(&p.near, "near", -0.015, false, fault, delay_ms);
    kn_rig_run(&p.rig, 300); // the ticks follow the poses of the hand that is let in first
    join(&p.far, "far", 0.015, true, fault, delay_ms);
}

static void check_rules(const char *name)
{
    const kn_rules *n = &p.near.rules, *f = &p.far.rules,
                   *judged[] = {&p.rig.end[0].served, &p.rig.end[1].served, n, f};
    for (int i = 0; i < 4; i++) {
        if (!kn_rules_broken(judged[i])) continue;
        KN_TEST_FAIL("%s: %s breaks a rule", name, i < 2 ? "kneadd" : "a device");
        kn_rules_print(judged[i]);
    }
    printf("     %s: forces: pressed %lld ms, at most %.3f N/ms in contact, %.3f else; model: %lld ms, %.3f, %.3f\n",
           name, (long long)n->pressed, n->contact_n, n->transition_n, (long long)f->pressed, f->contact_n,
           f->transition_n);
}

// Check that the poses missing at kneadd are those that the link lost or delayed, and that kneadd's counters agree
// with the link's. A tolerance covers two poses and a run of lost ones under way at the end.
static void check_counts(bool swapped)
{
    for (kn_rig_end *e = p.rig.end; e < p.rig.end + 2; e++) {
        const kn_packets *n = &p.rig.exchange.receiver.source[e - p.rig.end].packets;
        const kn_way *up = &e->up;
        double share = (double)(swapped ? up->swapped : up->lost) / (double)(up->carried + up->lost);
        double lacks = 1 - (double)e->served.fresh / (double)e->served.ticks;
        CHECK_NEAR(lacks, share, 0.002);
        CHECK_NEAR(n->lost, up->lost, 2 + n->lost_in_a_row_max);
        CHECK_NEAR(n->duplicate, up->twice, 2);
        CHECK_NEAR(n->reordered, up->swapped, 2);
    }
}

static void run_row(const char *name, const kn_link_fault *fault, kn_auth *auth)
{
    start(fault, 0, auth);
    kn_rig_run(&p.rig, times("KN_LINK_SECONDS", 1000, ROW_MS));
    check_rules(name);
}

TEST("a lossy, repeating, swapping, delaying or flipping link breaks no safety rule, and kneadd counts its faults")
{
    static const struct {
        const char *name;
        kn_link_fault fault;
        bool counts, swapped;
    } rows[] = {{"no fault", {.burst = 1}, true, false},
                {"loss 1 %", {.loss = 0.01}, true, false},
                {"loss 5 %", {.loss = 0.05}, true, false},
                {"loss 20 %", {.loss = 0.2}, true, false},
                {"bursts of 3", {.loss = 0.05, .burst = 3}, true, false},
                {"bursts of 20", {.loss = 0.05, .burst = 20}, true, false},
                {"repeats", {.twice = 0.01}, true, false},
                {"swaps", {.swap = 0.01}, true, true},
                {"jitter of 5 ms", {.jitter = 5}, false, false},
                {"flipped bits", {.flip = 0.001}, false, false},
                {"all at once",
                 {.loss = 0.05, .burst = 3, .jitter = 4, .twice = 0.01, .swap = 0.01, .flip = 0.001},
                 false,
                 false}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        run_row(rows[i].name, &rows[i].fault, NULL);
        if (rows[i].counts) check_counts(rows[i].swapped);
        const kn_packets *n = &p.rig.exchange.receiver.source[0].packets;
        if (rows[i].fault.jitter > 0) CHECK(n->late > 0 && n->reordered > 0);
    }
}

TEST("after a kill or freeze of kneadd in a press a device gives 0 N by 20 ms, with the local model by 300 ms")
{
    const int kills = times("KN_KILLS", 1, KILLS);
    start(&(kn_link_fault){0}, 0, NULL);
    for (int kill = 0; kill < kills; kill++) {
        if (!p.rig.serves) serve(true);
        kn_rig_run(&p.rig, throw(1300, 2500)); // a new session begins 1.2 s after the kill, and presses 0.4 s later
        if (kill % 2) {
            p.rig.frozen_ns = p.rig.time.now_ns + 1;
            p.rig.thawed_ns = p.rig.time.now_ns + 400 * (int64_t)KN_PERIOD_NS;
            kn_rig_until(&p.rig, p.rig.thawed_ns);
        }
        kn_rig_kill(&p.rig);
        kn_rig_run(&p.rig, throw(30, 400)); // until the next kneadd starts
    }
    check_rules("kills");
    CHECK(p.near.rules.outages == kills && p.near.rules.felt >= kills / 3 && p.far.rules.felt >= kills / 5);
    CHECK(p.near.rules.zero_at <= 20 && p.far.rules.zero_at <= 300);
}

TEST("in a freeze of 5 to 200 ms the missed cycles are counted and skipped, and no safety rule is broken")
{
    static const int freeze_ms[] = {5, 20, 50, 200};
    start(&(kn_link_fault){0}, 0, NULL);
    kn_loop *loop = &p.rig.loop;
    int64_t skipped = 0;
    const int freezes = times("KN_STALLS", 4, 4 * FREEZES);
    for (int n = 0; n < freezes; n++) {
        kn_rig_run(&p.rig, throw(2100, 2900)); // a new session begins 1.2 s after a trip, and presses 0.5 s later
        int64_t tick = loop->clock.tick, due_ns = loop->clock.start_ns + (tick + 1) * KN_PERIOD_NS;
        p.rig.frozen_ns = p.rig.time.now_ns + 1;
        p.rig.thawed_ns = p.rig.frozen_ns + freeze_ms[n % 4] * (int64_t)KN_PERIOD_NS + throw(0, KN_PERIOD_NS);
        int64_t missed = (p.rig.thawed_ns - due_ns) / KN_PERIOD_NS;
        kn_wake wake = kn_loop_wait(loop);
        kn_loop_tick(loop, &wake);
        CHECK(wake.missed == missed && missed >= freeze_ms[n % 4] - 1 && wake.tick == tick + 1 + missed);
        CHECK(atomic_load(&loop->account.missed) == (skipped += missed));
        for (int i = 0; i < 3; i++) {
            wake = kn_loop_wait(loop);
            kn_loop_tick(loop, &wake);
            CHECK(wake.missed == 0 && wake.late_ns == 0 && wake.tick == tick + missed + 2 + i);
        }
    }
    kn_rig_run(&p.rig, 1000);
    check_rules("freezes");
    CHECK(p.near.rules.zero_at <= 20 && p.near.rules.pressed > freezes * 500);
}

TEST("the local model gives kneadd's force within 10 %, even 20 ms away; plain forces from 20 ms away are refused")
{
    const kn_haptic_render *near = &p.bridge[0].now.session.render, *far = &p.bridge[1].now.session.render;
    double near_n = 0;
    for (int delay_ms = 0; delay_ms <= 20; delay_ms += 20) {
        start(&(kn_link_fault){0}, delay_ms, NULL);
        kn_rig_run(&p.rig, 2500);
        CHECK(far->guards == 0 && far->reflexes == 0 && far->model.taken > 2000 && p.far.rules.pressed > 1000);
        if (delay_ms == 0) near_n = p.near.rules.largest_n;
        CHECK_NEAR(p.far.rules.largest_n, near_n, 0.1 * near_n);
    }
    CHECK(near->stop == KN_HAPTIC_RENDER_FAR && near->refusals == 1 && p.near.rules.largest_n == 0);
    CHECK(strstr(kn_haptic_render_why(near->stop), "--local render") && far->round_trip_s > 0.015);
    check_rules("behind 20 ms");
}

TEST("a device with the local model gives 0 N if kneadd sends no contacts")
{
    begin();
    serve(false);
    join(&p.near, "near", -0.015, false, &(kn_link_fault){0}, 0);
    join(&p.far, "far", 0.015, true, &(kn_link_fault){0}, 0);
    kn_rig_run(&p.rig, 2000);
    CHECK(p.near.rules.pressed > 500 && p.rig.end[1].served.pressed > 500 && p.far.rules.largest_n == 0);
}

static int wild_left;

static void be_wild(kn_rig_end *end, knead_contact_force_t *force)
{
    (void)end;
    if (wild_left > 0 && force->force_n[2] > 0.3) force->force_n[2] = 60, wild_left--;
}

TEST("a forged force of 60 N trips the device's guard; the force fades in steps and a new session begins")
{
    start(&(kn_link_fault){0}, 0, NULL);
    for (int i = 0; i < 1500 && p.near.now.force_n[2] < 1; i++) kn_rig_run(&p.rig, 1);
    const kn_device_session *t = &p.bridge[0].now.session;
    int64_t session = t->session;
    double last_n = p.near.now.force_n[2];
    CHECK(last_n > 0.9 && p.near.live && t->render.reflexes == 0);
    p.rig.end[0].sent = be_wild;
    wild_left = 20;
    for (int i = 0; i < 40; i++) {
        kn_rig_run(&p.rig, 1);
        CHECK(fabs(p.near.now.force_n[2] - last_n) <= 0.5 + 1e-9);
        last_n = p.near.now.force_n[2];
    }
    CHECK(last_n == 0 && !p.near.live && t->render.reflexes == 1);
    kn_rig_run(&p.rig, 3000);
    CHECK(t->session == session + 1 && p.near.rules.pressed > 1000 && t->render.reflexes == 1);
}

TEST("with a key every flipped or replayed message is rejected, and all others are accepted")
{
    static kn_auth auth;
    char path[] = "link-key-XXXXXX", error[200] = "";
    int fd = mkstemp(path);
    for (int i = 0; i < KN_AUTH_KEY; i++) CHECK(dprintf(fd, "%02x", 7 * i % 256) == 2);
    close(fd);
    setenv("KNEAD_KEY", path, 1); // the devices use this key from now on
    CHECK(kn_auth_load(&auth, path, error, sizeof error));
    const kn_receiver *r = &p.rig.exchange.receiver;
    const kn_rig_end *e = p.rig.end;

    run_row("flipped bits, a key", &(kn_link_fault){.flip = 0.001}, &auth);
    CHECK(r->rejected[KN_REJECT_MAC] == e[0].up.flipped + e[1].up.flipped && e[0].up.flipped > 0);
    CHECK(r->accepted == r->received - r->rejected[KN_REJECT_MAC] - r->rejected[KN_REJECT_HELLO]);
    for (int i = 0; i < 2; i++) CHECK_NEAR(1 - (double)e[i].served.fresh / (double)e[i].served.ticks, 0.001, 0.01);

    run_row("every message flipped, a key", &(kn_link_fault){.flip = 1}, &auth);
    CHECK(r->received > 1000 && r->accepted == 0 && r->rejected[KN_REJECT_MAC] == r->received);
    CHECK(p.near.rules.heard + p.far.rules.heard == 0);

    run_row("worse, a key",
            &(kn_link_fault){.loss = 0.2, .burst = 20, .jitter = 4, .twice = 0.01, .swap = 0.01, .flip = 0.001}, &auth);

    start(&(kn_link_fault){0}, 0, &auth); // poses of another life are not accepted, but the hands find the new life
    kn_rig_run(&p.rig, 1500);
    kn_datagram_batch recorded = {.count = 1, .datagram[0] = p.rig.inbox[0].datagram[0]};
    int64_t life = auth.life, session = p.bridge[0].now.session.session, pressed = p.near.rules.pressed;
    kn_rig_kill(&p.rig);
    kn_rig_run(&p.rig, 50);
    serve(true);
    kn_exchange_hear(&p.rig.exchange, &recorded);
    CHECK(auth.life != life && r->rejected[KN_REJECT_REPLAYED] == 1 && r->accepted == 0);
    kn_rig_run(&p.rig, 4000);
    CHECK(p.bridge[0].now.session.session == session + 1 && p.near.rules.pressed > pressed + 1000);
    CHECK(r->rejected[KN_REJECT_HELLO] > 0 && r->rejected[KN_REJECT_MAC] == 0);
    check_rules("another life");
    unlink(path);
}

TESTS_MAIN
