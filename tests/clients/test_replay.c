// gate in release: three times as long with the sanitizers; fuzz.log and fuzz.replay look at its memory there
#include "clients/cli/commands.h"
#include "server/operator_orders.h"
#include "server/log_replay.h"
#include "server/store.h"
#include "tests/check.h"
#include "tests/dice.h"
#include "tests/recorder.h"
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

OWNS(kn_replay, kn_replay_destroy)

typedef kn_recorder recorder;

static uint64_t seed;

static recorder *record_with(const char *path, const char *set)
{
    recorder *r = malloc(sizeof *r);
    kn_recorder_open(r, path,
                     &(kn_served_object_def){.scene_path = KN_SOURCE_DIR "/core/scenes/dough-small.yaml",
                                             .sets = &set,
                                             .set_count = set != NULL});
    for (int p = 0; p < 2; p++)
        memcpy(r->hand[p].position_m, (double[]){0.02 * p, 0, 0.07}, sizeof r->hand[p].position_m);
    return r;
}

static recorder *record(const char *path) { return record_with(path, NULL); }

static void record_end(recorder *r)
{
    kn_recorder_close(r);
    free(r);
}

static void tick(recorder *r)
{
    r->late_us = (int64_t)(300 * kn_dice(&seed));
    kn_recorder_tick(r);
}

// Move the hand towards z for so many ms, at 2 cm/s at most. `trouble`: share of poses lost, and of cycles missed.
static void move(recorder *r, int p, double z_m, int ms, double trouble)
{
    double v = 0.0;
    for (int i = 0; i < ms; i++) {
        kn_pose *hand = &r->hand[p];
        double way = z_m - hand->position_m[2], most = 0.02;
        double target = fmax(-most, fmin(most, 20.0 * way));
        v += fmax(-2e-4, fmin(2e-4, target - v));
        hand->position_m[2] += 1e-3 * v;
        hand->velocity_m_s[2] = v;
        if (kn_dice(&seed) < trouble) r->in.missed = 1 + (int)(3.0 * kn_dice(&seed));
        if (kn_dice(&seed) < trouble) hand->seq++; // lost on its way
        else kn_recorder_pose(r, p);
        if (kn_dice(&seed) < trouble) kn_recorder_pose(r, p); // two poses in one tick: the later one counts
        tick(r);
    }
}

static void quiet(recorder *r, int ms)
{
    for (int i = 0; i < ms; i++) tick(r);
}

static void end_session(recorder *r, int p) { r->in.pose[p] = NULL; }

// The common story of the tests. The plate presses, loses its poses and comes back as another session. The finger
// joins. Then a reset and a stop.
static void story(recorder *r, double trouble)
{
    r->hand[0].session = 11;
    r->hand[1].session = 22;
    move(r, 0, 0.030, 2700, trouble); // rests on the surface
    move(r, 0, 0.0295, 600, trouble);
    move(r, 0, 0.028, 300, trouble);
    quiet(r, 30); // long enough for a trip
    move(r, 0, 0.036, 800, trouble);
    move(r, 0, 0.029, 500, trouble);
    quiet(r, 1000);
    end_session(r, 0);
    quiet(r, 321);
    r->in.missed = 7; // no hand is attached to be told
    quiet(r, 200);
    r->hand[0].session = 12;
    r->hand[0].position_m[2] = 0.04;
    for (int i = 0; i < 1200; i++) { // both tools at once
        double v0 = i < 500 ? 0.0 : -0.01, v1 = i < 300 ? 0.0 : -0.03;
        r->hand[0].velocity_m_s[2] = v0;
        r->hand[1].velocity_m_s[2] = v1;
        r->hand[0].position_m[2] += 1e-3 * v0;
        r->hand[1].position_m[2] += 1e-3 * v1;
        kn_recorder_pose(r, 0);
        if (i % 3) kn_recorder_pose(r, 1);
        tick(r);
    }
    r->hand[0].buttons = KN_BUTTON_LEAVING;
    kn_recorder_pose(r, 0);
    for (int i = 0; i < 40; i++) {
        kn_recorder_pose(r, 1);
        tick(r);
    }
    CHECK(!r->in.pose[0] && r->servo.safety[0].tripped[KN_FAULT_POSE_SILENCE] == 2);
    r->in.reset = true;
    quiet(r, 5);
    r->in.recover = true;
    move(r, 1, 0.06, 700, trouble);
    r->in.stop = true;
    quiet(r, 30);
}

// Run knead replay with these arguments in a process of its own. Return its exit code, with its output in out[] and
// err[].
static char out[4096], err[4096];

static void slurp(const char *path, char *text, size_t size)
{
    FILE *f = fopen(path, "r");
    size_t n = f ? fread(text, 1, size - 1, f) : 0;
    text[n] = '\0';
    if (f) fclose(f);
}

static int replay(const char *const *arguments)
{
    char *argv[16] = {"knead replay"};
    int argc = 1;
    for (; arguments[argc - 1]; argc++) argv[argc] = (char *)arguments[argc - 1];
    fflush(NULL);
    pid_t child = fork();
    if (child == 0) {
        if (!freopen("replay.out", "w", stdout) || !freopen("replay.err", "w", stderr)) _exit(99);
        int code = kn_replay_main(argc, argv);
        fflush(NULL);
        _exit(code);
    }
    int status = 0;
    waitpid(child, &status, 0);
    slurp("replay.out", out, sizeof out);
    slurp("replay.err", err, sizeof err);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128;
}
#define REPLAY(...) replay((const char *const[]){__VA_ARGS__, NULL})

static long long hash_in(const char *text)
{
    const char *at = strstr(text, "hash 0x");
    return at ? (long long)strtoull(at + 5, NULL, 16) : 0;
}

static char folder[] = "/tmp/knead_replay.XXXXXX";

static void remove_folder(void)
{
    char command[64];
    snprintf(command, sizeof command, "rm -rf %s", folder);
    if (system(command) != 0) fprintf(stderr, "%s stays behind\n", folder);
}

static void scratch(void) // work in a temporary folder, since the tests write files
{
    static bool made; // a flag, because the folder's name may itself end with an X
    if (made) return;
    if (!mkdtemp(folder) || chdir(folder) != 0) SKIP("no scratch folder");
    made = true;
    atexit(remove_folder);
}

static void tell_story(const char *path, double trouble, unsigned long long from)
{
    scratch();
    seed = from;
    recorder *r = record(path);
    story(r, trouble);
    record_end(r);
}

TEST("a log replays to its recorded forces, with and without lost poses and missed cycles")
{
    for (int i = 0; i < 3; i++) {
        tell_story("story.lcmlog", i * 0.03, 5 + (unsigned)i);
        CHECK(REPLAY("story.lcmlog", "--verify") == KN_EXIT_OK);
        CHECK(strstr(out, "verified ") && strstr(out, "forces, 2 probes"));
        CHECK_STR(err, "");
    }
}

TEST("a log written by a replay verifies and replays to the same hash")
{
    tell_story("story.lcmlog", 0.02, 9);
    CHECK(REPLAY("story.lcmlog", "--hash", "--out", "again.lcmlog") == KN_EXIT_OK);
    long long first = hash_in(out);
    CHECK(REPLAY("again.lcmlog", "--hash", "--verify") == KN_EXIT_OK);
    CHECK(first != 0 && hash_in(out) == first);
    CHECK(REPLAY(KN_SOURCE_DIR "/core/scenes/dough-small.yaml", "story.lcmlog", "--hash") == KN_EXIT_OK);
    CHECK(hash_in(out) == first);
}

TEST("the CSV has its documented columns, one row per force, and contact forces before the limits of the device")
{
    tell_story("story.lcmlog", 0.0, 3);
    CHECK(REPLAY("story.lcmlog", "--csv", "a.csv") == KN_EXIT_OK);
    FILE *f = fopen("a.csv", "r");
    char line[512];
    CHECK(f && fgets(line, sizeof line, f));
    CHECK_STR(
        line,
        "tick,time_s,probe,x_m,y_m,z_m,contact_fx_n,contact_fy_n,contact_fz_n,fx_n,fy_n,fz_n,tx_n_m,ty_n_m,tz_n_m,"
        "contacts,residual,execution_ns,proxy_x_m,proxy_y_m,proxy_z_m\n");
    int rows = 0, commas = 0, pressed = 0;
    double t, first = -1.0;
    char probe[32];
    for (; fgets(line, sizeof line, f); rows++) {
        double x[12];
        long long tick_number;
        commas = 0;
        for (const char *c = line; *c; c++) commas += *c == ',';
        CHECK(commas == 20);
        CHECK(sscanf(line, "%lld,%lf,%31[^,],%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf", &tick_number, &t, probe, x, x + 1,
                     x + 2, x + 3, x + 4, x + 5, x + 6, x + 7, x + 8) == 12);
        if (rows == 0) first = t;
        pressed += x[5] > 1.0;
    }
    fclose(f);
    CHECK(rows > 5000 && pressed > 100);
    CHECK_NEAR(first, 0.0, 1e-9);
}

TEST("a lost force record is reported by a replay and refused by --verify")
{
    scratch();
    seed = 4;
    recorder *r = record("gap.lcmlog");
    r->lose_tick = 2000;
    story(r, 0.0);
    record_end(r);
    CHECK(REPLAY("gap.lcmlog", "--hash") == KN_EXIT_OK);
    CHECK(strstr(err, "the first is tick 2000"));
    CHECK(REPLAY("gap.lcmlog", "--verify") == KN_EXIT_FAILED);
    CHECK(strstr(err, "cannot be verified") && strstr(err, "tick 2000") && !strstr(out, "verified"));
}

TEST("a log cut within a record replays up to the cut and fails --verify")
{
    tell_story("story.lcmlog", 0.0, 3);
    char *bytes = malloc(1 << 24);
    FILE *f = fopen("story.lcmlog", "rb");
    size_t size = fread(bytes, 1, 1 << 24, f);
    fclose(f);
    for (int cut = 1; cut < 60; cut += 13) {
        f = fopen("cut.lcmlog", "wb");
        fwrite(bytes, 1, size / 2 - (size_t)cut, f);
        fclose(f);
        CHECK(REPLAY("cut.lcmlog") == KN_EXIT_OK);
        CHECK(strstr(err, "complete records: only the log before this point was used"));
        CHECK(REPLAY("cut.lcmlog", "--verify") == KN_EXIT_FAILED);
        CHECK(strstr(err, "cannot be verified completely: cut within a record") &&
              strstr(err, "forces before this point are equal"));
        CHECK(!strstr(out, "verified"));
    }
    free(bytes);
}

TEST("a file of two logs fails --verify")
{
    tell_story("story.lcmlog", 0.0, 3);
    char *bytes = malloc(1 << 24);
    FILE *f = fopen("story.lcmlog", "rb");
    size_t size = fread(bytes, 1, 1 << 24, f);
    fclose(f);
    f = fopen("twice.lcmlog", "wb");
    for (int i = 0; i < 2; i++) fwrite(bytes, 1, size, f);
    fclose(f);
    free(bytes);
    CHECK(REPLAY("twice.lcmlog", "--verify") == KN_EXIT_FAILED);
    CHECK(strstr(err, "begins at byte") && !strstr(out, "verified"));
}

static void put_checkpoint(recorder *r, int64_t tick, double missed)
{
    uint8_t bytes[256];
    const knead_event_t m = {.utime = r->utime, .tick = tick, .arg = {missed}, .probe = -1};
    kn_recorder_put(r, "KNEAD_EVENT", bytes, knead_event_t_encode(bytes, 0, sizeof bytes, &m));
}

// End the log. Return the number of ticks that it replays to. err: damage of the log.
static int64_t ticks_of(recorder *r)
{
    int64_t ticks = 0;
    record_end(r);
    OWN(kn_replay) *again = kn_replay_create(&(kn_replay_def){.log_path = "far.lcmlog"}, err, sizeof err);
    while (again && kn_replay_step(again)) ticks++;
    if (again) snprintf(err, sizeof err, "%s", again->damage);
    return ticks;
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
    scratch();
    for (size_t i = 0; i < sizeof far / sizeof *far; i++) {
        recorder *r = record("far.lcmlog");
        for (int t = 0; t < HAND_MS; t++, r->utime += far[i].tick ? 0 : 1000) {
            kn_recorder_pose(r, 0);
            if (far[i].tick) kn_recorder_tick(r);
        }
        r->utime += 1000 * far[i].ms;
        if (far[i].tick) put_checkpoint(r, r->in.tick + far[i].tick, far[i].missed);
        else kn_recorder_pose(r, 0);
        CHECK(ticks_of(r) == far[i].ticks && (far[i].damage[0] ? strstr(err, far[i].damage) != NULL : !err[0]));
    }
    recorder *r = record("far.lcmlog"); // first ticks of a second server after a checkpoint far ahead
    put_checkpoint(r, 1000000000, 0);
    kn_recorder_pose(r, 0);
    kn_recorder_tick(r);
    CHECK(ticks_of(r) == 1 && strstr(err, "a second run of the server"));
    r = record("far.lcmlog"); // no hand for longer than a minute, on a touched object
    kn_recorder_pose(r, 0);
    kn_recorder_tick(r);
    for (int64_t s = 1; s <= IDLE_S; s++) put_checkpoint(r, 1000 * s, 0);
    CHECK(ticks_of(r) == 1000 * IDLE_S + 1 && !err[0]);
}

TEST("one changed bit of a force record is reported with its tick, probe and field")
{
    scratch();
    seed = 3;
    recorder *r = record("flip.lcmlog");
    r->hand[0].session = 11;
    move(r, 0, 0.035, 2500, 0.0);
    r->in.tick = 2499;
    uint8_t bytes[512];
    knead_contact_force_t m;
    kn_recorder_pose(r, 0);
    kn_tick_out good;
    r->in.tick++;
    kn_servo_tick(&r->servo, &r->in, &good);
    good.force[0].gain = 0.999999;
    kn_wire_force(&m, &good, 0, r->utime, 1);
    kn_recorder_put(r, "KNEAD_FORCE_plate", bytes, knead_contact_force_t_encode(bytes, 0, sizeof bytes, &m));
    record_end(r);
    CHECK(REPLAY("flip.lcmlog", "--verify") == KN_EXIT_FAILED);
    CHECK(strstr(err, "tick 2500, probe plate: gain is 0.99999") && strstr(err, "1 in the replay"));
}

TEST("a log that begins on an untouched or reset object replays; one on a deformed object is refused with a message")
{
    for (int late = 0; late < 3; late++) { // 2: the object is reset at the log's first tick
        scratch();
        seed = 8;
        recorder *r = record("late.lcmlog");
        r->mute = true;
        quiet(r, 1234);
        r->hand[0].session = 11;
        if (late) {
            move(r, 0, 0.030, 2700, 0.0);
            move(r, 0, 0.029, 900, 0.0);
            quiet(r, 1001);
            end_session(r, 0);
            quiet(r, 10);
        }
        r->mute = false;
        r->in.reset = late == 2;
        r->hand[0].session = 12;
        r->hand[0].position_m[2] = 0.05;
        move(r, 0, 0.033, 1500, 0.01);
        record_end(r);
        CHECK(REPLAY("late.lcmlog", "--verify") == (late == 1 ? KN_EXIT_USAGE : KN_EXIT_OK));
        CHECK(late != 1 || strstr(err, "was already deformed when this log begins"));
        char why[300]; // a replay that needs only the hand's poses is possible
        kn_replay_def def = {.log_path = "late.lcmlog",
                             .scene_path = KN_SOURCE_DIR "/core/scenes/dough-small.yaml",
                             .sets = (const char *const[]){"quality=own"},
                             .set_count = 1,
                             .afresh = true};
        OWN(kn_replay) *again = kn_replay_create(&def, why, sizeof why);
        CHECK(again && !again->same && kn_replay_step(again) && again->tally.mismatches == 0);
    }
}

// Save the object as a keeper would do now.
static kn_saved keep(recorder *r, kn_store *store)
{
    char why[200];
    kn_saved saved = {.state = kn_state_keep(r->on.model), .servo = r->servo, .tick = r->in.tick, .utime = r->utime};
    kn_state_copy(r->on.model, saved.state, r->on.backend.state(r->on.backend.self));
    CHECK(kn_store_save(store, &saved, false, why, sizeof why));
    return saved;
}

static char state[16]; // directory of the test, inside `folder`
static kn_store new_store(recorder *r)
{
    static int made;
    kn_store store;
    char error[300];
    snprintf(state, sizeof state, "state%d", made++);
    if (mkdir(state, 0700) != 0) exit(1);
    CHECK(kn_store_open(&store, state, r->on.scene, r->on.model, error, sizeof error) == 0);
    return store;
}

TEST("a log that begins on a deformed object continues bit for bit from a snapshot of its run")
{
    // tool in the air, under load, latched; with lost poses and cycles before and after
    for (int mid = 0; mid < 3; mid++) {
        scratch();
        seed = 8u + (unsigned)mid;
        recorder *r = record("late.lcmlog");
        kn_store store = new_store(r);
        r->mute = true;
        r->hand[0].session = 11;
        r->hand[1].session = 22;
        r->hand[1].position_m[2] = 0.05;
        move(r, 1, 0.049, 600, 0.01);
        kn_saved early = keep(r, &store); // long before the log
        move(r, 1, 0.040, 1100, 0.01);
        r->mute = mid == 0;
        if (mid == 1) move(r, 1, 0.038, 200, 0.02);
        if (mid == 2) quiet(r, 40);
        if (mid == 0) move(r, 1, 0.050, 700, 0.02);
        r->mute = false;
        if (mid != 1) move(r, 1, 0.050, 30, 0.0);
        kn_saved saved = keep(r, &store);
        story(r, 0.01);
        kn_saved late = keep(r, &store); // of the last tick: nothing follows
        record_end(r);
        kn_store_close(&store);
        CHECK(REPLAY("late.lcmlog", "--verify") == KN_EXIT_USAGE);
        CHECK(strstr(err, "expected --snapshot with a snapshot of that run"));
        CHECK(REPLAY("late.lcmlog", "--snapshot", state, "--verify") == KN_EXIT_OK);
        if (!strstr(out, "verified")) printf("%s%s", out, err);
        char line[80];
        snprintf(line, sizeof line, "continued from the snapshot of tick %lld\n", (long long)saved.tick);
        CHECK(strstr(out, line));
        CHECK(REPLAY("late.lcmlog", "--snapshot", state, "--set", "material.k1=300 gf/cm^3") == KN_EXIT_USAGE);
        CHECK(REPLAY("late.lcmlog", "--snapshot", "nowhere") == KN_EXIT_USAGE && strstr(err, "nowhere: No such file"));
        kn_state_destroy(early.state), kn_state_destroy(saved.state), kn_state_destroy(late.state);
    }
}

TEST("a snapshot from the middle of a complete log replays to the same bits as the complete log")
{
    scratch();
    seed = 8;
    recorder *r = record("story.lcmlog");
    kn_store store = new_store(r);
    r->hand[1].session = 22;
    move(r, 1, 0.041, 1500, 0.01);
    kn_saved saved = keep(r, &store);
    story(r, 0.01);
    record_end(r);
    kn_store_close(&store);
    CHECK(REPLAY("story.lcmlog", "--verify", "--hash") == KN_EXIT_OK);
    char line[80];
    CHECK(REPLAY("story.lcmlog", "--snapshot", state, "--verify") == KN_EXIT_OK);
    snprintf(line, sizeof line, "tick %lld\n", (long long)saved.tick);
    CHECK(strstr(out, line) && strstr(out, "verified"));
    kn_state_destroy(saved.state);
}

TEST("a log that begins with missed cycles continues from the snapshot of the last tick before the gap")
{
    for (int told = 0; told < 2; told++) { // missed cycles told by a checkpoint, by a force
        scratch();
        seed = 8;
        recorder *r = record("behind.lcmlog");
        kn_store store = new_store(r);
        r->mute = true;
        r->hand[1].session = 22;
        move(r, 1, 0.040, 1500, 0.0);
        if (!told) end_session(r, 1), quiet(r, 10);
        kn_saved saved = keep(r, &store);
        r->mute = false;
        r->in.missed = 18;
        if (!told) quiet(r, 1);
        r->hand[1].session = 23;
        move(r, 1, 0.039, 300, 0.0);
        record_end(r);
        kn_store_close(&store);
        CHECK(REPLAY("behind.lcmlog", "--snapshot", state, "--verify") == KN_EXIT_OK);
        CHECK(strstr(out, "verified"));
        kn_state_destroy(saved.state);
    }
}

TEST("restores replay with their snapshots and undos without; a missing or damaged snapshot is refused")
{
    scratch();
    seed = 4;
    recorder *r = record("restored.lcmlog");
    kn_store store = new_store(r);
    AT_END(kn_undo_free) kn_undo points = {0};
    CHECK(kn_undo_init(&points, r->on.model));
    r->servo.undo = &points;
    r->hand[1].session = 22;
    r->hand[1].position_m[2] = 0.05;
    move(r, 1, 0.041, 1500, 0.0);
    kn_saved saved = keep(r, &store);
    move(r, 1, 0.05, 1000, 0.0);
    r->in.restore = saved.state, r->in.restored_generation = saved.generation, r->in.restored_tick = saved.tick;
    quiet(r, 1);
    r->in.restore = NULL;
    move(r, 1, 0.055, 700, 0.0);
    move(r, 1, 0.041, 1500, 0.0);
    for (int i = 0; i < 3; i++) { // undo the second press, the restore, the first press
        r->in.undo = true;
        quiet(r, 1);
        r->in.undo = false;
        CHECK(r->out.restored_hash != 0);
        move(r, 1, 0.05, 300, 0.0);
    }
    story(r, 0.0);
    record_end(r);
    char series[100];
    snprintf(series, sizeof series, "%s", store.series);
    kn_store_close(&store);
    CHECK(REPLAY("restored.lcmlog", "--verify") == KN_EXIT_USAGE);
    CHECK(strstr(err, "the server restored generation 1 of its snapshots, state 0x"));
    CHECK(strstr(err, "expected --snapshot"));
    CHECK(REPLAY("restored.lcmlog", "--snapshot", state, "--verify") == KN_EXIT_OK);
    CHECK(strstr(out, "verified") && !strstr(out, "went on"));
    char name[300];
    snprintf(name, sizeof name, "%s/%s.00000001.knead", state, series);
    CHECK(REPLAY("restored.lcmlog", "--snapshot", name, "--verify") == KN_EXIT_OK);
    FILE *f = fopen(name, "r+");
    fseek(f, 9000, SEEK_SET), fputc(1, f), fclose(f);
    CHECK(REPLAY("restored.lcmlog", "--snapshot", state, "--verify") == KN_EXIT_USAGE && strstr(err, "checksum"));
    kn_state_destroy(saved.state);
}

TEST("another scene is refused, and changed solver settings replay but cannot be verified")
{
    tell_story("story.lcmlog", 0.0, 3);
    CHECK(REPLAY(KN_SOURCE_DIR "/core/scenes/jelly.yaml", "story.lcmlog") == KN_EXIT_USAGE);
    CHECK(strstr(err, "jelly.yaml") && strstr(err, "dough-small.yaml"));
    CHECK(REPLAY("story.lcmlog", "--precision", "f64", "--verify") == KN_EXIT_USAGE);
    CHECK(strstr(err, "--verify cannot compare another scene"));
    long long hashes[4];
    CHECK(REPLAY("story.lcmlog", "--hash") == KN_EXIT_OK);
    hashes[0] = hash_in(out);
    CHECK(REPLAY("story.lcmlog", "--hash", "--precision", "f64", "--solver", "secant") == KN_EXIT_OK);
    hashes[1] = hash_in(out);
    CHECK(REPLAY("story.lcmlog", "--hash", "--dt", "0.0005") == KN_EXIT_OK);
    hashes[2] = hash_in(out);
    CHECK(REPLAY("story.lcmlog", "--hash", "--set", "material.k1=300 gf/cm^2") == KN_EXIT_OK);
    hashes[3] = hash_in(out);
    for (int i = 0; i < 4; i++)
        for (int k = 0; k < i; k++) CHECK(hashes[i] != hashes[k]);
    CHECK(REPLAY("story.lcmlog", "--dt", "0.7 ms") == KN_EXIT_USAGE);
    CHECK(strstr(err, "1 ms divided by a whole number"));
    // refused because of the stability limit, without a step
    CHECK(REPLAY("story.lcmlog", "--solver", "rk4") == KN_EXIT_USAGE);
    CHECK(strstr(err, "rk4 is stable up to"));
}

// Record a machine that is too slow for the chosen point, twice. Then an operator chooses a point despite that.
static void tell_slow_story(const char *path)
{
    scratch();
    recorder *r = record_with(path, "quality={chosen: accurate, accurate: {passes: 2}, balanced: {iterations: 7}, "
                                    "fast: {iterations: 4, iterations_max: 6}}");
    r->hand[0].session = 11;
    move(r, 0, 0.030, 2700, 0.0);
    r->in.execution_ns = 900000;
    move(r, 0, 0.0285, 12, 0.0);
    r->in.execution_ns = 300000;
    move(r, 0, 0.0285, 500, 0.02);
    r->in.execution_ns = 900000;
    move(r, 0, 0.0285, 30, 0.0);
    r->in.execution_ns = 300000;
    r->in.take = KN_QUALITY_CAUSE_COMMAND;
    r->in.quality = KN_QUALITY_OWN;
    move(r, 0, 0.028, 600, 0.0);
    CHECK(r->servo.quality == KN_QUALITY_OWN && r->servo.safety[0].gain == 1.0);
    record_end(r);
}

TEST("a replay changes quality points at the log's ticks, regardless of its own execution time")
{
    tell_slow_story("slow.lcmlog");
    CHECK(REPLAY("slow.lcmlog", "--verify") == KN_EXIT_OK);
    CHECK(REPLAY("slow.lcmlog", "--hash", "--out", "again.lcmlog") == KN_EXIT_OK);
    long long hash = hash_in(out);
    CHECK(REPLAY("again.lcmlog", "--verify", "--hash") == KN_EXIT_OK && hash_in(out) == hash);
    kn_replay_def def = {.log_path = "slow.lcmlog"};
    OWN(kn_replay) *r = kn_replay_create(&def, err, sizeof err);
    int taken = 0, reduced = 0;
    while (r && kn_replay_step(r)) {
        CHECK(r->tick.in.execution_ns == 0);
        for (int i = 0; i < r->tick.out.event_count; i++)
            taken += r->tick.out.event[i].kind == KNEAD_EVENT_T_KIND_QUALITY;
        reduced += (r->tick.out.force[0].flags & KNEAD_CONTACT_FORCE_T_FLAG_REDUCED) != 0;
    }
    // the third step down finds no lower point
    CHECK(taken == 4 && reduced > 500 && r->tally.checkpoints > 4 && r->tally.mismatches == 0);
}

// Record a hand that strikes while a deadline ends most ticks. The logger starts after `from` ms.
static void tell_hurried_story(const char *path, int from)
{
    scratch();
    recorder *r = record(path);
    r->hand[1].session = 22;
    r->in.deadline = 100000;
    r->mute = from > 0;
    quiet(r, from + 1);
    r->mute = false;
    move(r, 1, 0.047, 2000, 0.0);
    for (int i = 0; i < 200; i++) {
        r->hand[1].velocity_m_s[2] = i < 100 ? -0.05 : 0.05;
        r->hand[1].position_m[2] += 1e-3 * r->hand[1].velocity_m_s[2];
        kn_recorder_pose(r, 1);
        tick(r);
        if (i == 120) r->in.deadline = 60000;
    }
    CHECK(r->servo.capped > 20);
    record_end(r);
}

TEST("a replay takes its tick deadlines from the log, and from the first checkpoint if the log begins in mid-run")
{
    for (int from = 0; from < 2000; from += 700) {
        tell_hurried_story("hurried.lcmlog", from);
        CHECK(REPLAY("hurried.lcmlog", "--verify") == KN_EXIT_OK && strstr(out, "verified "));
        kn_replay_def def = {.log_path = "hurried.lcmlog"};
        OWN(kn_replay) *r = kn_replay_create(&def, err, sizeof err);
        CHECK(r && r->servo.deadline == (from > 0 ? 100000 : 0));
        while (r && kn_replay_step(r)) CHECK(r->tick.out.units <= 100000);
        CHECK(r && r->servo.deadline == 60000);
        def.sets = (const char *const[]){"solver.tolerance=0.002"}, def.set_count = 1; // another computation
        OWN(kn_replay) *free = kn_replay_create(&def, err, sizeof err);
        int64_t most = 0;
        for (; free && kn_replay_step(free);) most = free->tick.out.units > most ? free->tick.out.units : most;
        CHECK(free && free->servo.deadline == 0 && most > 100000);
    }
}

TEST("--quality replays a log at any quality point with another result, and an unknown point is refused")
{
    static const char *const names[] = {"fast", "balanced", "accurate", "own"};
    long long hashes[4];
    tell_slow_story("slow.lcmlog");
    for (int i = 0; i < 4; i++) {
        CHECK(REPLAY("slow.lcmlog", "--hash", "--quality", names[i]) == KN_EXIT_OK);
        hashes[i] = hash_in(out);
        for (int k = 0; k < i; k++) CHECK(hashes[i] != hashes[k]);
    }
    CHECK(REPLAY("slow.lcmlog", "--quality", "fast", "--verify") == KN_EXIT_USAGE);
    CHECK(REPLAY("slow.lcmlog", "--quality", "quick") == KN_EXIT_USAGE);
    CHECK_STR(err, "knead replay: --quality quick: expected fast, balanced, accurate or own\n");
    tell_story("story.lcmlog", 0.0, 3);
    CHECK(REPLAY("story.lcmlog", "--quality", "fast") == KN_EXIT_USAGE);
    CHECK(strstr(err, "--quality fast: the scene has no quality points"));
}

TEST("a --set that renames a probe of the log is refused, and the message names the --set")
{
    tell_story("story.lcmlog", 0.0, 3);
    CHECK(REPLAY("story.lcmlog", "--set", "density=1 g/cm^3", "--set", "probes.plate.name=stamp") == KN_EXIT_USAGE);
    CHECK(strstr(err, "--set probes.plate.name=stamp: leaves no probe `plate`") && !strstr(err, "malformed"));
}

TEST("a log of poses alone replays to the same peak contact force within 5 %, and cannot be verified")
{
    double peak[2];
    scratch();
    seed = 6;
    recorder *r = record("full.lcmlog");
    r->hand[0].session = 11;
    move(r, 0, 0.030, 2700, 0.0);
    move(r, 0, 0.027, 900, 0.0);
    record_end(r);
    AT_END(kn_log_close) kn_log log = {0};
    kn_log_record record;
    CHECK(kn_log_open(&log, "full.lcmlog", err, sizeof err));
    lcm_eventlog_t *poses = lcm_eventlog_create("poses.lcmlog", "w");
    while (kn_log_read(&log, &record) != KN_LOG_END)
        if (record.kind == KN_LOG_POSE || record.kind == KN_LOG_SCENE)
            CHECK(kn_log_write(poses, record.utime, record.channel, (void *)record.data, record.size));
    lcm_eventlog_destroy(poses);
    for (int i = 0; i < 2; i++) {
        CHECK(REPLAY(i ? "poses.lcmlog" : "full.lcmlog") == KN_EXIT_OK);
        const char *at = strstr(out, "peak contact force ");
        peak[i] = at ? atof(at + 19) : NAN;
    }
    CHECK(peak[0] > 3.0);
    CHECK_NEAR(peak[1] / peak[0], 1.0, 0.05);
    CHECK(REPLAY("poses.lcmlog", "--verify") == KN_EXIT_FAILED);
    CHECK(strstr(err, "holds no forces"));
}

TEST("a log with one replaced byte, at every 11th place, is read to its end without a fault")
{
    scratch();
    seed = 2;
    recorder *r = record("small.lcmlog");
    r->hand[0].session = 11;
    move(r, 0, 0.06, 12, 0.0);
    record_end(r);
    static uint8_t bytes[1 << 16];
    FILE *f = fopen("small.lcmlog", "rb");
    size_t size = fread(bytes, 1, sizeof bytes, f);
    fclose(f);
    CHECK(size > 4000 && size < sizeof bytes);
    int64_t records = 0;
    for (size_t i = 0; i < size; i += 11) { // fuzz_log tries every byte
        uint8_t was = bytes[i];
        bytes[i] = (uint8_t)(kn_dice(&seed) * 256.0);
        f = fopen("bad.lcmlog", "wb");
        fwrite(bytes, 1, size, f);
        fclose(f);
        AT_END(kn_log_close) kn_log log = {0};
        kn_log_record record;
        CHECK(kn_log_open(&log, "bad.lcmlog", err, sizeof err));
        while (kn_log_read(&log, &record) != KN_LOG_END) records++;
        if (i % 5 == 0) { // replay to the end
            kn_replay_def def = {.log_path = "bad.lcmlog"};
            OWN(kn_replay) *replay_ = kn_replay_create(&def, err, sizeof err);
            int64_t ticks = 0;
            while (replay_ && ticks++ < 100000 && kn_replay_step(replay_)) continue;
        }
        bytes[i] = was;
    }
    CHECK(records > (int64_t)size / 11);
}

TEST("a missing, foreign or unwritable file and a bad option are refused in one line with an exit code")
{
    scratch();
    CHECK(REPLAY("none.lcmlog") == KN_EXIT_USAGE && strstr(err, "No such file"));
    CHECK(REPLAY(KN_SOURCE_DIR "/README.md") == KN_EXIT_USAGE && strstr(err, "not a record of an LCM event log"));
    CHECK(REPLAY(".") == KN_EXIT_USAGE && strstr(err, "not a regular file"));
    tell_story("story.lcmlog", 0.0, 3);
    CHECK(REPLAY("story.lcmlog", "--csv", "/nonexistent/a.csv") == KN_EXIT_DEVICE);
    CHECK(REPLAY("story.lcmlog", "--out", "./story.lcmlog") == KN_EXIT_USAGE && strstr(err, "is being read"));
    CHECK(REPLAY("story.lcmlog", "--verify", "story.lcmlog") == KN_EXIT_USAGE);
    CHECK(strstr(err, "is a log, expected a scene"));
    CHECK(REPLAY("story.lcmlog", "--speed", "slow") == KN_EXIT_USAGE && strstr(err, "max or real"));
    CHECK(REPLAY("--help") == KN_EXIT_OK && strstr(out, "usage: knead replay"));
}

TESTS_MAIN
