// The daemon's loop over a whole day, with everything but its threads: from datagrams to forces on the wire, under a
// virtual clock. KN_TICKS=86400000 is a day; the usual 90 000 ticks are a minute and a half. Every million ticks (or
// a tenth of a shorter run) a line reports memory and state.
#include "core/hash.h"
#include "server/loop.h"
#include "server/receiver.h"
#include "server/snapshot_file.h"
#include "server/wire.h"
#include "tests/check.h"
#include "tests/server/datagram.h"
#include "tests/server/loop_fixture.h"
#include <sys/wait.h>
#include <unistd.h>

// --- the hand: a story of 30 s, repeated ---

enum { FINGER_MS = 21000, POKE_MS = 1400, PLATE_FROM_MS = 22700, PLATE_TO_MS = 28200, STORY_MS = 30000 };
enum { FRESH_STORIES = 6 }; // a reset every three minutes

// Set the pose of millisecond n. Return the tool's index, or -1 if no hand is there, long enough for a session to
// end.
static int hand_at(int64_t n, kn_pose *pose)
{
    int64_t story = n / STORY_MS, ms = n % STORY_MS;
    double *x = pose->position_m;
    *pose = (kn_pose){.session = 100 + story, .orientation_wxyz = {1}};
    if (ms < FINGER_MS) { // 15 pokes of 3 to 9 mm, each in another place
        double poke = (double)(story * 15 + ms / POKE_MS), s = 1e-3 * (double)(ms % POKE_MS);
        double turn = 2.4 * (poke - fmax(0, 1 - s / 0.3)); // moves over from the place of the last poke
        double down = s < 0.4 ? 0 : s < 1.0 ? (s - 0.4) / 0.6 : fmax(0, 1 - (s - 1.0) / 0.3);
        double deep_m = 0.008 + 0.001 * (double)(story % FRESH_STORIES) + 0.001 * fabs(sin(poke)); // deeper each time
        x[0] = 0.006 * sin(turn), x[1] = 0.006 * cos(turn), x[2] = 0.04 - deep_m * down;
        pose->velocity_m_s[2] = s < 0.4 ? 0 : s < 1.0 ? -deep_m / 0.6 : s < 1.3 ? deep_m / 0.3 : 0;
        bool lost = ms >= 7 * POKE_MS + 800 && ms < 7 * POKE_MS + 860; // poses lost during a press
        return lost ? -1 : 1;
    }
    if (ms < PLATE_FROM_MS || ms >= PLATE_TO_MS) return -1;
    double s = 1e-3 * (double)(ms - PLATE_FROM_MS); // 5 mm deep at 1 cm/s, held, and up
    double down_m = s < 0.5 ? 0 : s < 1.7 ? 0.01 * (s - 0.5) : s < 4.2 ? 0.012 : fmax(0, 0.012 - 0.01 * (s - 4.2));
    x[2] = 0.027 - down_m;
    pose->velocity_m_s[2] = s < 0.5 ? 0 : s < 1.7 ? -0.01 : s < 4.2 || down_m == 0 ? 0 : 0.01;
    return 0;
}

// --- the daemon ---

typedef struct soak {
    kn_loop_fixture *f;
    kn_undo undo;
    kn_receiver receiver;
    int64_t seq, sent, repeated, touching, resets, missed, not_finite, unread;
    double peak_n;
    uint64_t hash; // hash of all forces on the wire
} soak;

static void start_server(soak *s)
{
    s->f = calloc(1, sizeof *s->f);
    kn_loop_fixture_open(s->f, "object.size=[3 cm, 3 cm, 2 cm]"); // 48 nodes, for short ticks
    if (!kn_undo_init(&s->undo, s->f->model)) exit(1);
    s->f->loop.skin = NULL; // nobody looks at the object
    s->f->loop.servo.undo = &s->undo;
    s->f->loop.free = true;
}

static void end_server(soak *s)
{
    kn_undo_free(&s->undo);
    kn_loop_fixture_close(s->f);
    free(s->f);
}

// Do the same as kneadd --state-dir at its end and its next start, without the disk.
static void restart(soak *s, int64_t tick)
{
    char why[200] = "too large";
    kn_model *model = s->f->model;
    size_t room = kn_saved_size_max(model);
    uint8_t *bytes = malloc(room);
    kn_saved saved = {.servo = s->f->loop.servo, .tick = tick, .utime = 1700000000000000, .generation = 1};
    saved.state = kn_state_create(model);
    kn_state_copy(model, saved.state, kn_loop_fixture_state(s->f));
    size_t size = kn_saved_encode(s->f->scene, model, &saved, bytes, room);
    kn_state_destroy(saved.state);
    end_server(s);
    start_server(s);
    kn_saved found = {.servo = s->f->loop.servo, .state = kn_state_create(s->f->model)};
    if (size == 0 || !kn_saved_decode(s->f->scene, s->f->model, bytes, size, &found, why, sizeof why))
        printf("%s\n", why), exit(1);
    s->f->backend.restore(s->f->backend.self, found.state);
    kn_saved_resume(&found, &s->f->loop.servo);
    kn_state_destroy(found.state);
    free(bytes);
}

static void hear(soak *s, int64_t n, int64_t now_ns)
{
    static const char *const channels[] = {"KNEAD_POSE_plate", "KNEAD_POSE_finger"};
    kn_datagram d = {.here = true};
    kn_pose pose;
    knead_probe_pose_t message;
    int p = hand_at(n, &pose);
    for (int again = 0; p >= 0 && again < 1 + (n % 10 == 0); again++) { // some poses are sent twice
        pose.seq = again ? s->seq : ++s->seq;
        pose.utime = now_ns / 1000;
        kn_wire_pose(&message, &pose);
        d.size = kn_pose_datagram(d.bytes, sizeof d.bytes, channels[p], &message);
        s->sent++, s->repeated += again;
        int probe;
        kn_pose taken;
        if (kn_receiver_judge(&s->receiver, &d, now_ns, &probe, &taken) == KN_ACCEPTED)
            kn_loop_post(&s->f->loop, probe, &taken);
    }
    unsigned ended = kn_receiver_expire(&s->receiver, now_ns);
    for (int q = 0; q < s->receiver.probes; q++)
        if (ended >> q & 1) kn_loop_post(&s->f->loop, q, NULL);
}

static void say(soak *s)
{
    kn_ring *records = &s->f->loop.records;
    for (const kn_tick_record *r; (r = kn_ring_front(records)); kn_ring_pop(records))
        for (int p = 0; p < r->out.probes; p++) {
            const kn_force *f = &r->out.force[p];
            knead_contact_force_t message;
            uint8_t bytes[512];
            double size_n = hypot(hypot(f->force_n[0], f->force_n[1]), f->force_n[2]);
            if (!f->live) continue;
            kn_wire_force(&message, &r->out, p, 0, 0);
            int size = knead_contact_force_t_encode(bytes, 0, sizeof bytes, &message);
            s->hash = kn_hash_bytes(s->hash, bytes, (size_t)size);
            s->touching += f->contacts > 0;
            s->not_finite += !isfinite(size_n);
            s->peak_n = fmax(s->peak_n, size_n);
        }
}

static double resident_mb(void)
{
    long pages = 0, resident = 0;
    FILE *f = fopen("/proc/self/statm", "r");
    if (!f || fscanf(f, "%ld %ld", &pages, &resident) != 2) resident = -1;
    if (f) fclose(f);
    return 1e-6 * (double)(resident * sysconf(_SC_PAGESIZE));
}

// --- a run ---

typedef struct result {
    uint64_t hash, state_hash;
    double drift_mb;
} result;

static const int64_t far_along = INT64_C(1) << 32; // a 32-bit counter wraps here

static int64_t ticks_of_run(void)
{
    const char *text = getenv("KN_TICKS");
    return text && atoll(text) > 0 ? atoll(text) : 90000;
}

// Start every counter so far below 2^32 that half of the run lies beyond. Return the start value.
static int64_t advance_counters(soak *s, int64_t ticks)
{
    int64_t from = far_along - ticks / 2;
    kn_loop *loop = &s->f->loop;
    s->seq = from;
    s->receiver.received = s->receiver.accepted = s->receiver.rejected[KN_REJECT_STALE] = from;
    loop->servo.ticks = loop->servo.capped = from;
    loop->servo.safety[1].faults = from;
    atomic_store(&loop->account.ticks, from);
    atomic_store(&loop->account.missed, from);
    return from;
}

static void check_counters(const soak *s, int64_t from, int64_t ticks, int64_t restarts, const char *name)
{
    const kn_loop *loop = &s->f->loop;
    const kn_receiver *r = &s->receiver;
    int64_t faults = loop->servo.safety[1].faults - from;
    printf("     %s: %lld poses, %lld ticks in touch, peak %.2f N, %lld faults, %lld resets, %lld missed\n", name,
           (long long)s->sent, (long long)s->touching, s->peak_n, (long long)faults, (long long)s->resets,
           (long long)s->missed);
    CHECK(r->received == from + s->sent && s->repeated > 0);
    CHECK(r->rejected[KN_REJECT_STALE] == from + s->repeated);
    CHECK(r->accepted == from + s->sent - s->repeated);
    CHECK(loop->servo.ticks == from + ticks);
    // a restarted daemon counts from its own start
    CHECK(restarts > 0 || atomic_load(&loop->account.ticks) == from + ticks);
    CHECK(restarts > 0 || atomic_load(&loop->account.missed) == from + s->missed);
    CHECK(faults >= ticks / STORY_MS && loop->servo.capped >= from);
    CHECK(loop->servo.diverged == 0 && s->not_finite == 0 && s->unread == 0);
    CHECK(!kn_loop_fixture_state(s->f)->bad);
    CHECK(s->touching > ticks / 20 && s->peak_n > 1);
    CHECK(s->missed > 0 && s->resets >= ticks / STORY_MS / FRESH_STORIES);
}

static result run(int64_t ticks, int64_t restart_ticks, const char *name)
{
    soak s = {.hash = KN_HASH_SEED};
    start_server(&s);
    kn_receiver_init(&s.receiver, &s.f->model->def);
    int64_t from = advance_counters(&s, ticks), restarts = 0, tick = from,
            told = ticks < 10000000 ? ticks / 10 : 1000000;
    double warm_mb = 0;
    kn_time time = {0}; // a tick takes no virtual time; otherwise a slow machine would report an overload
    kn_clock_hand(&time);
    for (int64_t n = 0; n < ticks; n++, tick++) {
        int64_t now_ns = 1000000 * tick;
        if (n > 0 && restart_ticks > 0 && n % restart_ticks == 0) restart(&s, tick - 1), restarts++;
        if (n % (FRESH_STORIES * STORY_MS) == 0)
            kn_orders_give(&s.f->loop.orders, KN_ORDER_RESET, KN_QUALITY_OWN), s.resets++;
        hear(&s, n, now_ns);
        kn_wake wake = {.tick = tick, .missed = n % 7001 == 7000, .due_ns = now_ns, .now_ns = time.now_ns = now_ns};
        if (wake.missed) wake.tick = ++tick, s.missed++; // a missed tick is skipped for good, and the grid goes on
        kn_loop_tick(&s.f->loop, &wake);
        s.unread += s.f->loop.account.unpublished > 0;
        say(&s);
        if ((n + 1) % told != 0) continue;
        double now_mb = resident_mb();
        if (warm_mb == 0) warm_mb = now_mb;
        printf("     %s: %10lld ticks, %.3f MB, state %016llx\n", name, (long long)(n + 1), now_mb,
               (unsigned long long)kn_loop_fixture_hash(s.f));
        fflush(stdout);
    }
    kn_clock_hand(NULL);
    check_counters(&s, from, ticks, restarts, name);
    result r = {s.hash, kn_loop_fixture_hash(s.f), resident_mb() - warm_mb};
    end_server(&s);
    return r;
}

// Start a run in a process of its own, so that its memory is its own. Several runs may go side by side.
static int run_apart(int64_t ticks, int64_t restart_ticks, const char *name, pid_t *child)
{
    int fds[2];
    fflush(NULL);
    if (pipe(fds) != 0 || (*child = fork()) < 0) exit(1);
    if (*child > 0) return close(fds[1]), fds[0];
    result r = run(ticks, restart_ticks, name);
    fflush(NULL);
    _exit(write(fds[1], &r, sizeof r) == sizeof r ? kn_test_failures > 0 : 70);
}

static result result_of(int fd, pid_t child)
{
    result r = {0};
    int status = 1;
    CHECK(read(fd, &r, sizeof r) == sizeof r);
    CHECK(waitpid(child, &status, 0) == child && status == 0);
    close(fd);
    return r;
}

TEST("a long run grows by less than a megabyte, counts past 32 bits, and gives the same bits through restarts")
{
    int64_t ticks = ticks_of_run(), hour = 120 * STORY_MS, part = ticks < hour ? STORY_MS : hour;
    pid_t straight, resumed;
    int a_fd = run_apart(ticks, 0, "straight", &straight), b_fd = run_apart(ticks, part, "restarted", &resumed);
    result a = result_of(a_fd, straight), b = result_of(b_fd, resumed);
    printf("     %lld ticks: %+.3f MB; the same through %lld restarts: forces %016llx, state %016llx\n",
           (long long)ticks, a.drift_mb, (long long)((ticks - 1) / part), (unsigned long long)a.hash,
           (unsigned long long)a.state_hash);
    CHECK(a.drift_mb < 1);
    CHECK(a.hash == b.hash && a.state_hash == b.state_hash);
}

TESTS_MAIN
