#include "server/loop.h"
#include <string.h>
#include <time.h>

#define RECORDS 512 // half a second: longer the main thread is not held up by anything but a stopped machine

bool kn_loop_init(kn_loop *loop, const kn_scene *scene, const kn_model *model, kn_backend *backend, kn_skin *skin)
{
    memset(loop, 0, sizeof *loop);
    kn_servo_init(&loop->servo, scene, model, backend);
    kn_account_init(&loop->account);
    atomic_init(&loop->account.quality, (int32_t)scene->quality);
    atomic_init(&loop->account.asked, (int32_t)scene->quality);
    for (int p = 0; p < KN_PROBES_MAX; p++) kn_mailbox_init(&loop->pose[p], loop->pose_slots[p], sizeof(kn_pose));
    loop->skin = skin;
    atomic_init(&loop->quality, -1);
    return kn_ring_init(&loop->records, RECORDS, sizeof(kn_record));
}

void kn_loop_free(kn_loop *loop)
{
    kn_ring_free(&loop->records);
}

void kn_loop_post(kn_loop *loop, int probe, const kn_pose *pose)
{
    kn_pose *back = kn_mailbox_back(&loop->pose[probe]);
    if (pose)
        *back = *pose;
    else
        back->session = 0;
    kn_mailbox_post(&loop->pose[probe]);
}

static void read_poses(kn_loop *loop, kn_tick_in *in)
{
    for (int p = 0; p < loop->servo.model->def.probe_count; p++) {
        const kn_pose *pose = kn_mailbox_latest(&loop->pose[p], &in->fresh[p]);
        if (pose->session != 0) in->pose[p] = pose;
    }
}

static int64_t wall_clock_us(void)
{
    struct timespec t;
    clock_gettime(CLOCK_REALTIME, &t);
    return t.tv_sec * INT64_C(1000000) + t.tv_nsec / 1000;
}

bool kn_loop_tick(kn_loop *loop, const kn_wake *wake)
{
    kn_tick_in in = {.tick = wake->tick,
                     .missed = wake->missed,
                     .execution_ns = loop->execution_ns,
                     .deadline_ns = wake->now_ns + KN_PERIOD_NS,
                     .reset = atomic_exchange_explicit(&loop->reset, false, memory_order_relaxed),
                     .stop = atomic_load_explicit(&loop->stop, memory_order_relaxed)};
    int quality = atomic_exchange_explicit(&loop->quality, -1, memory_order_relaxed);
    if (quality >= 0) in.take = KN_TAKE_COMMAND, in.quality = (kn_quality)quality;
    kn_record record = {.wake = *wake};
    kn_backend *backend = loop->servo.backend;

    read_poses(loop, &in);
    kn_servo_tick(&loop->servo, &in, &record.out); // step, guard

    if (!in.stop) loop->running_tick = wake->tick;
    bool last = record.out.stopped || wake->tick - loop->running_tick > KN_LOOP_STOP_TICKS;
    record.utime = wall_clock_us();
    record.execution_ns = loop->execution_ns = kn_now_ns() - wake->now_ns;
    bool published = kn_ring_push(&loop->records, &record);
    if (last) atomic_store_explicit(&loop->done, true, memory_order_release);
    if (loop->notify) loop->notify(loop->notify_arg);

    if (loop->skin) kn_skin_capture(loop->skin, backend->state(backend->self), wake->tick, loop->servo.generation);
    kn_account_tick(&loop->account, &loop->servo, &in, &record.out, wake, kn_now_ns() - wake->now_ns, published);
    return !last;
}

void *kn_loop_run(void *arg)
{
    kn_loop *loop = arg;
    kn_wake wake;
    do wake = kn_clock_wait(&loop->clock);
    while (kn_loop_tick(loop, &wake));
    return NULL;
}
