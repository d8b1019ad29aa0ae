// Between start and stop the servo thread must never allocate, take a lock, touch a page that is not resident, or
// call the kernel. Exceptions: it may sleep and wake another thread. With a circuit behind a line it may also read,
// write and wait for that line. malloc, related functions and the mutex are interposed here and count while a thread
// is armed. In the live runs the kernel itself reports every other system call (seccomp).
// KN_TICKS=N: ticks of the first run, 1e5. KN_LIVE_TICKS=N: ticks of each live run, 4000, 1 ms each.
// without sanitizers: they allocate themselves
// a program of its own: malloc and its kin are interposed
#include "clients/hand/tool_path.h"
#include "server/keeper.h"
#include "tests/allocations.h"
#include "tests/cleared.h"
#include "tests/server/board.h"
#include "tests/server/loop_fixture.h"
#include <dlfcn.h>
#include <errno.h>
#include <ev.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <pthread.h>
#include <signal.h>
#include <stddef.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>

static atomic_long locks, calls, last_call;

static int (*real_lock)(pthread_mutex_t *);

int pthread_mutex_lock(pthread_mutex_t *mutex)
{
    locks += armed;
    if (!real_lock) *(void **)&real_lock = dlsym(RTLD_NEXT, "pthread_mutex_lock");
    return real_lock(mutex);
}

typedef struct rig {
    kn_loop_fixture fixture;
    kn_board board; // simulated board of a circuit
    const char *const *how;
    int kills;
    int64_t losses; // the circuit's losses when it was last killed
    atomic_int tid;
    long faulted;
    kn_keeper keeper;
    char directory[32];
    kn_tool_path *path;
    int64_t forces, contacts, pressed, ticks;
} rig;

// how: options of a simulated circuit, or NULL for no circuit
static void rig_open(rig *r, const char *const *how)
{
    static const char *const all[] = {"quality={fast: {iterations: 5}, accurate: {passes: 2}}", "mesh.measures=both"};
    memset(r, 0, sizeof *r);
    if (how) r->board = kn_board_start(r->how = how);
    if (how) strcat(r->board.uri, "?miss=10"); // allows for a busy machine
    kn_loop_fixture_open_on(&r->fixture, how ? kn_fixed_set : all, how ? KN_FIXED_SETS : 2, how ? r->board.uri : NULL);
    r->path =
        kn_tool_path_press(&(kn_tool_path_def){.touch_z_m = 0.03, .clear_m = 0.005, .depth_m = 0.008, .hold_s = 0.3});
    // a tick then does all it can do
    bool identifies = how || kn_backend_cpu_identify(&r->fixture.backend, (kn_coupling){600, 1.5});
    if (!r->path || !identifies) exit(1);
    char error[256] = "";
    strcpy(r->directory, "/tmp/knead_trap_XXXXXX");
    if (!mkdtemp(r->directory) ||
        kn_keeper_open(&r->keeper, r->directory, r->fixture.scene, r->fixture.model, error, sizeof error) != 0)
        fprintf(stderr, "%s\n", error), exit(1);
    r->fixture.loop.keeper = &r->keeper;
    kn_keeper_start(&r->keeper, &r->fixture.loop.servo, &r->fixture.loop.orders);
}

static void rig_drain(rig *r)
{
    for (const kn_tick_record *record; (record = kn_ring_front(&r->fixture.loop.records));
         kn_ring_pop(&r->fixture.loop.records)) {
        r->ticks++;
        r->forces += record->out.force[0].live;
        r->contacts += record->out.local && record->out.contact[0]->contact_count > 0;
        r->pressed += record->out.force[0].contacts > 0;
    }
}

enum { ROUND = 6000 };

static int64_t wanted(const char *name, int64_t otherwise)
{
    const char *text = getenv(name);
    return text ? (int64_t)atof(text) : otherwise;
}

static long faults(void) // page faults of this thread
{
    struct rusage usage;
    getrusage(RUSAGE_THREAD, &usage);
    return usage.ru_minflt + usage.ru_majflt;
}

// Play the hand of a round of 6 s. It engages in air, rests on the surface, presses 8 mm deep and stalls for 50 ms (a
// fault). Then it withdraws, engages again and falls silent, and its session ends.
static void play(rig *r, int64_t round, int ms)
{
    double stall_ms = 500 + 1e3 * r->path->hold_end_s - 100;
    kn_tool_path_point point;
    kn_tool_path_at(r->path, 1e-3 * (ms - 500), &point);
    if (ms == 5900) kn_loop_post(&r->fixture.loop, 0, NULL);
    if ((ms >= stall_ms && ms < stall_ms + 50) || ms >= 5700) return;
    kn_pose pose = {.session = 1 + round, .seq = 1 + ms, .orientation_wxyz = {1}};
    memcpy(pose.position_m, point.position_m, sizeof pose.position_m);
    memcpy(pose.velocity_m_s, point.velocity_m_s, sizeof pose.velocity_m_s);
    kn_loop_post(&r->fixture.loop, 0, &pose);
}

TEST("ticks with contact, faults, recoveries, sessions, resets, undos and copies do not allocate, lock or page-fault")
{
    static rig r;
    rig_open(&r, NULL);
    const int64_t most = wanted("KN_TICKS", 100000);
    bool locked = mlockall(MCL_CURRENT | MCL_FUTURE) == 0; // as kneadd does
    long faulted = 0;
    for (int64_t n = 0; n < most; n++) {
        play(&r, n / ROUND, (int)(n % ROUND));
        // Reset, because the dent would keep later rounds from touching.
        if (n % ROUND == 0) kn_orders_give(&r.fixture.loop.orders, KN_ORDER_RESET, 0);
        if (n / ROUND % 3 == 2 && n % ROUND == 2500) kn_orders_give(&r.fixture.loop.orders, KN_ORDER_ESTOP, 0);
        if (n / ROUND % 3 == 2 && n % ROUND == 2700) kn_orders_give(&r.fixture.loop.orders, KN_ORDER_RECOVER, 0);
        if (n / ROUND % 4 == 1 && n % ROUND == 3000) kn_orders_give(&r.fixture.loop.orders, KN_ORDER_UNDO, 0);
        r.keeper.ending = true;
        if (n % 50 == 0) kn_keeper_run(&r.keeper); // does the work of the keeper's thread
        kn_quality other = n / ROUND % 2 ? KN_QUALITY_FAST : KN_QUALITY_ACCURATE;
        if (n % ROUND == 2000) kn_orders_give(&r.fixture.loop.orders, KN_ORDER_QUALITY, other);
        kn_wake wake = {.tick = n + n / 997, .missed = n > 0 && n % 997 == 0, .now_ns = kn_now_ns()};
        long before = faults();
        armed = true;
        kn_loop_tick(&r.fixture.loop, &wake);
        r.fixture.loop.execution_ns = 0; // a slow machine would report an overload
        armed = false;
        faulted += faults() - before;
        rig_drain(&r);
    }
    munlockall();
    printf("%lld ticks: %ld allocations, %ld locks, %ld page faults%s\n", (long long)most, (long)allocations,
           (long)locks, faulted, locked ? "" : ", memory not locked");
    CHECK(allocations == 0);
    CHECK(locks == 0);
    CHECK(faulted == 0 || !locked);
    CHECK(r.ticks == most && r.forces > most / 2 && r.pressed > most / 10); // the run really had contacts
    CHECK(r.contacts > most / 10);
    CHECK(r.keeper.saves > 20 && r.keeper.errors == 0 && r.fixture.loop.servo.generation > most / ROUND);
    CHECK(r.fixture.loop.account.faults >= most / ROUND); // and faults
    kn_tool_path_destroy(r.path);
    clear_directory(r.directory, true);
    kn_keeper_close(&r.keeper);
    kn_loop_fixture_close(&r.fixture);
}

// Test the trap itself. Otherwise the counts above would prove nothing.
TEST("the trap sees an allocation and a lock")
{
    pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
    long a = allocations, l = locks;
    armed = true;
    void *volatile memory = malloc(1);
    free(memory);
    pthread_mutex_lock(&mutex);
    armed = false;
    pthread_mutex_unlock(&mutex);
    CHECK(allocations == a + 2 && locks == l + 1);
}

static void on_sigsys(int number, siginfo_t *info, void *context)
{
    (void)number, (void)context;
    last_call = info->si_syscall;
    calls++;
}

// Restrict the system calls of this thread from here on. The thread may sleep and write (waking another thread is a
// write to an eventfd). With a line it may also read and wait for that line. Any other call raises SIGSYS.
static bool forbid_calls(bool line)
{
    struct sock_filter allow[] = {
        BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, nr)),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_clock_nanosleep, 5, 0),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_write, 4, 0),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_rt_sigreturn, 3, 0),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, line ? SYS_read : SYS_write, 2, 0),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, line ? SYS_ppoll : SYS_write, 1, 0),
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_TRAP),
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
    };
    struct sock_fprog program = {sizeof allow / sizeof *allow, allow};
    sigaction(SIGSYS, &(struct sigaction){.sa_sigaction = on_sigsys, .sa_flags = SA_SIGINFO}, NULL);
    return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 && prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) == 0;
}

// Return the page faults of another thread of this process, read from /proc. That thread may no longer ask for them
// itself.
static long faults_of(int tid)
{
    char path[64];
    long minor = -1, major = 0;
    snprintf(path, sizeof path, "/proc/self/task/%d/stat", tid);
    FILE *file = fopen(path, "r");
    if (file && fscanf(file, "%*d %*s %*c %*d %*d %*d %*d %*d %*u %ld %*u %ld", &minor, &major) != 2) minor = -1;
    if (file) fclose(file);
    return minor + major;
}

static struct ev_loop *events;
static int64_t live_ticks;
static ev_async ticked;
static atomic_int finished; // 1 done, -1 no seccomp here

static void *servo_main(void *arg)
{
    rig *r = arg;
    r->tid = (int)syscall(SYS_gettid);
    if (!forbid_calls(r->how && strcmp(r->how[0], "--uart") == 0)) {
        finished = -1;
        return NULL;
    }
    armed = true;
    kn_loop_run(&r->fixture.loop);
    armed = false;
    long during = calls;
    syscall(SYS_getppid); // test of the trap
    calls = calls == during + 1 ? during : -1;
    finished = 1;
    // even ending the thread is forbidden
    for (;;) clock_nanosleep(CLOCK_MONOTONIC, 0, &(struct timespec){.tv_sec = 1}, NULL);
}

static void notify(void *arg) { ev_async_send(events, arg); }

// Kill the circuit and start it again. Do not wait until it is ready, because a hand would be silent for too long.
static void replug(rig *r, int64_t losses)
{
    kn_board_kill(&r->board);
    kn_board again = kn_board_spawn(r->how);
    memcpy(again.uri, r->board.uri, sizeof again.uri);
    r->board = again;
    r->kills++;
    r->losses = losses;
}

static void on_ticked(struct ev_loop *loop, ev_async *w, int revents)
{
    (void)revents;
    rig *r = w->data;
    bool done = r->fixture.loop.done;
    rig_drain(r);
    play(r, r->ticks / ROUND, (int)(r->ticks % ROUND));
    if (r->ticks % ROUND == 3500 || r->ticks % ROUND == 5900)
        kn_orders_give(&r->fixture.loop.orders, KN_ORDER_RESET, 0);
    if (r->ticks % ROUND == 3600) kn_orders_give(&r->fixture.loop.orders, KN_ORDER_UNDO, 0);
    if (r->faulted == 0 && r->ticks >= 200) r->faulted = faults_of(r->tid);
    kn_fpga_counts n = {0};
    if (r->how) kn_backend_fpga_counts(&r->fixture.backend, &n);
    const int64_t kills = live_ticks / 1500;
    bool missed = r->kills == 0 || n.losses > r->losses; // the last kill has been noticed
    if (n.in_step && missed && r->kills < kills && r->ticks / 1500 > r->kills) replug(r, n.losses); // during a press
    // On a busy machine the hand may fall silent, and a lost circuit comes back late.
    bool all_killed = !r->how || (r->kills == kills && missed);
    bool enough = all_killed && r->ticks >= live_ticks && r->pressed > live_ticks / 8;
    if ((enough || r->ticks >= 10 * live_ticks) && !r->fixture.loop.stop) {
        r->faulted = faults_of(r->tid) - r->faulted;
        r->fixture.loop.stop = true;
    }
    if (done) ev_break(loop, EVBREAK_ALL);
}

static void run_live(rig *r, const char *const *how)
{
    rig_open(r, how);
    bool locked = mlockall(MCL_CURRENT | MCL_FUTURE) == 0; // as kneadd does
    events = ev_default_loop(0);
    ev_async_init(&ticked, on_ticked);
    ticked.data = r;
    ev_async_start(events, &ticked);
    r->fixture.loop.notify = notify;
    r->fixture.loop.notify_arg = &ticked;
    kn_loop_start(&r->fixture.loop, kn_now_ns() + 20 * KN_PERIOD_NS);
    allocations = locks = calls = 0;
    finished = 0;
    live_ticks = wanted("KN_LIVE_TICKS", 4000);
    pthread_t thread;
    CHECK(pthread_create(&thread, NULL, servo_main, r) == 0);
    while (!finished && !r->fixture.loop.done) ev_run(events, EVRUN_ONCE);
    while (!finished) {
    }
    ev_async_stop(events, &ticked);
    munlockall();
    rig_drain(r);
    if (how) kn_board_end(&r->board);
    clear_directory(r->directory, true);
    if (finished < 0) SKIP("no seccomp here: %s", strerror(errno));
    if (calls != 0)
        KN_TEST_FAIL("%ld system calls that the tick must not make, the last one number %ld", (long)calls,
                     (long)last_call);
    printf("%lld live ticks, %lld pressing: %ld allocations, %ld locks, %ld other system calls, %ld page faults%s\n",
           (long long)r->ticks, (long long)r->pressed, (long)allocations, (long)locks, (long)calls, r->faulted,
           locked ? "" : ", memory not locked");
    CHECK(allocations == 0);
    CHECK(locks == 0);
    CHECK(r->faulted == 0 || !locked);
    CHECK(r->ticks >= live_ticks && r->pressed > live_ticks / 8);
}

TEST("a live servo thread calls the kernel only to sleep and to wake the main thread")
{
    static rig r;
    run_live(&r, NULL);
}

TEST("with a circuit in memory or behind a serial line, killed and restarted, the servo thread makes no other system "
     "calls, but that it reads, writes and waits for the line")
{
    static rig r[2];
    static char name[32], link[64];
    snprintf(name, sizeof name, "knead-trap-%d", (int)getpid());
    snprintf(link, sizeof link, "/tmp/%s", name);
    static const char *const how[][4] = {{"--bar", name, NULL}, {"--uart", "--link", link, NULL}};
    for (int i = 0; i < 2; i++) {
        kn_fpga_counts n;
        run_live(&r[i], how[i]);
        CHECK(kn_backend_fpga_counts(&r[i].fixture.backend, &n));
        printf("%lld ticks on the circuit, lost %lld times, loaded %lld\n", (long long)n.on_circuit,
               (long long)n.losses, (long long)n.loads);
        // The number of ticks on the circuit depends on the machine.
        CHECK(n.on_circuit > live_ticks / 20 && n.losses >= r[i].kills && n.different == 0);
        CHECK(r[i].kills > 0 && r[i].kills == live_ticks / 1500);
    }
}

// Press and lift without a clock, and ask for the state now and then.
static void *alone_main(void *arg)
{
    kn_backend *b = arg;
    if (!forbid_calls(false)) finished = -1;
    armed = true;
    for (int t = 0; t < 500 && !finished; t++) {
        kn_output output;
        kn_input input = {
            .probe[0] = {t % 100 > 20, {0, 0, 0.0305 - 1e-5 * (t % 100)}, {0, 0, 0}, {1, 0, 0, 0}, false}};
        b->submit(b->self, &input);
        b->wait(b->self, 0, &output);
        b->afterwards(b->self);
        if (t % 7 == 0) b->state(b->self);
    }
    armed = false;
    if (!finished) finished = 1;
    for (;;) clock_nanosleep(CLOCK_MONOTONIC, 0, &(struct timespec){.tv_sec = 1}, NULL);
    return NULL;
}

TEST("the servo thread makes no other calls for a circuit that computes alone either")
{
    static char name[32];
    static kn_backend b;
    snprintf(name, sizeof name, "knead-trap-%d", (int)getpid());
    const char *const how[] = {"--bar", name, NULL};
    kn_board board = kn_board_start(how);
    strcat(board.uri, "?miss=500&shadow=off&lost=go-on");
    kn_scene *scene = load_scene("dough-small.yaml", kn_fixed_set, KN_FIXED_SETS);
    kn_model *model = build(&scene->model);
    char why[KN_LINK_WHY] = "";
    bool device, placed = false;
    for (int tries = 0; !placed && tries < 20; tries++)
        placed = kn_backend_place(&b, model, board.uri, false, SIZE_MAX, why, &device);
    if (!placed) KN_TEST_FAIL("%s", why);
    allocations = locks = calls = 0;
    finished = 0;
    pthread_t thread;
    CHECK(placed && pthread_create(&thread, NULL, alone_main, &b) == 0);
    while (!finished) usleep(1000);
    kn_fpga_counts n;
    kn_backend_fpga_counts(&b, &n);
    kn_board_end(&board);
    if (finished < 0) SKIP("no seccomp here: %s", strerror(errno));
    printf("%lld ticks on the circuit: %ld allocations, %ld locks, %ld other system calls\n", (long long)n.on_circuit,
           (long)allocations, (long)locks, (long)calls);
    CHECK(n.on_circuit == 500 && n.losses == 0 && allocations == 0 && locks == 0 && calls == 0);
}

TESTS_MAIN
