#include "clients/knead/device.h"
#include "clients/knead/join.h"
#include "proto/knead_contact_force_t.h"
#include "proto/knead_probe_pose_t.h"
#include "server/clock.h"
#include "server/wire.h"
#include <stdio.h>
#include <string.h>

// Real-time priority of the device's thread. It is below that of kneadd's threads, because a real device has its own
// processor and never delays kneadd.
static const int device_priority = 60;

// Handle a force message. Keep only the newest force.
static void on_force(const lcm_recv_buf_t *buf, const char *channel, void *self)
{
    (void)channel;
    kn_device *d = self;
    knead_contact_force_t f;
    if (knead_contact_force_t_decode(buf->data, 0, (int)buf->data_size, &f) < 0) return;
    // Ignore a force message that is a repetition, or that arrives after a newer message.
    if (f.session == d->force.session && f.tick <= d->force.tick) return;
    d->force.session = f.session;
    d->force.seq = f.seq;
    d->force.tick = f.tick;
    d->force.sent_ns = f.sent_ns;
    d->force.energy_j = f.energy_j;
    d->force.flags = f.flags;
    d->force.fault = f.fault;
    d->force.contacts = f.contacts;
    memcpy(d->force.force_n, f.force_n, sizeof d->force.force_n);
    d->fresh = true;
}

// Handle a message with one entry of the local contact model.
static void on_contact(const lcm_recv_buf_t *buf, const char *channel, void *self)
{
    (void)channel;
    kn_device *d = self;
    knead_contact_model_t message;
    kn_hand_force *f = &d->force;
    if (knead_contact_model_t_decode(buf->data, 0, (int)buf->data_size, &message) < 0) return;
    // The contact messages of one tick have the same time stamp. A new time stamp starts a new list of contacts.
    if (f->units > 0 && (f->unit->utime != message.utime || f->units == KN_CONTACT_UNITS)) f->units = 0;
    kn_wire_unit(&f->unit[f->units++], &message);
}

// Publish a pose of the tool on the bus, stamped with the present time.
static void publish(kn_device *d, const kn_hand_out *out, int32_t buttons)
{
    uint8_t bytes[256];
    knead_probe_pose_t pose = {.utime = kn_stamp_us(), .session = out->session, .seq = out->seq, .buttons = buttons};
    memcpy(pose.position_m, out->point.position_m, sizeof pose.position_m);
    memcpy(pose.velocity_m_s, out->point.velocity_m_s, sizeof pose.velocity_m_s);
    memcpy(pose.orientation_wxyz, out->point.orientation_wxyz, sizeof pose.orientation_wxyz);
    pose.frame = KNEAD_PROBE_POSE_T_FRAME_SCENE;
    pose.sent_ns = kn_now_ns();
    int size = knead_probe_pose_t_encode(bytes, 0, sizeof bytes, &pose);
    // A pose that cannot be sent is simply lost, because the watchdogs handle lost poses.
    kn_join_send(d->bus, d->pose_channel, bytes, size);
}

// Publish one last pose with the information that the hand leaves the tool. This pose is sent once per session.
static void say_leaving(kn_device *d)
{
    if (!d->last.send) return;
    d->last.seq++;
    publish(d, &d->last, KNEAD_PROBE_POSE_T_BUTTON_LEAVING);
    d->last.send = false;
}

// Join the bus and subscribe to the channels of the tool. Fail if this process may not send, because a device must send
// poses.
static bool open_bus(kn_device *d)
{
    d->bus = kn_join_open(d->url, KN_FORCE_URL, d->error, d->error_size);
    return d->bus && kn_join_speaks(d->error, d->error_size) && kn_join_hear(d->bus, d->force_channel, on_force, d) &&
           kn_join_hear(d->bus, d->contact_channel, on_contact, d);
}

bool kn_device_tick(kn_device *d, int elapsed_ms)
{
    d->fresh = false;
    kn_join_handle(d->bus, 0); // handle all waiting messages, so that the newest force is known
    kn_hand_out out = d->hand(d->self, d->fresh ? &d->force : NULL, elapsed_ms);
    if (out.send) publish(d, &out, 0), d->last = out;
    if (out.end || out.leaves) say_leaving(d);
    return !out.end;
}

// Main function of the device's thread: join the bus, then call the hand once per millisecond.
static void *run(void *self)
{
    kn_device *d = self;
    d->priority_error = kn_join_priority(device_priority);
    bool ok = open_bus(d);
    if (!ok) atomic_store(&d->stop, true);
    // Wake up kn_device_start, which waits until the bus has been joined.
    sem_post(&d->ready);

    kn_clock clock;
    kn_clock_start(&clock, kn_now_ns());
    for (bool goes_on = true; goes_on && !atomic_load(&d->stop);) {
        // Count cycles that this thread missed and report them to the hand. They are not played later.
        int missed = kn_clock_wait(&clock).missed;
        atomic_fetch_add(&d->missed, missed);
        goes_on = kn_device_tick(d, 1 + missed);
    }
    atomic_store(&d->done, true);
    return NULL;
}

static void prepare(kn_device *d, kn_device_hand *hand, void *self, const char *url, const char *probe, char *error,
                    size_t error_size)
{
    d->hand = hand;
    d->self = self;
    d->url = url;
    d->error = error;
    d->error_size = error_size;
    snprintf(d->pose_channel, sizeof d->pose_channel, "KNEAD_POSE_%s", probe);
    snprintf(d->force_channel, sizeof d->force_channel, "KNEAD_FORCE_%s", probe);
    snprintf(d->contact_channel, sizeof d->contact_channel, "KNEAD_CONTACT_%s", probe);
}

bool kn_device_join(kn_device *d, kn_device_hand *hand, void *self, const char *url, const char *probe, char *error,
                    size_t error_size)
{
    prepare(d, hand, self, url, probe, error, error_size);
    return open_bus(d);
}

void kn_device_leave(kn_device *d)
{
    if (d->bus) say_leaving(d);
    kn_join_close(d->bus);
    d->bus = NULL;
}

bool kn_device_start(kn_device *d, kn_device_hand *hand, void *self, const char *url, const char *probe, char *error,
                     size_t error_size)
{
    prepare(d, hand, self, url, probe, error, error_size);
    sem_init(&d->ready, 0, 0);
    if (pthread_create(&d->thread, NULL, run, d) != 0) {
        snprintf(error, error_size, "cannot start a thread for the device");
        return false;
    }
    while (sem_wait(&d->ready) != 0)
        ; // sem_wait was interrupted by a signal, so wait again
    if (!atomic_load(&d->stop)) return true;
    kn_device_stop(d);
    return false;
}

int kn_device_priority_error(const kn_device *d) { return d->priority_error; }

void kn_device_stop(kn_device *d)
{
    atomic_store(&d->stop, true);
    pthread_join(d->thread, NULL);
    kn_device_leave(d);
    sem_destroy(&d->ready);
}
