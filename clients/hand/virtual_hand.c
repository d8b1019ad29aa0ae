#include "clients/hand/virtual_hand.h"
#include "core/algebra/algebra.h"
#include "proto/knead_contact_force_t.h"
#include "proto/knead_probe_pose_t.h"
#include "server/clock.h"
#include "server/wire.h"
#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <unistd.h>

// Longest wait until the server engages the tool; usually 200 ms of poses and 200 ms of ramp are needed.
static const int answer_ms = 3000;
static const int clear_ms = 1000; // time that the server has to clear a fault after the tool was lifted
// Time without poses between two attempts; the server ends a session after 1 s without poses.
static const int silence_ms = 1200;
// Return the record of the present attempt to play the path.
static kn_attempt *current(kn_hand *h) { return &h->attempt[h->tries - 1]; }

static void enter(kn_hand *h, kn_hand_mode mode)
{
    h->mode = mode;
    h->mode_ms = 0;
}

// Start an attempt to play the path: open a new session at the beginning of the path.
static void open_attempt(kn_hand *h)
{
    h->tries++;
    current(h)->session = h->def.session + h->tries - 1;
    h->force = (kn_hand_force){.session = current(h)->session, .tick = -1};
    h->engaged_n = 0.0;
    h->refusal = NULL;
    h->path_s = 0.0;
    h->piece = "engage";
    kn_tool_path_at(h->def.path, 0.0, &h->point);
    kn_watchdog_rearm(&h->watchdog);
    enter(h, KN_HAND_ENGAGE);
}

int64_t kn_hand_session(void)
{
    int64_t session = 0;
    if (getrandom(&session, sizeof session, 0) != sizeof session) session = kn_now_ns() ^ (int64_t)getpid() << 32;
    // The session number is not 0. It is so small that it never overflows when 1 is added for each further attempt.
    return (session & (INT64_MAX >> 1)) | 1 << 8;
}

void kn_hand_init(kn_hand *h, const kn_hand_def *def)
{
    memset(h, 0, sizeof *h);
    h->def = *def;
    if (h->def.tries <= 0 || h->def.tries > KN_HAND_TRIES) h->def.tries = KN_HAND_TRIES;
    kn_watchdog_init(&h->watchdog, h->def.hold_ms, h->def.zero_ms);
    open_attempt(h);
}

static void give_up(kn_hand *h, kn_hand_trouble trouble)
{
    h->trouble = trouble;
    enter(h, KN_HAND_GAVE_UP);
}

// Record the cause of a trip and start the retreat from the present pose.
static void trip(kn_hand *h, int elapsed_ms)
{
    kn_tool_path_point home;
    h->trip[h->trips++] = (kn_trip){
        .piece = h->piece,
        .time_s = h->path_s,
        .force_n = h->engaged_n,
        .refusal = h->refusal,
        .own = h->watchdog.tripped,
        .silent_ms = h->watchdog.silent_ms,
        .stalled_ms = elapsed_ms - 1,
        .fault = (kn_fault)h->force.fault,
    };
    // Plan the retreat: lift the tool first, then move it to the place where the path begins.
    kn_tool_path_at(h->def.path, 0.0, &home);
    kn_tool_path_retreat(&h->way_out, h->way_out_piece, &h->point, h->def.clear_z_m, &home);
    h->path_s = 0.0;
    enter(h, KN_HAND_RETREAT);
}

// Process a force message for the device, in every mode of the hand. A message resets the watchdog only if its tick is
// newer.
static void feel(kn_hand *h, const kn_hand_force *force, int elapsed_ms)
{
    bool fresh = force && force->session == current(h)->session && force->tick > h->force.tick;
    if (fresh) h->force = *force;
    if (fresh && (force->flags & KN_FLAG_ENGAGED)) h->engaged_n = sqrt(kn_dot(force->force_n, force->force_n));
    double factor = kn_watchdog_tick(&h->watchdog, fresh, elapsed_ms);
    // If messages stop, the watchdog fades the last force: `factor` falls to 0.
    for (int i = 0; i < 3; i++) h->given_n[i] = factor * h->force.force_n[i];
}

// Start the path when the server has engaged the tool. Give up if the server does not engage the tool in time.
static void engage(kn_hand *h)
{
    if (h->force.flags & KN_FLAG_ENGAGED) {
        current(h)->play_seq = current(h)->sent + 1;
        enter(h, KN_HAND_PLAY);
    } else if (h->mode_ms >= answer_ms) {
        // If the watchdog is armed, force messages have arrived: the server answers but has not engaged the tool.
        give_up(h, h->watchdog.armed ? KN_HAND_NOT_ENGAGED : KN_HAND_NO_ANSWER);
    }
}

// Wait until the tool is lifted and the server has had time to clear its fault.
static void retreat(kn_hand *h)
{
    bool latched = h->force.flags & KN_FLAG_LATCHED;
    double wait_ms = 1e3 * h->way_out.duration_s + (latched ? clear_ms : 0);
    if (h->mode_ms < wait_ms) return;
    h->trip[h->trips - 1].cleared = !h->watchdog.tripped && !latched;
    if (h->trips == h->def.tries) give_up(h, KN_HAND_SPOILT);
    else enter(h, KN_HAND_SILENT);
}

// Change the mode of the hand if necessary, before the pose of this millisecond is sent.
static void decide(kn_hand *h, int elapsed_ms)
{
    bool playing = h->mode == KN_HAND_ENGAGE || h->mode == KN_HAND_PLAY;
    bool latched = h->force.flags & KN_FLAG_LATCHED;
    if (playing && (h->watchdog.tripped || latched || h->refusal)) trip(h, elapsed_ms);
    if (h->mode == KN_HAND_ENGAGE) engage(h);
    else if (h->mode == KN_HAND_RETREAT) retreat(h);
    else if (h->mode == KN_HAND_SILENT && h->mode_ms >= silence_ms) open_attempt(h);
    if (h->mode == KN_HAND_PLAY && h->path_s > h->def.path->duration_s) enter(h, KN_HAND_DONE);
}

void kn_hand_refuse(kn_hand *h, const char *refusal, bool again)
{
    if (h->refusal || (h->mode != KN_HAND_ENGAGE && h->mode != KN_HAND_PLAY)) return;
    h->refusal = refusal;
    // If a further attempt is useless, make the present attempt the last one.
    if (!again) h->def.tries = h->tries;
}

void kn_hand_take_path(kn_hand *h, const kn_tool_path *path)
{
    assert(h->mode == KN_HAND_SILENT);
    h->def.path = path;
}

// Return true while the injected fault (drop_ms) suppresses poses.
static bool dropping(kn_hand *h)
{
    bool drop = h->mode == KN_HAND_PLAY && h->tries == 1 && h->dropped_ms < h->def.drop_ms &&
                h->path_s >= 1e-3 * h->def.drop_at_ms;
    h->dropped_ms += drop;
    return drop;
}

kn_hand_out kn_hand_tick(kn_hand *h, const kn_hand_force *force, int elapsed_ms)
{
    feel(h, force, elapsed_ms);
    decide(h, elapsed_ms);
    h->mode_ms++;
    bool end = h->mode == KN_HAND_DONE || h->mode == KN_HAND_GAVE_UP;
    // Send no pose while the hand is silent, at the end, or during the gap of the fault injection.
    if (h->mode == KN_HAND_SILENT || end || dropping(h)) return (kn_hand_out){.end = end};
    // Advance on the path. While the hand is engaging, the tool stays at the first point.
    if (h->mode != KN_HAND_ENGAGE) {
        const kn_tool_path *path = h->mode == KN_HAND_PLAY ? h->def.path : &h->way_out;
        h->piece = kn_tool_path_at(path, h->path_s, &h->point)->name;
        h->path_s += 1e-3;
    }
    return (kn_hand_out){.send = true, .session = current(h)->session, .seq = ++current(h)->sent, .point = h->point};
}

bool kn_motor_record_open(kn_motor_record *m, int room)
{
    *m = (kn_motor_record){.row = malloc(sizeof *m->row * (size_t)room), .room = room};
    // Write to all memory pages now, so that no page fault delays the thread of the device.
    if (m->row) memset(m->row, 0, sizeof *m->row * (size_t)room);
    return m->row != NULL;
}

void kn_motor_record_close(kn_motor_record *m)
{
    free(m->row);
    *m = (kn_motor_record){0};
}

void kn_motor_record_add(kn_motor_record *m, const kn_hand *h, const double position_m[3], const double force_n[3],
                         int elapsed_ms)
{
    m->ms += elapsed_ms;
    // If the list is full, drop the new row but continue to count the time.
    if (m->count == m->room) return;
    kn_motor_record_row *row = &m->row[m->count++];
    *row = (kn_motor_record_row){.ms = m->ms,
                                 .tick = h->force.tick,
                                 .doing = h->mode == KN_HAND_SILENT ? "silent" : h->piece,
                                 .attempt = h->tries,
                                 .contacts = h->force.contacts,
                                 .silent_ms = h->watchdog.silent_ms};
    memcpy(row->position_m, position_m, sizeof row->position_m);
    memcpy(row->force_n, force_n, sizeof row->force_n);
}

void kn_motor_record_csv(FILE *out, const kn_motor_record *m)
{
    fprintf(out, "time_s,try,doing,x_m,y_m,z_m,fx_n,fy_n,fz_n,contacts,silent_ms,tick\n");
    for (int i = 0; i < m->count; i++) {
        const kn_motor_record_row *r = &m->row[i];
        const double *x = r->position_m, *f = r->force_n;
        fprintf(out, "%.3f,%d,%s,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%d,%d,%lld\n", 1e-3 * (double)r->ms, r->attempt,
                r->doing, x[0], x[1], x[2], f[0], f[1], f[2], r->contacts, r->silent_ms, (long long)r->tick);
    }
}

// Publish the state of the hand for other threads.
static void tell(kn_hand_player *p)
{
    const double *f = p->hand.given_n;
    atomic_store(&p->path_ms, (int)lround(1e3 * p->hand.path_s));
    atomic_store(&p->given_mn, (int)lround(1e3 * sqrt(kn_dot(f, f))));
    atomic_store(&p->piece, p->hand.piece);
    atomic_store(&p->tries, p->hand.tries);
    atomic_store(&p->trips, p->hand.trips);
    // Store the mode last, so that the other values are valid when another thread sees the new mode.
    atomic_store(&p->mode, (int)p->hand.mode);
}

void kn_hand_player_init(kn_hand_player *p, const kn_hand_def *def)
{
    kn_hand_init(&p->hand, def);
    tell(p);
}

kn_hand_out kn_hand_player_tick(void *self, const kn_hand_force *force, int elapsed_ms)
{
    kn_hand_player *p = self;
    // Between two attempts, fetch the path that another thread has prepared for the next attempt.
    if (p->hand.mode == KN_HAND_SILENT && atomic_load(&p->next_path))
        kn_hand_take_path(&p->hand, atomic_exchange(&p->next_path, NULL));
    kn_hand_out out = kn_hand_tick(&p->hand, force, elapsed_ms);
    if (!p->gripped) kn_motor_record_add(&p->motors, &p->hand, p->hand.point.position_m, p->hand.given_n, elapsed_ms);
    tell(p);
    return out;
}

// Real-time priority of the device's thread. The priority is below the priorities of kneadd's threads, because the
// thread stands for a real device, which has its own processor and cannot delay kneadd.
static const int device_priority = 60;
#define REST_MS 10 // time between two calls of a hand that sends no poses

// Handle a force message. Keep only the newest force.
static void on_force(const lcm_recv_buf_t *buf, const char *channel, void *self)
{
    (void)channel;
    kn_virtual_device *d = self;
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
    kn_virtual_device *d = self;
    knead_contact_model_t message;
    kn_hand_force *f = &d->force;
    if (knead_contact_model_t_decode(buf->data, 0, (int)buf->data_size, &message) < 0) return;
    // The contact messages of one tick have the same time stamp. A new time stamp starts a new list of contacts.
    if (f->units > 0 && (f->unit->utime != message.utime || f->units == KN_CONTACT_UNITS)) f->units = 0;
    kn_wire_unit(&f->unit[f->units++], &message);
}

// Publish a pose of the tool on the bus, stamped with the present time.
static void send_pose(kn_virtual_device *d, const kn_hand_out *out, int32_t buttons)
{
    uint8_t bytes[256];
    knead_probe_pose_t pose = {.utime = kn_stamp_us(), .session = out->session, .seq = out->seq, .buttons = buttons};
    memcpy(pose.position_m, out->point.position_m, sizeof pose.position_m);
    memcpy(pose.velocity_m_s, out->point.velocity_m_s, sizeof pose.velocity_m_s);
    memcpy(pose.orientation_wxyz, out->point.orientation_wxyz, sizeof pose.orientation_wxyz);
    pose.frame = KNEAD_PROBE_POSE_T_FRAME_SCENE;
    pose.sent_ns = kn_now_ns();
    int size = knead_probe_pose_t_encode(bytes, 0, sizeof bytes, &pose);
    // If a pose cannot be sent, do not send it again: the watchdogs handle lost poses.
    kn_bus_client_send(d->bus, d->pose_channel, bytes, size);
}

// Publish one last pose with the information that the hand leaves the tool. This pose is sent once per session.
static void say_leaving(kn_virtual_device *d)
{
    if (!d->last.send) return;
    d->last.seq++;
    send_pose(d, &d->last, KNEAD_PROBE_POSE_T_BUTTON_LEAVING);
    d->last.send = false;
}

// Join the bus and subscribe to the channels of the tool. Fail if this process may not send, because a device must send
// poses.
static bool open_bus(kn_virtual_device *d)
{
    d->bus = kn_bus_client_open(d->url, KN_FORCE_URL, d->error, d->error_size);
    return d->bus && kn_bus_client_speaks(d->error, d->error_size) &&
           kn_bus_client_hear(d->bus, d->force_channel, on_force, d) &&
           kn_bus_client_hear(d->bus, d->contact_channel, on_contact, d);
}

bool kn_virtual_device_tick(kn_virtual_device *d, int elapsed_ms)
{
    d->fresh = false;
    kn_bus_client_handle(d->bus, 0); // handle all waiting messages, so that the newest force is known
    kn_hand_out out = d->hand(d->self, d->fresh ? &d->force : NULL, elapsed_ms);
    if (out.send) send_pose(d, &out, 0), d->last = out;
    if (out.end || out.leaves) say_leaving(d);
    return !out.end;
}

// Main function of the device's thread: join the bus, then call the hand once per millisecond. A hand that sends no
// poses, because it has let go of its tool, is called every REST_MS.
static void *device_main(void *self)
{
    kn_virtual_device *d = self;
    d->priority_error = kn_bus_client_priority(device_priority);
    bool ok = open_bus(d);
    if (!ok) atomic_store(&d->stop, true);
    // Wake up kn_virtual_device_start, which waits until the bus has been joined.
    sem_post(&d->ready);

    kn_clock clock;
    kn_clock_start(&clock, kn_now_ns());
    int rested_ms = 0;
    for (bool goes_on = true; goes_on && !atomic_load(&d->stop);) {
        // Count the cycles that this thread missed, and report their number to the hand. Missed cycles are not played
        // later.
        int missed = kn_clock_wait(&clock).missed;
        atomic_fetch_add(&d->missed, missed);
        goes_on = kn_virtual_device_tick(d, 1 + missed + rested_ms);
        rested_ms = 0;
        if (d->last.send || !goes_on) continue;
        const int64_t since_ns = kn_now_ns();
        usleep(1000 * REST_MS);
        kn_clock_start(&clock, kn_now_ns());
        rested_ms = (int)((kn_now_ns() - since_ns) / INT64_C(1000000));
    }
    atomic_store(&d->done, true);
    return NULL;
}

static void prepare(kn_virtual_device *d, kn_virtual_device_hand *hand, void *self, const char *url, const char *probe,
                    char *error, size_t error_size)
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

bool kn_virtual_device_join(kn_virtual_device *d, kn_virtual_device_hand *hand, void *self, const char *url,
                            const char *probe, char *error, size_t error_size)
{
    prepare(d, hand, self, url, probe, error, error_size);
    return open_bus(d);
}

void kn_virtual_device_leave(kn_virtual_device *d)
{
    if (d->bus) say_leaving(d);
    kn_bus_client_close(d->bus);
    d->bus = NULL;
}

bool kn_virtual_device_start(kn_virtual_device *d, kn_virtual_device_hand *hand, void *self, const char *url,
                             const char *probe, char *error, size_t error_size)
{
    prepare(d, hand, self, url, probe, error, error_size);
    sem_init(&d->ready, 0, 0);
    if (pthread_create(&d->thread, NULL, device_main, d) != 0) {
        snprintf(error, error_size, "cannot start a thread for the device");
        return false;
    }
    while (sem_wait(&d->ready) != 0)
        ; // sem_wait was interrupted by a signal, so wait again
    if (!atomic_load(&d->stop)) return true;
    kn_virtual_device_stop(d);
    return false;
}

int kn_virtual_device_priority_error(const kn_virtual_device *d) { return d->priority_error; }

void kn_virtual_device_stop(kn_virtual_device *d)
{
    atomic_store(&d->stop, true);
    pthread_join(d->thread, NULL);
    kn_virtual_device_leave(d);
    sem_destroy(&d->ready);
}
