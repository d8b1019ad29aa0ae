// A link over a serial line or a pseudo-terminal.
#include "server/backend/link.h"
#include "server/clock.h"
#include <errno.h>
#include <fcntl.h>
#include <linux/serial.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <termios.h>
#include <unistd.h>

typedef struct uart {
    int fd;
    bool asked;
    kn_link_status down; // reason why the line is gone; OK: the line works
    kn_framer framer;
    kn_request request;
    kn_link_counts counts;
    size_t out_at, out_size, in_at, in_size;
    // Send a 0x00 first, so that a partial frame that is already on the line ends there.
    uint8_t out[1 + KN_FRAMER_WIRE];
    uint8_t in[4096];
} uart;

// Note the first fatal error of the line; all later calls return it.
static kn_link_status fallen(uart *u, kn_link_status status)
{
    if (u->down == KN_LINK_OK) u->down = status;
    return u->down;
}

static kn_link_status error(uart *u)
{
    return fallen(u, errno == EIO || errno == ENXIO || errno == ENODEV ? KN_LINK_GONE : KN_LINK_IO);
}

// Write as many bytes of the request as the line accepts now.
static kn_link_status push(uart *u)
{
    while (u->out_at < u->out_size) {
        ssize_t n = write(u->fd, u->out + u->out_at, u->out_size - u->out_at);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0 && errno != EAGAIN) return error(u);
        if (n <= 0) break;
        u->out_at += (size_t)n;
    }
    return KN_LINK_OK;
}

static kn_link_status submit(void *self, const kn_request *request)
{
    uart *u = self;
    if (u->down != KN_LINK_OK) return u->down;
    u->request = *request;
    u->asked = true;
    u->out[0] = 0;
    u->out_at = 0;
    u->out_size = 1 + kn_framer_encode(request->bytes, request->size, u->out + 1);
    return push(u);
}

// Look for a reply in the bytes that were read. Return CRC if a damaged frame arrived instead.
static kn_link_status hear(uart *u, kn_reply *reply)
{
    kn_framer *f = &u->framer;
    while (u->in_at < u->in_size) {
        size_t used = 0;
        const int64_t broken = u->counts.crc + u->counts.coding;
        size_t payload = kn_framer_read(f, u->in + u->in_at, u->in_size - u->in_at, &used);
        u->in_at += used;
        u->counts.crc = f->crc;
        u->counts.coding = f->cobs + f->length;
        // A good frame is the reply to the request, or a stray reply (for example the reply to a request that was
        // dropped).
        if (payload && u->asked && kn_reply_parse(reply, &u->request, f->bytes, payload)) {
            u->asked = false;
            return KN_LINK_OK;
        }
        if (payload) u->counts.stray++;
        if (u->asked && u->counts.crc + u->counts.coding > broken) return KN_LINK_CRC;
    }
    return KN_LINK_LATE;
}

// Read the bytes that have arrived. Return LATE if there are none. Treat an end of file as a hang-up.
static kn_link_status take(uart *u)
{
    ssize_t n = read(u->fd, u->in, sizeof u->in);
    u->in_at = 0;
    u->in_size = n > 0 ? (size_t)n : 0;
    if (n > 0) return KN_LINK_OK;
    if (n == 0) return fallen(u, KN_LINK_GONE);
    return errno == EAGAIN || errno == EINTR ? KN_LINK_LATE : error(u);
}

// Sleep until the line can be read or written, or until the deadline.
static kn_link_status doze(uart *u, int64_t deadline_ns)
{
    int64_t left = deadline_ns - kn_now_ns();
    if (left <= 0) return KN_LINK_LATE;
    struct pollfd p = {u->fd, (short)(u->out_at < u->out_size ? POLLIN | POLLOUT : POLLIN), 0};
    struct timespec t = {left / 1000000000, left % 1000000000};
    if (ppoll(&p, 1, &t, NULL) < 0 && errno != EINTR) return fallen(u, KN_LINK_IO);
    return KN_LINK_OK;
}

// Look for a reply in the bytes read, send the rest of the request, read more bytes, and sleep if there is nothing to
// do.
static kn_link_status wait_reply(void *self, int64_t deadline_ns, kn_reply *reply)
{
    uart *u = self;
    // Check the deadline in each turn, so that a line that never stops sending cannot delay the caller.
    for (bool looked = false;; looked = true) {
        kn_link_status heard = hear(u, reply);
        if (heard != KN_LINK_LATE) return heard;
        if (looked && kn_now_ns() >= deadline_ns) return KN_LINK_LATE;
        if (u->down != KN_LINK_OK) return u->down;
        if (push(u) != KN_LINK_OK) return u->down;
        kn_link_status taken = take(u);
        if (taken == KN_LINK_OK) continue;
        if (taken != KN_LINK_LATE) return taken;
        kn_link_status dozed = doze(u, deadline_ns);
        if (dozed != KN_LINK_OK) return dozed;
    }
}

// Drop the request, and all bytes on their way in this module and in the kernel.
static void forget(void *self)
{
    uart *u = self;
    u->asked = false;
    u->out_at = u->out_size = u->in_at = u->in_size = 0;
    if (u->down == KN_LINK_OK) tcflush(u->fd, TCIOFLUSH);
}

static void close_uart(void *self)
{
    uart *u = self;
    close(u->fd);
    free(u);
}

// ---- opening

bool kn_link_is_baud(int baud, char why[KN_LINK_WHY])
{
    struct termios t = {0};
    // glibc takes a rate as a number. Below 9600 it also takes its codes of rates.
    if (baud >= 9600 && cfsetspeed(&t, (speed_t)baud) == 0) return true;
    snprintf(why, KN_LINK_WHY,
             "baud=%d: expected 9600, 19200, 38400, 57600, 115200, 230400, 460800, 500000, "
             "576000, 921600, 1000000, 1152000, 1500000, 2000000, 2500000, 3000000, 3500000 or 4000000",
             baud);
    return false;
}

// Set the line to raw mode: eight bits, no flow control, no modem lines (HUPCL resets many boards when a program closes
// the line). VMIN is 1, because with VMIN 0 an empty line and a hang-up could not be distinguished.
static bool make_raw(int fd, int baud)
{
    struct termios t;
    if (tcgetattr(fd, &t)) return false;
    cfmakeraw(&t);
    t.c_cflag = (t.c_cflag & ~(tcflag_t)(CSTOPB | CRTSCTS | HUPCL)) | CLOCAL | CREAD;
    t.c_cc[VMIN] = 1;
    t.c_cc[VTIME] = 0;
    if (baud && cfsetspeed(&t, (speed_t)baud)) return false;
    return tcsetattr(fd, TCSANOW, &t) == 0;
}

// Set the USB adapter to low latency; otherwise the adapter collects input for up to 16 ms. The setting is made through
// the driver or through sysfs. If neither accepts the setting, the adapter stays slow.
static void hurry(int fd, const char *path, const char *sysfs)
{
    struct serial_struct serial;
    char file[KN_LINK_URI + 64], real[4096];
    if (ioctl(fd, TIOCGSERIAL, &serial) == 0) {
        serial.flags = (int)((unsigned)serial.flags | ASYNC_LOW_LATENCY);
        ioctl(fd, TIOCSSERIAL, &serial);
    }
    const char *name = realpath(path, real) ? strrchr(real, '/') + 1 : "";
    snprintf(file, sizeof file, "%s/class/tty/%.60s/device/latency_timer", sysfs, name);
    int timer = open(file, O_WRONLY | O_CLOEXEC);
    if (timer < 0) return;
    ssize_t written = write(timer, "1", 1);
    (void)written;
    close(timer);
}

int kn_link_line(const char *path, int baud, const char *sysfs)
{
    const int fd = open(path, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (fd < 0) return -1;
    const bool ours = flock(fd, LOCK_EX | LOCK_NB) == 0;
    // Only one program may send to a circuit or drive a motor. A pseudo-terminal gets no TIOCEXCL: the program at its
    // other end keeps it open, so the flag would outlive this process.
    struct stat file;
    const bool pseudo = fstat(fd, &file) == 0 && major(file.st_rdev) >= 136 && major(file.st_rdev) <= 143;
    if (ours && make_raw(fd, baud) && (pseudo || ioctl(fd, TIOCEXCL) == 0)) {
        if (baud) hurry(fd, path, sysfs);
        tcflush(fd, TCIOFLUSH);
        return fd;
    }
    const int why = ours ? errno : EBUSY;
    close(fd);
    errno = why;
    return -1;
}

bool kn_link_uart(kn_link *link, const char *path, int baud, const char *sysfs, char why[KN_LINK_WHY])
{
    uart *u = calloc(1, sizeof *u);
    if (!u || (u->fd = kn_link_line(path, baud, sysfs)) < 0) {
        snprintf(why, KN_LINK_WHY, "%s: %s", path,
                 errno == EBUSY    ? "in use by another program"
                 : errno == ENOTTY ? "expected a serial line"
                                   : strerror(errno));
        free(u);
        return false;
    }
    *link = (kn_link){.byte_ns = baud ? 10000000000 / baud : 0,
                      .counts = &u->counts,
                      .self = u,
                      .submit = submit,
                      .wait = wait_reply,
                      .forget = forget,
                      .close = close_uart};
    return true;
}
