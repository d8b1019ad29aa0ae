#include "clients/tactile/paddle.h"
#include "server/clock.h"
#include <errno.h>
#include <fcntl.h>
#include <linux/serial.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

static const int waiting_most = 2 * KN_FRAME_SIZE; // bytes in the line: what waits longer is an old force

static const struct {
    int baud;
    speed_t speed;
} speeds[] = {{230400, B230400},   {460800, B460800},   {500000, B500000},   {576000, B576000},   {921600, B921600},
              {1000000, B1000000}, {1500000, B1500000}, {2000000, B2000000}, {3000000, B3000000}, {4000000, B4000000}};

static speed_t speed_of(int baud)
{
    for (size_t i = 0; i < sizeof speeds / sizeof *speeds; i++)
        if (speeds[i].baud == baud) return speeds[i].speed;
    return B0;
}

bool kn_paddle_baud_known(int baud) { return speed_of(baud) != B0; }

// The proof of a paddle's own watchdog, from its opening on:
//
//     0 ms  commands without enable   10 ms  with enable, 0 N   30 ms  silence   50 ms  its watchdog has tripped
//
// It begins anew when this thread was late for it, or the motor has not shown that it was on.
#define ENABLED_NS 10000000
#define SILENT_NS 30000000
#define JUDGED_NS 130000000
#define LATE_NS 5000000
#define PROOFS 5

static void begin_proof(kn_paddle *p)
{
    p->armed = false;
    p->proofs++;
    p->begun_ns = p->given_ns = kn_now_ns();
}

static void judge_watchdog(kn_paddle *p, const kn_frame *f)
{
    bool tripped = f->flags & KN_FRAME_TRIPPED;
    int64_t age_ns = kn_now_ns() - p->begun_ns;
    p->armed &= tripped || p->base.watchdog == KN_OWN_UNPROVED; // after the proof, until a command has rearmed it
    if (p->base.watchdog != KN_OWN_UNPROVED) return;
    if (age_ns > ENABLED_NS && age_ns <= SILENT_NS && !tripped && f->flags & KN_FRAME_MOTOR) p->armed = true;
    if (age_ns > SILENT_NS && p->armed && tripped) p->base.watchdog = KN_OWN_TRUSTED;
    else if (age_ns > JUDGED_NS && (p->armed || p->proofs == PROOFS)) p->base.watchdog = KN_OWN_MISSING;
    else if (age_ns > JUDGED_NS) begin_proof(p);
}

// Return whether a command of the proof is to be sent.
static bool prove(kn_paddle *p, bool *live)
{
    int64_t now_ns = kn_now_ns(), age_ns = now_ns - p->begun_ns;
    if (age_ns <= SILENT_NS && now_ns - p->given_ns > LATE_NS) begin_proof(p), age_ns = 0;
    p->given_ns = now_ns;
    *live = age_ns > ENABLED_NS;
    return age_ns <= SILENT_NS;
}

static void take(kn_paddle *p, const kn_frame *f)
{
    judge_watchdog(p, f);
    kn_tactile_pose pose = {.orientation_wxyz = {1.0}, .buttons = f->flags >> 4};
    pose.position_m[2] = 1e-9 * f->position_nm;
    pose.velocity_m_s[2] = 1e-6 * f->velocity_um_s;
    p->base.messages++;
    snprintf(p->base.state, sizeof p->base.state, "motor %s%s%s%s", f->flags & KN_FRAME_MOTOR ? "on" : "off",
             f->flags & KN_FRAME_TRIPPED ? ", its watchdog tripped" : "",
             f->flags & KN_FRAME_SATURATED ? ", saturated" : "", p->held_back ? ", line too slow" : "");
    kn_bridge_moved(p->bridge, &pose);
}

static void on_readable(struct ev_loop *ev, ev_io *watcher, int events)
{
    (void)ev, (void)events;
    kn_paddle *p = watcher->data;
    uint8_t bytes[256];
    kn_frame frame, newest = {0};
    ssize_t size = read(p->fd, bytes, sizeof bytes);
    if (size < 0 && (errno == EAGAIN || errno == EINTR)) return;
    if (size <= 0) {
        ev_io_stop(ev, watcher);
        kn_bridge_lost(p->bridge, "%s: %s", p->tty, size < 0 ? strerror(errno) : "hung up");
        return;
    }
    kn_deframer *d = &p->deframer;
    int64_t skipped = d->skipped;
    for (ssize_t i = 0; i < size; i++)
        if (kn_deframer_push(d, bytes[i], &frame)) newest = frame; // after a stall, the old ones are history
    if (d->skipped != skipped)
        kn_tactile_bad(&p->base, "%lld bytes that are no frame, %lld wrong checksums so far", (long long)d->skipped,
                       (long long)d->bad);
    p->base.lost = d->lost;
    if (newest.kind) take(p, &newest);
}

static bool setup(int fd, int baud)
{
    struct termios t;
    if (tcgetattr(fd, &t) != 0) return false;
    cfmakeraw(&t);
    t.c_cflag &= (tcflag_t) ~(CSTOPB | PARENB | CRTSCTS | HUPCL); // HUPCL resets many boards whenever somebody closes
    t.c_cflag |= CS8 | CLOCAL | CREAD;
    if (cfsetspeed(&t, speed_of(baud)) != 0 || tcsetattr(fd, TCSANOW, &t) != 0) return false;
    struct serial_struct line; // USB adapters collect bytes for 16 ms unless told; those that cannot be told do not
    if (ioctl(fd, TIOCGSERIAL, &line) == 0) {
        line.flags = (int)((unsigned)line.flags | ASYNC_LOW_LATENCY);
        ioctl(fd, TIOCSSERIAL, &line);
    }
    return tcflush(fd, TCIOFLUSH) == 0;
}

static bool open_paddle(kn_tactile *device, kn_bridge *bridge, char *error, size_t error_size)
{
    kn_paddle *p = (kn_paddle *)device;
    p->bridge = bridge;
    p->fd = open(p->tty, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (p->fd < 0 || ioctl(p->fd, TIOCEXCL) != 0 || !setup(p->fd, p->baud)) {
        snprintf(error, error_size, "%s: %s%s; knead devices lists what is there", p->tty,
                 errno == ENOTTY ? "no serial line" : strerror(errno),
                 errno == EACCES ? ", join the group dialout" : "");
        if (p->fd >= 0) close(p->fd);
        return false;
    }
    p->deframer.count = 0;
    p->base.watchdog = p->unwatched ? KN_OWN_TRUSTED : KN_OWN_UNPROVED;
    p->proofs = 0;
    begin_proof(p);
    ev_io_init(&p->readable, on_readable, p->fd, EV_READ);
    p->readable.data = p;
    ev_io_start(bridge->ev, &p->readable);
    return true;
}

static void close_paddle(kn_tactile *device)
{
    kn_paddle *p = (kn_paddle *)device;
    ev_io_stop(p->bridge->ev, &p->readable);
    close(p->fd);
}

static void give(kn_tactile *device, const double force_n[3], bool live)
{
    kn_paddle *p = (kn_paddle *)device;
    uint8_t bytes[KN_FRAME_SIZE];
    int waiting = 0;
    if (p->base.watchdog != KN_OWN_UNPROVED) live &= !p->armed;
    else if (!prove(p, &live)) return;
    else force_n = (double[3]){0};
    if (ioctl(p->fd, TIOCOUTQ, &waiting) == 0 && waiting > waiting_most) {
        p->held_back++;
        return;
    }
    kn_frame_encode(&(kn_frame){.kind = KN_FRAME_COMMAND,
                                .flags = live ? KN_FRAME_ENABLE : 0,
                                .seq = p->seq++,
                                .force_un = kn_frame_number(force_n[2], 1e-6)},
                    bytes);
    if (write(p->fd, bytes, sizeof bytes) < 0 && errno != EAGAIN && errno != EINTR)
        kn_bridge_lost(p->bridge, "%s: %s", p->tty, strerror(errno));
}

void kn_paddle_init(kn_paddle *p, const char *tty, int baud, bool unwatched)
{
    *p = (kn_paddle){.base = {.name = "paddle", .open = open_paddle, .close = close_paddle, .give = give},
                     .tty = tty,
                     .baud = baud,
                     .unwatched = unwatched,
                     .fd = -1,
                     .deframer.kind = KN_FRAME_STATE};
}
