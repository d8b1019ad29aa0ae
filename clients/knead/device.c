#include "clients/knead/device.h"
#include "clients/knead/join.h"
#include "proto/knead_contact_force_t.h"
#include "proto/knead_probe_pose_t.h"
#include "server/clock.h"
#include "server/wire.h"
#include <stdio.h>
#include <string.h>

// Real-time priority, below kneadd's threads: a real device has a processor of its own and never delays kneadd.
static const int device_priority = 60;

// Take a force message. Keep only the newest force.
static void on_force(const lcm_recv_buf_t *buf, const char *channel, void *self)
{
    (void)channel;
    kn_device *d = self;
    knead_contact_force_t f;
    if (knead_contact_force_t_decode(buf->data, 0, (int)buf->data_size, &f) < 0) return;
    // Ignore a message that is repeated, or that was overtaken by a newer message.
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

// Take a message of the local contact model.
static void on_contact(const lcm_recv_buf_t *buf, const char *channel, void *self)
{
    (void)channel;
    kn_device *d = self;
    knead_contact_model_t message;
    kn_hand_force *f = &d->force;
    if (knead_contact_model_t_decode(buf->data, 0, (int)buf->data_size, &message) < 0) return;
    // Messages of one tick have the same time. A new time starts a new list.
    if (f->units > 0 && (f->unit->utime != message.utime || f->units == KN_CONTACT_UNITS)) f->units = 0;
    kn_wire_unit(&f->unit[f->units++], &message);
}

// Publish a pose of the tool, stamped with the present time.
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
    // Poses may be lost. The watchdogs handle lost poses.
    kn_join_send(d->bus, d->pose_channel, bytes, size);
}

// Publish one last pose that says the hand leaves the tool. It is sent once per session.
static void say_leaving(kn_device *d)
{
    if (!d->last.send) return;
    d->last.seq++;
    publish(d, &d->last, KNEAD_PROBE_POSE_T_BUTTON_LEAVING);
    d->last.send = false;
}

// Join the bus and subscribe to the tool's channels. A process that may not send cannot be a device.
static bool open_bus(kn_device *d)
{
    d->bus = kn_join_open(d->url, KN_FORCE_URL, d->error, d->error_size);
    return d->bus && kn_join_speaks(d->error, d->error_size) && kn_join_hear(d->bus, d->force_channel, on_force, d) &&
           kn_join_hear(d->bus, d->contact_channel, on_contact, d);
}

bool kn_device_tick(kn_device *d, int elapsed_ms)
{
    d->fresh = false;
    kn_join_handle(d->bus, 0); // take all waiting messages and keep the newest force
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
    // kn_device_start waits for the result.
    sem_post(&d->ready);

    kn_clock clock;
    kn_clock_start(&clock, kn_now_ns());
    for (bool goes_on = true; goes_on && !atomic_load(&d->stop);) {
        // Missed cycles are counted and reported to the hand, but they are not played later.
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
        ; // interrupted by a signal: wait again
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
