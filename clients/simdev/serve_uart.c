// Frames on a pseudo-terminal.
#include "clients/simdev/serve.h"
#include "hdl/registers.h"
#include "server/clock.h"
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

typedef struct line {
    kn_serve *serve;
    const char *link;
    char name[64]; // of the slave
    int fd, keep; // master; slave, held open so that a host that leaves is no hang-up
    kn_framer framer, inner;
    bool reacted; // of this request: a torn result once
    bool refuses; // this request
    int64_t in_ns, out_ns; // when the last byte was through, either way
} line;

void kn_serve_sleep_us(uint32_t us)
{
    nanosleep(&(struct timespec){0, 1000L * (long)us}, NULL);
}

// A name that was another line's is taken; one that is anything else is somebody's.
static bool take_name(const line *l)
{
    struct stat was;
    if (!l->link) return true;
    if (lstat(l->link, &was) == 0) {
        errno = EEXIST;
        if (!S_ISLNK(was.st_mode) || unlink(l->link)) return false;
    }
    return symlink(l->name, l->link) == 0;
}

static void leave_name(const line *l)
{
    char to[sizeof l->name] = "";
    if (l->link && readlink(l->link, to, sizeof to - 1) > 0 && strcmp(to, l->name) == 0) unlink(l->link);
}

static bool plug_in(line *l, bool tell)
{
    struct termios t;
    char *name = l->name;
    l->fd = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (l->fd < 0 || grantpt(l->fd) || unlockpt(l->fd) || ptsname_r(l->fd, name, sizeof l->name)) return false;
    l->keep = open(name, O_RDWR | O_NOCTTY | O_CLOEXEC);
    if (l->keep < 0 || tcgetattr(l->keep, &t)) return false;
    cfmakeraw(&t);
    if (tcsetattr(l->keep, TCSANOW, &t)) return false;
    if (!take_name(l)) return false;
    if (tell) printf("pty:%s\n", l->link ? l->link : name);
    fflush(stdout);
    return true;
}

static void plug_out(line *l)
{
    leave_name(l);
    close(l->keep);
    close(l->fd);
}

// ---- the engine's bus, with what goes wrong on it

static bool read_word(void *self, uint32_t address, uint32_t *word)
{
    line *l = self;
    kn_engine *e = &l->serve->engine;
    bool reaction = address >= KN_WINDOW_REACTIONS && address < KN_WINDOW_NODES;
    if (reaction && !l->reacted && address % 6 == 3 && e->stray && kn_faults_strike(&l->serve->faults, KN_FAULT_TORN)) {
        l->reacted = true;
        e->stray(e->bus.self);
    }
    bool read = !l->refuses && e->bus.read(e->bus.self, address, word);
    if (read && address == KN_REG_BUILD_HASH && l->serve->faults.rate[KN_FAULT_HASH] > 0) *word ^= 1;
    return read;
}

static bool write_word(void *self, uint32_t address, uint32_t word)
{
    line *l = self;
    return !l->refuses && l->serve->engine.bus.write(l->serve->engine.bus.self, address, word);
}

// ---- frames

// A line of its own either way, on which one byte comes after the other.
static void pass(line *l, int64_t *through_ns, size_t bytes)
{
    int64_t now_ns = kn_now_ns();
    if (l->serve->byte_ns == 0) return;
    *through_ns = (*through_ns > now_ns ? *through_ns : now_ns) + (int64_t)bytes * l->serve->byte_ns;
    kn_clock_sleep(*through_ns);
}

static void say(line *l, const uint8_t *wire, size_t size)
{
    pass(l, &l->out_ns, size);
    for (size_t at = 0; at < size && !*l->serve->stop;) {
        ssize_t n = write(l->fd, wire + at, size - at);
        if (n > 0) at += (size_t)n;
        if (n < 0 && errno != EAGAIN && errno != EINTR) return;
        if (n <= 0) poll(&(struct pollfd){l->fd, POLLOUT, 0}, 1, 100);
    }
}

static void answer(line *l, const uint8_t *payload, size_t size)
{
    kn_faults *f = &l->serve->faults;
    const kn_word_bus bus = {l, read_word, write_word};
    uint8_t reply[KN_FRAMER_PAYLOAD], wire[KN_FRAMER_WIRE];
    l->reacted = false;
    l->refuses = kn_faults_strike(f, KN_FAULT_REFUSE);
    l->serve->requests++;
    size = kn_request_execute(payload, size, &bus, reply);
    size = kn_faults_mangle(f, wire, kn_framer_encode(reply, size, wire));
    if (kn_faults_strike(f, KN_FAULT_DROP)) return;
    say(l, wire, size);
    if (kn_faults_strike(f, KN_FAULT_DUPLICATE)) say(l, wire, size);
}

// The line's faults of a request that came whole; once more through a receiver, which has to notice them.
static void hear(line *l, const uint8_t *payload, size_t size)
{
    kn_faults *f = &l->serve->faults;
    uint8_t wire[KN_FRAMER_WIRE];
    size = kn_faults_mangle(f, wire, kn_framer_encode(payload, size, wire));
    if (kn_faults_strike(f, KN_FAULT_DROP)) return;
    int times = kn_faults_strike(f, KN_FAULT_DUPLICATE) ? 2 : 1;
    for (size_t at = 0, used = 0; at < size * (size_t)times; at += used) {
        size_t heard = kn_framer_read(&l->inner, wire + at % size, size - at % size, &used);
        if (heard) answer(l, l->inner.bytes, heard);
    }
}

static bool suffer(line *l) // false: the line could not be plugged in again
{
    kn_faults *f = &l->serve->faults;
    if (kn_faults_strike(f, KN_FAULT_DELAY)) kn_serve_sleep_us(1000 + kn_faults_random(f, 3000));
    if (kn_faults_strike(f, KN_FAULT_HANG)) kn_serve_sleep_us(20000);
    if (kn_faults_strike(f, KN_FAULT_BLANK)) l->serve->engine.blank(l->serve->engine.bus.self);
    if (!kn_faults_strike(f, KN_FAULT_DISCONNECT)) return true;
    plug_out(l);
    kn_serve_sleep_us(5000);
    return plug_in(l, false);
}

static bool listen_once(line *l)
{
    uint8_t bytes[4096];
    ssize_t size = read(l->fd, bytes, sizeof bytes);
    if (size < 0 && errno != EAGAIN && errno != EINTR) return false;
    if (size <= 0) poll(&(struct pollfd){l->fd, POLLIN, 0}, 1, 100);
    if (size > 0) pass(l, &l->in_ns, (size_t)size);
    int fd = l->fd;
    size_t used = 0;
    for (ssize_t at = 0; at < size && fd == l->fd && !*l->serve->stop; at += (ssize_t)used) {
        size_t payload = kn_framer_read(&l->framer, bytes + at, (size_t)(size - at), &used);
        if (!payload) continue;
        int64_t unplugged = l->serve->faults.done[KN_FAULT_DISCONNECT];
        if (!suffer(l)) return false;
        if (l->serve->faults.done[KN_FAULT_DISCONNECT] > unplugged) break;
        hear(l, l->framer.bytes, payload);
    }
    return true;
}

bool kn_serve_uart(kn_serve *serve, const char *link)
{
    prctl(PR_SET_TIMERSLACK, 1000UL);
    line l = {.serve = serve, .link = link};
    bool good = plug_in(&l, true);
    while (good && !*serve->stop) good = listen_once(&l);
    int why = errno;
    if (l.fd >= 0) plug_out(&l);
    errno = why;
    return good;
}
