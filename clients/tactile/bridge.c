#include "clients/tactile/bridge.h"
#include "clients/hand/bus_client.h"
#include "proto/knead_probe_pose_t.h"
#include "server/clock.h"
#include "server/wire.h"
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/timerfd.h>
#include <unistd.h>

// Priority of the bridge's thread (SCHED_FIFO). The threads of kneadd have higher priorities, so the bridge needs
// another processor than kneadd's servo thread.
static const int priority = 60;
static const int retry_ms = 500;

// ---- mounting

void kn_mount_init(kn_device_def *d)
{
    *d = (kn_device_def){.basis = {1, 2, 3}, .rotation_wxyz = {1.0}, .scale = 1.0, .force_scale = 1.0};
}

bool kn_mount_basis(kn_device_def *d, const char *text, char *error, size_t error_size)
{
    kn_device_def turned = *d;
    const char *at = text, *wrong = NULL;
    // Read one optional sign and one letter per axis. The axes have the numbers 1 to 3; an unknown letter gets the
    // number 0.
    for (int i = 0; i < 3; i++) {
        double sign = *at == '-' ? -1.0 : 1.0;
        at += *at == '-' || *at == '+';
        const char *letter = *at ? strchr("XYZxyz", *at) : NULL;
        turned.basis[i] = letter ? sign * (double)((letter - "XYZxyz") % 3 + 1) : 0.0;
        at += letter != NULL;
    }
    // kn_device_check refuses unknown letters, repeated axes and left-handed bases.
    wrong = *at ? "more than three axes, expected something like XYZ or Y-XZ" : kn_device_check(&turned);
    if (!wrong) memcpy(d->basis, turned.basis, sizeof d->basis);
    else snprintf(error, error_size, "%s", wrong);
    return !wrong;
}

void kn_mount_orientation(const kn_device_def *d, const double device_wxyz[4], double scene_wxyz[4])
{
    double a[3][3];
    kn_device_axes(d, a);
    scene_wxyz[0] = device_wxyz[0]; // the matrix A turns the axis of the rotation; the angle stays unchanged
    for (int i = 0; i < 3; i++)
        scene_wxyz[1 + i] = a[i][0] * device_wxyz[1] + a[i][1] * device_wxyz[2] + a[i][2] * device_wxyz[3];
}

// ---- bridge

void kn_tactile_bad(kn_tactile *device, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    vsnprintf(device->why, sizeof device->why, format, args);
    va_end(args);
    device->bad++;
}

void kn_bridge_lost(kn_bridge *b, const char *format, ...)
{
    va_list args;
    if (b->lost) return; // the device is already reported lost, so keep the first reason
    va_start(args, format);
    vsnprintf(b->now.why, sizeof b->now.why, format, args);
    va_end(args);
    b->lost = true;
}

static double now_s(void) { return 1e-9 * (double)kn_now_ns(); }

// Give the device its newest force. Enable the motors only if the session allows a force and the device's own watchdog
// is trusted.
static void answer(kn_bridge *b)
{
    const kn_device_session *t = &b->now.session;
    b->answered = true;
    if (b->device->watchdog == KN_OWN_UNPROVED) return; // prove() sends the commands
    bool live = kn_device_session_live(t) && b->device->watchdog == KN_OWN_TRUSTED;
    if (b->open && b->device->give) b->device->give(b->device, t->render.given_n, live);
}

// Test of a device's own watchdog, at 0 N. Times count from the first command:
//
//     0 ms    commands with the motors off
//     10 ms   commands with the motors on
//     30 ms   the device reports that its motors are on; no more commands
//     130 ms  the next report decides: the device must have switched its motors off by itself
//
// If its motors do not come on, or this thread was late with a command, the test begins again, five times at most.
enum { ON_MS = 10, SILENT_MS = 30, JUDGED_MS = 130, LATE_MS = 5, TESTS = 5 };

static void prove(kn_bridge *b, int elapsed_ms)
{
    kn_tactile *d = b->device;
    const int before_ms = b->proof_ms, ms = b->proof_ms += elapsed_ms;
    const char *why = NULL;
    if (before_ms > 0 && before_ms < SILENT_MS && elapsed_ms > LATE_MS)
        why = "this program was late in 5 tests of its watchdog";
    else if (before_ms < SILENT_MS && ms >= SILENT_MS && !d->motors)
        why = "its motors were off in 5 tests of its watchdog: is its force switched on?";
    if (why) {
        b->proof_ms = 0;
        if (++b->tests < TESTS) return;
        b->now.untrusted = why;
        d->watchdog = KN_OWN_MISSING;
    } else if (ms < SILENT_MS) {
        d->give(d, (double[3]){0}, ms >= ON_MS);
    } else if (ms < JUDGED_MS) {
        b->proof_messages = d->messages;
    } else if (d->messages > b->proof_messages) {
        b->now.untrusted =
            "its watchdog has not acted in 100 ms of silence, so the force would stay on if this program died";
        d->watchdog = d->motors ? KN_OWN_MISSING : KN_OWN_TRUSTED;
    }
}

static void send_pose(kn_bridge *b, knead_probe_pose_t *pose)
{
    uint8_t bytes[256];
    pose->utime = kn_stamp_us();
    pose->sent_ns = kn_now_ns();
    int size = knead_probe_pose_t_encode(bytes, 0, sizeof bytes, pose);
    kn_bus_client_send(b->bus, b->pose_channel, bytes, size); // do not retry: the watchdogs cover a lost pose
}

// Take a pose of the device: turn it into the scene's axes, add the number of the session and of the pose, and send it.
void kn_bridge_moved(kn_bridge *b, const kn_tactile_pose *device)
{
    kn_device_session *t = &b->now.session;
    // only let_go may set the button that means "the hand leaves the tool"
    knead_probe_pose_t pose = {.buttons = device->buttons & ~KNEAD_PROBE_POSE_T_BUTTON_LEAVING,
                               .frame = KNEAD_PROBE_POSE_T_FRAME_SCENE};
    kn_device_position(&b->mount, device->position_m, pose.position_m);
    kn_device_velocity(&b->mount, device->velocity_m_s, pose.velocity_m_s);
    kn_mount_orientation(&b->mount, device->orientation_wxyz, pose.orientation_wxyz);
    // The local model needs the tool's orientation before it computes the force for this pose.
    kn_haptic_render_turn(&t->render, pose.orientation_wxyz);
    b->now.arrivals += !b->now.there;
    b->now.there = true;
    if (b->device->watchdog == KN_OWN_UNPROVED) return; // kneadd must not push before the device may
    if (!kn_device_session_pose(t, device->position_m, device->velocity_m_s)) return;
    pose.session = t->session;
    pose.seq = t->seq;
    send_pose(b, &pose);
    b->last = pose;
    memcpy(b->now.position_m, pose.position_m, sizeof pose.position_m);
    // With the local model, compute and give the force for this pose at once. Exception: a device that sends a pose
    // only as an answer to a force gets its force in the next tick.
    if (!t->render.def.local || b->device->answers) return;
    kn_device_session_give(t, now_s());
    answer(b);
}

static void on_force(const lcm_recv_buf_t *buf, const char *channel, void *self)
{
    (void)channel;
    kn_bridge *b = self;
    knead_contact_force_t f;
    if (knead_contact_force_t_decode(buf->data, 0, (int)buf->data_size, &f) < 0) return;
    b->heard |= kn_device_session_take(&b->now.session, &f, 1e-9 * (double)(kn_now_ns() - f.sent_ns));
}

static void on_contact(const lcm_recv_buf_t *buf, const char *channel, void *self)
{
    (void)channel;
    kn_bridge *b = self;
    knead_contact_model_t message;
    kn_contact_unit unit;
    if (knead_contact_model_t_decode(buf->data, 0, (int)buf->data_size, &message) < 0) return;
    kn_wire_unit(&unit, &message);
    kn_haptic_render_contact(&b->now.session.render, &unit);
}

// Close a device that was reported lost. The device is closed in the tick and not at once, because a driver must not be
// closed inside its own callback.
static void close_lost(kn_bridge *b)
{
    if (!b->lost) return;
    b->lost = false;
    b->device->close(b->device);
    b->now.losses += b->now.there;
    b->open = b->now.there = b->device->motors = false;
    b->proof_ms = b->tests = 0;
    b->retry_ms = retry_ms;
}

void kn_bridge_hear(kn_bridge *b)
{
    // Read every waiting message, so that the device gets only the newest force.
    kn_bus_client_handle(b->bus, 0);
    if (b->heard && !b->now.session.render.def.local) {
        kn_device_session_give(&b->now.session, now_s());
        answer(b);
    }
    b->heard = false;
}

static void on_forces(struct ev_loop *ev, ev_io *watcher, int events)
{
    (void)ev, (void)events;
    kn_bridge_hear(watcher->data);
}

static void open_device(kn_bridge *b)
{
    char error[sizeof b->now.why];
    b->retry_ms = retry_ms;
    b->open = b->device->open(b->device, b, error, sizeof error);
}

void kn_bridge_tick(kn_bridge *b, int elapsed_ms)
{
    kn_tactile *d = b->device;
    b->now.late += elapsed_ms - 1;
    // Let the driver run first, because it may report a pose or a loss in this tick.
    if (b->open && d->tick) d->tick(d, elapsed_ms);
    if (b->now.there && d->watchdog == KN_OWN_UNPROVED) prove(b, elapsed_ms);
    bool live = kn_device_session_live(&b->now.session);
    kn_device_session_tick(&b->now.session, now_s(), elapsed_ms);
    // Call `give` in this tick even without a new force, so that a tripped watchdog switches the motors off at once.
    if (!b->answered || kn_device_session_live(&b->now.session) != live) answer(b);
    b->answered = false;
    close_lost(b);
    if (!b->open && (b->retry_ms -= elapsed_ms) <= 0) open_device(b);

    // Post the bridge's state for other threads. The mailbox never blocks this thread.
    b->now.device = *d;
    *(kn_bridge_news *)kn_mailbox_back(&b->news) = b->now;
    kn_mailbox_post(&b->news);
}

static void on_timer(struct ev_loop *ev, ev_io *watcher, int events)
{
    (void)ev, (void)events;
    kn_bridge *b = watcher->data;
    // The timer tells how many periods have passed since the last read, so the watchdogs notice a stall of this
    // process. A stall of more than 1 s counts as 1 s.
    uint64_t times = 1;
    if (read(b->timer_fd, &times, sizeof times) == sizeof times) kn_bridge_tick(b, times < 1000 ? (int)times : 1000);
}

static void on_stop(struct ev_loop *ev, ev_async *watcher, int events)
{
    (void)watcher, (void)events;
    ev_break(ev, EVBREAK_ALL);
}

static bool open_bus(kn_bridge *b)
{
    b->bus = kn_bus_client_open(b->url, KN_FORCE_URL, b->error, b->error_size);
    return b->bus && kn_bus_client_speaks(b->error, b->error_size) &&
           kn_bus_client_hear(b->bus, b->force_channel, on_force, b) &&
           (!b->now.session.render.def.local || kn_bus_client_hear(b->bus, b->contact_channel, on_contact, b));
}

static bool watch(kn_bridge *b)
{
    ev_io_init(&b->forces, on_forces, kn_bus_client_fd(b->bus), EV_READ);
    b->forces.data = b;
    ev_io_start(b->ev, &b->forces);
    // Use a timerfd, because libev's own timers have only the millisecond resolution of epoll.
    const struct itimerspec every = {{0, KN_PERIOD_NS}, {0, KN_PERIOD_NS}};
    b->timer_fd = timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);
    if (b->timer_fd < 0 || timerfd_settime(b->timer_fd, 0, &every, NULL) != 0) {
        snprintf(b->error, b->error_size, "no timer: %s", strerror(errno));
        return false;
    }
    ev_io_init(&b->timer, on_timer, b->timer_fd, EV_READ);
    b->timer.data = b;
    ev_io_start(b->ev, &b->timer);
    return true;
}

// Tell kneadd that the hand leaves the tool, and close the device.
static void let_go(kn_bridge *b)
{
    if (b->last.session) {
        b->last.seq++;
        b->last.buttons |= KNEAD_PROBE_POSE_T_BUTTON_LEAVING;
        send_pose(b, &b->last);
    }
    if (b->open && b->device->give) b->device->give(b->device, (double[3]){0}, false);
    if (b->open) b->device->close(b->device);
    if (b->device->destroy) b->device->destroy(b->device);
}

// Thread of the bridge: report to kn_bridge_start whether the start succeeded, then run until on_stop.
static void *run(void *self)
{
    kn_bridge *b = self;
    b->priority_error = kn_bus_client_priority(priority);
    bool ok = open_bus(b) && watch(b) && b->device->open(b->device, b, b->error, b->error_size);
    b->open = ok;
    atomic_store(&b->up, ok);
    sem_post(&b->ready);
    if (ok) ev_run(b->ev, 0);
    let_go(b);
    return NULL;
}

static void close_all(kn_bridge *b)
{
    kn_bus_client_close(b->bus);
    if (b->timer_fd >= 0) close(b->timer_fd);
    if (b->ev) ev_loop_destroy(b->ev);
    sem_destroy(&b->ready);
}

static void prepare(kn_bridge *b, const kn_bridge_def *def, kn_tactile *device, char *error, size_t error_size)
{
    b->device = device;
    b->url = def->url;
    b->mount = def->render.device;
    b->error = error;
    b->error_size = error_size;
    b->timer_fd = -1;
    snprintf(b->pose_channel, sizeof b->pose_channel, "KNEAD_POSE_%s", def->probe);
    snprintf(b->force_channel, sizeof b->force_channel, "KNEAD_FORCE_%s", def->probe);
    snprintf(b->contact_channel, sizeof b->contact_channel, "KNEAD_CONTACT_%s", def->probe);
    b->now.untrusted = "its watchdog cannot be tested";
    kn_device_session_init(&b->now.session, def->session, &def->render);
    kn_mailbox_init(&b->news, b->slots, sizeof *b->slots);
}

bool kn_bridge_open(kn_bridge *b, const kn_bridge_def *def, kn_tactile *device, char *error, size_t error_size)
{
    prepare(b, def, device, error, error_size);
    return open_bus(b) && (b->open = device->open(device, b, error, error_size));
}

void kn_bridge_close(kn_bridge *b)
{
    let_go(b);
    kn_bus_client_close(b->bus);
}

bool kn_bridge_start(kn_bridge *b, const kn_bridge_def *def, kn_tactile *device, char *error, size_t error_size)
{
    prepare(b, def, device, error, error_size);
    sem_init(&b->ready, 0, 0);
    b->ev = ev_loop_new(EVFLAG_AUTO);
    if (b->ev) {
        ev_async_init(&b->stop, on_stop);
        ev_async_start(b->ev, &b->stop);
    }
    if (!b->ev || pthread_create(&b->thread, NULL, run, b) != 0) {
        snprintf(error, error_size, "cannot start the thread of the device");
        close_all(b);
        return false;
    }
    // Wait again if a signal has interrupted sem_wait.
    while (sem_wait(&b->ready) != 0)
        ;
    if (atomic_load(&b->up)) return true;
    pthread_join(b->thread, NULL);
    close_all(b);
    return false;
}

const kn_bridge_news *kn_bridge_latest(kn_bridge *b)
{
    bool fresh;
    return kn_mailbox_latest(&b->news, &fresh);
}

void kn_bridge_stop(kn_bridge *b)
{
    ev_async_send(b->ev, &b->stop);
    pthread_join(b->thread, NULL);
    close_all(b);
}
