#include "clients/tactile/paddle.h"
#include "server/backend/link.h"
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

// Largest number of bytes that may wait in the serial line when a command is sent. With more waiting bytes, the command
// would reach the motor too late.
static const int waiting_most = 2 * KN_PADDLE_FRAME_SIZE;
static const int off_most_ms = 100; // longest time in which a paddle may refuse the force that it is given

// Pass a state frame to the bridge as a pose, and describe the state of the paddle in words for the user.
static void take(kn_paddle *p, const kn_paddle_frame *f)
{
    bool tripped = f->flags & KN_PADDLE_FRAME_TRIPPED;
    p->base.motors = f->flags & KN_PADDLE_FRAME_MOTOR;
    p->clears = tripped && (p->clears || p->base.watchdog == KN_OWN_UNPROVED);
    // Opened again, the paddle begins at 0 N. A session that has ended clears a trip before that.
    p->off_ms = tripped && p->enabled ? p->off_ms + 1 : 0;
    if (p->off_ms == off_most_ms) kn_bridge_lost(p->bridge, "it has switched its motor off");
    kn_tactile_pose pose = {.orientation_wxyz = {1.0}, .buttons = f->flags >> 4};
    pose.position_m[2] = 1e-9 * f->position_nm;
    pose.velocity_m_s[2] = 1e-6 * f->velocity_um_s;
    p->base.messages++;
    snprintf(p->base.state, sizeof p->base.state, "motor %s%s%s%s", p->base.motors ? "on" : "off",
             tripped ? ", switched off by the paddle itself" : "",
             f->flags & KN_PADDLE_FRAME_SATURATED ? ", saturated" : "", p->held_back ? ", serial line too slow" : "");
    kn_bridge_moved(p->bridge, &pose);
}

static void on_readable(struct ev_loop *ev, ev_io *watcher, int events)
{
    (void)ev, (void)events;
    kn_paddle *p = watcher->data;
    uint8_t bytes[256];
    kn_paddle_frame frame, newest = {0};
    ssize_t size = read(p->fd, bytes, sizeof bytes);
    if (size < 0 && (errno == EAGAIN || errno == EINTR)) return;
    if (size <= 0) {
        ev_io_stop(ev, watcher);
        kn_bridge_lost(p->bridge, "%s: %s", p->tty, size < 0 ? strerror(errno) : "hung up");
        return;
    }
    kn_paddle_decoder *d = &p->deframer;
    int64_t skipped = d->skipped;
    for (ssize_t i = 0; i < size; i++)
        // Keep the newest frame only, because older frames are out of date after a stall.
        if (kn_paddle_decoder_push(d, bytes[i], &frame)) newest = frame;
    if (d->skipped != skipped)
        kn_tactile_bad(&p->base, "%lld bytes that are not part of a frame, %lld wrong checksums so far",
                       (long long)d->skipped, (long long)d->bad);
    p->base.lost = d->lost;
    if (newest.kind) take(p, &newest);
}

static bool open_paddle(kn_tactile *device, kn_bridge *bridge, char *error, size_t error_size)
{
    kn_paddle *p = (kn_paddle *)device;
    p->bridge = bridge;
    p->fd = kn_link_line(p->tty, p->baud, "/sys");
    if (p->fd < 0) {
        snprintf(error, error_size, "%s: %s%s; knead devices lists the serial lines", p->tty,
                 errno == ENOTTY  ? "no serial line"
                 : errno == EBUSY ? "in use by another program"
                                  : strerror(errno),
                 errno == EACCES ? ", join the group dialout" : "");
        return false;
    }
    p->deframer.count = 0;
    device->watchdog = device->unwatched ? KN_OWN_TRUSTED : KN_OWN_UNPROVED;
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
    uint8_t bytes[KN_PADDLE_FRAME_SIZE];
    int waiting = 0;
    if (ioctl(p->fd, TIOCOUTQ, &waiting) == 0 && waiting > waiting_most) {
        p->held_back++;
        return;
    }
    p->enabled = live && !p->clears;
    kn_paddle_frame_encode(&(kn_paddle_frame){.kind = KN_PADDLE_FRAME_COMMAND,
                                              .flags = p->enabled ? KN_PADDLE_FRAME_ENABLE : 0,
                                              .seq = p->seq++,
                                              .force_un = kn_paddle_frame_number(force_n[2], 1e-6)},
                           bytes);
    if (write(p->fd, bytes, sizeof bytes) < 0 && errno != EAGAIN && errno != EINTR)
        kn_bridge_lost(p->bridge, "%s: %s", p->tty, strerror(errno));
}

void kn_paddle_init(kn_paddle *p, const char *tty, int baud)
{
    *p = (kn_paddle){.base = {.name = "paddle", .open = open_paddle, .close = close_paddle, .give = give},
                     .tty = tty,
                     .baud = baud,
                     .deframer.kind = KN_PADDLE_FRAME_STATE};
}
