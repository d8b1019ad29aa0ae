// gate in release: three times as long with the sanitizers; fuzz.log and fuzz.replay look at its memory there
#include "clients/cli/commands.h"
#include "server/operator_orders.h"
#include "server/log_replay.h"
#include "server/store.h"
#include "tests/clients/heard.h"
#include "tests/dice.h"
#include "tests/recorder.h"
#include <sys/stat.h>

#define SMALL KN_SOURCE_DIR "/core/scenes/dough-small.yaml"

OWNS(kn_replay, kn_replay_destroy)

static kn_recorder r;
static uint64_t seed;

// Record a log of two hands, above the block. from: seed of its lost poses and missed cycles.
static void record(const char *path, const char *set, uint64_t from)
{
    seed = from;
    kn_recorder_open(&r, path, &(kn_served_object_def){.scene_path = SMALL, .sets = &set, .set_count = set != NULL});
    for (int p = 0; p < 2; p++) {
        memcpy(r.hand[p].position_m, (double[]){0.02 * p, 0, 0.07}, sizeof r.hand[p].position_m);
        r.hand[p].session = 11 * (p + 1);
    }
}

static void quiet(int ms)
{
    for (int i = 0; i < ms; i++) {
        r.late_us = (int64_t)(300 * kn_dice(&seed));
        kn_recorder_tick(&r);
    }
}

// Move the hand towards z for so many ms, at 2 cm/s at most. `trouble`: share of poses lost, and of cycles missed.
static void move(int p, double z_m, int ms, double trouble)
{
    double v = 0.0;
    for (int i = 0; i < ms; i++) {
        kn_pose *hand = &r.hand[p];
        double way = z_m - hand->position_m[2], most = 0.02;
        double target = fmax(-most, fmin(most, 20.0 * way));
        v += fmax(-2e-4, fmin(2e-4, target - v));
        hand->position_m[2] += 1e-3 * v;
        hand->velocity_m_s[2] = v;
        if (kn_dice(&seed) < trouble) r.in.missed = 1 + (int)(3.0 * kn_dice(&seed));
        if (kn_dice(&seed) < trouble) hand->seq++; // lost on its way
        else kn_recorder_pose(&r, p);
        if (kn_dice(&seed) < trouble) kn_recorder_pose(&r, p); // two poses in one tick: the later one counts
        quiet(1);
    }
}

// Move the hand for a ms at this velocity.
static void push(int p, double v_m_s)
{
    r.hand[p].velocity_m_s[2] = v_m_s;
    r.hand[p].position_m[2] += 1e-3 * v_m_s;
}

// The common story of the tests. The plate presses, loses its poses and comes back as another session. The finger
// joins. Then a reset and a stop.
static void story(double trouble)
{
    move(0, 0.030, 2700, trouble); // rests on the surface
    move(0, 0.0295, 600, trouble);
    move(0, 0.028, 300, trouble);
    quiet(30); // long enough for a trip
    move(0, 0.036, 800, trouble);
    move(0, 0.029, 500, trouble);
    quiet(1000);
    r.in.pose[0] = NULL;
    quiet(321);
    r.in.missed = 7; // no hand is attached to be told
    quiet(200);
    r.hand[0].session = 12;
    r.hand[0].position_m[2] = 0.04;
    for (int i = 0; i < 1200; i++) { // both tools at once
        push(0, i < 500 ? 0.0 : -0.01);
        push(1, i < 300 ? 0.0 : -0.03);
        kn_recorder_pose(&r, 0);
        if (i % 3) kn_recorder_pose(&r, 1);
        quiet(1);
    }
    r.hand[0].buttons = KN_BUTTON_LEAVING;
    kn_recorder_pose(&r, 0);
    for (int i = 0; i < 40; i++) {
        kn_recorder_pose(&r, 1);
        quiet(1);
    }
    CHECK(!r.in.pose[0] && r.servo.safety[0].tripped[KN_FAULT_POSE_SILENCE] == 2);
    r.in.reset = true;
    quiet(5);
    r.in.recover = true;
    move(1, 0.06, 700, trouble);
    r.in.stop = true;
    quiet(30);
}

static void tell_story(const char *path, double trouble, uint64_t from)
{
    record(path, NULL, from);
    story(trouble);
    kn_recorder_close(&r);
}

static void plain_story(void) // record the story without trouble, once
{
    if (access("plain.lcmlog", F_OK) != 0) tell_story("plain.lcmlog", 0.0, 3);
}

#define REPLAYS(code, words, ...) KN_CALLS(code, words, kn_replay_main, "knead replay", __VA_ARGS__)

static unsigned long long hash(const char *arguments)
{
    REPLAYS(KN_EXIT_OK, "hash 0x", "--hash %s", arguments);
    const char *at = strstr(kn_out, "hash 0x");
    return at ? strtoull(at + 5, NULL, 16) : 0;
}

// Check that the log replays to another hash with each of these options.
static void check_differ(const char *log, const char *const options[4])
{
    unsigned long long hashes[4];
    char arguments[200];
    for (int i = 0; i < 4; i++) {
        snprintf(arguments, sizeof arguments, "%s %s", log, options[i]);
        hashes[i] = hash(arguments);
        for (int k = 0; k < i; k++) CHECK(hashes[i] != hashes[k]);
    }
}

static char error[512];

TEST("a log replays to its recorded forces, with and without lost poses and missed cycles")
{
    for (unsigned i = 0; i < 3; i++) {
        tell_story("story.lcmlog", i * 0.03, 5 + i);
        REPLAYS(KN_EXIT_OK, "forces, 2 probes", "story.lcmlog --verify");
        CHECK(strstr(kn_out, "verified ") && !*kn_err);
    }
}

TEST("a log written by a replay verifies and replays to the same hash")
{
    tell_story("story.lcmlog", 0.02, 9);
    const unsigned long long first = hash("story.lcmlog --out again.lcmlog");
    CHECK(hash("again.lcmlog --verify") == first && hash(SMALL " story.lcmlog") == first);
}

TEST("a lost force record is reported by a replay and refused by --verify")
{
    record("gap.lcmlog", NULL, 4);
    r.lose_tick = 2000;
    story(0.0);
    kn_recorder_close(&r);
    REPLAYS(KN_EXIT_OK, "the first is tick 2000", "gap.lcmlog --hash");
    REPLAYS(KN_EXIT_FAILED, "tick 2000", "gap.lcmlog --verify");
    CHECK(kn_said("cannot be verified"));
}

TEST("a log cut within a record replays up to the cut and fails --verify, and so does a file of two logs")
{
    static char bytes[1 << 24];
    plain_story();
    const size_t size = kn_read("plain.lcmlog", bytes, sizeof bytes / 2);
    for (size_t cut = 1; cut < 60; cut += 13) {
        kn_write("cut.lcmlog", bytes, size / 2 - cut);
        REPLAYS(KN_EXIT_OK, "complete records: only the log before this point was used", "cut.lcmlog");
        REPLAYS(KN_EXIT_FAILED, "cannot be verified completely: cut within a record", "cut.lcmlog --verify");
        CHECK(kn_said("forces before this point are equal"));
    }
    memcpy(bytes + size, bytes, size);
    kn_write("twice.lcmlog", bytes, 2 * size);
    REPLAYS(KN_EXIT_FAILED, "begins at byte", "twice.lcmlog --verify");
}

static void put_checkpoint(int64_t tick, double missed)
{
    uint8_t bytes[256];
    const knead_event_t m = {.utime = r.utime, .tick = tick, .arg = {missed}, .probe = -1};
    kn_recorder_put(&r, "KNEAD_EVENT", bytes, knead_event_t_encode(bytes, 0, sizeof bytes, &m));
}

static void pose_and_tick(void)
{
    kn_recorder_pose(&r, 0);
    kn_recorder_tick(&r);
}

// End the log. Check the number of ticks that it replays to, and the damage that the replay reports.
static void check_ticks(int64_t expected, const char *damage)
{
    int64_t ticks = 0;
    kn_recorder_close(&r);
    OWN(kn_replay) *again = kn_replay_create(&(kn_replay_def){.log_path = "far.lcmlog"}, error, sizeof error);
    while (again && kn_replay_step(again)) ticks++;
    CHECK(ticks == expected && again && strstr(again->damage, damage) && !*damage == !*again->damage);
}

TEST("a tick or time far ahead in a log does not make the replay run ticks without records")
{
    enum { HAND_MS = 50, HOUR_MS = 3600000, IDLE_S = 70 };
    static const struct {
        // ticks and time from the last good tick to a checkpoint; tick 0: to a pose in a log without forces
        int64_t tick, ms;
        double missed;
        int64_t ticks;
        const char *damage;
    } far[] = {{1000000000, 0, 0, HAND_MS, "more than an hour without records"},
               {1000000000, 0, 1e308, HAND_MS, "more than an hour without records"},
               {HOUR_MS - 1, 0, 0, HAND_MS, "ticks without a record up to tick 36000"},
               {HOUR_MS - 1, 0, -1, HAND_MS, "ticks without a record"},
               {HOUR_MS - 1, 0, HOUR_MS - 2, HAND_MS + 1, ""}, // the server stood still for an hour
               {1, 8 * HOUR_MS, 0, HAND_MS + 1, ""},           // the machine slept for a night
               {0, HOUR_MS - 1, 0, HAND_MS, "ticks without a record"},
               {0, 2 * HOUR_MS, 0, HAND_MS, "more than an hour without records"}};
    for (size_t i = 0; i < sizeof far / sizeof *far; i++) {
        record("far.lcmlog", NULL, 1);
        for (int t = 0; t < HAND_MS; t++, r.utime += far[i].tick ? 0 : 1000)
            if (far[i].tick) pose_and_tick();
            else kn_recorder_pose(&r, 0);
        r.utime += 1000 * far[i].ms;
        if (far[i].tick) put_checkpoint(r.in.tick + far[i].tick, far[i].missed);
        else kn_recorder_pose(&r, 0);
        check_ticks(far[i].ticks, far[i].damage);
    }
    record("far.lcmlog", NULL, 1); // first ticks of a second server after a checkpoint far ahead
    put_checkpoint(1000000000, 0);
    pose_and_tick();
    check_ticks(1, "a second run of the server");
    record("far.lcmlog", NULL, 1); // no hand for longer than a minute, on a touched object
    pose_and_tick();
    for (int64_t s = 1; s <= IDLE_S; s++) put_checkpoint(1000 * s, 0);
    check_ticks(1000 * IDLE_S + 1, "");
}

TEST("one changed bit of a force record is reported with its tick, probe and field")
{
    uint8_t bytes[512];
    knead_contact_force_t m;
    record("flip.lcmlog", NULL, 3);
    move(0, 0.035, 2500, 0.0);
    r.lose_tick = 2500;
    pose_and_tick();
    r.out.force[0].gain = 0.999999;
    kn_wire_force(&m, &r.out, 0, r.utime, 1);
    kn_recorder_put(&r, "KNEAD_FORCE_plate", bytes, knead_contact_force_t_encode(bytes, 0, sizeof bytes, &m));
    kn_recorder_close(&r);
    REPLAYS(KN_EXIT_FAILED, "tick 2500, probe plate: gain is 0.99999", "flip.lcmlog --verify");
    CHECK(kn_said("1 in the replay"));
}

TEST("a log that begins on an untouched or reset object replays; one on a deformed object is refused with a message")
{
    // 2: the object is reset at the log's first tick; 3: it has settled under gravity
    for (int late = 0; late < 4; late++) {
        char heavy[] = "gravity=9.81 m/s^2";
        record("late.lcmlog", late == 3 ? heavy : NULL, 8);
        r.mute = true;
        quiet(1234);
        if (late == 1 || late == 2) {
            move(0, 0.030, 2700, 0.0);
            move(0, 0.029, 900, 0.0);
            quiet(1001);
            r.in.pose[0] = NULL;
            quiet(10);
        }
        r.mute = false;
        r.in.reset = late == 2;
        r.hand[0].session = 12;
        r.hand[0].position_m[2] = 0.05;
        move(0, 0.033, 1500, 0.01);
        kn_recorder_close(&r);
        REPLAYS(late == 1 ? KN_EXIT_USAGE : KN_EXIT_OK,
                late == 1 ? "was already deformed when this log begins" : "verified ", "late.lcmlog --verify");
        kn_replay_def def = {.log_path = "late.lcmlog", // a replay that needs only the hand's poses is possible
                             .scene_path = SMALL,
                             .sets = (const char *const[]){"quality=own"},
                             .set_count = 1,
                             .afresh = true};
        OWN(kn_replay) *again = kn_replay_create(&def, error, sizeof error);
        CHECK(again && !again->same && kn_replay_step(again) && again->tally.mismatches == 0);
    }
}

// ---- snapshots of the object

static kn_store store;
static kn_saved saved; // the snapshot saved last
static char state[16]; // directory of the snapshots

static void record_with_store(const char *path, uint64_t from)
{
    static int made;
    record(path, NULL, from);
    snprintf(state, sizeof state, "state%d", made++);
    CHECK(mkdir(state, 0700) == 0);
    CHECK(kn_store_open(&store, state, r.on.scene, r.on.model, error, sizeof error) == 0);
}

// Save the object as a keeper would do now. Return the tick.
static int64_t keep(void)
{
    kn_state_destroy(saved.state);
    saved = (kn_saved){.state = kn_state_create(r.on.model), .servo = r.servo, .tick = r.in.tick, .utime = r.utime};
    kn_state_copy(r.on.model, saved.state, r.on.backend.state(r.on.backend.self));
    CHECK(kn_store_save(&store, &saved, false, error, sizeof error));
    return saved.tick;
}

static void close_with_store(void)
{
    kn_state_destroy(saved.state);
    saved.state = NULL;
    kn_recorder_close(&r);
    kn_store_close(&store);
}

// Check that the log is verified from the snapshot of this tick.
static void check_continues(const char *log, int64_t tick)
{
    char words[80];
    snprintf(words, sizeof words, "continued from the snapshot of tick %lld\n", (long long)tick);
    REPLAYS(KN_EXIT_OK, words, "%s --snapshot %s --verify", log, state);
    CHECK(kn_said("verified "));
}

TEST("a log continues bit for bit from a snapshot of its run, and needs one if it begins on a deformed object")
{
    // tool in the air, under load, latched; with lost poses and cycles before and after; 3: a complete log
    for (int mid = 0; mid < 4; mid++) {
        record_with_store("late.lcmlog", 8u + (unsigned)mid);
        r.mute = mid < 3;
        r.hand[1].position_m[2] = 0.05;
        move(1, 0.049, 600, 0.01);
        const int64_t early = keep(); // long before the log, unless the log is complete
        move(1, 0.040, 1100, 0.01);
        r.mute = mid == 0;
        if (mid == 1) move(1, 0.038, 200, 0.02);
        if (mid == 2) quiet(40);
        if (mid == 0) move(1, 0.050, 700, 0.02);
        r.mute = false;
        if (mid != 1) move(1, 0.050, 30, 0.0);
        const int64_t tick = keep();
        story(0.01);
        keep(); // of the last tick: nothing follows
        close_with_store();
        REPLAYS(mid < 3 ? KN_EXIT_USAGE : KN_EXIT_OK,
                mid < 3 ? "expected --snapshot with a snapshot of that run" : "verified ", "late.lcmlog --verify");
        check_continues("late.lcmlog", mid < 3 ? tick : early);
        REPLAYS(KN_EXIT_USAGE, "", "late.lcmlog --snapshot %s --set 'material.k1=300 gf/cm^3'", state);
        if (mid < 3) REPLAYS(KN_EXIT_USAGE, "nowhere: No such file", "late.lcmlog --snapshot nowhere");
    }
}

// Write the object as it is now into the log, as `knead probe --record` does.
static void record_object(int64_t late_us, size_t damaged)
{
    kn_saved object = {.state = kn_state_create(r.on.model), .servo = r.servo, .generation = 1, .tick = r.in.tick};
    size_t room = kn_saved_size_max(r.on.model);
    uint8_t *bytes = malloc(room);
    object.utime = r.utime + late_us;
    kn_state_copy(r.on.model, object.state, r.on.backend.state(r.on.backend.self));
    size_t size = kn_saved_encode(r.on.scene, r.on.model, &object, bytes, room);
    bytes[damaged] ^= damaged > 0;
    for (size_t at = 0; at < size; at += KN_LOG_SNAPSHOT_PIECE) {
        size_t piece = size - at < KN_LOG_SNAPSHOT_PIECE ? size - at : KN_LOG_SNAPSHOT_PIECE;
        kn_recorder_put(&r, KN_LOG_SNAPSHOT_CHANNEL, bytes + at, (int)piece);
    }
    free(bytes);
    kn_state_destroy(object.state);
}

TEST("a log that holds its object replays by itself, and a damaged object or one of another run is refused")
{
    static const struct {
        int64_t late_us;
        size_t damaged;
        int code;
        const char *words;
    } cases[] = {{0, 0, KN_EXIT_OK, "verified "},
                 {0, 9000, KN_EXIT_USAGE, "the object that it holds does not fit: checksum"},
                 {3600000000, 0, KN_EXIT_USAGE, "the object that it holds does not fit: of another run"}};
    for (int i = 0; i < 3; i++) {
        record("own.lcmlog", NULL, 8);
        r.mute = true;
        r.hand[1].position_m[2] = 0.05;
        move(1, 0.040, 1500, 0.01);
        r.mute = false;
        record_object(cases[i].late_us, cases[i].damaged);
        r.in.pose[1] = NULL; // no hand, so no record for a while
        quiet(300);
        story(0.01);
        kn_recorder_close(&r);
        REPLAYS(cases[i].code, cases[i].words, "own.lcmlog --verify");
        if (i > 0) continue;
        // other settings begin at the object, too, or are refused
        REPLAYS(KN_EXIT_OK, "continued from the snapshot", "own.lcmlog --set mesh.rate='40 Hz'");
        REPLAYS(KN_EXIT_USAGE, "the log begins on a kneaded object, which does not fit these settings",
                "own.lcmlog --set 'material.k1=300 gf/cm^3'");
    }
}

TEST("a log that holds an untouched object replays with a copy of its scene and other settings")
{
    record("fresh.lcmlog", NULL, 8);
    r.mute = true;
    quiet(300);
    r.mute = false;
    record_object(0, 0);
    story(0.01);
    kn_recorder_close(&r);
    CHECK(symlink(SMALL, "copy.yaml") == 0);
    REPLAYS(KN_EXIT_OK, "replayed ", "copy.yaml fresh.lcmlog --set 'material.k1=300 gf/cm^3'");
}

TEST("a log that begins with missed cycles continues from the snapshot of the last tick before the gap")
{
    for (int told = 0; told < 2; told++) { // missed cycles told by a checkpoint, by a force
        record_with_store("behind.lcmlog", 8);
        r.mute = true;
        move(1, 0.040, 1500, 0.0);
        if (!told) r.in.pose[1] = NULL, quiet(10);
        const int64_t tick = keep();
        r.mute = false;
        r.in.missed = 18;
        if (!told) quiet(1);
        r.hand[1].session = 23;
        move(1, 0.039, 300, 0.0);
        close_with_store();
        check_continues("behind.lcmlog", tick);
    }
}

TEST("restores replay with their snapshots and undos without; a missing or damaged snapshot is refused")
{
    record_with_store("restored.lcmlog", 4);
    AT_END(kn_undo_free) kn_undo points = {0};
    CHECK(kn_undo_init(&points, r.on.model));
    r.servo.undo = &points;
    r.hand[1].position_m[2] = 0.05;
    move(1, 0.041, 1500, 0.0);
    keep();
    move(1, 0.05, 1000, 0.0);
    r.in.restore = saved.state, r.in.restored_generation = saved.generation, r.in.restored_tick = saved.tick;
    quiet(1);
    r.in.restore = NULL;
    move(1, 0.055, 700, 0.0);
    move(1, 0.041, 1500, 0.0);
    for (int i = 0; i < 3; i++) { // undo the second press, the restore, the first press
        r.in.undo = true;
        quiet(1);
        r.in.undo = false;
        CHECK(r.out.restored_hash != 0);
        move(1, 0.05, 300, 0.0);
    }
    story(0.0);
    char name[300];
    snprintf(name, sizeof name, "%s/%s.00000001.knead", state, store.series);
    close_with_store();
    REPLAYS(KN_EXIT_USAGE, "the server restored generation 1 of its snapshots, state 0x", "restored.lcmlog --verify");
    CHECK(kn_said("expected --snapshot"));
    REPLAYS(KN_EXIT_OK, "verified ", "restored.lcmlog --snapshot %s --verify", state);
    CHECK(!kn_said("continued"));
    REPLAYS(KN_EXIT_OK, "verified ", "restored.lcmlog --snapshot %s --verify", name);
    FILE *f = fopen(name, "r+");
    fseek(f, 9000, SEEK_SET), fputc(1, f), fclose(f);
    REPLAYS(KN_EXIT_USAGE, "checksum", "restored.lcmlog --snapshot %s --verify", state);
}

// ---- other settings than the log's

TEST("another scene is refused, and changed solver settings replay but cannot be verified")
{
    plain_story();
    REPLAYS(KN_EXIT_USAGE, "jelly.yaml", KN_SOURCE_DIR "/core/scenes/jelly.yaml plain.lcmlog");
    CHECK(kn_said("dough-small.yaml"));
    REPLAYS(KN_EXIT_USAGE, "--verify cannot compare another scene", "plain.lcmlog --precision f64 --verify");
    check_differ("plain.lcmlog", (const char *const[4]){"", "--precision f64 --solver secant", "--dt 0.0005",
                                                        "--set 'material.k1=300 gf/cm^2'"});
    REPLAYS(KN_EXIT_USAGE, "1 ms divided by a whole number", "plain.lcmlog --dt '0.7 ms'");
    // refused because of the stability limit, without a step
    REPLAYS(KN_EXIT_USAGE, "rk4 is stable up to", "plain.lcmlog --solver rk4");
    REPLAYS(KN_EXIT_USAGE, "--set probes.plate.name=stamp: no probe `plate`",
            "plain.lcmlog --set 'density=1 g/cm^3' --set probes.plate.name=stamp");
    CHECK(!kn_said("malformed"));
}

// Record a machine that is too slow for the chosen point, twice. Then an operator chooses a point despite that.
static void slow_story(void)
{
    if (access("slow.lcmlog", F_OK) == 0) return;
    record("slow.lcmlog",
           "quality={chosen: accurate, accurate: {passes: 2}, balanced: {iterations: 7}, "
           "fast: {iterations: 4, iterations_max: 6}}",
           1);
    move(0, 0.030, 2700, 0.0);
    r.in.execution_ns = 900000;
    move(0, 0.0285, 12, 0.0);
    r.in.execution_ns = 300000;
    move(0, 0.0285, 500, 0.02);
    r.in.execution_ns = 900000;
    move(0, 0.0285, 30, 0.0);
    r.in.execution_ns = 300000;
    r.in.take = KN_QUALITY_CAUSE_COMMAND;
    r.in.quality = KN_QUALITY_OWN;
    move(0, 0.028, 600, 0.0);
    CHECK(r.servo.quality == KN_QUALITY_OWN && r.servo.safety[0].gain == 1.0);
    kn_recorder_close(&r);
}

// Replay the log. Return the number of quality points that were taken, and the number of ticks with a reduced force.
static int points_taken(const kn_replay_def *def, int *reduced)
{
    OWN(kn_replay) *again = kn_replay_create(def, error, sizeof error);
    int taken = 0;
    *reduced = 0;
    while (again && kn_replay_step(again)) {
        CHECK(again->tick.in.execution_ns == 0);
        for (int i = 0; i < again->tick.out.event_count; i++)
            taken += again->tick.out.event[i].kind == KNEAD_EVENT_T_KIND_QUALITY;
        *reduced += (again->tick.out.force[0].flags & KNEAD_CONTACT_FORCE_T_FLAG_REDUCED) != 0;
    }
    CHECK(again && (def->set_count > 0 || (again->tally.checkpoints > 4 && again->tally.mismatches == 0)));
    return taken;
}

TEST("a replay changes quality points at the log's ticks, regardless of its own execution time")
{
    slow_story();
    int reduced;
    REPLAYS(KN_EXIT_OK, "verified ", "slow.lcmlog --verify");
    const unsigned long long first = hash("slow.lcmlog --out again.lcmlog");
    CHECK(hash("again.lcmlog --verify") == first);
    // the third step down finds no lower point
    CHECK(points_taken(&(kn_replay_def){.log_path = "slow.lcmlog"}, &reduced) == 4 && reduced > 500);
}

TEST("--quality replays a log at any quality point, without the log's changes; an unknown point is refused")
{
    const kn_replay_def fast = {
        .log_path = "slow.lcmlog", .sets = (const char *const[]){"quality=fast"}, .set_count = 1};
    int reduced;
    slow_story();
    CHECK(points_taken(&fast, &reduced) == 0);
    check_differ("slow.lcmlog",
                 (const char *const[4]){"--quality fast", "--quality balanced", "--quality accurate", "--quality own"});
    REPLAYS(KN_EXIT_USAGE, "", "slow.lcmlog --quality fast --verify");
    REPLAYS(KN_EXIT_USAGE, "knead replay: --quality quick: expected fast, balanced, accurate or own\n",
            "slow.lcmlog --quality quick");
    plain_story();
    REPLAYS(KN_EXIT_USAGE, "--quality fast: the scene has no quality points", "plain.lcmlog --quality fast");
}

// Record a hand that strikes while a deadline ends most ticks. The logger starts after `from` ms.
static void tell_hurried_story(int from)
{
    record("hurried.lcmlog", NULL, 1);
    r.in.deadline = 100000;
    r.mute = from > 0;
    quiet(from + 1);
    r.mute = false;
    move(1, 0.047, 2000, 0.0);
    for (int i = 0; i < 200; i++) {
        push(1, i < 100 ? -0.05 : 0.05);
        kn_recorder_pose(&r, 1);
        quiet(1);
        if (i == 120) r.in.deadline = 60000;
    }
    CHECK(r.servo.capped > 20);
    kn_recorder_close(&r);
}

TEST("a replay takes its tick deadlines from the log, and from the first checkpoint if the log begins in mid-run")
{
    for (int from = 0; from < 2000; from += 700) {
        tell_hurried_story(from);
        REPLAYS(KN_EXIT_OK, "verified ", "hurried.lcmlog --verify");
        kn_replay_def def = {.log_path = "hurried.lcmlog"};
        OWN(kn_replay) *again = kn_replay_create(&def, error, sizeof error);
        CHECK(again && again->servo.deadline == (from > 0 ? 100000 : 0));
        while (again && kn_replay_step(again)) CHECK(again->tick.out.units <= 100000);
        CHECK(again && again->servo.deadline == 60000);
        def.sets = (const char *const[]){"solver.tolerance=0.002"}, def.set_count = 1; // another computation
        OWN(kn_replay) *free = kn_replay_create(&def, error, sizeof error);
        int64_t most = 0;
        for (; free && kn_replay_step(free);) most = free->tick.out.units > most ? free->tick.out.units : most;
        CHECK(free && free->servo.deadline == 0 && most > 100000);
    }
}

// ---- other files

TEST("a log of poses alone replays to the same peak contact force within 5 %, and cannot be verified")
{
    double peak[2];
    record("full.lcmlog", NULL, 6);
    move(0, 0.030, 2700, 0.0);
    move(0, 0.027, 900, 0.0);
    kn_recorder_close(&r);
    AT_END(kn_log_close) kn_log log = {0};
    kn_log_record one;
    CHECK(kn_log_open(&log, "full.lcmlog", error, sizeof error));
    lcm_eventlog_t *poses = lcm_eventlog_create("poses.lcmlog", "w");
    while (kn_log_read(&log, &one) != KN_LOG_END)
        if (one.kind == KN_LOG_POSE || one.kind == KN_LOG_SCENE)
            CHECK(kn_log_write(poses, one.utime, one.channel, (void *)one.data, one.size));
    lcm_eventlog_destroy(poses);
    for (int i = 0; i < 2; i++) {
        REPLAYS(KN_EXIT_OK, "peak contact force ", "%s", i ? "poses.lcmlog" : "full.lcmlog");
        const char *at = strstr(kn_out, "peak contact force ");
        peak[i] = at ? atof(at + 19) : NAN;
    }
    CHECK(peak[0] > 3.0);
    CHECK_NEAR(peak[1] / peak[0], 1.0, 0.05);
    REPLAYS(KN_EXIT_FAILED, "holds no forces", "poses.lcmlog --verify");
}

TEST("a missing, foreign or unwritable file and a bad option are refused in one line with an exit code")
{
    plain_story();
    REPLAYS(KN_EXIT_USAGE, "No such file", "none.lcmlog");
    REPLAYS(KN_EXIT_USAGE, "not a record of an LCM event log", KN_SOURCE_DIR "/README.md");
    REPLAYS(KN_EXIT_USAGE, "not a regular file", ".");
    REPLAYS(KN_EXIT_DEVICE, "/nonexistent/a.csv", "plain.lcmlog --csv /nonexistent/a.csv");
    REPLAYS(KN_EXIT_USAGE, "is being read", "plain.lcmlog --out ./plain.lcmlog");
    REPLAYS(KN_EXIT_USAGE, "is a log, expected a scene", "plain.lcmlog --verify plain.lcmlog");
    REPLAYS(KN_EXIT_USAGE, "max or real", "plain.lcmlog --speed slow");
    REPLAYS(KN_EXIT_OK, "usage: knead replay", "--help");
}

TESTS_MAIN
