// The virtual hand with a simulated server: it engages before it moves, retreats from a fault, and comes back.
#include "clients/hand/virtual_hand.h"
#include "tests/check.h"

// A server as seen on the wire: 200 ms of poses, 200 ms of ramp, then engaged. After 20 ms of silence the server
// latches.
typedef struct server {
    int64_t session, tick;
    int flow_ms, silent_ms;
    bool dead, latched, never_engages;
    kn_fault latch_next; // the fault to latch at the next deep pose
    kn_fault fault;
} server;

static bool serve(server *s, const kn_hand_out *pose, kn_hand_force *force)
{
    if (pose->send && pose->session != s->session) {
        if (s->session && s->silent_ms < 1000) return false; // the session before still owns the tool
        *s = (server){.session = pose->session,
                      .tick = s->tick,
                      .dead = s->dead,
                      .never_engages = s->never_engages,
                      .latch_next = s->latch_next};
    }
    s->tick++;
    s->silent_ms = pose->send ? 0 : s->silent_ms + 1;
    s->flow_ms = pose->send ? s->flow_ms + 1 : 0;
    if (s->silent_ms == 20) s->latched = true, s->fault = KN_FAULT_POSE_SILENCE;
    bool engaged = s->flow_ms > 400 && !s->never_engages;
    double z_m = pose->point.position_m[2];
    if (s->fault == KN_FAULT_POSE_SILENCE && z_m > 0.03 && engaged) s->latched = false;
    if (engaged && s->latch_next && z_m < 0.025)
        s->latched = true, s->fault = s->latch_next, s->latch_next = KN_FAULT_NONE;
    if (s->dead || !s->session || s->silent_ms >= 1000) return false;
    *force = (kn_hand_force){.session = s->session,
                             .seq = pose->seq,
                             .tick = s->tick,
                             .fault = s->latched ? (int32_t)s->fault : 0,
                             .force_n = {0, 0, s->latched || !engaged ? 0.0 : 5.0}};
    force->flags = s->latched ? KN_FLAG_LATCHED : engaged ? KN_FLAG_ENGAGED : KN_FLAG_RAMPING;
    return true;
}

static struct {
    kn_hand hand;
    server server;
    kn_hand_force force;
    bool fresh; // force is on its way to the hand
    int ms, sent;
    double lowest_m;
} r;

static kn_tool_path *path;
static const double step_limit_m = KN_TOOL_PATH_AIR_M_S * 1e-3 * 1.001;

static void begin(kn_hand_def def)
{
    memset(&r, 0, sizeof r);
    kn_tool_path_destroy(path);
    path = kn_tool_path_press(&(kn_tool_path_def){.touch_z_m = 0.03, .hold_s = 0.5});
    def.path = path, def.clear_z_m = 0.05, def.session = 100;
    kn_hand_init(&r.hand, &def);
    r.lowest_m = 1;
}

static bool ended(void) { return r.hand.mode == KN_HAND_DONE || r.hand.mode == KN_HAND_GAVE_UP; }

// Play for so many ms, or until the hand has ended. The pose never jumps.
static void play(int ms)
{
    static double last_m;
    for (int i = 0; i < ms && !ended(); i++) {
        kn_hand_out pose = kn_hand_tick(&r.hand, r.fresh ? &r.force : NULL, 1);
        if (pose.send) {
            double z = pose.point.position_m[2];
            CHECK(r.sent++ == 0 || fabs(z - last_m) <= step_limit_m);
            last_m = z;
            r.lowest_m = fmin(r.lowest_m, z);
        }
        r.fresh = serve(&r.server, &pose, &r.force);
        r.ms++;
    }
}

TEST("a hand engages above the object, plays its path once and is done")
{
    begin((kn_hand_def){0});
    play(399);
    CHECK(r.hand.mode == KN_HAND_ENGAGE && r.lowest_m == 0.05);
    play(20000);
    CHECK(r.hand.mode == KN_HAND_DONE && r.hand.tries == 1 && r.hand.trips == 0);
    CHECK_NEAR(r.lowest_m, 0.02, 1e-9);
    CHECK(r.hand.attempt[0].play_seq > 400);
    CHECK_NEAR((double)(r.hand.attempt[0].sent - r.hand.attempt[0].play_seq), path->duration_s * 1e3, 1.5);
}

TEST("without a server the hand gives up within 4 s and does not move; a server that never engages is another trouble")
{
    begin((kn_hand_def){0});
    r.server.dead = true;
    play(20000);
    CHECK(r.hand.trouble == KN_HAND_NO_ANSWER && r.lowest_m == 0.05 && r.ms < 4000);
    begin((kn_hand_def){0});
    r.server.never_engages = true;
    play(20000);
    CHECK(r.hand.trouble == KN_HAND_NOT_ENGAGED && r.lowest_m == 0.05);
}

TEST("if the server dies, the watchdog holds the force 3 ms, reaches 0 N by 20 ms, and the hand retreats")
{
    begin((kn_hand_def){0});
    play(2500);
    CHECK(r.hand.mode == KN_HAND_PLAY);
    CHECK(r.hand.given_n[2] == 5);
    r.server.dead = true;
    play(1); // deliver the force that is under way
    for (int silent = 1; silent <= 25; silent++) {
        play(1);
        const double given_n = r.hand.given_n[2];
        CHECK(silent <= 3 ? given_n == 5 : silent < 20 ? given_n > 0 && given_n < 5 : given_n == 0);
    }
    CHECK(r.hand.mode == KN_HAND_RETREAT && r.hand.trips == 1);
    const kn_trip *trip = &r.hand.trip[0];
    CHECK(trip->own && trip->silent_ms == 20 && trip->stalled_ms == 0 && trip->force_n == 5);
    CHECK_STR(trip->piece, "press");
    play(20000);
    CHECK(r.hand.trouble == KN_HAND_NO_ANSWER && r.hand.tries == 2 && !trip->cleared);
    CHECK(r.hand.point.position_m[2] == 0.05);
}

TEST("a server restarted at tick 0 does not feed the watchdog; the hand lifts and presses again")
{
    begin((kn_hand_def){0});
    while (!ended() && r.hand.point.position_m[2] > 0.025) play(1);
    r.server = (server){.session = r.server.session};
    play(25);
    CHECK(r.hand.mode == KN_HAND_RETREAT && r.hand.trips == 1);
    CHECK(r.hand.trip[0].own && r.hand.trip[0].silent_ms == 20 && r.hand.trip[0].force_n == 5.0);
    play(20000);
    CHECK(r.hand.mode == KN_HAND_DONE && r.hand.tries == 2 && r.hand.trips == 1);
}

TEST("lost poses latch a fault that lifting clears, and the press is repeated in a new session")
{
    begin((kn_hand_def){.drop_at_ms = 1500, .drop_ms = 30});
    play(60000);
    CHECK(r.hand.mode == KN_HAND_DONE && r.hand.tries == 2 && r.hand.trips == 1);
    CHECK(!r.hand.trip[0].own && r.hand.trip[0].fault == KN_FAULT_POSE_SILENCE && r.hand.trip[0].cleared);
    CHECK_NEAR(r.hand.trip[0].time_s, 1.5, 0.03);
    CHECK(r.hand.attempt[1].session == 101 && r.server.session == 101);
    CHECK_NEAR(r.lowest_m, 0.02, 1e-9);
}

TEST("a fault that lifting does not clear ends with the session; the next try succeeds, and three spoilt tries end the "
     "hand")
{
    begin((kn_hand_def){0});
    r.server.latch_next = KN_FAULT_IMPULSE;
    play(60000);
    CHECK(r.hand.mode == KN_HAND_DONE && r.hand.tries == 2 && r.hand.trips == 1);
    CHECK(r.hand.trip[0].fault == KN_FAULT_IMPULSE && !r.hand.trip[0].cleared);
    begin((kn_hand_def){0});
    for (int i = 0; i < 200 && !ended(); i++) {
        if (!r.server.latched) r.server.latch_next = KN_FAULT_IMPULSE;
        play(500);
    }
    CHECK(r.hand.mode == KN_HAND_GAVE_UP && r.hand.trouble == KN_HAND_SPOILT);
    CHECK(r.hand.trips == KN_HAND_TRIES && r.hand.tries == KN_HAND_TRIES);
    CHECK(r.hand.point.position_m[2] == 0.05);
}

TEST("a stall of 15 ms makes no jump of the pose, and a stall of 40 ms trips the hand's own watchdog")
{
    begin((kn_hand_def){0});
    play(2000);
    double before = r.hand.point.position_m[2];
    kn_hand_force force = {.session = 100, .tick = r.force.tick + 1, .flags = KN_FLAG_ENGAGED, .force_n = {0, 0, 5}};
    kn_hand_tick(&r.hand, &force, 15);
    CHECK(r.hand.mode == KN_HAND_PLAY && fabs(r.hand.point.position_m[2] - before) <= step_limit_m);
    kn_hand_tick(&r.hand, &force, 40);
    CHECK(r.hand.mode == KN_HAND_RETREAT && r.hand.trip[0].own && r.hand.trip[0].stalled_ms == 39);
}

TEST("forces of another session are ignored")
{
    begin((kn_hand_def){0});
    kn_hand_force force = {.session = 7, .flags = KN_FLAG_ENGAGED, .force_n = {0, 0, 5}};
    for (int i = 0; i < 100; i++) kn_hand_tick(&r.hand, &force, 1);
    CHECK(r.hand.mode == KN_HAND_ENGAGE && r.hand.given_n[2] == 0);
}

TESTS_MAIN
