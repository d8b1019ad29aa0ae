#include "clients/tactile/spacenav.h"
#include "clients/hand/live_server.h"
#include "core/algebra/algebra.h"
#include <errno.h>
#include <math.h>
#include <spnav.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

// ---- steering

// lag_s: time constant of the lag between puck and tool. dt_s: duration of the movement in one call of step().
static const double lag_s = 0.05, dt_s = 1e-3;

void kn_puck_init(kn_puck *p, const kn_puck_def *def)
{
    *p = (kn_puck){.def = *def, .pose.orientation_wxyz = {1.0}};
    if (!(p->def.speed_m_s > 0.0)) p->def.speed_m_s = 0.05;
    if (p->def.dead <= 0) p->def.dead = 15;
    if (!(p->def.reach_m > 0.0)) p->def.reach_m = 0.08;
    p->def.floor_m = fmin(fmax(p->def.floor_m, -p->def.reach_m), p->def.reach_m);
}

// Return the deflection as a fraction of full deflection, -1 .. 1. Return 0 inside the dead zone.
static double share(const kn_puck *p, int counts)
{
    double beyond = fabs((double)counts) - p->def.dead;
    if (beyond <= 0.0) return 0.0;
    return copysign(fmin(1.0, beyond / (KN_PUCK_FULL - p->def.dead)), counts);
}

// Rotate the orientation q for the time dt_s, with the angular velocity w about the device's axes. Normalise q
// afterwards, because rounding errors add up.
static void turn(double q[4], const double w[3])
{
    double speed = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]), half = 0.5 * speed * dt_s, out[4];
    double s = speed > 0.0 ? sin(half) / speed : 0.0;
    kn_turn_multiply((double[]){cos(half), s * w[0], s * w[1], s * w[2]}, q, out);
    kn_turn_unit(out, q);
}

static void step(kn_puck *p, const int counts[6])
{
    double *x = p->pose.position_m, *v = p->pose.velocity_m_s, gain = dt_s / lag_s;
    // Smooth the wanted speed and twist with the first-order lag. Then move the tool and keep each coordinate within
    // its limits.
    for (int i = 0; i < 3; i++) {
        double low = i == 2 ? p->def.floor_m : -p->def.reach_m, high = p->def.reach_m;
        v[i] += gain * (p->def.speed_m_s * share(p, counts[i]) - v[i]);
        p->turning_rad_s[i] += gain * (p->def.turn_rad_s * share(p, counts[3 + i]) - p->turning_rad_s[i]);
        double to = fmin(fmax(x[i] + v[i] * dt_s, low), high);
        // Set the actual velocity, which is smaller than the smoothed one if the tool has reached a limit.
        v[i] = (to - x[i]) / dt_s;
        x[i] = to;
    }
    turn(p->pose.orientation_wxyz, p->turning_rad_s);
}

void kn_puck_tick(kn_puck *p, const int counts[6], int elapsed_ms)
{
    // After a stall of this process, move the tool only as far as in 5 ms, because a longer movement would be a jump.
    for (int ms = 0; ms < (elapsed_ms < 5 ? elapsed_ms : 5); ms++) step(p, counts);
}

// ---- driver

static const size_t event_bytes = 8 * sizeof(int32_t); // size of one event in spacenavd's protocol
static const int events_most = 64;                     // largest number of events read at each wake-up
// Number of buttons that a pose can have. Bit 30 of the pose is no button, but KN_BUTTON_LEAVING.
static const int buttons_most = 30;

const char *kn_spacenav_socket(void)
{
    const char *named = getenv("SPNAV_SOCKET");
    return named && *named ? named : "/var/run/spnav.sock";
}

bool kn_spacenav_reach(void)
{
    const int fd = kn_live_server_dial(kn_spacenav_socket(), SOCK_NONBLOCK);
    if (fd >= 0) close(fd);
    return fd >= 0;
}

// Store one event of spacenavd: deflection of the puck, a button, or the arrival or loss of a puck.
static void take(kn_spacenav *s, const spnav_event *event)
{
    const struct spnav_event_motion *m = &event->motion;
    const struct spnav_event_button *b = &event->button;
    int32_t *buttons = &s->puck.pose.buttons;
    switch (event->type) {
    case SPNAV_EVENT_MOTION:
        // Swap y and z: spacenavd has y up, the device's frame has z up.
        memcpy(s->counts, (int[]){m->x, m->z, m->y, m->rx, m->rz, m->ry}, sizeof s->counts);
        s->base.messages++;
        break;
    case SPNAV_EVENT_BUTTON:
        if (b->bnum < 0 || b->bnum >= buttons_most) kn_tactile_bad(&s->base, "an unknown button, number %d", b->bnum);
        else if (b->press) *buttons |= 1 << b->bnum;
        else *buttons &= ~(1 << b->bnum);
        s->base.messages++;
        break;
    case SPNAV_EVENT_DEV:
        memset(s->counts, 0, sizeof s->counts); // a puck that was unplugged sends no zero, so clear the deflection here
        snprintf(s->base.state, sizeof s->base.state,
                 event->dev.op == SPNAV_DEV_RM ? "puck unplugged" : "puck plugged in");
        break;
    }
}

// Return 1 if a complete event waits in the socket. libspnav may read the socket only then: it would report the end of
// the connection as "no event", and half an event as a complete event.
static int waiting(kn_spacenav *s)
{
    uint8_t bytes[8 * sizeof(int32_t)];
    ssize_t size = recv(spnav_fd(), bytes, sizeof bytes, MSG_PEEK | MSG_DONTWAIT);
    if (size == (ssize_t)event_bytes) return 1;
    if (size < 0 && (errno == EAGAIN || errno == EINTR)) return 0;
    kn_bridge_lost(s->bridge, "spacenavd: %s", size > 0 ? "an incomplete event" : size ? strerror(errno) : "hung up");
    return 0;
}

static void on_readable(struct ev_loop *ev, ev_io *watcher, int events)
{
    (void)events;
    kn_spacenav *s = watcher->data;
    // Limit the number of events per wake-up, so that a flood of events cannot delay the timer.
    int n = 0;
    for (; n < events_most && waiting(s); n++) {
        spnav_event event = {0};
        if (spnav_poll_event(&event) > 0) take(s, &event);
        else kn_tactile_bad(&s->base, "an event of unknown kind");
    }
    if (s->bridge->lost) ev_io_stop(ev, watcher);
}

static bool open_spacenav(kn_tactile *device, kn_bridge *bridge, char *error, size_t error_size)
{
    kn_spacenav *s = (kn_spacenav *)device;
    s->bridge = bridge;
    // libspnav leaks a little memory in every failed attempt, and the bridge tries twice a second. So call spnav_open
    // only if it may succeed: spacenavd's socket accepts a connection, or /etc/spnavrc exists, which may name another
    // socket.
    bool worth = kn_spacenav_reach() || access("/etc/spnavrc", R_OK) == 0;
    errno = 0; // clear errno, because libspnav would read the errno of an earlier call
    if (!worth || spnav_open() != 0) {
        snprintf(error, error_size, "spacenavd does not answer at %s: is it running? see knead devices",
                 kn_spacenav_socket());
        return false;
    }
    // Clear the deflection that the puck had before the connection was lost, so that it does not steer the tool now.
    memset(s->counts, 0, sizeof s->counts);
    s->puck.pose.buttons = 0;
    ev_io_init(&s->readable, on_readable, spnav_fd(), EV_READ);
    s->readable.data = s;
    ev_io_start(bridge->ev, &s->readable);
    return true;
}

static void close_spacenav(kn_tactile *device)
{
    kn_spacenav *s = (kn_spacenav *)device;
    ev_io_stop(s->bridge->ev, &s->readable);
    spnav_close();
}

static void tick(kn_tactile *device, int elapsed_ms)
{
    kn_spacenav *s = (kn_spacenav *)device;
    kn_puck_tick(&s->puck, s->counts, elapsed_ms);
    kn_bridge_moved(s->bridge, &s->puck.pose);
}

void kn_spacenav_init(kn_spacenav *s, const kn_puck_def *def)
{
    *s = (kn_spacenav){.base = {.name = "spacenav", .open = open_spacenav, .close = close_spacenav, .tick = tick}};
    kn_puck_init(&s->puck, def);
}
