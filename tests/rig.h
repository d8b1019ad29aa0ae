#ifndef KN_TESTS_RIG_H
#define KN_TESTS_RIG_H
// kneadd, a link and hands in one thread and in virtual time. Receiver, servo loop and publisher are connected by
// server/exchange.h, as in the daemon. The hands run on the bridge of clients/tactile or on the device of
// clients/knead. liblcm's queue in memory replaces the sockets, one queue for each end.
//
//     hand --memq--> way up ----> inbox --> receiver -.
//      ^                                              servo loop     sleeps: meanwhile the others run until its wake
//      '----memq---- way down <-- memq <-- publisher <'
//
// A tick takes no virtual time. When the servo loop sleeps (until its next deadline, or for a pose), the links and
// the hands run until the wake time. A frozen server does not receive, publish or wake until it is thawed.
#include "clients/hand/virtual_hand.h"
#include "clients/hand/bus_client.h"
#include "server/exchange.h"
#include "server/served_object.h"
#include "tests/server/datagram.h"
#include "tests/tactile/link.h"
#include "tests/tactile/presser.h"

#define KN_RIG_ENDS 2
#define KN_RIG_BATCHES 64 // more batches than arrive during any freeze

typedef struct kn_rig_end { // one hand's end of the link
    struct kn_rig *rig;
    int64_t due_ns; // time of its next tick; INT64_MAX: the hand has ended
    kn_way up, down;
    lcm_t *lcm;
    kn_bridge *bridge; // exactly one of bridge and device is set
    kn_virtual_device *device;
    kn_rules served; // rules that check the forces from kneadd
    // called with each force, may change the force; or NULL
    void (*sent)(struct kn_rig_end *end, knead_contact_force_t *force);
} kn_rig_end;

typedef struct kn_rig {
    kn_time time; // must come first: kn_rig_sleep casts it to kn_rig
    kn_served_object on;
    kn_loop loop;
    kn_exchange exchange;
    kn_auth *auth; // NULL: no key
    bool serves;
    int64_t frozen_ns, thawed_ns;
    kn_rig_end end[KN_RIG_ENDS];
    int ends, batches;
    kn_datagram_batch inbox[KN_RIG_BATCHES]; // datagrams waiting in kneadd's socket
} kn_rig;

static inline bool kn_rig_frozen(const kn_rig *r)
{
    return r->time.now_ns >= r->frozen_ns && r->time.now_ns < r->thawed_ns;
}

static inline void kn_rig_hear(kn_rig *r)
{
    for (int i = 0; i < r->batches && r->serves; i++) kn_exchange_hear(&r->exchange, &r->inbox[i]);
    r->batches = 0;
}

static inline void kn_rig_arrive(void *to, const char *channel, const void *bytes, unsigned size)
{
    kn_rig *r = to;
    bool full = r->batches == 0 || r->inbox[r->batches - 1].count == KN_BATCH;
    if (full && r->batches == KN_RIG_BATCHES) return; // drop the datagram, as a full socket does
    if (full) r->inbox[r->batches++].count = 0;
    kn_datagram_batch *batch = &r->inbox[r->batches - 1];
    kn_datagram *d = &batch->datagram[batch->count++];
    *d = (kn_datagram){.here = true};
    d->size = kn_lc02(d->bytes, sizeof d->bytes, channel, bytes, size);
}

static inline void kn_rig_publish(void *to, const char *channel, const void *bytes, unsigned size)
{
    lcm_publish(to, channel, bytes, size);
}

static inline void kn_rig_up(const lcm_recv_buf_t *buf, const char *channel, void *end)
{
    kn_way_take(&((kn_rig_end *)end)->up, channel, buf->data, buf->data_size);
}

static inline void kn_rig_down(const lcm_recv_buf_t *buf, const char *channel, void *self)
{
    kn_rig_end *end = self;
    knead_contact_force_t force;
    uint8_t bytes[512];
    int size = (int)buf->data_size;
    memcpy(bytes, buf->data, buf->data_size);
    if (!strncmp(channel, "KNEAD_FORCE_", 12) && knead_contact_force_t_decode(bytes, 0, size, &force) >= 0) {
        kn_rules_force(&end->served, &force);
        if (end->sent) end->sent(end, &force), size = knead_contact_force_t_encode(bytes, 0, sizeof bytes, &force);
    }
    kn_way_take(&end->down, channel, bytes, (unsigned)size);
}

static inline void kn_rig_pump(lcm_t *lcm)
{
    while (lcm_handle_timeout(lcm, 0) > 0)
        ;
}

static inline int64_t kn_rig_next(kn_rig *r)
{
    int64_t next_ns = INT64_MAX;
    for (kn_rig_end *e = r->end; e < r->end + r->ends; e++) {
        const struct kn_way_message *up = kn_way_first(&e->up), *down = kn_way_first(&e->down);
        if (e->due_ns < next_ns) next_ns = e->due_ns;
        if (up && up->due_ns < next_ns) next_ns = up->due_ns;
        if (down && down->due_ns < next_ns) next_ns = down->due_ns;
    }
    return next_ns;
}

static inline void kn_rig_move(kn_rig_end *e)
{
    bool goes_on = true;
    if (e->bridge) kn_bridge_tick(e->bridge, 1);
    else goes_on = kn_virtual_device_tick(e->device, 1);
    kn_rig_pump(e->lcm);
    e->due_ns = goes_on ? e->due_ns + KN_PERIOD_NS : INT64_MAX;
}

// Run everything but the servo loop until that time.
static inline void kn_rig_until(kn_rig *r, int64_t until_ns)
{
    for (int64_t next_ns; (next_ns = kn_rig_next(r)) <= until_ns;) {
        if (next_ns > r->time.now_ns) r->time.now_ns = next_ns;
        for (kn_rig_end *e = r->end; e < r->end + r->ends; e++) {
            if (e->due_ns <= r->time.now_ns) kn_rig_move(e);
            kn_way_deliver(&e->up);
            if (kn_way_deliver(&e->down) && e->bridge) kn_bridge_hear(e->bridge);
        }
        if (!kn_rig_frozen(r)) kn_rig_hear(r);
    }
    r->time.now_ns = until_ns;
}

static inline void kn_rig_sleep(kn_time *time, int64_t until_ns)
{
    kn_rig *r = (kn_rig *)time;
    if (until_ns > r->time.now_ns) kn_rig_until(r, until_ns);
    if (!kn_rig_frozen(r)) return;
    kn_rig_until(r, r->thawed_ns);
    // after an odd thaw time the poses are heard before the servo's tick, after an even one behind it
    if (r->thawed_ns & 1) kn_rig_hear(r);
}

static inline void kn_rig_ticked(void *rig)
{
    kn_rig *r = rig;
    kn_exchange_ticked(&r->exchange);
    kn_rig_pump(r->exchange.publisher.lcm);
}

static inline void kn_rig_subscribe(kn_rig_end *e, const char *probe)
{
    char channels[80];
    snprintf(channels, sizeof channels, "KNEAD_(FORCE|CONTACT)_%s|KNEAD_LIFE", probe);
    lcm_subscription_set_queue_capacity(lcm_subscribe(e->rig->exchange.publisher.lcm, channels, kn_rig_down, e), 64);
}

static inline const char *kn_rig_probe(const kn_rig_end *e)
{
    const char *channel = e->bridge ? e->bridge->pose_channel : e->device->pose_channel;
    return channel + strlen("KNEAD_POSE_");
}

// Start kneadd anew, with the object in its initial state. End the program on failure.
static inline void kn_rig_serve(kn_rig *r, const kn_served_object_def *def)
{
    char error[512] = "out of memory";
    kn_clock_hand(&r->time);
    // Virtual time never goes back: the devices of one process share their knowledge of kneadd's life.
    static int64_t rigs;
    if (r->time.now_ns == 0) r->time = (kn_time){.now_ns = ++rigs * INT64_C(1000000000000), .sleep = kn_rig_sleep};
    if (r->auth) kn_auth_begin(r->auth);
    memset(&r->exchange, 0, sizeof r->exchange);
    r->exchange.loop = &r->loop;
    if (kn_served_object_load(&r->on, def, error, sizeof error) != 0 ||
        !kn_publisher_open(&r->exchange.publisher, KN_MEMORY_URL, r->on.scene, 0, error, sizeof error) ||
        !kn_loop_init(&r->loop, r->on.scene, r->on.model, &r->on.backend, NULL, r->on.audit))
        fprintf(stderr, "%s\n", error), exit(1);
    kn_receiver_init(&r->exchange.receiver, &r->on.model->def);
    r->exchange.receiver.auth = r->exchange.publisher.auth = r->auth;
    r->loop.notify = kn_rig_ticked;
    r->loop.notify_arg = r;
    for (kn_rig_end *e = r->end; e < r->end + r->ends; e++) kn_rig_subscribe(e, kn_rig_probe(e));
    kn_loop_start(&r->loop, r->time.now_ns + KN_PERIOD_NS);
    r->serves = true;
}

static inline void kn_rig_kill(kn_rig *r) // messages already sent stay under way
{
    if (!r->serves) return;
    r->serves = false;
    kn_publisher_close(&r->exchange.publisher);
    kn_loop_free(&r->loop);
    kn_served_object_free(&r->on);
    memset(&r->on, 0, sizeof r->on);
    for (kn_rig_end *e = r->end; e < r->end + r->ends; e++) {
        e->served.silent = e->served.missing = 0;
        memset(e->served.last_n, 0, sizeof e->served.last_n);
    }
}

// Add a hand, with its ticks starting after offset_ns. link: the faults of both directions.
static inline kn_rig_end *kn_rig_join(kn_rig *r, const kn_link_fault *link, double delay_ms, int64_t offset_ns)
{
    int n = r->ends++;
    kn_rig_end *e = &r->end[n];
    memset(e, 0, sizeof *e);
    e->rig = r;
    e->due_ns = r->time.now_ns + offset_ns;
    kn_way_init(&e->up, link, 0.5 * delay_ms, 2 * (uint64_t)n + 1);
    kn_way_init(&e->down, link, 0.5 * delay_ms, 2 * (uint64_t)n + 2);
    e->up.deliver = kn_rig_arrive, e->up.to = r;
    e->served = (kn_rules){.of = KN_JUDGED_SERVER,
                           .clamp_n = r->loop.servo.safety[0].limits.clamp_n,
                           .guard_n_per_ms = r->loop.servo.safety[0].limits.guard_n_per_ms};
    return e;
}

static inline void kn_rig_joined(kn_rig_end *e, bool opened, lcm_t *lcm, const char *error)
{
    char channel[64];
    if (!opened) fprintf(stderr, "%s\n", error), exit(1);
    e->lcm = lcm;
    e->down.deliver = kn_rig_publish, e->down.to = lcm;
    snprintf(channel, sizeof channel, "KNEAD_POSE_%s|KNEAD_HELLO", kn_rig_probe(e));
    lcm_subscribe(lcm, channel, kn_rig_up, e);
    kn_rig_subscribe(e, kn_rig_probe(e));
}

// Run for so many milliseconds of virtual time. Without a server only the hands run.
static inline void kn_rig_run(kn_rig *r, int ms)
{
    int64_t end_ns = r->time.now_ns + ms * (int64_t)KN_PERIOD_NS;
    while (r->serves && r->time.now_ns + KN_PERIOD_NS <= end_ns) {
        kn_wake wake = kn_loop_wait(&r->loop);
        kn_loop_tick(&r->loop, &wake);
    }
    if (!r->serves) kn_rig_until(r, end_ns);
}

static inline void kn_rig_close(kn_rig *r)
{
    kn_rig_kill(r);
    for (kn_rig_end *e = r->end; e < r->end + r->ends; e++) {
        if (e->bridge) kn_bridge_close(e->bridge);
        else kn_virtual_device_leave(e->device);
        while (e->up.count) free(e->up.list[--e->up.count].bytes);
        while (e->down.count) free(e->down.list[--e->down.count].bytes);
    }
    r->ends = 0;
    kn_clock_hand(NULL);
}

#endif
