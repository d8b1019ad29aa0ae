// A circuit in step with its twin, at 1 kHz, against knead-simdev: the purpose of the queue between them, and the
// deadline. KN_LOSSES=N: how often each fault makes the circuit lost (5).
// gate in release: a board in real time
#include "core/scene/scene.h"
#include "core/algebra/algebra.h"
#include "hdl/registers.h"
#include "server/backend/fpga.h"
#include "server/clock.h"
#include "tests/check.h"
#include "tests/server/board.h"
#include <fcntl.h>

static kn_board start(const char *baud, const char *fault)
{
    static char name[64];
    snprintf(name, sizeof name, "/tmp/knead-circuit-%d", (int)getpid());
    const char *const all[] = {"--uart", "--link", name, "--baud", baud, fault ? "--fault" : NULL, fault, NULL};
    kn_board b = kn_board_start(all);
    strcat(b.uri, "?miss=10"); // allows for a busy machine
    return b;
}

// Start a circuit in a card's memory, whose file is at `path`.
static kn_board start_card(char path[96])
{
    snprintf(path, 96, "/dev/shm/knead-circuit-%d", (int)getpid());
    const char *const all[] = {"--bar", strrchr(path, '/') + 1, NULL};
    kn_board b = kn_board_start(all);
    strcat(b.uri, "?miss=500");
    return b;
}

typedef struct object {
    kn_scene *scene;
    kn_model *model;
    kn_backend backend;
    kn_input input;
    int64_t due_ns;
    int ticks;
} object;

static object make(const char *file)
{
    static const char *const set[] = {"solver.kind=fixed", "solver.precision=f64", "solver.passes=1",
                                      "solver.iterations=2"};
    object o = {.scene = load_scene(file, set, 4)};
    o.model = build(&o.scene->model);
    return o;
}

// Put the object on the circuit at this address. `room`: bytes allowed for the queue. A busy machine may not answer
// at once, so this function tries up to twenty times. Return the seconds of the successful try, or -1 if refused.
static double attach_with(object *o, const char *uri, size_t room, char why[KN_LINK_WHY])
{
    bool device = true;
    for (int tries = 0; device && tries < 20; tries++) {
        const int64_t began_ns = kn_now_ns();
        if (kn_backend_fpga(&o->backend, o->model, uri, room, why, &device))
            return 1e-9 * (double)(kn_now_ns() - began_ns);
    }
    if (device) fprintf(stderr, "%s\n", why), exit(1);
    return -1;
}

static double attach(object *o, const char *uri)
{
    char why[KN_LINK_WHY] = "";
    const double took_s = attach_with(o, uri, SIZE_MAX, why);
    if (took_s < 0) fprintf(stderr, "%s\n", why), exit(1);
    return took_s;
}

static void unmake(object *o)
{
    if (o->backend.destroy) o->backend.destroy(o->backend.self);
    kn_model_destroy(o->model);
    kn_scene_destroy(o->scene);
}

// Sleep until the grid's next tick. Lost time is not made up for.
static void next(object *o, int64_t period_ns)
{
    int64_t now_ns = kn_now_ns();
    if (o->due_ns < now_ns - KN_PERIOD_NS) o->due_ns = now_ns;
    kn_clock_sleep(o->due_ns += period_ns);
}

// Run a tick. Return its status, and in *returned_ns the end of its wait.
static kn_backend_status tick(object *o, int64_t period_ns, int64_t *returned_ns)
{
    kn_output output;
    next(o, period_ns);
    double phase = 0.001 * o->ticks++; // the plate comes and goes; most of the time it is off the dough
    double depth = 0.001 * (phase - (int)phase < 0.1);
    o->input.probe[0] = (kn_probe_input){true, {0, 0, 0.031 - 2 * depth}, {0, 0, 0}, {1, 0, 0, 0}, false};
    o->backend.submit(o->backend.self, &o->input);
    kn_backend_status status = o->backend.wait(o->backend.self, o->due_ns + KN_PERIOD_NS, &output);
    *returned_ns = kn_now_ns();
    if (o->backend.afterwards) o->backend.afterwards(o->backend.self);
    return status;
}

// Run a tick without a deadline, with a plate pressed to this depth. No answer of the circuit is missed.
static void press(object *o, double depth_m)
{
    kn_output output;
    o->input.probe[0] = (kn_probe_input){true, {0, 0, 0.031 - depth_m}, {0, 0, 0}, {1, 0, 0, 0}, false};
    o->backend.submit(o->backend.self, &o->input);
    o->backend.wait(o->backend.self, 0, &output);
    if (o->backend.afterwards) o->backend.afterwards(o->backend.self);
}

// Run until the circuit has computed 50 ticks in step, whether by their deadlines or later. Return the number of
// ticks, or -1 if that never happens. Ticks come every millisecond for 4 s, in which a load has to arrive. After that
// they come every two, four, eight and sixteen milliseconds, so that a busy machine can catch up too.
static int until_in_step(object *o)
{
    const int64_t began_ns = kn_now_ns();
    int64_t returned_ns, lasted_s = 0;
    kn_fpga_counts c;
    int64_t out = 0; // ticks on the circuit up to the last one out of step
    for (int n = 0; lasted_s < 60; n++) {
        lasted_s = (kn_now_ns() - began_ns) / 1000000000;
        int64_t period_ns = (int64_t)KN_PERIOD_NS << (lasted_s < 16 ? lasted_s / 4 : 4);
        tick(o, period_ns, &returned_ns);
        kn_backend_fpga_counts(&o->backend, &c);
        if (n == 0 || !c.in_step) out = c.on_circuit;
        if (c.on_circuit >= out + 50) return n;
    }
    return -1;
}

TEST("a lattice that loads longer than a second over its line gets in step, also after each restart of the circuit")
{
    kn_board b = start("3000000", NULL);
    object o = make("dough.yaml");
    char why[KN_LINK_WHY] = "";
    kn_fpga_counts n;
    const double load_s = attach(&o, b.uri);
    CHECK(load_s > 1.024); // the smallest queue holds as many ticks as 1.024 s has
    for (int kill = 0; kill < 2; kill++) {
        int first = until_in_step(&o);
        CHECK(first >= 0);
        kn_board_kill(&b);
        b = start("3000000", NULL);
        int64_t returned_ns;
        for (int i = 0; i < 20; i++) tick(&o, KN_PERIOD_NS, &returned_ns);
        int again = until_in_step(&o);
        CHECK(again >= 0);
        CHECK(kn_backend_fpga_counts(&o.backend, &n));
        printf("     %d nodes, %.2f s to load, of that %.2f s the state: in step after %d ticks, started again after "
               "%d, queue of %lld\n",
               o.model->node_count, load_s, 1e-9 * (double)n.load_ns, first, again, (long long)n.queue);
    }
    CHECK(n.losses >= 2 && n.different == 0 && n.because[KN_LOSS_REMOVED] >= 2 && n.last != KN_LOSS_COUNT);
    CHECK(n.queue >= n.load_ns * 3 / 2000000);
    kn_device_stats stats;
    CHECK(kn_backend_fpga_agrees(&o.backend, why, &stats));
    unmake(&o);
    kn_board_end(&b);
}

TEST("the queue is as long as a load takes, and a queue without enough memory is refused with its length")
{
    kn_board b = start("1000000", NULL);
    object o = make("dough.yaml");
    char why[KN_LINK_WHY] = "";
    kn_fpga_counts n;
    CHECK(attach_with(&o, b.uri, 1 << 20, why) < 0 && strstr(why, "ticks") && strstr(why, "expected"));
    printf("     %s\n", why);
    attach(&o, b.uri);
    CHECK(kn_backend_fpga_counts(&o.backend, &n));
    CHECK(n.load_ns > 1000000000 && n.queue >= 2048 && n.queue >= n.load_ns * 3 / 2000000);
    unmake(&o);
    kn_board_end(&b);
}

TEST("a tool on more nodes than the circuit can list costs one loss and one load per press")
{
    enum { PRESSES = 4, TICKS = 400 };
    const char *const few[] = {"--uart", "--caps", "8,11,3", NULL};
    kn_board b = kn_board_start(few);
    object o = make("dough-small.yaml");
    kn_fpga_counts n;
    attach(&o, strcat(b.uri, "?miss=500"));
    for (int i = 0; i < PRESSES * TICKS; i++) {
        double deepest_m = 0.003 * (1 + i / TICKS); // deeper than the dent of the press before
        double depth_m = deepest_m * (i % TICKS < TICKS / 2) * fmin(1, 0.02 * (i % TICKS));
        press(&o, depth_m);
        if (i % TICKS == TICKS - 1) kn_clock_sleep(kn_now_ns() + 100000000); // time to get in step again
    }
    CHECK(kn_backend_fpga_counts(&o.backend, &n));
    printf("     %d presses: lost %lld times, loaded %lld, %lld ticks of %d on the circuit\n", PRESSES,
           (long long)n.losses, (long long)n.loads, (long long)n.on_circuit, PRESSES * TICKS);
    CHECK(n.because[KN_LOSS_BOUNDS] == PRESSES && n.losses == PRESSES && n.different == 0);
    CHECK(n.loads == PRESSES + 1 || n.loads == PRESSES); // the load after the last press may be under way
    CHECK(n.on_circuit > TICKS);
    unmake(&o);
    kn_board_end(&b);
}

TEST("a circuit whose object differs from the twin's gets the whole object again")
{
    char path[96], why[KN_LINK_WHY] = "";
    kn_board b = start_card(path);
    object o = make("dough-small.yaml");
    kn_fpga_counts n;
    attach(&o, b.uri);
    int fd = open(path, O_RDWR), ticks = 0;
    for (n.on_circuit = 0; n.on_circuit < 700 && ticks < 20000; ticks++) {
        const int i = ticks;
        press(&o, 0.003);
        if (i == 400) o.backend.reset(o.backend.self);
        if (i == 400) // change the material of the circuit's edges; a load of the state alone does not repair that
            for (uint32_t e = 0; e < 400; e++)
                CHECK(pwrite(fd, &(uint32_t){7}, 4, 4 * ((off_t)KN_WINDOW_EDGES + 8 * e + 1)) == 4);
        if (i > 400) kn_clock_sleep(kn_now_ns() + 200000); // leave the processor to the other processes
        kn_backend_fpga_counts(&o.backend, &n);
    }
    printf("     %lld other numbers, loaded %lld times; on the circuit %lld ticks of %d\n", (long long)n.different,
           (long long)n.loads, (long long)n.on_circuit, ticks);
    CHECK(n.different >= 1 && n.because[KN_LOSS_TWIN] >= 1);
    CHECK(n.different <= 3 && n.loads <= 5);
    CHECK(n.on_circuit >= 700);
    kn_device_stats stats;
    CHECK(kn_backend_fpga_agrees(&o.backend, why, &stats));
    close(fd);
    unmake(&o);
    kn_board_end(&b);
}

// Run at 1 kHz until the circuit has come back that often from a loss for this reason. Measure the ms until it was in
// step again.
static void be_lost(const char *const board[], kn_loss reason, const char *what, int times)
{
    enum { MOST = 1000, PATIENCE = 60000 };
    static double lasted_ms[MOST];
    kn_board b = kn_board_start(board);
    object o = make("dough-small.yaml");
    kn_fpga_counts n = {0};
    int64_t returned_ns, since_ns = 0, seen = 0, blamed = 0;
    if (reason != KN_LOSS_TIMEOUT) strcat(b.uri, "?miss=10"); // allows for a busy machine
    int back = 0;
    attach(&o, b.uri);
    while (back < times && back < MOST && o.ticks < PATIENCE) {
        tick(&o, KN_PERIOD_NS, &returned_ns);
        kn_backend_fpga_counts(&o.backend, &n);
        if (n.losses > seen && n.because[reason] > blamed && since_ns == 0) since_ns = returned_ns;
        seen = n.losses;
        blamed = n.because[reason];
        if (!n.in_step || since_ns == 0) continue;
        lasted_ms[back++] = 1e-6 * (double)(returned_ns - since_ns);
        since_ns = 0;
    }
    CHECK(back == times && n.because[reason] >= times && n.different == 0);
    qsort(lasted_ms, (size_t)back, sizeof *lasted_ms, kn_ascending);
    printf("     %-20s lost %d times in %d ticks", what, back, o.ticks);
    if (back)
        printf(": in step again after p50 %.0f, p90 %.0f, at most %.0f ms; its state takes %.1f ms",
               lasted_ms[back / 2], lasted_ms[back * 9 / 10], lasted_ms[back - 1], 1e-6 * (double)n.load_ns);
    putchar('\n');
    unmake(&o);
    kn_board_end(&b);
}

TEST("a lost circuit of 144 nodes comes back after being unplugged, hung, or switched off and on")
{
    const int times = getenv("KN_LOSSES") ? atoi(getenv("KN_LOSSES")) : 5;
    static const char *const fault[] = {"disconnect=0.003", "hang=0.003", "blank=0.003"};
    static const kn_loss reason[] = {KN_LOSS_REMOVED, KN_LOSS_TIMEOUT, KN_LOSS_BLANK};
    char name[64], link[80], what[64];
    snprintf(name, sizeof name, "knead-lost-%d", (int)getpid());
    snprintf(link, sizeof link, "/tmp/%s", name);
    for (int i = 0; i < 3; i++) {
        const char *const by_line[] = {"--uart", "--link", link, "--fault", fault[i], NULL};
        const char *const by_memory[] = {"--bar", name, "--fault", fault[i], NULL};
        snprintf(what, sizeof what, "pty, %s", fault[i]);
        be_lost(by_line, reason[i], what, times);
        snprintf(what, sizeof what, "shm, %s", fault[i]);
        be_lost(by_memory, reason[i], what, times);
    }
    const char *const slowly[] = {"--uart", "--link", link, "--baud", "3000000", "--fault", "hang=0.001", NULL};
    be_lost(slowly, KN_LOSS_TIMEOUT, "3 Mbaud, hang=0.001", (times + 2) / 3);
}

TEST("a circuit that cannot accept a state gets its whole object again")
{
    char path[96], why[KN_LINK_WHY] = "";
    kn_board b = start_card(path);
    object o = make("dough-small.yaml");
    kn_fpga_counts n = {0};
    attach(&o, b.uri);
    for (int i = 0; i < 100; i++) press(&o, 0.003);
    // change a setting that a load of the state alone does not restore, and that the state's checksum notices
    int fd = open(path, O_RDWR);
    CHECK(pwrite(fd, &(uint32_t){7}, 4, 4 * (off_t)KN_REG_EDGE_COUNT) == 4);
    o.backend.reset(o.backend.self);
    for (int i = 0; i < 20000 && (n.loads < 2 || !n.in_step); i++) {
        press(&o, 0.003);
        kn_clock_sleep(kn_now_ns() + 200000);
        kn_backend_fpga_counts(&o.backend, &n);
    }
    CHECK(n.in_step && n.loads == 2 && n.because[KN_LOSS_LOAD] + n.because[KN_LOSS_BLANK] == 1);
    kn_device_stats stats;
    CHECK(kn_backend_fpga_agrees(&o.backend, why, &stats));
    close(fd);
    unmake(&o);
    kn_board_end(&b);
}

// Run the next tick on a backend without a circuit, then sleep until the end of the wait for a circuit. The result
// shows the machine's own lateness. Return the time of the end.
static int64_t step_and_sleep(object *o, kn_backend *plain)
{
    kn_output output;
    next(o, KN_PERIOD_NS);
    plain->submit(plain->self, &o->input);
    plain->wait(plain->self, o->due_ns + KN_PERIOD_NS, &output);
    kn_clock_sleep(o->due_ns + 6 * KN_PERIOD_NS / 10);
    return kn_now_ns();
}

TEST("a circuit that hangs costs no tick its deadline: the wait ends about when a sleep until then would")
{
    enum { TICKS = 1000 };
    kn_board b = start("3000000", "hang=1");
    object o = make("dough-small.yaml");
    char uri[160];
    snprintf(uri, sizeof uri, "%.*s?miss=500", (int)strcspn(b.uri, "?"), b.uri);
    attach(&o, uri);
    kn_backend plain;
    CHECK(kn_backend_cpu(&plain, o.model));
    int waited = 0, slept = 0, early = 0;
    for (int i = 0; i < TICKS; i++) {
        int64_t returned_ns;
        bool shadowed = tick(&o, KN_PERIOD_NS, &returned_ns) == KN_BACKEND_SHADOWED;
        waited += returned_ns > o.due_ns + KN_PERIOD_NS;
        early += shadowed && returned_ns < o.due_ns + KN_PERIOD_NS / 2;
        slept += step_and_sleep(&o, &plain) > o.due_ns + KN_PERIOD_NS;
    }
    plain.destroy(plain.self);
    kn_fpga_counts n;
    CHECK(kn_backend_fpga_counts(&o.backend, &n));
    printf("     %d ticks, %lld of them without an answer: %d ended late, %d of as many with a sleep\n", TICKS,
           (long long)n.shadowed, waited, slept);
    CHECK(n.shadowed > TICKS / 2);
    CHECK(early < TICKS / 10); // the wait lasted as long as it should
    CHECK(waited <= 2 * slept + TICKS / 20);
    unmake(&o);
    kn_board_end(&b);
}

TESTS_MAIN
