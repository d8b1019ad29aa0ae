#include "server/exchange.h"
#include <string.h>

void kn_exchange_hear(kn_exchange *x, const kn_batch *batch)
{
    int64_t now_ns = kn_now_ns();
    for (int i = 0; i < batch->count; i++) {
        int probe;
        kn_pose pose;
        kn_verdict verdict = kn_receiver_judge(&x->receiver, &batch->datagram[i], now_ns, &probe, &pose);
        if (verdict == KN_ACCEPTED) kn_loop_post(x->loop, probe, &pose);
        if (verdict == KN_REJECT_HELLO) kn_publisher_answer(&x->publisher, x->receiver.nonce);
    }
}

// Publish the records of all ticks since the last call, in order.
static void publish_records(kn_exchange *x)
{
    for (const kn_record *record; (record = kn_ring_front(&x->loop->records)); kn_ring_pop(&x->loop->records)) {
        kn_publisher_record(&x->publisher, record);
        if (x->trace) kn_trace_record(x->trace, record, &x->publisher.scene->model);
        if (x->sentinel) kn_sentinel_hear(x->sentinel, &record->wake);
        memcpy(x->force, record->out.force, sizeof x->force);
        // A session has sent its last pose and its force is zero: free its probe.
        for (int p = 0; p < record->out.probes; p++)
            if (x->force[p].left && kn_receiver_leave(&x->receiver, p, x->force[p].session))
                kn_loop_post(x->loop, p, NULL);
    }
    const kn_touched *touched;
    for (; x->loop->touches.capacity && (touched = kn_ring_front(&x->loop->touches)); kn_ring_pop(&x->loop->touches))
        kn_publisher_touch(&x->publisher, touched);
}

// Publish the new scene after a tick has adopted a change.
static void go_over(kn_exchange *x)
{
    kn_scene_change *changed = atomic_load_explicit(&x->loop->changed, memory_order_acquire);
    if (changed == x->told || !kn_publisher_go_over(&x->publisher, changed->scene)) return;
    kn_publisher_scene(&x->publisher, kn_stamp_us());
    x->told = changed;
}

bool kn_exchange_ticked(kn_exchange *x)
{
    // Read `done` before the records, so that the records read below include the last one.
    bool done = atomic_load_explicit(&x->loop->done, memory_order_acquire);
    // publish the new scene before the event of its change, so that clients that receive both get the scene first
    go_over(x);
    publish_records(x);
    if (x->sentinel) kn_sentinel_judge(x->sentinel, kn_now_ns());
    // End the sessions that fell silent.
    unsigned ended = kn_receiver_expire(&x->receiver, kn_now_ns());
    for (int p = 0; ended >> p; p++)
        if (ended >> p & 1) kn_loop_post(x->loop, p, NULL);
    return done;
}
