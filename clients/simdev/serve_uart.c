// Serve frames on a pseudo-terminal.
#include "clients/simdev/simdev.h"
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
#include <unistd.h>

typedef struct line {
    kn_simdev *simdev;
    const char *link;
    char name[64];                     // path of the slave
    int fd, keep;                      // master; slave, held open so that a host that leaves is no hang-up
    kn_framer framer;                  // used when the engine has no link of its own
    uint8_t frame[2 * KN_FRAMER_WIRE]; // the frame so far; noise if it does not end within this size
    size_t size;                       // bytes of frame
    bool reacted;                      // this request has had its torn result
    bool refuses;                      // this request is refused
    int64_t in_ns, out_ns;             // time at which the last byte was through, in each direction
} line;

// Make the name a link to this line. A symbolic link there is replaced; anything else belongs to somebody.
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

// Open a pseudo-terminal in raw mode and name it.
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

// ---- the engine's bus, with the faults on it

static bool read_word(void *self, uint32_t address, uint32_t *word)
{
    line *l = self;
    kn_engine *e = &l->simdev->engine;
    // The fault `torn`: take another tick while a host reads the reactions, once a request.
    bool reaction = address >= KN_WINDOW_REACTIONS && address < KN_WINDOW_NODES;
    if (reaction && !l->reacted && address % 6 == 3 && e->stray &&
        kn_link_faults_strike(&l->simdev->faults, KN_LINK_FAULT_TORN)) {
        l->reacted = true;
        e->stray(e->bus.self);
    }
    bool read = !l->refuses && e->bus.read(e->bus.self, address, word);
    if (read && address == KN_REG_BUILD_HASH && l->simdev->faults.rate[KN_LINK_FAULT_HASH] > 0) *word ^= 1;
    return read;
}

static bool write_word(void *self, uint32_t address, uint32_t word)
{
    line *l = self;
    return !l->refuses && l->simdev->engine.bus.write(l->simdev->engine.bus.self, address, word);
}

// ---- frames

// Wait until bytes are through. Each direction is a line of its own, on which one byte follows the other.
static void pass(line *l, int64_t *through_ns, size_t bytes)
{
    int64_t now_ns = kn_now_ns();
    if (l->simdev->byte_ns == 0) return;
    *through_ns = (*through_ns > now_ns ? *through_ns : now_ns) + (int64_t)bytes * l->simdev->byte_ns;
    kn_clock_sleep(*through_ns);
}

static void say(line *l, const uint8_t *wire, size_t size)
{
    pass(l, &l->out_ns, size);
    for (size_t at = 0; at < size && !*l->simdev->stop;) {
        ssize_t n = write(l->fd, wire + at, size - at);
        if (n > 0) at += (size_t)n;
        if (n < 0 && errno != EAGAIN && errno != EINTR) return;
        if (n <= 0) poll(&(struct pollfd){l->fd, POLLOUT, 0}, 1, 100);
    }
}

// Send an answer, with the faults of the line.
static void answer(line *l, uint8_t wire[KN_FRAMER_WIRE], size_t size)
{
    kn_link_faults *f = &l->simdev->faults;
    l->simdev->requests++;
    size = kn_link_faults_mangle(f, wire, size);
    if (kn_link_faults_strike(f, KN_LINK_FAULT_DROP)) return;
    say(l, wire, size);
    if (kn_link_faults_strike(f, KN_LINK_FAULT_DUPLICATE)) say(l, wire, size);
}

// Do in C what the circuit's link does.
static size_t execute(line *l, const kn_word_bus *bus, const uint8_t *bytes, size_t count, size_t *used,
                      uint8_t wire[KN_FRAMER_WIRE])
{
    uint8_t reply[KN_FRAMER_PAYLOAD];
    size_t payload = kn_framer_read(&l->framer, bytes, count, used);
    return payload ? kn_framer_encode(reply, kn_request_execute(l->framer.bytes, payload, bus, reply), wire) : 0;
}

// Give bytes to the link and send its answers.
static void hear(line *l, const uint8_t *bytes, size_t count)
{
    const kn_engine *e = &l->simdev->engine;
    const kn_word_bus bus = {l, read_word, write_word};
    uint8_t wire[KN_FRAMER_WIRE];
    l->reacted = false;
    for (size_t at = 0, used; at < count; at += used) {
        size_t size = e->hear ? e->hear(e->bus.self, &bus, bytes + at, count - at, &used, wire)
                              : execute(l, &bus, bytes + at, count - at, &used, wire);
        if (size) answer(l, wire, size);
    }
}

// Bring a frame to the link with the faults of the line. The link decides whether it is a frame.
static void bring(line *l)
{
    kn_link_faults *f = &l->simdev->faults;
    size_t size = kn_link_faults_mangle(f, l->frame, l->size);
    if (kn_link_faults_strike(f, KN_LINK_FAULT_DROP)) return;
    l->refuses = kn_link_faults_strike(f, KN_LINK_FAULT_REFUSE);
    for (int times = kn_link_faults_strike(f, KN_LINK_FAULT_DUPLICATE) ? 2 : 1; times > 0; times--)
        hear(l, l->frame, size);
    l->refuses = false;
}

// Apply the faults of a request, and set *unplugged if it is lost. Return false if the line could not be plugged in
// again.
static bool suffer(line *l, bool *unplugged)
{
    bool blanked;
    *unplugged = kn_simdev_suffer(l->simdev, &blanked);
    if (!*unplugged) return true;
    plug_out(l);
    kn_simdev_sleep_us(5000);
    return plug_in(l, false);
}

// Read what came, and handle each frame at its 0x00.
static bool listen_once(line *l)
{
    uint8_t bytes[4096];
    ssize_t size = read(l->fd, bytes, sizeof bytes);
    if (size < 0 && errno != EAGAIN && errno != EINTR) return false;
    if (size <= 0) poll(&(struct pollfd){l->fd, POLLIN, 0}, 1, 100);
    if (size > 0) pass(l, &l->in_ns, (size_t)size);
    for (ssize_t at = 0; at < size && !*l->simdev->stop; at++) {
        // Collect bytes up to a 0x00 or a full buffer.
        l->frame[l->size++] = bytes[at];
        if (bytes[at] && l->size < sizeof l->frame) continue;
        if (l->size == 1 || bytes[at]) { // nothing, or noise
            hear(l, l->frame, l->size);
        } else {
            bool unplugged;
            if (!suffer(l, &unplugged)) return false;
            if (unplugged) at = size; // drop what came with the frame, too
            else bring(l);
        }
        l->size = 0;
    }
    return true;
}

bool kn_simdev_uart(kn_simdev *simdev, const char *link)
{
    prctl(PR_SET_TIMERSLACK, 1000UL);
    line l = {.simdev = simdev, .link = link};
    bool good = plug_in(&l, true);
    while (good && !*simdev->stop) good = listen_once(&l);
    int why = errno;
    if (l.fd >= 0) plug_out(&l);
    errno = why;
    return good;
}
