#include "server/keeper.h"
#include "core/snapshot.h"
#include "proto/knead_event_t.h"
#include "tests/check.h"
#include "tests/cleared.h"
#include "tests/server/loop_fixture.h"
#include <errno.h>
#include <unistd.h>

// A rig: a loop with its keeper on a directory, and a finger above the dough. One call per tick. The keeper's thread
// runs when a test calls it.
#define AIR 0.049 // heights of the finger's centre, m; its radius is 15 mm, the dough 30 mm high
#define DEEP 0.037

#if defined(KN_SANITIZED)
#define SANITIZED 1
#else
#define SANITIZED 0
#endif

typedef struct rig {
    kn_loop_fixture fixture;
    kn_keeper keeper;
    char directory[64];
    kn_pose pose;
    int64_t tick;
    kn_tick_out out;
    kn_event restored; // the last restore event
    int restores, saves_seen;
    double steepest_n;
} rig;

// Start a server on a directory.
static void serve(rig *r, const char *directory)
{
    char error[512] = "";
    kn_loop_fixture_open(&r->fixture, NULL);
    if (kn_keeper_open(&r->keeper, directory, r->fixture.scene, r->fixture.model, error, sizeof error) != 0)
        printf("%s\n", error), exit(1);
    r->fixture.loop.keeper = &r->keeper;
    kn_keeper_start(&r->keeper, &r->fixture.loop.servo, &r->fixture.loop.orders);
}

static rig *rig_open(void)
{
    rig *r = calloc(1, sizeof *r);
    strcpy(r->directory, "/tmp/knead_keeper_XXXXXX");
    if (!mkdtemp(r->directory)) exit(1);
    serve(r, r->directory);
    r->pose = (kn_pose){.session = 1, .orientation_wxyz = {1}, .position_m = {0, 0, AIR}};
    return r;
}

// Stop the server; the directory stays.
static void end(rig *r)
{
    kn_keeper_close(&r->keeper);
    kn_loop_fixture_close(&r->fixture);
}

static void rig_close(rig *r)
{
    end(r);
    clear_directory(r->directory, true);
    free(r);
}

OWNS(rig, rig_close)

// Run the keeper's thread until nothing is left to write.
static void write_files(rig *r)
{
    r->keeper.ending = true;
    kn_keeper_run(&r->keeper);
}

// Move the finger to a height and run a tick. Take its force and restore events from the records.
static void tick(rig *r, double z_m)
{
    double before_n = r->out.force[1].force_n[2], vz = (z_m - r->pose.position_m[2]) / 1e-3;
    r->pose.seq++;
    r->pose.position_m[2] = z_m;
    r->pose.velocity_m_s[2] = vz;
    kn_loop_post(&r->fixture.loop, 1, &r->pose);
    kn_wake wake = {.tick = r->tick++, .now_ns = kn_now_ns()};
    kn_loop_tick(&r->fixture.loop, &wake);
    // A slow machine would otherwise count as an overload.
    r->fixture.loop.execution_ns = 0;
    for (const kn_tick_record *record; (record = kn_ring_front(&r->fixture.loop.records));
         kn_ring_pop(&r->fixture.loop.records)) {
        r->out = record->out;
        for (int i = 0; i < r->out.event_count; i++) {
            if (r->out.event[i].kind != KNEAD_EVENT_T_KIND_RESTORE) continue;
            r->restored = r->out.event[i];
            r->restores++;
        }
    }
    r->steepest_n = fmax(r->steepest_n, fabs(r->out.force[1].force_n[2] - before_n));
}

// Move the finger to a height in so many ms.
static void move(rig *r, double z_m, int ms)
{
    double from_m = r->pose.position_m[2];
    for (int i = 1; i <= ms; i++) tick(r, from_m + (z_m - from_m) * i / ms);
}

// Press the dough to a height, and lift the finger again.
static void press(rig *r, double z_m)
{
    move(r, AIR, 450);
    move(r, z_m, 1400);
    move(r, AIR, 1400);
    move(r, AIR, 300);
}

static const kn_state *object(rig *r) { return r->fixture.backend.state(r->fixture.backend.self); }
static uint64_t hash(rig *r) { return kn_state_hash(r->fixture.model, object(r)); }

TEST("an untouched object is not saved, a kneaded one at most every half second, and a resting one ever less often")
{
    OWN(rig) *r = rig_open();
    for (int i = 0; i < 3000; i++) tick(r, AIR), write_files(r);
    CHECK(r->keeper.saves == 0 && kn_keeper_age_ms(&r->keeper) == -1);
    int64_t first = r->tick, before = 0, shortest = 1 << 20, last_tick = -500;
    for (int i = 0; i < 5000; i++) {
        double t = i < 1600 ? 1e-3 * i : 1.6;
        tick(r, i < 3000 ? AIR - 7e-3 * t : fmin(AIR, r->pose.position_m[2] + 2e-5));
        write_files(r);
        if (r->keeper.saves == before) continue;
        if (before) shortest = r->tick - last_tick < shortest ? r->tick - last_tick : shortest;
        before = r->keeper.saves, last_tick = r->tick;
    }
    printf("     %lld files in %lld ms of a press, %lld ms apart at least\n", (long long)before,
           (long long)(r->tick - first), (long long)shortest);
    CHECK(before >= 7 && shortest >= 499 && r->keeper.errors == 0);
    CHECK(kn_keeper_age_ms(&r->keeper) >= 0 && kn_keeper_age_ms(&r->keeper) < 60000);

    // Left alone it creeps ever less, so it is written ever less often.
    int64_t early = r->keeper.saves;
    for (int i = 0; i < 10000; i++) tick(r, AIR), write_files(r);
    int64_t middle = r->keeper.saves;
    CHECK(middle - early <= 20);
    if (SANITIZED) return; // 150 s would take it a minute
    for (int i = 0; i < 140000; i++) tick(r, AIR), write_files(r);
    int64_t late = r->keeper.saves;
    for (int i = 0; i < 10000; i++) tick(r, AIR), write_files(r);
    printf("     then %lld in 10 s alone, and %lld in 10 s after 150\n", (long long)(middle - early),
           (long long)(r->keeper.saves - late));
    CHECK(r->keeper.saves - late < middle - early);
}

TEST(
    "a restarted server continues with the last object, reports its state hash in an event and keeps the tool detached")
{
    OWN(rig) *r = rig_open();
    move(r, AIR, 450);
    move(r, DEEP, 1400); // in the middle of a press
    CHECK(r->out.force[1].contacts > 0);
    kn_keeper_finish(&r->keeper, &r->fixture.loop.servo, r->tick - 1);
    uint64_t saved = hash(r);
    int64_t generation = r->keeper.store.generation;
    end(r);
    serve(r, r->directory);
    r->tick = 0;
    tick(r, DEEP);
    CHECK(r->restores == 1 && r->restored.state_hash == saved && r->restored.tick == 0);
    CHECK(r->restored.arg[0] == (double)generation && r->restored.arg[1] == 1849);
    CHECK(r->fixture.loop.servo.generation == 1);
    move(r, DEEP, 300);
    CHECK(r->out.force[1].contacts == 0 && r->out.force[1].force_n[2] == 0); // the tool is inside: it must be lifted
    r->steepest_n = 0;
    press(r, DEEP - 2e-3);
    CHECK(r->keeper.errors == 0 && kn_keeper_age_ms(&r->keeper) >= 0);
}

static bool broken;
static int64_t unwritten; // writes that failed; each failed save makes one
// A write that fails as on a full disk while `broken` is set.
static ssize_t no_write(int fd, const void *bytes, size_t size)
{
    errno = ENOSPC;
    unwritten += broken;
    return broken ? -1 : kn_files_system.write(fd, bytes, size);
}

// The text printed on stderr while it listens.
typedef struct ear {
    FILE *file;
    int before;
} ear;

static ear hear(void)
{
    fflush(stderr);
    ear e = {tmpfile(), dup(STDERR_FILENO)};
    dup2(fileno(e.file), STDERR_FILENO);
    return e;
}

// Stop listening. Return the number of lines; *sum is the sum of the failed saves that they report.
static int heard(ear *e, long long *sum)
{
    char line[512];
    int lines = 0;
    dup2(e->before, STDERR_FILENO);
    close(e->before);
    rewind(e->file);
    for (*sum = 0; fgets(line, sizeof line, e->file); lines++) {
        const char *at = strrchr(line, '(');
        fputs(line, stderr);
        CHECK(at != NULL);
        if (at) *sum += atoll(at + 1);
    }
    fclose(e->file);
    return lines;
}

TEST("a full disk is counted per save and reported at most once a second; the servo runs on and saves when there is "
     "room")
{
    OWN(rig) *r = rig_open();
    kn_files files = kn_files_system;
    files.write = no_write;
    press(r, DEEP);
    write_files(r);
    int64_t good = r->keeper.store.generation;
    CHECK(good >= 1);
    CHECK(r->keeper.generation == good);
    r->keeper.store.files = &files;
    broken = true;
    unwritten = 0;
    ear e = hear();
    int64_t from_ns = kn_now_ns(), ticks = r->fixture.loop.servo.ticks;
    long long told;
    move(r, DEEP, 1400);
    for (int i = 0; i < 2000; i++) tick(r, DEEP), write_files(r);
    int most = 2 + (int)((kn_now_ns() - from_ns) / 1000000000); // most lines: one a second
    CHECK(r->keeper.errors >= 3 && r->keeper.errors == unwritten && r->keeper.store.generation == good);
    CHECK(r->fixture.loop.servo.ticks == ticks + 3400);
    int64_t errors = r->keeper.errors;
    broken = false;
    for (int i = 0; i < 501; i++) tick(r, DEEP), write_files(r);
    CHECK(r->keeper.errors == errors && r->keeper.store.generation == good + 1 && r->keeper.generation == good + 1);
    int lines = heard(&e, &told);
    CHECK(lines >= 1 && lines <= most && told == errors);
}

// --- orders, while it runs ---

typedef struct running {
    rig *r;
    _Atomic double z_m;
    atomic_bool stop;
    _Atomic int64_t tick;
} running;

// The servo's thread: move the finger towards z_m at 10 um a tick.
static void *run(void *arg)
{
    running *x = arg;
    while (!x->stop) {
        double way = x->z_m - x->r->pose.position_m[2];
        tick(x->r, x->r->pose.position_m[2] + fmax(-1e-5, fmin(1e-5, way)));
        x->tick = x->r->tick;
        nanosleep(&(struct timespec){.tv_nsec = 20000}, NULL);
    }
    return NULL;
}

// Wait for so many ticks.
static void await(running *x, int64_t ticks)
{
    for (int64_t until = x->tick + ticks; x->tick < until;) nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
}

TEST("snapshot, restore and undo are answered with generation, tick and state hash, or with the reason of a refusal")
{
    OWN(rig) *r = rig_open();
    running x = {.r = r, .z_m = AIR};
    pthread_t servo, keeper;
    pthread_create(&servo, NULL, run, &x);
    pthread_create(&keeper, NULL, kn_keeper_run, &r->keeper);
    kn_answer none = kn_keeper_undo(&r->fixture.loop.orders);
    CHECK(!none.ok && strstr(none.error, "nothing to undo"));
    none = kn_keeper_restore(&r->keeper, &r->fixture.loop.orders, r->fixture.scene, r->fixture.model, 0);
    CHECK(!none.ok && !strcmp(none.error, "restore: none"));
    await(&x, 500);
    kn_answer untouched = kn_keeper_snapshot(&r->keeper);
    CHECK(untouched.ok && untouched.generation == 1 && untouched.tick > 0 && untouched.state_hash != 0);
    x.z_m = DEEP;
    await(&x, 1300);
    kn_answer pressed = kn_keeper_snapshot(&r->keeper);
    CHECK(pressed.ok && pressed.generation > 1 && pressed.state_hash != untouched.state_hash);
    kn_answer undone = kn_keeper_undo(&r->fixture.loop.orders); // an undo under the tool
    CHECK(undone.ok && undone.tick > pressed.tick && undone.generation == 0);
    kn_answer again =
        kn_keeper_restore(&r->keeper, &r->fixture.loop.orders, r->fixture.scene, r->fixture.model, pressed.generation);
    CHECK(again.ok && again.state_hash == pressed.state_hash && again.generation == pressed.generation);
    none = kn_keeper_restore(&r->keeper, &r->fixture.loop.orders, r->fixture.scene, r->fixture.model, 999);
    CHECK(!none.ok && !strcmp(none.error, "restore: generation 999: none"));
    kn_answer back = kn_keeper_undo(&r->fixture.loop.orders); // an undo of the restore
    CHECK(back.ok);
    x.stop = true;
    r->keeper.ending = true;
    pthread_join(servo, NULL);
    pthread_join(keeper, NULL);
    CHECK(r->restores == 3 && r->steepest_n < 2.4);
    CHECK(r->keeper.errors == 0);
}

TEST("an emergency stop and its end are on disk before the answer, and a restart keeps the last one")
{
    OWN(rig) *r = rig_open();
    pthread_t keeper;
    char why[300] = "";
    pthread_create(&keeper, NULL, kn_keeper_run, &r->keeper);
    CHECK(!kn_store_estopped(&r->keeper.store) && kn_keeper_mark(&r->keeper, false, why, sizeof why));
    for (int i = 0; i < 3; i++) {
        CHECK(kn_keeper_mark(&r->keeper, true, why, sizeof why) && kn_store_estopped(&r->keeper.store));
        CHECK(kn_keeper_mark(&r->keeper, true, why, sizeof why) && kn_store_estopped(&r->keeper.store));
        if (i == 1) CHECK(kn_keeper_mark(&r->keeper, false, why, sizeof why) && !kn_store_estopped(&r->keeper.store));
    }
    r->keeper.ending = true;
    pthread_join(keeper, NULL);
    end(r);
    serve(r, r->directory);
    CHECK(kn_store_estopped(&r->keeper.store));
}

TEST("without a directory nothing is saved or restored, and undo works")
{
    rig *r = calloc(1, sizeof *r);
    serve(r, NULL);
    r->pose = (kn_pose){.session = 1, .orientation_wxyz = {1}, .position_m = {0, 0, AIR}};
    uint64_t new = hash(r);
    press(r, DEEP);
    CHECK(hash(r) != new &&kn_keeper_age_ms(&r->keeper) == -1 && r->keeper.saves == 0);
    CHECK(!kn_keeper_snapshot(&r->keeper).ok &&
          !kn_keeper_restore(&r->keeper, &r->fixture.loop.orders, r->fixture.scene, r->fixture.model, 0).ok);
    kn_orders_give(&r->fixture.loop.orders, KN_ORDER_UNDO, 0);
    tick(r, AIR);
    CHECK(r->restores == 1 && r->restored.arg[0] == 0 && r->restored.state_hash == new);
    end(r);
    free(r);
}

TESTS_MAIN
