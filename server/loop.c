#include "server/loop.h"
#include "core/step_effort.h"
#include "server/keeper.h"
#include "server/served.h"
#include <math.h>
#include <stddef.h>
#include <string.h>

// capacity of the record queue: half a second of ticks; the main thread is later than that only if the machine stops
#define RECORDS 512

#define ORDER_BITS 8 // number of low bits in loop->orders that hold the kinds of orders

// sleep between two checks for a late pose, ns; waking up from the sleep takes about as long
static const int64_t look_ns = 15000;
// Sleep after a tick that took longer than 1 ms. A thread that never sleeps takes the processor from all other threads,
// the sentinel first, and the kernel ends the process by LimitRTTIME.
static const int64_t breath_ns = 50000;

bool kn_loop_init(kn_loop *loop, const kn_scene *scene, const kn_model *model, kn_backend *backend, kn_skin *skin,
                  kn_audit *audit)
{
    memset(loop, 0, sizeof *loop);
    kn_servo_init(&loop->servo, scene, model, backend);
    loop->audit = audit;
    if (audit) loop->servo.audit = kn_audit_read(audit);
    kn_account_init(&loop->account);
    kn_phase_init(&loop->phase);
    atomic_init(&loop->account.quality, (int32_t)scene->quality);
    atomic_init(&loop->account.asked, (int32_t)scene->quality);
    atomic_init(&loop->account.budget_s, scene->budget_s);
    for (int p = 0; p < KN_PROBES_MAX; p++) kn_mailbox_init(&loop->pose[p], loop->pose_slots[p], sizeof(kn_posted));
    loop->skin = skin;
    return kn_ring_init(&loop->records, RECORDS, sizeof(kn_record));
}

void kn_loop_free(kn_loop *loop)
{
    kn_ring_free(&loop->records);
    kn_ring_free(&loop->touches);
}

bool kn_loop_touch(kn_loop *loop)
{
    // Allocate room for the touch patches of 64 ms, because older patches are useless.
    return kn_ring_init(&loop->touches, 16 * KN_PROBES_MAX, sizeof(kn_touched));
}

void kn_loop_start(kn_loop *loop, int64_t start_ns)
{
    kn_clock_start(&loop->clock, start_ns);
    loop->priced = loop->deadline;
    atomic_store(&loop->start_ns, start_ns);
}

void kn_loop_post(kn_loop *loop, int probe, const kn_pose *pose)
{
    kn_posted *back = kn_mailbox_back(&loop->pose[probe]);
    if (pose) back->pose = *pose;
    else back->pose.session = 0;
    back->before_ns = loop->posted_ns[probe];
    back->posted_ns = loop->posted_ns[probe] = kn_now_ns();
    kn_mailbox_post(&loop->pose[probe]);
}

// The number of orders and their kinds share one word, so that no tick sees one without the other.
int64_t kn_loop_order(kn_loop *loop, kn_order order, kn_quality quality)
{
    if (order == KN_ORDER_QUALITY) atomic_store(&loop->quality, (int)quality);
    int64_t given = atomic_load(&loop->orders), more;
    // An order `recover` cancels an earlier emergency stop that no tick has taken yet.
    int64_t ends = order == KN_ORDER_RECOVER ? INT64_C(1) << KN_ORDER_ESTOP : 0;
    do more = ((given & ~ends) | INT64_C(1) << order) + (1 << ORDER_BITS);
    while (!atomic_compare_exchange_weak(&loop->orders, &given, more));
    return more >> ORDER_BITS;
}

bool kn_loop_obeyed(const kn_loop *loop, int64_t number, int64_t *tick)
{
    if (atomic_load(&loop->obeyed) < number) return false;
    *tick = atomic_load(&loop->obeyed_tick[number % KN_LOOP_ORDERS]);
    return true;
}

bool kn_loop_estopped(const kn_loop *loop)
{
    return loop->servo.estopped || (atomic_load(&loop->orders) >> KN_ORDER_ESTOP & 1);
}

// Take the orders that were given since the last tick. Return the total number of orders given so far.
static int64_t read_orders(kn_loop *loop, kn_tick_in *in)
{
    int64_t orders = atomic_fetch_and(&loop->orders, ~((INT64_C(1) << ORDER_BITS) - 1));
    in->reset = orders >> KN_ORDER_RESET & 1;
    in->recover = orders >> KN_ORDER_RECOVER & 1;
    in->estop = orders >> KN_ORDER_ESTOP & 1;
    in->undo = orders >> KN_ORDER_UNDO & 1;
    // A change brings its own deadline, unless that is 0. The counts of long steps of the old model do not apply to the
    // new one.
    if (orders >> KN_ORDER_CHANGE & 1) {
        in->change = loop->change;
        if (loop->change->deadline > 0) in->deadline = loop->deadline = loop->priced = loop->change->deadline;
        loop->dear = loop->cheap = 0;
    }
    if (orders >> KN_ORDER_RESTORE & 1) {
        in->restore = loop->restore->state;
        in->restored_generation = loop->restore->generation;
        in->restored_tick = loop->restore->tick;
    }
    if (orders >> KN_ORDER_QUALITY & 1) {
        in->take = KN_TAKE_COMMAND;
        in->quality = (kn_quality)atomic_load(&loop->quality);
    }
    return orders >> ORDER_BITS;
}

// Read the latest pose of each probe, and note when it arrived.
static void read_poses(kn_loop *loop, kn_tick_in *in, kn_arrival arrival[])
{
    for (int p = 0; p < loop->servo.model->def.probe_count; p++) {
        const kn_posted *posted = kn_mailbox_latest(&loop->pose[p], &in->fresh[p]);
        if (posted->pose.session != 0) in->pose[p] = &posted->pose;
        arrival[p] = (kn_arrival){posted->pose.session, posted->posted_ns, posted->before_ns, in->fresh[p], false};
    }
}

// Move the grid towards the arrival of the poses (phase.h).
static void follow_poses(kn_loop *loop, kn_arrival arrival[], const kn_wake *wake)
{
    int probes = loop->servo.model->def.probe_count;
    for (int p = 0; p < probes; p++) arrival[p].engaged = loop->servo.safety[p].attached;
    loop->clock.start_ns += kn_phase_tick(&loop->phase, arrival, probes, wake);
    atomic_store_explicit(&loop->start_ns, loop->clock.start_ns, memory_order_relaxed);
}

// Queue the touch patches, every KN_LOOP_TOUCH_TICKS ticks. Called after the forces have been queued, because a touch
// display tolerates more delay than a force on a hand. The main thread is woken once more for the patches.
static void tell_touches(kn_loop *loop, const kn_record *record)
{
    // Missed ticks may skip the tick of a patch, so compare quotients instead of testing the remainder.
    int64_t tick = record->out.tick, before = tick - 1 - record->out.missed;
    if (tick / KN_LOOP_TOUCH_TICKS == before / KN_LOOP_TOUCH_TICKS) return;
    kn_backend *backend = loop->servo.backend;
    for (int p = 0; p < record->out.probes; p++) {
        const kn_force *f = &record->out.force[p];
        kn_touched touched = {.utime = record->utime, .session = f->session, .pose_seq = f->seq, .probe = p};
        if (!f->live) continue;
        kn_touch_read(loop->servo.model, backend->state(backend->self), p, &touched.touch);
        kn_ring_push(&loop->touches, &touched);
    }
    if (loop->notify) loop->notify(loop->notify_arg);
}

// Continue with the audit and the budget of a change that the servo has adopted.
static void go_over(kn_loop *loop, kn_change *change)
{
    if (loop->audit && change->audit) kn_audit_follow(change->audit, loop->audit);
    loop->audit = change->audit;
    atomic_store_explicit(&loop->account.budget_s, change->scene->budget_s, memory_order_relaxed);
    atomic_store_explicit(&loop->changed, change, memory_order_release);
}

// Adapt the deadline to the speed of the processor; see KN_LOOP_DEAR in loop.h.
static void follow_price(kn_loop *loop, int64_t units)
{
    // A step that used less than half of its units says little about the time of a unit.
    if (loop->deadline <= 0 || 2 * units < loop->deadline) return;
    const double share = (double)loop->execution_ns / (1e9 * loop->servo.scene->budget_s);
    loop->dear = share > KN_LOOP_DEAR_SHARE ? loop->dear + 1 : 0;
    loop->cheap = share < KN_LOOP_CHEAP_SHARE ? loop->cheap + 1 : 0;
    loop->dear_share = loop->dear > 1 ? fmin(loop->dear_share, share) : share;
    if (loop->dear == KN_LOOP_DEAR) {
        // Steps take too long. Reduce the deadline so that the fastest of these steps would take KN_SERVED_SHARE of the
        // budget: by half at most, and not below the units of the shortest step.
        const double least = (double)kn_deadline_least(loop->servo.model);
        loop->deadline = (int64_t)fmax(least, (double)loop->deadline * fmax(0.5, KN_SERVED_SHARE / loop->dear_share));
        loop->dear = 0;
    } else if (loop->cheap == KN_LOOP_CHEAP) {
        // Steps are fast again. Raise the deadline by an eighth, up to its measured value.
        loop->deadline = (int64_t)fmin((double)loop->priced, 1.125 * (double)loop->deadline);
        loop->cheap = 0;
    }
}

bool kn_loop_tick(kn_loop *loop, const kn_wake *wake)
{
    // Gather the input of the tick: time, orders, poses.
    kn_tick_in in = {.tick = wake->tick,
                     .missed = wake->missed,
                     .execution_ns = loop->execution_ns,
                     .now_ns = kn_now_ns,
                     .deadline_ns = kn_wake_deadline(wake),
                     .deadline = loop->deadline,
                     .stop = atomic_load_explicit(&loop->stop, memory_order_relaxed)};
    int64_t ordered = read_orders(loop, &in);
    kn_record record;
    memset(&record, 0, offsetof(kn_record, out)); // clear all fields but `out`, which the servo fills in
    record.wake = *wake;
    kn_arrival arrival[KN_PROBES_MAX];

    read_poses(loop, &in, arrival);
    kn_servo_tick(&loop->servo, &in, &record.out); // run the tick: step the lattice and guard the forces
    if (record.out.changed) go_over(loop, record.out.changed);
    kn_backend *backend = loop->servo.backend;

    // End after the tick that has brought every gain to zero, or after KN_LOOP_STOP_TICKS.
    if (!in.stop) loop->running_tick = wake->tick;
    bool last = record.out.stopped || wake->tick - loop->running_tick > KN_LOOP_STOP_TICKS;
    // The forces are ready. Complete the record and queue it, without the contacts if nobody identifies local models.
    record.utime = kn_stamp_us();
    record.guarded_ns = kn_now_ns();
    record.execution_ns = loop->execution_ns = record.guarded_ns - wake->now_ns;
    follow_price(loop, record.out.units);
    for (int p = 0; p < record.out.probes; p++) record.posted_ns[p] = arrival[p].arrived_ns;
    size_t bytes = record.out.local ? sizeof record : offsetof(kn_record, out.contact);
    bool published = kn_ring_push_start(&loop->records, &record, bytes);
    // Tell the threads that gave orders which tick took their orders. After a long wait only the last KN_LOOP_ORDERS
    // are kept.
    if (in.restore || in.undo) atomic_store(&loop->restored, record.out.restored_hash);
    int64_t n = atomic_load(&loop->obeyed);
    if (ordered - n > KN_LOOP_ORDERS) n = ordered - KN_LOOP_ORDERS;
    while (n < ordered) atomic_store(&loop->obeyed_tick[++n % KN_LOOP_ORDERS], wake->tick);
    atomic_store(&loop->obeyed, n);
    if (last) atomic_store_explicit(&loop->done, true, memory_order_release);
    if (loop->notify) loop->notify(loop->notify_arg);

    // The main thread now publishes the forces. Do everything else in the rest of the tick.
    if (loop->touches.capacity) tell_touches(loop, &record);
    if (backend->afterwards) backend->afterwards(backend->self);
    if (loop->audit && record.out.replaced) kn_audit_restart(loop->audit);
    if (loop->audit) kn_audit_tick(loop->audit, backend->state(backend->self));
    if (loop->keeper) kn_keeper_tick(loop->keeper, &loop->servo, wake, record.utime);
    if (loop->skin)
        kn_skin_capture(loop->skin, loop->servo.model, backend->state(backend->self), wake->tick,
                        loop->servo.generation);
    // Account for the whole tick, then move the grid for the next one.
    int64_t end_ns = kn_now_ns();
    kn_busy_tell(&loop->busy, loop->servo.ticks, wake->now_ns, end_ns);
    kn_account_tick(&loop->account, &loop->servo, &in, &record.out, wake, end_ns - wake->now_ns, published);
    if (!loop->free) follow_poses(loop, arrival, wake);
    return !last;
}

// Wait a short time for a late pose, so that the pose does not have to wait for the next tick. Do not wait after missed
// cycles. Wait at most a third of the part of the period that the last tick did not use.
static void await_pose(kn_loop *loop, kn_wake *wake)
{
    int probe = loop->free || wake->missed ? -1 : kn_phase_awaits(&loop->phase);
    int64_t left_ns = (KN_PERIOD_NS - loop->execution_ns) / 3;
    int64_t woke_ns = wake->now_ns, end_ns = woke_ns + (left_ns < KN_PHASE_HOLD_NS ? left_ns : KN_PHASE_HOLD_NS);
    while (probe >= 0 && wake->now_ns < end_ns && !kn_mailbox_unseen(&loop->pose[probe])) {
        kn_clock_sleep(wake->now_ns + look_ns);
        wake->now_ns = kn_now_ns();
    }
    wake->held_ns = wake->now_ns - woke_ns;
}

kn_wake kn_loop_wait(kn_loop *loop)
{
    if (loop->execution_ns > KN_PERIOD_NS) kn_clock_sleep(kn_now_ns() + breath_ns);
    kn_wake wake = kn_clock_wait(&loop->clock);
    await_pose(loop, &wake);
    return wake;
}

void *kn_loop_run(void *arg)
{
    kn_wake wake;
    do wake = kn_loop_wait(arg);
    while (kn_loop_tick(arg, &wake));
    return NULL;
}
