#include "server/exchange.h"
#include "server/wire.h"
#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

// --- publisher ---

// room for a message of any type of fixed size, bytes; the largest type, status_t, has about 1 kB
#define ROOM_FIXED 2048
_Static_assert(sizeof(knead_status_t) + 64 <= ROOM_FIXED, "a status fits");

// From now on publish `scene`, which must have the same probes as the scene published before. Borrows `scene`. May
// allocate. If memory is short, return false and keep publishing the previous scene.
static bool take_scene(kn_publisher *p, const kn_scene *scene)
{
    knead_scene_t message;
    // the scene is the only message whose size varies: allocate room for it now, not while publishing
    kn_wire_scene(&message, scene, p->initial_hash, 0);
    int room = ROOM_FIXED + knead_scene_t_encoded_size(&message);
    if (room > p->room) {
        uint8_t *bytes = realloc(p->bytes, (size_t)room + KN_AUTH_TRAILER);
        if (!bytes) return false;
        p->bytes = bytes;
        p->room = room;
    }
    p->scene = scene;
    return true;
}

bool kn_publisher_open(kn_publisher *p, const char *url, const kn_scene *scene, uint64_t initial_hash, char *error,
                       size_t error_size)
{
    *p = (kn_publisher){.scene = scene, .initial_hash = initial_hash};
    // format the channel names once, not for every force
    for (int i = 0; i < scene->model.probe_count; i++) {
        snprintf(p->force_channel[i], sizeof p->force_channel[i], "KNEAD_FORCE_%s", scene->model.probe[i].name);
        snprintf(p->touch_channel[i], sizeof p->touch_channel[i], "KNEAD_TOUCH_%s", scene->model.probe[i].name);
        snprintf(p->contact_channel[i], sizeof p->contact_channel[i], "KNEAD_CONTACT_%s", scene->model.probe[i].name);
    }
    p->lcm = take_scene(p, scene) ? lcm_create(url) : NULL;
    if (p->lcm) return true;
    snprintf(error, error_size, "%s: %s", url, p->bytes ? "LCM refused this URL" : "out of memory");
    kn_publisher_close(p);
    return false;
}

void kn_publisher_close(kn_publisher *p)
{
    if (p->lcm) lcm_destroy(p->lcm);
    free(p->bytes);
    p->lcm = NULL;
    p->bytes = NULL;
}

// Send the message that is encoded in p->bytes. A message that does not fit or is refused counts as failed; later
// messages are not affected.
static void send_bytes(kn_publisher *p, const char *channel, int size)
{
    bool sent = kn_wire_send(p->lcm, p->auth, &p->signed_us, channel, p->bytes, size);
    p->published += sent;
    p->failed += !sent;
}

// Answer a listener's KNEAD_HELLO with KNEAD_LIFE. p->auth must not be NULL.
static void answer_hello(kn_publisher *p, const unsigned char nonce[KN_AUTH_NONCE])
{
    memcpy(p->bytes, nonce, KN_AUTH_NONCE);
    send_bytes(p, KN_LIFE_CHANNEL, KN_AUTH_NONCE);
}

// Publish a tick: its events in the order they were applied, then the force of every probe that has a session. If local
// contact models are identified, the probe's contact model (KNEAD_CONTACT) follows its force.
static void publish_record(kn_publisher *p, const kn_tick_record *record)
{
    for (int i = 0; i < record->out.event_count; i++) {
        knead_event_t message;
        kn_wire_event(&message, &record->out.event[i], record->utime);
        send_bytes(p, "KNEAD_EVENT", knead_event_t_encode(p->bytes, 0, p->room, &message));
    }
    for (int i = 0; i < record->out.probes; i++) {
        if (!record->out.force[i].live) continue;
        // publish the force first, because a hand waits for it
        knead_contact_force_t message;
        kn_wire_force(&message, &record->out, i, record->utime, record->execution_ns);
        send_bytes(p, p->force_channel[i], knead_contact_force_t_encode(p->bytes, 0, p->room, &message));
        if (!record->out.local) continue;
        // send one datagram per contact unit; for a probe that touches nothing, send one datagram with contact_count 0
        const kn_contact_unit *unit = record->out.contact[i];
        for (int c = 0; c == 0 || c < unit->contact_count; c++) {
            knead_contact_model_t contact;
            kn_wire_contact(&contact, &unit[c], record->utime);
            send_bytes(p, p->contact_channel[i], knead_contact_model_t_encode(p->bytes, 0, p->room, &contact));
        }
    }
}

static void publish_touch(kn_publisher *p, const kn_touch_patch *touched)
{
    knead_touch_patch_t message;
    kn_wire_touch(&message, &touched->touch, touched->session, touched->pose_seq, touched->utime);
    send_bytes(p, p->touch_channel[touched->probe], knead_touch_patch_t_encode(p->bytes, 0, p->room, &message));
}

void kn_publisher_scene(kn_publisher *p, int64_t utime)
{
    knead_scene_t message;
    kn_wire_scene(&message, p->scene, p->initial_hash, utime);
    send_bytes(p, "KNEAD_SCENE", knead_scene_t_encode(p->bytes, 0, p->room, &message));
}

void kn_publisher_status(kn_publisher *p, const knead_status_t *status)
{
    send_bytes(p, "KNEAD_STATUS", knead_status_t_encode(p->bytes, 0, p->room, status));
}

void kn_publisher_health(kn_publisher *p, const knead_health_t *health)
{
    send_bytes(p, "KNEAD_HEALTH", knead_health_t_encode(p->bytes, 0, p->room, health));
}

// --- trace ---

#define ROWS 4096 // capacity of the ring in rows: one second of four probes, the longest expected wait for a busy disk

typedef struct row {
    char probe[KN_NAME_MAX];
    int64_t tick, session, seq, arrived_ns, woke_ns, stepped_ns, guarded_ns, due_ns, asked_ns, late_ns;
} row;

bool kn_tick_trace_open(kn_tick_trace *trace, const char *path, bool append, char *error, size_t error_size)
{
    *trace = (kn_tick_trace){0};
    // write the column names only into a new file, because a later scene of this process appends its rows to the file
    if (!path) return true;
    trace->file = fopen(path, append ? "ae" : "we");
    if (trace->file && kn_ring_init(&trace->rows, ROWS, sizeof(row))) {
        if (!append)
            fputs("tick,probe,session,seq,arrived_ns,woke_ns,stepped_ns,guarded_ns,due_ns,asked_ns,late_ns\n",
                  trace->file);
        return true;
    }
    snprintf(error, error_size, "--trace %s: %s", path, strerror(errno));
    kn_tick_trace_close(trace);
    return false;
}

// Add the rows of a tick to the ring; real-time safe.
static void trace_record(kn_tick_trace *trace, const kn_tick_record *record, const kn_model_def *def)
{
    for (int p = 0; trace->file && p < record->out.probes; p++) {
        const kn_force *force = &record->out.force[p];
        if (!force->live) continue;
        // the fields have the same names as the columns of the file
        row r = {.tick = record->out.tick,
                 .session = force->session,
                 .seq = force->seq,
                 .arrived_ns = record->posted_ns[p],
                 .woke_ns = record->wake.now_ns,
                 .stepped_ns = record->out.stepped_ns,
                 .guarded_ns = record->guarded_ns,
                 .due_ns = record->wake.due_ns,
                 .asked_ns = record->wake.asked_ns,
                 .late_ns = record->wake.late_ns};
        memcpy(r.probe, def->probe[p].name, sizeof r.probe);
        trace->lost += !kn_ring_push(&trace->rows, &r);
    }
}

void kn_tick_trace_drain(kn_tick_trace *trace)
{
    // a failed write is reported at the end, and does not stop the server
    for (const row *r; trace->file && (r = kn_ring_front(&trace->rows)); kn_ring_pop(&trace->rows))
        trace->failed |= fprintf(trace->file,
                                 "%" PRId64 ",%s,%" PRId64 ",%" PRId64 ",%" PRId64 ",%" PRId64 ",%" PRId64 ",%" PRId64
                                 ",%" PRId64 ",%" PRId64 ",%" PRId64 "\n",
                                 r->tick, r->probe, r->session, r->seq, r->arrived_ns, r->woke_ns, r->stepped_ns,
                                 r->guarded_ns, r->due_ns, r->asked_ns, r->late_ns) < 0;
}

bool kn_tick_trace_close(kn_tick_trace *trace)
{
    kn_tick_trace_drain(trace);
    if (trace->file) trace->failed |= fclose(trace->file) != 0;
    kn_ring_free(&trace->rows);
    trace->file = NULL;
    return !trace->failed;
}

// --- exchange ---

void kn_exchange_hear(kn_exchange *x, const kn_datagram_batch *batch)
{
    int64_t now_ns = kn_now_ns();
    for (int i = 0; i < batch->count; i++) {
        int probe;
        kn_pose pose;
        kn_pose_verdict verdict = kn_receiver_judge(&x->receiver, &batch->datagram[i], now_ns, &probe, &pose);
        if (verdict == KN_ACCEPTED) kn_loop_post(x->loop, probe, &pose);
        if (verdict == KN_REJECT_HELLO) answer_hello(&x->publisher, x->receiver.nonce);
    }
}

// Publish the records of all ticks since the last call, in order.
static void publish_records(kn_exchange *x)
{
    for (const kn_tick_record *record; (record = kn_ring_front(&x->loop->records)); kn_ring_pop(&x->loop->records)) {
        publish_record(&x->publisher, record);
        if (x->trace) trace_record(x->trace, record, &x->publisher.scene->model);
        if (x->sentinel) kn_sentinel_hear(x->sentinel, &record->wake);
        memcpy(x->force, record->out.force, sizeof x->force);
        // If a session has sent its last pose and its force is zero, the session gives up its probe.
        for (int p = 0; p < record->out.probes; p++)
            if (x->force[p].left && kn_receiver_leave(&x->receiver, p, x->force[p].session))
                kn_loop_post(x->loop, p, NULL);
    }
    const kn_touch_patch *touched;
    for (; x->loop->touches.capacity && (touched = kn_ring_front(&x->loop->touches)); kn_ring_pop(&x->loop->touches))
        publish_touch(&x->publisher, touched);
}

// Publish the new scene after a tick has adopted a change.
static void publish_change(kn_exchange *x)
{
    kn_scene_change *changed = atomic_load_explicit(&x->loop->changed, memory_order_acquire);
    if (changed == x->told || !take_scene(&x->publisher, changed->scene)) return;
    kn_publisher_scene(&x->publisher, kn_stamp_us());
    x->told = changed;
}

bool kn_exchange_ticked(kn_exchange *x)
{
    // Read `done` before the records, so that the records read below include the last one.
    bool done = atomic_load_explicit(&x->loop->done, memory_order_acquire);
    // publish the new scene before the event of its change, so that clients that receive both get the scene first
    publish_change(x);
    publish_records(x);
    if (x->sentinel) kn_sentinel_judge(x->sentinel, kn_now_ns());
    // End the sessions that fell silent.
    unsigned ended = kn_receiver_expire(&x->receiver, kn_now_ns());
    for (int p = 0; ended >> p; p++)
        if (ended >> p & 1) kn_loop_post(x->loop, p, NULL);
    return done;
}
