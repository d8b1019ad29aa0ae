// Serve the registers by frames over a pseudo-terminal.
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
    char name[64]; // path of the pseudo-terminal's slave side, which hosts open
    int fd, keep;  // fd: master side; keep: slave side, kept open so that the master gets no hang-up when a host leaves
    kn_framer framer; // decoder of frames, used if the engine has no link of its own
    // Bytes of the present frame. If this array fills up without the end of a frame (0x00), its bytes are noise.
    uint8_t frame[2 * KN_FRAMER_WIRE];
    size_t size;  // bytes of frame
    bool reacted; // true: the fault `torn` has already struck the present request
    bool refuses; // true: the fault `refuse` strikes the present request
    // Times when the line is free again. in_ns: for bytes from the host; out_ns: for bytes to the host.
    int64_t in_ns, out_ns;
} line;

// Create the symbolic link of --link to this pseudo-terminal. An existing symbolic link is replaced. Any other file
// stays, because it belongs to somebody else.
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

// Open a pseudo-terminal in raw mode and create the symbolic link to it. tell: print the URI of the device.
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
    // Fault `torn`: while a host reads the reactions, step another tick, at most once per request.
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

// Wait until the bytes have passed the line at its baud rate. Each direction is a separate line, on which the bytes
// follow one another.
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

// Send an answer to the host. Faults of the line may strike it.
static void answer(line *l, uint8_t wire[KN_FRAMER_WIRE], size_t size)
{
    kn_link_faults *f = &l->simdev->faults;
    l->simdev->requests++;
    size = kn_link_faults_mangle(f, wire, size);
    if (kn_link_faults_strike(f, KN_LINK_FAULT_DROP)) return;
    say(l, wire, size);
    if (kn_link_faults_strike(f, KN_LINK_FAULT_DUPLICATE)) say(l, wire, size);
}

// Do the work of the circuit's link in C: decode a frame, execute its request and encode the answer.
static size_t execute(line *l, const kn_word_bus *bus, const uint8_t *bytes, size_t count, size_t *used,
                      uint8_t wire[KN_FRAMER_WIRE])
{
    uint8_t reply[KN_FRAMER_PAYLOAD];
    size_t payload = kn_framer_read(&l->framer, bytes, count, used);
    return payload ? kn_framer_encode(reply, kn_request_execute(l->framer.bytes, payload, bus, reply), wire) : 0;
}

// Give received bytes to the link, and send its answers.
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

// Give a received frame to the link, after the faults of the line have struck. The link decides whether the frame is
// valid.
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

// Read the bytes that have come, and handle each frame when its final 0x00 is reached. An unplugged device loses the
// frame and the bytes after it. Return false if the pseudo-terminal could not be opened again.
static bool listen_once(line *l)
{
    uint8_t bytes[4096];
    bool blanked;
    ssize_t size = read(l->fd, bytes, sizeof bytes);
    if (size < 0 && errno != EAGAIN && errno != EINTR) return false;
    if (size <= 0) poll(&(struct pollfd){l->fd, POLLIN, 0}, 1, 100);
    if (size > 0) pass(l, &l->in_ns, (size_t)size);
    for (ssize_t at = 0; at < size && !*l->simdev->stop; at++) {
        l->frame[l->size++] = bytes[at];
        if (bytes[at] && l->size < sizeof l->frame) continue;
        if (l->size == 1 || bytes[at]) { // nothing, or noise
            hear(l, l->frame, l->size);
        } else if (kn_simdev_suffer(l->simdev, &blanked)) {
            plug_out(l);
            kn_clock_sleep(kn_now_ns() + KN_SIMDEV_UNPLUGGED_NS);
            if (!plug_in(l, false)) return false;
            at = size;
        } else {
            bring(l);
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
