#include "server/keeper.h"
#include "core/snapshot.h"
#include "tests/cleared.h"
#include "tests/server/loop_fixture.h"
#include <errno.h>
#include <unistd.h>

// A rig: a loop with its keeper on a directory, and a finger above the dough. One call per tick. The keeper's thread
// runs when a test calls it.
#define AIR 0.049 // heights of the finger's centre, m; its radius is 15 mm, the dough 30 mm high
#define DEEP 0.037

typedef struct rig {
    kn_loop_fixture f;
    kn_keeper keeper;
    char directory[64];
    kn_pose pose;
    double steepest_n;
} rig;

// Start a server on the rig's directory.
static void serve(rig *r)
{
    char error[512] = "", *directory = *r->directory ? r->directory : NULL;
    kn_loop_fixture_open(&r->f, NULL);
    if (kn_keeper_open(&r->keeper, directory, r->f.scene, r->f.model, error, sizeof error) != 0)
        printf("%s\n", error), exit(1);
    r->f.loop.keeper = &r->keeper;
    kn_keeper_start(&r->keeper, &r->f.loop.servo, &r->f.loop.orders);
}

static rig *rig_open(const char *directory)
{
    rig *r = calloc(1, sizeof *r);
    strcpy(r->directory, directory);
    if (*directory && !mkdtemp(r->directory)) exit(1);
    serve(r);
    r->pose = (kn_pose){.session = 1, .orientation_wxyz = {1}, .position_m = {0, 0, AIR}};
    return r;
}

// Stop the server; the directory stays.
static void end(rig *r)
{
    kn_keeper_close(&r->keeper);
    kn_loop_fixture_close(&r->f);
}

static void rig_close(rig *r)
{
    end(r);
    if (*r->directory) clear_directory(r->directory, true);
    free(r);
}

OWNS(rig, rig_close)

// Move the finger to a height and run a tick.
static void tick(rig *r, double z_m)
{
    double before_n = r->f.out.force[1].force_n[2];
    kn_loop_fixture_tick(&r->f, 1, &r->pose, z_m);
    r->steepest_n = fmax(r->steepest_n, fabs(r->f.out.force[1].force_n[2] - before_n));
}

// Move the finger to a height in so many ms.
static void move(rig *r, double z_m, int ms)
{
    double from_m = r->pose.position_m[2];
    for (int i = 1; i <= ms; i++) tick(r, from_m + (z_m - from_m) * i / ms);
}

// Hold the finger for so many ms, while the keeper's thread writes all that there is to write.
static void write_files(rig *r, int ms)
{
    r->keeper.ending = true;
    for (int i = 0; i < ms; i++) tick(r, r->pose.position_m[2]), kn_keeper_run(&r->keeper);
}

// Press the dough to a height, and lift the finger again.
static void press(rig *r, double z_m)
{
    move(r, AIR, 450);
    move(r, z_m, 1400);
    move(r, AIR, 1400);
    move(r, AIR, 300);
}

TEST("an untouched object is not saved, a kneaded one at most every half second, and a resting one ever less often")
{
    OWN(rig) *r = rig_open("/tmp/knead_keeper_XXXXXX");
    write_files(r, 3000);
    CHECK(r->keeper.saves == 0 && kn_keeper_age_ms(&r->keeper) == -1);
    int64_t before = 0, shortest = 1 << 20, last_tick = 0;
    for (int i = 0; i < 5000; i++) {
        tick(r, i < 3000 ? AIR - 7e-6 * fmin(i, 1600) : fmin(AIR, r->pose.position_m[2] + 2e-5));
        kn_keeper_run(&r->keeper);
        if (r->keeper.saves == before) continue;
        if (before && r->f.tick - last_tick < shortest) shortest = r->f.tick - last_tick;
        before = r->keeper.saves, last_tick = r->f.tick;
    }
    printf("     %lld files in 5000 ms of a press, %lld ms apart at least\n", (long long)before, (long long)shortest);
    CHECK(before >= 7 && shortest >= 499 && r->keeper.errors == 0);
    CHECK(kn_keeper_age_ms(&r->keeper) >= 0 && kn_keeper_age_ms(&r->keeper) < 60000);

    // Left alone it creeps ever less, so it is written ever less often.
    int64_t early = r->keeper.saves;
    write_files(r, 10000);
    int64_t middle = r->keeper.saves;
    CHECK(middle - early <= 20);
    if (KN_LENGTH(1, 0, 0)) return; // with sanitizers 150 s would take a minute
    write_files(r, 140000);
    int64_t late = r->keeper.saves;
    write_files(r, 10000);
    printf("     then %lld in 10 s alone, and %lld in 10 s after 150\n", (long long)(middle - early),
           (long long)(r->keeper.saves - late));
    CHECK(r->keeper.saves - late < middle - early);
}

TEST("a restarted server continues with the last object, reports its state hash in an event and keeps the tool "
     "detached until it is lifted")
{
    OWN(rig) *r = rig_open("/tmp/knead_keeper_XXXXXX");
    move(r, AIR, 450);
    move(r, DEEP, 1400); // in the middle of a press
    CHECK(r->f.out.force[1].contacts > 0);
    kn_keeper_finish(&r->keeper, &r->f.loop.servo, r->f.tick - 1);
    uint64_t saved = kn_loop_fixture_hash(&r->f);
    int64_t generation = r->keeper.store.generation;
    end(r);
    serve(r);
    const kn_event *restored = &r->f.last[KNEAD_EVENT_T_KIND_RESTORE];
    tick(r, DEEP);
    CHECK(r->f.kinds[KNEAD_EVENT_T_KIND_RESTORE] == 1 && restored->state_hash == saved && restored->tick == 0);
    CHECK(restored->arg[0] == (double)generation && restored->arg[1] == 1849);
    CHECK(r->f.loop.servo.generation == 1);
    move(r, DEEP, 300);
    CHECK(r->f.out.force[1].contacts == 0 && r->f.out.force[1].force_n[2] == 0);
    press(r, DEEP - 2e-3);
    CHECK(r->f.kinds[KNEAD_EVENT_T_KIND_ATTACH] == 1);
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

TEST("on a full disk each failed save is counted, the servo runs on, and saves when there is room")
{
    OWN(rig) *r = rig_open("/tmp/knead_keeper_XXXXXX");
    kn_files files = kn_files_system;
    files.write = no_write;
    press(r, DEEP);
    write_files(r, 1);
    int64_t good = r->keeper.store.generation, ticks = r->f.loop.servo.ticks;
    CHECK(good >= 1 && r->keeper.generation == good);
    r->keeper.store.files = &files;
    broken = true;
    move(r, DEEP, 1400);
    write_files(r, 2000);
    CHECK(r->keeper.errors >= 3 && r->keeper.errors == unwritten && r->keeper.store.generation == good);
    CHECK(r->f.loop.servo.ticks == ticks + 3400);
    broken = false;
    write_files(r, 501);
    CHECK(r->keeper.errors == unwritten && r->keeper.store.generation == good + 1 && r->keeper.generation == good + 1);
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
        x->tick = x->r->f.tick;
        nanosleep(&(struct timespec){.tv_nsec = 20000}, NULL);
    }
    return NULL;
}

// Wait for so many ticks.
static void await(running *x, int64_t ticks)
{
    for (int64_t until = x->tick + ticks; x->tick < until;) nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
}

static kn_answer restore(rig *r, int64_t generation)
{
    return kn_keeper_restore(&r->keeper, &r->f.loop.orders, r->f.scene, r->f.model, generation);
}

TEST(
    "snapshot, restore and undo are answered with generation, tick and state hash, or with the reason of a refusal; an "
    "emergency stop and its end are on disk before the answer")
{
    OWN(rig) *r = rig_open("/tmp/knead_keeper_XXXXXX");
    running x = {.r = r, .z_m = AIR};
    pthread_t servo, keeper;
    char why[300] = "";
    pthread_create(&servo, NULL, run, &x);
    pthread_create(&keeper, NULL, kn_keeper_run, &r->keeper);
    kn_answer none = kn_keeper_undo(&r->f.loop.orders);
    CHECK(!none.ok && strstr(none.error, "nothing to undo"));
    none = restore(r, 0);
    CHECK(!none.ok && !strcmp(none.error, "restore: none"));
    await(&x, 500);
    kn_answer untouched = kn_keeper_snapshot(&r->keeper);
    CHECK(untouched.ok && untouched.generation == KN_STORE_OWN && untouched.tick > 0 && untouched.state_hash != 0);
    x.z_m = DEEP;
    await(&x, 1300);
    kn_answer pressed = kn_keeper_snapshot(&r->keeper);
    CHECK(pressed.ok && pressed.generation == 2 * KN_STORE_OWN && pressed.state_hash != untouched.state_hash);
    kn_answer undone = kn_keeper_undo(&r->f.loop.orders); // an undo under the tool
    CHECK(undone.ok && undone.tick > pressed.tick && undone.generation == 0);
    kn_answer again = restore(r, pressed.generation);
    CHECK(again.ok && again.state_hash == pressed.state_hash && again.generation == pressed.generation);
    none = restore(r, 999);
    CHECK(!none.ok && !strcmp(none.error, "restore: generation 999: none"));
    none = restore(r, 7 * KN_STORE_OWN);
    CHECK(!none.ok && !strcmp(none.error, "restore: snapshot 7: none"));
    CHECK(kn_keeper_undo(&r->f.loop.orders).ok); // an undo of the restore
    for (int i = 0; i < 5; i++) {
        bool stands = i % 3 > 0; // off, on, on, off, on
        CHECK(kn_keeper_mark(&r->keeper, stands, why, sizeof why) && kn_store_estopped(&r->keeper.store) == stands);
    }
    x.stop = true;
    r->keeper.ending = true;
    pthread_join(servo, NULL);
    pthread_join(keeper, NULL);
    CHECK(r->f.kinds[KNEAD_EVENT_T_KIND_RESTORE] == 3 && r->steepest_n < 2.4);
    CHECK(r->keeper.errors == 0);
    end(r);
    serve(r);
    CHECK(kn_store_estopped(&r->keeper.store)); // after a restart, too
}

TEST("without a directory nothing is saved or restored, and undo works")
{
    OWN(rig) *r = rig_open("");
    uint64_t new = kn_loop_fixture_hash(&r->f);
    press(r, DEEP);
    CHECK(kn_loop_fixture_hash(&r->f) != new);
    CHECK(kn_keeper_age_ms(&r->keeper) == -1 && r->keeper.saves == 0);
    CHECK(!kn_keeper_snapshot(&r->keeper).ok && !restore(r, 0).ok);
    kn_orders_give(&r->f.loop.orders, KN_ORDER_UNDO, 0);
    tick(r, AIR);
    const kn_event *restored = &r->f.last[KNEAD_EVENT_T_KIND_RESTORE];
    CHECK(r->f.kinds[KNEAD_EVENT_T_KIND_RESTORE] == 1 && restored->arg[0] == 0 && restored->state_hash == new);
}

TESTS_MAIN
