// The driver of a circuit against knead-simdev, a process of its own, over a pseudo-terminal and shared memory.
//     KN_TICKS=N   ticks of each comparison (1000)        KN_KILLS=N   how often the device is killed in a run (4)
//     KN_ENGINE=rtl   the circuit itself steps, under Verilator, at its own speed
// a program of its own: hdl/test_device.sh runs it on the circuit itself
#include "server/backend/circuit_device.h"
#include "hdl/registers.h"
#include "server/clock.h"
#include "tests/core/rig.h"
#include "tests/server/board.h"
#include "tests/words.h"

static int64_t after_ms(int64_t ms) { return kn_now_ns() + 1000000 * ms; }

static int wanted(const char *name, int otherwise) { return getenv(name) ? atoi(getenv(name)) : otherwise; }

static const char *engine(void) { return getenv("KN_ENGINE") ? getenv("KN_ENGINE") : "golden"; }

static bool golden(void) { return strcmp(engine(), "golden") == 0; }

enum { NODES = 60, EDGES = 400 };

// ---- the simulated device

static kn_board start(const char *const arguments[])
{
    const char *all[16] = {"--engine", engine()};
    for (int i = 0; arguments[i]; i++) all[i + 2] = arguments[i];
    return kn_board_start(all);
}

// line: the device's last line, which tells its faults
static void stop(kn_board *b, int signal, char line[256])
{
    int status = 0;
    kill(b->pid, signal);
    if (!fgets(line, 256, b->out)) line[0] = 0;
    waitpid(b->pid, &status, 0);
    if (signal == SIGTERM) CHECK(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    fclose(b->out);
}

static char name_of_link[64], name_of_bar[64];

static kn_board start_on(bool bar, const char *faults, const char *seed)
{
    snprintf(name_of_link, sizeof name_of_link, "/tmp/knead-test-%d", (int)getpid());
    snprintf(name_of_bar, sizeof name_of_bar, "knead-test-%d", (int)getpid());
    const char *const on_bar[] = {"--bar", name_of_bar, "--seed", seed, faults ? "--fault" : NULL, faults, NULL};
    const char *const on_uart[] = {"--uart", "--link", name_of_link, "--seed", seed, faults ? "--fault" : NULL,
                                   faults,   NULL};
    return start(bar ? on_bar : on_uart);
}

static kn_device *open_patient(const kn_board *b, double miss_ms)
{
    char uri[192], why[KN_LINK_WHY] = "";
    snprintf(uri, sizeof uri, "%s?miss=%g", b->uri, golden() ? miss_ms : 40 * miss_ms);
    kn_device *d = kn_device_open(uri, why);
    if (!d) KN_TEST_FAIL("%s", why);
    return d;
}

// ---- a device with its object

typedef struct lab {
    kn_board board;
    kn_device *device;
    rig *r; // the twin
    uint64_t seed;
    kn_device_result result;
} lab;

static lab lab_open(kn_board board, double miss_ms, int nodes, int edges)
{
    return (lab){.board = board, .device = open_patient(&board, miss_ms), .r = make(nodes, edges, 5), .seed = 9};
}

static void lab_close(lab *l)
{
    char line[256];
    kn_device_close(l->device);
    unmake(l->r);
    if (l->board.pid) stop(&l->board, SIGTERM, line);
}

static kn_link_status identify(lab *l) { return kn_device_identify(l->device, after_ms(5000)); }
static kn_link_status load(lab *l) { return kn_device_load(l->device, &l->r->image, &l->r->fixed, after_ms(5000)); }

// Move the nodes, and run a tick of device and twin with so many bounds. Return whether they agree.
static bool both(lab *l, int count)
{
    rig *r = l->r;
    move_all(r, &l->seed, 1 << 12);
    tick(r, count);
    return kn_device_submit(l->device, r->bound, count) == KN_LINK_OK &&
           kn_device_wait(l->device, after_ms(5000), &l->result) == KN_LINK_OK && l->result.count == count &&
           l->result.residual == r->result.residual &&
           memcmp(l->result.reaction, r->reaction, (size_t)count * sizeof *r->reaction) == 0;
}

// ---- a device and its twin, through losses

typedef struct pair {
    kn_board board;
    kn_device *device;
    rig *before, *after; // the twin before the tick under way, and after that tick
    uint64_t seed;
    int count;
    int taken, loaded; // results received; loads of the whole state
} pair;

static pair begin(kn_board board, double miss_ms, uint64_t seed)
{
    return (pair){.board = board,
                  .device = open_patient(&board, miss_ms),
                  .before = make(NODES, EDGES, seed),
                  .after = make(NODES, EDGES, seed),
                  .seed = seed};
}

static void end(pair *p, char line[256])
{
    kn_device_close(p->device);
    unmake(p->before);
    unmake(p->after);
    stop(&p->board, SIGTERM, line);
}

static void copy(rig *to, const rig *from)
{
    memcpy(to->memory, from->memory, kn_fixed_bytes(&from->image));
    to->fixed.flags = from->fixed.flags;
}

// Hold or push random nodes, each of them once, and compute the twin's tick.
static void choose(pair *p)
{
    kn_fixed_bound *b = p->after->bound;
    move_all(p->after, &p->seed, 1 << 14);
    for (int i = NODES - 1; i > 0; i--) {
        int j = within(&p->seed, 0, i);
        uint16_t node = b[i].node;
        b[i].node = b[j].node;
        b[j].node = node;
        b[i].holds = within(&p->seed, 0, 3) > 0;
    }
    p->count = within(&p->seed, 0, 4) ? within(&p->seed, 0, 8) : within(&p->seed, 0, NODES);
}

static void twin(pair *p)
{
    copy(p->after, p->before);
    tick(p->after, p->count);
}

// Bring the device to IDENTIFIED and SYNCED again, with the state before the tick under way.
static void recover(pair *p)
{
    for (int64_t until = after_ms(20000); kn_now_ns() < until;) {
        if (kn_device_identify(p->device, after_ms(5000)) != KN_LINK_OK) {
            usleep(1000);
            continue;
        }
        if (kn_device_load(p->device, &p->before->image, &p->before->fixed, after_ms(5000)) != KN_LINK_OK) continue;
        p->loaded++;
        p->before->fixed.flags = 0;
        return;
    }
    KN_TEST_FAIL("not recovered: %s", kn_device_why(p->device));
    exit(1);
}

static bool same(const pair *p, const kn_device_result *r)
{
    bool equal = r->residual == p->after->result.residual && r->flags == p->after->result.flags && r->count == p->count;
    return equal && memcmp(r->reaction, p->after->reaction, (size_t)p->count * sizeof *r->reaction) == 0;
}

// Run one tick of the device and of the twin. Every result received must equal the twin's, and so must the
// displacements.
static void step(pair *p)
{
    kn_device_result result;
    int32_t moves[3 * NODES];
    choose(p);
    for (bool over = false; !over;) {
        twin(p);
        kn_link_status status = KN_LINK_PROTOCOL;
        if (kn_device_state_of(p->device) == KN_DEVICE_SYNCED &&
            (status = kn_device_submit(p->device, p->after->bound, p->count)) == KN_LINK_OK) {
            do status = kn_device_wait(p->device, after_ms(1), &result);
            while (status == KN_LINK_LATE);
        }
        if (status == KN_LINK_OK) {
            p->taken++;
            CHECK(same(p, &result));
            do status = kn_device_moves(p->device, moves, after_ms(1));
            while (status == KN_LINK_LATE);
        }
        over = status == KN_LINK_OK;
        if (over) {
            CHECK(memcmp(moves, p->after->fixed.u, sizeof moves) == 0);
            continue;
        }
        CHECK(kn_device_state_of(p->device) != KN_DEVICE_SYNCED && *kn_device_why(p->device));
        CHECK(kn_device_loss(p->device) < KN_LOSS_COUNT);
        recover(p);
    }
    copy(p->before, p->after);
}

static void check_states(pair *p)
{
    uint32_t crc = 0;
    OWN(rig) *read = make(NODES, EDGES, 1);
    while (kn_device_crc(p->device, after_ms(5000), &crc) != KN_LINK_OK) recover(p);
    CHECK(crc == kn_fixed_crc(&p->before->fixed));
    while (kn_device_read(p->device, &read->fixed, after_ms(5000)) != KN_LINK_OK) recover(p);
    CHECK(kn_fixed_crc(&read->fixed) == crc);
}

// ---- tests

TEST("an invalid URI is refused in one line that says what was expected")
{
    static const char wrong[] =
        "|uart|uart:|uart:ttyUSB0|uart:/dev/ttyUSB0?baud=|uart:/dev/ttyUSB0?baud|uart:/dev/ttyUSB0?baud=3000001|uart:/"
        "dev/ttyUSB0?baud=4097|"
        "uart:/dev/ttyUSB0?speed=9600|uart:/dev/ttyUSB0?baud=9600x|pty:/dev/pts/1?baud=9600|pty:/dev/pts/1?miss=0|"
        "pcie:01:00.0|pcie:0000:01:00.0/../"
        "x|pcie:0000:01:00.g|shm:|shm:x?shadow=on|shm:x?lost=go-on|shm:x?shadow=full&lost=stop|shm:x?shadow=off&shadow="
        "off|shm:../etc/passwd|shm:a/b|shm:.|usb:1|golden:";
    static const char *const absent[][2] = {{"shm:knead-test-none", "No such file"},
                                            {"pty:/dev/null", "expected a serial line"},
                                            {"pty:/dev/pts/none", "No such file"}};
    char why[KN_LINK_WHY], longest[400] = "shm:";
    kn_link link = {0};
    for (int i = 0; word_of(wrong, i); i++) {
        CHECK(!kn_link_open(&link, word_of(wrong, i), "/sys", why) && strstr(why, "expected ") && !strchr(why, '\n'));
        CHECK(!kn_link_is_uri(word_of(wrong, i), why) && strstr(why, "expected ") && !strchr(why, '\n'));
    }
    for (int i = 0; i < 3; i++) {
        CHECK(kn_link_is_uri(absent[i][0], why));
        CHECK(!kn_link_open(&link, absent[i][0], "/sys", why) && strstr(why, absent[i][1]));
    }
    memset(longest + 4, 'a', sizeof longest - 5);
    CHECK(!kn_link_open(&link, longest, "/sys", why) && strstr(why, "expected "));
    CHECK(kn_link_is_uri("pcie:0000:01:00.0?miss=2", why));
}

TEST("a circuit is identified by one program at a time, and an unsuitable object is refused with the reason")
{
    for (int bar = 0; bar < 2; bar++) {
        char why[KN_LINK_WHY];
        AT_END(lab_close) lab l = lab_open(start_on(bar, NULL, "1"), 50, NODES, EDGES);
        kn_link second = {0};
        CHECK(!kn_link_open(&second, l.board.uri, "/sys", why) && strstr(why, "in use by another program"));
        CHECK(kn_device_state_of(l.device) == KN_DEVICE_CLOSED && load(&l) == KN_LINK_PROTOCOL);
        CHECK(identify(&l) == KN_LINK_OK && kn_device_state_of(l.device) == KN_DEVICE_IDENTIFIED);
        const kn_device_caps *caps = kn_device_caps_of(l.device);
        CHECK(caps->nodes == (golden() ? 4096 : 1024));
        CHECK(caps->edges == (golden() ? 65536 : 16384) && caps->bounds == 1023);
        CHECK(kn_device_submit(l.device, l.r->bound, 0) == KN_LINK_PROTOCOL);
        l.r->image.config.passes = 99;
        CHECK(load(&l) == KN_LINK_PROTOCOL && strstr(kn_device_why(l.device), "passes outside 1..15"));
        l.r->image.config.passes = 2;
        CHECK(load(&l) == KN_LINK_OK && kn_device_state_of(l.device) == KN_DEVICE_SYNCED);
        CHECK(kn_device_submit(l.device, l.r->bound, 1024) == KN_LINK_PROTOCOL);
        CHECK(kn_device_state_of(l.device) == KN_DEVICE_SYNCED);
    }
    if (!golden()) return;
    const char *const small[] = {"--uart", "--caps", "5,6,3", NULL};
    AT_END(lab_close) lab l = lab_open(start(small), 50, NODES, EDGES);
    CHECK(identify(&l) == KN_LINK_OK && kn_device_caps_of(l.device)->bounds == 7);
    CHECK(load(&l) == KN_LINK_PROTOCOL);
    CHECK(strstr(kn_device_why(l.device), "60 nodes and 400 edges: expected at most 32 and 64"));
}

TEST("a link name that now points to another line is looked up again when the old line is silent")
{
    char mute[64];
    snprintf(name_of_link, sizeof name_of_link, "/tmp/knead-test-%d", (int)getpid());
    int nobody = posix_openpt(O_RDWR | O_NOCTTY);
    CHECK(nobody >= 0 && grantpt(nobody) == 0 && unlockpt(nobody) == 0 && ptsname_r(nobody, mute, sizeof mute) == 0);
    CHECK(symlink(mute, name_of_link) == 0);
    kn_board b = {.uri = "pty:"};
    strcat(b.uri, name_of_link);
    AT_END(lab_close) lab l = lab_open(b, 1, NODES, EDGES);
    CHECK(identify(&l) == KN_LINK_IO && kn_device_loss(l.device) == KN_LOSS_TIMEOUT);
    CHECK(identify(&l) == KN_LINK_IO); // the second try is silent as well
    unlink(name_of_link);
    CHECK(identify(&l) == KN_LINK_GONE && kn_device_loss(l.device) == KN_LOSS_REMOVED);
    l.board = start_on(false, NULL, "1");
    kn_link_status status = KN_LINK_GONE; // a late answer is asked for again
    for (int64_t until = after_ms(5000); status != KN_LINK_OK && kn_now_ns() < until; usleep(1000))
        status = identify(&l);
    CHECK(status == KN_LINK_OK);
    close(nobody);
}

TEST("a list of bounds of any length is sent and its reactions return, in any number of frames")
{
    static const int counts[] = {0, 1, 40, 41, 42, 59, 60, 61, 62, 83, 84, 123, 124, 125, 250, 255};
    for (int bar = 0; bar < 2; bar++) {
        const char *fault = !bar && golden() ? "flip=0.02,drop=0.02" : NULL;
        AT_END(lab_close) lab l = lab_open(start_on(bar, fault, "3"), 100, 300, 900);
        CHECK(identify(&l) == KN_LINK_OK && load(&l) == KN_LINK_OK);
        for (size_t i = 0; i < sizeof counts / sizeof *counts; i++)
            CHECK(both(&l, counts[i]) && l.result.tick == i + 1);
    }
}

TEST("after an interrupted load the device is not taken for loaded, even if the data under its checksum arrived")
{
    AT_END(lab_close) lab l = lab_open(start_on(false, NULL, "1"), 100, NODES, EDGES);
    int broken_off = 0;
    CHECK(identify(&l) == KN_LINK_OK && load(&l) == KN_LINK_OK);
    for (int slices = 1; slices < 60 && kn_device_state_of(l.device) != KN_DEVICE_LOST; slices++) {
        // another material; the state at rest is the same
        for (int e = 0; e < EDGES; e++) l.r->image.edge[e].kv ^= 0xffff;
        kn_link_status status = KN_LINK_LATE;
        for (int i = 0; i < slices && status == KN_LINK_LATE; i++) {
            status = kn_device_load(l.device, &l.r->image, &l.r->fixed, 0);
            usleep(200);
        }
        if (status == KN_LINK_OK) break;
        broken_off++;
        CHECK(identify(&l) == KN_LINK_OK);
        CHECK(kn_device_submit(l.device, l.r->bound, 0) == KN_LINK_PROTOCOL);
        CHECK(load(&l) == KN_LINK_OK && both(&l, 10));
        kn_fixed_rest(&l.r->fixed);
    }
    CHECK(broken_off > 5);
}

TEST("a step is executed once, however often it is requested, and stays pending after a timeout")
{
    char line[256];
    pair p = begin(start_on(false, "hang=1", "1"), 200, 3);
    kn_device_result result;
    kn_device_stats stats;
    recover(&p);
    choose(&p);
    twin(&p);
    CHECK(kn_device_submit(p.device, p.after->bound, p.count) == KN_LINK_OK);
    CHECK(kn_device_submit(p.device, p.after->bound, p.count) == KN_LINK_LATE);
    CHECK(kn_device_wait(p.device, after_ms(1), &result) == KN_LINK_LATE);
    CHECK(kn_device_wait(p.device, after_ms(2000), &result) == KN_LINK_OK && same(&p, &result));
    kn_device_stats_of(p.device, &stats);
    CHECK(stats.steps == 1);
    end(&p, line);
}

TEST("every tick equals the twin's, to the bit. Under every fault of link or device no wrong result is accepted, and "
     "the device recovers")
{
    static const struct {
        const char *fault, *at;
        bool bar;
    } runs[] = {{NULL, "", false},
                {NULL, "", true},
                {"flip=0.02", "flip", false},
                {"drop=0.02", "drop", false},
                {"duplicate=0.02", "duplicate", false},
                {"truncate=0.02", "truncate", false},
                {"delay=0.02", "delay", false},
                {"delay=0.02", "delay", true},
                {"hang=0.01", "hang", false},
                {"hang=0.01", "hang", true},
                {"disconnect=0.01", "disconnect", false},
                {"disconnect=0.01", "disconnect", true},
                {"blank=0.01", "blank", false},
                {"blank=0.01", "blank", true},
                {"torn=0.02", "torn", false},
                {"torn=0.02", "torn", true},
                {"refuse=0.02", "refuse", false},
                {"flip=0.01,drop=0.01,duplicate=0.01,truncate=0.01,delay=0.005,hang=0.002,disconnect=0.002,blank=0.002,"
                 "torn=0.005",
                 "", false}};
    for (size_t i = 0; i < sizeof runs / sizeof *runs; i++) {
        char line[256], seed[16];
        const char *fault = runs[i].fault;
        if (!golden() && fault && strstr(fault, "torn")) continue; // the real circuit steps only when asked
        snprintf(seed, sizeof seed, "%zu", i + 1);
        pair p = begin(start_on(runs[i].bar, fault, seed), !fault ? 1000 : runs[i].bar ? 1.6 : 3, 100 + i);
        kn_device_stats stats;
        recover(&p);
        int ticks = wanted("KN_TICKS", 1000) / (fault ? 2 : 1);
        for (int t = 1; t <= ticks; t++) {
            step(&p);
            if (t == ticks || (!fault && t % 100 == 0)) check_states(&p);
        }
        kn_device_stats_of(p.device, &stats);
        CHECK(p.taken >= ticks && stats.steps == p.taken);
        if (!fault) CHECK(stats.lost + stats.link.crc + stats.link.coding == 0 && p.loaded == 1 && p.taken == ticks);
        end(&p, line);
        bool struck = strstr(line, runs[i].at), waited = strcmp(runs[i].at, "delay") == 0 || !golden();
        CHECK(struck || !golden()); // the real circuit's ticks are slow and few
        CHECK(!fault || !struck || waited || stats.retries + stats.lost + stats.link.stray > 0);
        line[strcspn(line, "\n")] = 0;
        printf("     %-4s %s: %d results in %.1f us (p50), %d loaded; %lld sent again, %lld crc, "
               "%lld coding, %lld stray, %lld lost\n",
               runs[i].bar ? "shm" : "pty", line, p.taken, 1e-3 * (double)stats.p50_ns, p.loaded,
               (long long)stats.retries, (long long)stats.link.crc, (long long)stats.link.coding,
               (long long)stats.link.stray, (long long)stats.lost);
    }
}

TEST("a device killed during a run and restarted is loaded again and continues with the same bits")
{
    for (int bar = 0; bar < 2; bar++) {
        char line[256];
        pair p = begin(start_on(bar, NULL, "1"), 1.6, 17);
        int kills = wanted("KN_KILLS", 4), ticks = 0;
        recover(&p);
        int loads = p.loaded;
        for (int i = 0; i <= kills; i++) {
            for (int more = i < kills ? within(&p.seed, 1, 60) : 50; more > 0; more--, ticks++) step(&p);
            if (i == kills) break;
            choose(&p);
            twin(&p);
            if (kn_device_state_of(p.device) == KN_DEVICE_SYNCED && i % 2)
                kn_device_submit(p.device, p.after->bound, p.count);
            stop(&p.board, SIGKILL, line);
            p.board = start_on(bar, NULL, "1");
            recover(&p);
        }
        check_states(&p);
        CHECK(p.loaded - loads >= kills);
        printf("     %-4s %d kills, %d ticks, %d loads\n", bar ? "shm" : "pty", kills, ticks, p.loaded);
        end(&p, line);
    }
}

TEST("every loss has a named reason, and a circuit with other number formats is refused")
{
    static const struct {
        const char *fault;
        bool bar;
        kn_loss loss;
    } runs[] = {{"hash", false, KN_LOSS_WRONG_HASH},      {"hash", true, KN_LOSS_WRONG_HASH},
                {NULL, false, KN_LOSS_REMOVED},           {NULL, true, KN_LOSS_TIMEOUT},
                {"hang=1", false, KN_LOSS_TIMEOUT},       {"blank=1", false, KN_LOSS_BLANK},
                {"torn=1", false, KN_LOSS_SEQ_GAP},       {"refuse=1", false, KN_LOSS_REFUSED},
                {"disconnect=1", false, KN_LOSS_REMOVED}, {"disconnect=1", true, KN_LOSS_REMOVED}};
    for (size_t i = 0; i < sizeof runs / sizeof *runs && (golden() || i < 2); i++) {
        AT_END(lab_close)
        lab l = lab_open(start_on(runs[i].bar, runs[i].fault, "1"), runs[i].loss == KN_LOSS_TIMEOUT ? 2 : 100, NODES,
                         EDGES);
        CHECK_STR(kn_loss_word(kn_device_loss(l.device)), "none");
        bool ready = identify(&l) == KN_LINK_OK && load(&l) == KN_LINK_OK;
        if (!runs[i].fault) kn_board_kill(&l.board), l.board.pid = 0;
        CHECK(!ready || !both(&l, 20));
        CHECK_STR(kn_loss_word(kn_device_loss(l.device)), kn_loss_word(runs[i].loss));
        if (runs[i].loss != KN_LOSS_WRONG_HASH) continue;
        CHECK(kn_device_state_of(l.device) == KN_DEVICE_CLOSED && strstr(kn_device_why(l.device), "BUILD_HASH is 0x"));
    }
}

// ---- without a board

// Run a command of the shell on a folder.
static void run(const char *command, const char *folder)
{
    char line[400];
    snprintf(line, sizeof line, command, folder);
    CHECK(system(line) == 0);
}

// Send a request and wait for its reply, at most so long.
static kn_link_status ask(kn_link *link, const kn_request *r, int64_t ms, kn_reply *reply)
{
    CHECK(link->submit(link->self, r) == KN_LINK_OK);
    return link->wait(link->self, after_ms(ms), reply);
}

TEST("a serial line is opened by name with its speed and a short latency timer, and carries the frames")
{
    char line[256], why[KN_LINK_WHY], uri[160], real[4096] = "", path[400], text[8] = "";
    char sysfs[] = "/tmp/knead-sysfs-XXXXXX";
    kn_board b = start_on(false, NULL, "1");
    CHECK(mkdtemp(sysfs) && realpath(b.uri + 4, real));
    snprintf(path, sizeof path, "%s/class/tty/%s/device/latency_timer", sysfs, strrchr(real, '/') + 1);
    run("f=%s; mkdir -p ${f%%/*} && echo 7 >$f", path);
    snprintf(uri, sizeof uri, "uart:%.100s?baud=921600", real);
    kn_link link = {0};
    CHECK(kn_link_open(&link, uri, sysfs, why));
    CHECK(link.byte_ns == 10000000000 / 921600);
    FILE *timer = fopen(path, "r");
    CHECK(timer && fgets(text, sizeof text, timer) && text[0] == '1');
    if (timer) fclose(timer);
    kn_request r;
    kn_reply reply;
    kn_request_begin(&r, 1);
    kn_request_read(&r, KN_REG_ID, 1);
    CHECK(ask(&link, &r, 5000, &reply) == KN_LINK_OK && reply.words[0] == KN_ENGINE_ID);
    stop(&b, SIGTERM, line);
    CHECK(link.wait(link.self, after_ms(5000), &reply) == KN_LINK_GONE);
    link.close(link.self);
    run("rm -r %s", sysfs);
}

TEST("a card's registers are its resource0, and a card that reads all ones is gone")
{
    char why[KN_LINK_WHY], path[400], sysfs[] = "/tmp/knead-sysfs-XXXXXX";
    const uint32_t id = KN_ENGINE_ID, ones = UINT32_MAX;
    CHECK(mkdtemp(sysfs));
    run("mkdir -p %s/bus/pci/devices/0000:01:00.0", sysfs);
    snprintf(path, sizeof path, "%s/bus/pci/devices/0000:01:00.0/resource0", sysfs);
    int fd = open(path, O_RDWR | O_CREAT, 0600);
    kn_link link = {0};
    CHECK(!kn_link_open(&link, "pcie:0000:01:00.0", sysfs, why) && strstr(why, "expected the registers"));
    CHECK(ftruncate(fd, 65536) == 0 && pwrite(fd, &id, 4, 0) == 4);
    CHECK(!kn_link_open(&link, "pcie:0000:02:00.0", sysfs, why) && strstr(why, "No such file"));
    CHECK(kn_link_open(&link, "pcie:0000:01:00.0", sysfs, why));
    kn_request r;
    kn_reply reply;
    kn_request_begin(&r, 1);
    kn_request_write(&r, KN_REG_SCRATCH, (const uint32_t[]){42}, 1);
    kn_request_read(&r, KN_REG_SCRATCH, 1);
    kn_request_read(&r, KN_REG_ID, 1);
    CHECK(ask(&link, &r, 0, &reply) == KN_LINK_OK);
    CHECK(reply.count == 2 && reply.words[0] == 42 && reply.words[1] == KN_ENGINE_ID);
    kn_request_begin(&r, 2);
    kn_request_wait(&r, KN_REG_STATUS, KN_STATUS_BUSY, 1, 0);
    CHECK(ask(&link, &r, 2, &reply) == KN_LINK_LATE);
    kn_request_begin(&r, 3);
    kn_request_read(&r, 65536 / 4, 1);
    CHECK(ask(&link, &r, 0, &reply) == KN_LINK_OK && reply.status == KN_REPLY_BUS && reply.count == 0);
    kn_request_begin(&r, 4);
    kn_request_read(&r, KN_REG_ID, 1);
    CHECK(pwrite(fd, &ones, 4, 0) == 4 && ask(&link, &r, 0, &reply) == KN_LINK_GONE);
    CHECK(pwrite(fd, &id, 4, 0) == 4 && ask(&link, &r, 0, &reply) == KN_LINK_OK);
    CHECK(ftruncate(fd, 0) == 0); // take the memory away, as when a card is removed
    CHECK(ask(&link, &r, 0, &reply) == KN_LINK_GONE);
    kn_request_write(&r, KN_WINDOW_NODES, (const uint32_t[]){42}, 1);
    kn_request_wait(&r, KN_REG_STATUS, KN_STATUS_BUSY, 0, 0);
    CHECK(ask(&link, &r, 2, &reply) == KN_LINK_GONE);
    link.close(link.self);
    close(fd);
    run("rm -r %s", sysfs);
}

TEST("a card of vfio-pci is never opened by sysfs")
{
    char why[KN_LINK_WHY], folder[300], sysfs[] = "/tmp/knead-sysfs-XXXXXX";
    CHECK(mkdtemp(sysfs));
    snprintf(folder, sizeof folder, "%s/bus/pci/devices/0000:01:00.0", sysfs);
    run("f=%s; mkdir -p $f && cd $f && truncate -s 65536 resource0 && ln -s ../../drivers/vfio-pci driver && "
        "ln -s ../../../../kernel/iommu_groups/999999 iommu_group",
        folder);
    kn_link link = {0};
    CHECK(!kn_link_open(&link, "pcie:0000:01:00.0", sysfs, why) && strstr(why, "by vfio-pci: /dev/vfio/"));
    run("rm %s/driver", folder); // as while the function is removed
    CHECK(!kn_link_open(&link, "pcie:0000:01:00.0", sysfs, why) && strstr(why, "bound to vfio-pci, as before"));
    link = (kn_link){0};
    CHECK(kn_link_open(&link, "pcie:0000:01:00.0", sysfs, why) && strstr(link.notice, "without isolation"));
    link.close(link.self);
    run("rm -r %s", sysfs);
}

TESTS_MAIN
