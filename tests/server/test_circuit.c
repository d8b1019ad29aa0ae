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

typedef struct object { // on a board
    kn_board board;
    kn_scene *scene;
    kn_model *model;
    kn_backend backend;
    kn_input input;
    int64_t due_ns;
    int ticks;
} object;

static object make_of(const char *file, const char *const set[], int count, kn_board board)
{
    object o = {.board = board, .scene = load_scene(file, set, count)};
    o.model = build(&o.scene->model);
    return o;
}

static object make(const char *file, kn_board board)
{
    static const char *const set[] = {"solver.kind=fixed", "solver.precision=f64", "solver.passes=1",
                                      "solver.iterations=2"};
    return make_of(file, set, 4, board);
}

// Put the object on its board's circuit. `room`: bytes allowed for the queue. A busy machine may not answer at once, so
// this function tries up to twenty times. Return the seconds of the successful try, or -1 if refused.
static double attach_with(object *o, size_t room, char why[KN_LINK_WHY])
{
    bool device = true;
    for (int tries = 0; device && tries < 20; tries++) {
        const int64_t began_ns = kn_now_ns();
        if (kn_backend_place(&o->backend, o->model, o->board.uri, false, room, why, &device))
            return 1e-9 * (double)(kn_now_ns() - began_ns);
    }
    if (device || room == SIZE_MAX) fprintf(stderr, "%s\n", why), exit(1);
    return -1;
}

static double attach(object *o)
{
    char why[KN_LINK_WHY] = "";
    return attach_with(o, SIZE_MAX, why);
}

static void unmake(object *o)
{
    if (o->backend.destroy) o->backend.destroy(o->backend.self);
    kn_model_destroy(o->model);
    kn_scene_destroy(o->scene);
    kn_board_end(&o->board);
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
    AT_END(unmake) object o = make("dough-diagonals.yaml", start("3000000", NULL));
    char why[KN_LINK_WHY] = "";
    kn_fpga_counts n;
    const double load_s = attach(&o);
    CHECK(load_s > 1.024); // the smallest queue holds as many ticks as 1.024 s has
    for (int kill = 0; kill < 2; kill++) {
        int first = until_in_step(&o);
        CHECK(first >= 0);
        kn_board_kill(&o.board);
        o.board = start("3000000", NULL);
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
}

TEST("the queue is as long as a load takes, and a queue without enough memory is refused with its length")
{
    AT_END(unmake) object o = make("dough-diagonals.yaml", start("1000000", NULL));
    char why[KN_LINK_WHY] = "";
    kn_fpga_counts n;
    CHECK(attach_with(&o, 1 << 20, why) < 0 && strstr(why, "ticks") && strstr(why, "expected"));
    printf("     %s\n", why);
    attach(&o);
    CHECK(kn_backend_fpga_counts(&o.backend, &n));
    CHECK(n.load_ns > 1000000000 && n.queue >= 2048 && n.queue >= n.load_ns * 3 / 2000000);
}

TEST("a tool on more nodes than the circuit can list costs one loss and one load per press")
{
    enum { PRESSES = 4, TICKS = 400 };
    const char *const few[] = {"--uart", "--caps", "8,11,3", NULL};
    AT_END(unmake) object o = make("dough-small.yaml", kn_board_start(few));
    kn_fpga_counts n;
    strcat(o.board.uri, "?miss=500");
    attach(&o);
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
}

TEST("a circuit whose object differs from the twin's, or that cannot accept a state, gets its whole object again")
{
    char path[96], why[KN_LINK_WHY] = "";
    snprintf(path, sizeof path, "/dev/shm/knead-circuit-%d", (int)getpid());
    const char *const card[] = {"--bar", strrchr(path, '/') + 1, NULL};
    for (int state = 0; state < 2; state++) {
        AT_END(unmake) object o = make("dough-small.yaml", kn_board_start(card));
        kn_fpga_counts n = {0};
        kn_device_stats stats;
        strcat(o.board.uri, "?miss=500");
        attach(&o);
        int fd = open(path, O_RDWR), ticks = 0;
        for (; ticks < 20000 && !(state ? n.loads >= 2 && n.in_step : n.on_circuit >= 700); ticks++) {
            press(&o, 0.003);
            if (ticks > 400) kn_clock_sleep(kn_now_ns() + 200000); // leave the processor to the other processes
            kn_backend_fpga_counts(&o.backend, &n);
            if (ticks != 400) continue;
            // Change a number that a load of the state alone does not repair: the material of the circuit's edges, or
            // the number of edges, which the state's checksum notices.
            for (uint32_t e = 0; e < (state ? 1 : 400); e++) {
                off_t word = state ? KN_REG_EDGE_COUNT : (off_t)KN_WINDOW_EDGES + 8 * e + 1;
                CHECK(pwrite(fd, &(uint32_t){7}, 4, 4 * word) == 4);
            }
            o.backend.reset(o.backend.self);
        }
        printf("     %lld other numbers, loaded %lld times; on the circuit %lld ticks of %d\n", (long long)n.different,
               (long long)n.loads, (long long)n.on_circuit, ticks);
        if (state) CHECK(n.in_step && n.loads == 2 && n.because[KN_LOSS_LOAD] + n.because[KN_LOSS_BLANK] == 1);
        else CHECK(n.different >= 1 && n.different <= 3 && n.because[KN_LOSS_TWIN] >= 1 && n.loads <= 5);
        CHECK(state || n.on_circuit >= 700);
        CHECK(kn_backend_fpga_agrees(&o.backend, why, &stats));
        close(fd);
    }
}

// Run at 1 kHz until the circuit has come back that often from a loss for this reason. Measure the ms until it was in
// step again.
static void be_lost(const char *const board[], kn_loss reason, const char *what, int times)
{
    enum { MOST = 1000, PATIENCE = 60000 };
    static double lasted_ms[MOST];
    AT_END(unmake) object o = make("dough-small.yaml", kn_board_start(board));
    kn_fpga_counts n = {0};
    int64_t returned_ns, since_ns = 0, seen = 0, blamed = 0;
    if (reason != KN_LOSS_TIMEOUT) strcat(o.board.uri, "?miss=10"); // allows for a busy machine
    int back = 0;
    attach(&o);
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
}

TEST("a lost circuit of 144 nodes comes back after being unplugged, hung, or switched off and on")
{
    const int times = getenv("KN_LOSSES") ? atoi(getenv("KN_LOSSES")) : 5;
    char name[64], link[80];
    snprintf(name, sizeof name, "knead-lost-%d", (int)getpid());
    snprintf(link, sizeof link, "/tmp/%s", name);
    const struct {
        const char *what, *board[8];
        kn_loss reason;
        int times;
    } rows[] = {{"pty, unplugged", {"--uart", "--link", link, "--fault", "disconnect=0.003"}, KN_LOSS_REMOVED, times},
                {"shm, unplugged", {"--bar", name, "--fault", "disconnect=0.003"}, KN_LOSS_REMOVED, times},
                {"pty, hung", {"--uart", "--link", link, "--fault", "hang=0.003"}, KN_LOSS_TIMEOUT, times},
                {"shm, hung", {"--bar", name, "--fault", "hang=0.003"}, KN_LOSS_TIMEOUT, times},
                {"pty, off and on", {"--uart", "--link", link, "--fault", "blank=0.003"}, KN_LOSS_BLANK, times},
                {"shm, off and on", {"--bar", name, "--fault", "blank=0.003"}, KN_LOSS_BLANK, times},
                {"3 Mbaud, hung",
                 {"--uart", "--link", link, "--baud", "3000000", "--fault", "hang=0.001"},
                 KN_LOSS_TIMEOUT,
                 (times + 2) / 3}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
        be_lost(rows[i].board, rows[i].reason, rows[i].what, rows[i].times);
}

// ---- a circuit that computes alone

static const char *card_name(void)
{
    static char name[64];
    snprintf(name, sizeof name, "knead-alone-%d", (int)getpid());
    return name;
}

// An object of 48 nodes, which gives its ticks and states in time on a busy machine and with sanitizers, too.
static object make_alone(const char *how, const char *fault)
{
    const char *const card[] = {"--bar", card_name(), fault ? "--fault" : NULL, fault, NULL};
    static const char *const set[] = {"solver.kind=fixed", "solver.precision=f64", "object.size=[3 cm, 2 cm, 3 cm]"};
    object o = make_of("dough-small.yaml", set, 3, kn_board_start(card));
    strcat(o.board.uri, how);
    attach(&o);
    return o;
}

// Run a tick of both backends without a deadline: the plate goes down and up, ever deeper. Return whether the outputs
// are the same bits.
static bool tick_both(object *o, kn_backend *plain, kn_backend_status *status)
{
    kn_output mine, its;
    const double deepest_m = 0.002 * (1 + o->ticks / 200), part = (o->ticks % 200) / 200.0;
    const double depth_m = deepest_m * (part < 0.5 ? 2 * part : 0);
    o->ticks++;
    o->input.probe[0] = (kn_probe_input){true, {0, 0, 0.031 - depth_m}, {0, 0, 0}, {1, 0, 0, 0}, false};
    o->backend.submit(o->backend.self, &o->input);
    *status = o->backend.wait(o->backend.self, 0, &mine);
    plain->submit(plain->self, &o->input);
    plain->wait(plain->self, 0, &its);
    o->backend.afterwards(o->backend.self);
    return memcmp(&mine, &its, sizeof mine) == 0;
}

TEST("a circuit that computes alone gives the forces and the object that the processor gives, to the bit")
{
    static const char *const how[] = {"?miss=500&shadow=off", "?miss=500&shadow=checked&lost=go-on"};
    for (int i = 0; i < 2; i++) {
        AT_END(unmake) object o = make_alone(how[i], NULL);
        kn_backend plain;
        kn_backend_status status;
        kn_fpga_counts n;
        int same = 0, shapes = 0, states = 0, ok = 0;
        CHECK(kn_backend_cpu(&plain, o.model));
        for (int t = 0; t < 1000; t++) {
            same += tick_both(&o, &plain, &status);
            ok += status == KN_BACKEND_OK;
            const kn_state *shape = kn_backend_shape(&o.backend), *all = plain.state(plain.self);
            const size_t bytes = kn_model_field(o.model, 3) * sizeof(double);
            shapes += memcmp(shape->displacement, all->displacement, bytes) == 0;
            if (t % 37) continue;
            states += kn_state_hash(o.model, o.backend.state(o.backend.self)) == kn_state_hash(o.model, all);
        }
        kn_backend_fpga_counts(&o.backend, &n);
        printf("     %s: %d of 1000 forces, %d shapes and %d of 28 states are the same; %lld ticks on the circuit\n",
               how[i], same, shapes, states, (long long)n.on_circuit);
        for (int k = 0; k < KN_LOSS_COUNT; k++)
            if (n.because[k]) printf("     lost: %s\n", kn_loss_word((kn_loss)k));
        CHECK(same == 1000 && shapes == 1000 && states == 28 && ok == 1000);
        CHECK(n.on_circuit == 1000 && n.losses == 0 && n.different == 0 && n.loads == 2);
        plain.destroy(plain.self);
    }
}

TEST("a circuit that computes alone with other numbers is found within 50 ticks if it is checked")
{
    AT_END(unmake) object o = make_alone("?miss=500&shadow=checked&lost=go-on", NULL);
    char path[96];
    kn_fpga_counts n = {0};
    snprintf(path, sizeof path, "/dev/shm/%s", card_name());
    for (int t = 0; t < 60; t++) press(&o, 0.003);
    // another material, which the next load of the state takes up
    int fd = open(path, O_RDWR);
    for (uint32_t e = 0; e < 400; e++)
        CHECK(pwrite(fd, &(uint32_t){7}, 4, 4 * (KN_WINDOW_EDGES + 8 * (off_t)e + 1)) == 4);
    close(fd);
    o.backend.reset(o.backend.self);
    kn_backend_fpga_counts(&o.backend, &n);
    const int64_t before = n.on_circuit;
    for (int t = 0; t < 20000 && n.different == 0; t++) {
        press(&o, 0.003);
        kn_backend_fpga_counts(&o.backend, &n);
    }
    printf("     found after %lld ticks on the circuit\n", (long long)(n.on_circuit - before));
    CHECK(n.different == 1 && n.because[KN_LOSS_TWIN] == 1 && n.on_circuit <= before + 60);
}

TEST("a circuit that takes ticks which nobody asked for is lost, and gives no wrong force while it computes alone")
{
    AT_END(unmake) object o = make_alone("?miss=500&shadow=off&lost=go-on", "torn=0.01");
    kn_fpga_counts n = {0};
    kn_backend plain;
    kn_backend_status status;
    int wrong = 0;
    CHECK(kn_backend_cpu(&plain, o.model));
    for (int t = 0; t < 2000; t++) {
        const bool same = tick_both(&o, &plain, &status);
        wrong += !same && status != KN_BACKEND_LOST;
        // the object went back: so does the other one
        if (status == KN_BACKEND_LOST) plain.restore(plain.self, o.backend.state(o.backend.self));
    }
    kn_backend_fpga_counts(&o.backend, &n);
    printf("     lost %lld times, %lld of 2000 ticks on the circuit\n", (long long)n.losses, (long long)n.on_circuit);
    CHECK(wrong == 0 && n.losses > 3 && n.because[KN_LOSS_SEQ_GAP] == n.losses && n.different == 0);
    CHECK(n.on_circuit > 100);
    plain.destroy(plain.self);
}

TEST("a lost circuit that computed alone holds the force for two ticks and puts the object back to its last whole "
     "state, which stands still or goes on")
{
    static const char *const how[] = {"?miss=20&shadow=off", "?miss=20&shadow=off&lost=go-on"};
    for (int i = 0; i < 2; i++) {
        AT_END(unmake) object o = make_alone(how[i], NULL);
        const char *const card[] = {"--bar", card_name(), NULL};
        kn_backend_status status = KN_BACKEND_OK;
        kn_output held, output;
        kn_fpga_counts n;
        // press in time that the circuit has; its whole state is that of a known tick
        for (int t = 0; t < 20; t++) press(&o, 0.003);
        const uint64_t whole = kn_state_hash(o.model, o.backend.state(o.backend.self));
        for (int t = 0; t < 7; t++) press(&o, 0.003);
        CHECK(kn_backend_fpga_counts(&o.backend, &n) && n.losses == 0);
        o.backend.submit(o.backend.self, &o.input);
        o.backend.wait(o.backend.self, 0, &held);
        kn_board_kill(&o.board);
        int late = 0;
        for (; status != KN_BACKEND_LOST && late < 10; late++) {
            o.backend.submit(o.backend.self, &o.input);
            status = o.backend.wait(o.backend.self, kn_now_ns() + KN_PERIOD_NS, &output);
            CHECK(memcmp(&output, &held, sizeof held) == 0);
            CHECK(status == KN_BACKEND_LATE || status == KN_BACKEND_LOST);
            o.backend.afterwards(o.backend.self);
        }
        CHECK(late <= 3 && o.backend.back(o.backend.self) >= 8 && o.backend.back(o.backend.self) <= 11);
        CHECK(kn_state_hash(o.model, o.backend.state(o.backend.self)) == whole);
        press(&o, 0.003);
        const bool still = kn_state_hash(o.model, o.backend.state(o.backend.self)) == whole;
        CHECK(still == (i == 0) && o.backend.still(o.backend.self) == still);
        const int64_t before = o.backend.state(o.backend.self)->tick;
        o.board = kn_board_start(card);
        strcat(o.board.uri, how[i]);
        CHECK(until_in_step(&o) >= 0);
        CHECK(o.backend.state(o.backend.self)->tick > before && !o.backend.still(o.backend.self));
    }
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
    AT_END(unmake) object o = make("dough-small.yaml", start("3000000", "hang=1"));
    strcpy(strchr(o.board.uri, '?'), "?miss=500");
    attach(&o);
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
}

TESTS_MAIN
