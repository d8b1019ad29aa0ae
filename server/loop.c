#include "server/loop.h"
#include "core/solve/step_effort.h"
#include "server/keeper.h"
#include <math.h>
#include <stddef.h>
#include <string.h>

// capacity of the record queue: half a second of ticks; the main thread falls further behind only if the machine stops
#define RECORDS 512

// sleep between two checks for a late pose, ns; waking up from the sleep takes about as long
static const int64_t look_ns = 15000;
// Sleep after a tick that took longer than 1 ms, ns. A thread that never sleeps takes the processor from all other
// threads, the sentinel first, and the kernel ends the process by LimitRTTIME.
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
    for (int p = 0; p < KN_PROBES_MAX; p++)
        kn_mailbox_init(&loop->pose[p], loop->pose_slots[p], sizeof(kn_posted_pose));
    loop->skin = skin;
    return kn_ring_init(&loop->records, RECORDS, sizeof(kn_tick_record));
}

void kn_loop_free(kn_loop *loop)
{
    kn_ring_free(&loop->records);
    kn_ring_free(&loop->touches);
}

bool kn_loop_touch(kn_loop *loop)
{
    // Allocate room for the touch patches of 64 ms, because older patches are useless.
    return kn_ring_init(&loop->touches, 16 * KN_PROBES_MAX, sizeof(kn_touch_patch));
}

void kn_loop_start(kn_loop *loop, int64_t start_ns)
{
    kn_clock_start(&loop->clock, start_ns);
    loop->measured_deadline = loop->deadline;
    atomic_store(&loop->start_ns, start_ns);
}

void kn_loop_post(kn_loop *loop, int probe, const kn_pose *pose)
{
    kn_posted_pose *back = kn_mailbox_back(&loop->pose[probe]);
    if (pose) back->pose = *pose;
    else back->pose.session = 0;
    back->before_ns = loop->posted_ns[probe];
    back->posted_ns = loop->posted_ns[probe] = kn_now_ns();
    kn_mailbox_post(&loop->pose[probe]);
}

bool kn_loop_estopped(const kn_loop *loop)
{
    return loop->servo.estopped || (atomic_load(&loop->orders.given) >> KN_ORDER_ESTOP & 1);
}

// Working data of one turn of the loop.
typedef struct turn {
    const kn_wake *wake;
    kn_tick_in in;
    int64_t orders; // total number of orders given so far
    kn_arrival arrival[KN_PROBES_MAX];
    kn_tick_record record;
    bool published; // true: the record was queued for the main thread
    bool last;      // true: the loop ends after this turn
} turn;

// --- read ---

// Adopt the deadline of a changed scene (units of work per step). 0 leaves the deadline unchanged. Reset the counts of
// slow and fast steps, because they belong to the old model.
static void take_deadline(kn_loop *loop, kn_tick_in *in)
{
    if (in->change->deadline > 0) in->deadline = loop->deadline = loop->measured_deadline = in->change->deadline;
    loop->slow_steps = loop->fast_steps = 0;
}

// Read the latest pose of each probe, and note when it arrived.
static void read_poses(kn_loop *loop, kn_tick_in *in, kn_arrival arrival[])
{
    for (int p = 0; p < loop->servo.model->def.probe_count; p++) {
        const kn_posted_pose *posted = kn_mailbox_latest(&loop->pose[p], &in->fresh[p]);
        if (posted->pose.session != 0) in->pose[p] = &posted->pose;
        arrival[p] = (kn_arrival){posted->pose.session, posted->posted_ns, posted->before_ns, in->fresh[p], false};
    }
}

// Gather the input of the tick: time, orders, poses.
static void read_input(kn_loop *loop, turn *t)
{
    const kn_wake *wake = t->wake;
    t->in = (kn_tick_in){.tick = wake->tick,
                         .missed = wake->missed,
                         .execution_ns = loop->execution_ns,
                         .now_ns = kn_now_ns,
                         .deadline_ns = kn_wake_deadline(wake),
                         .deadline = loop->deadline,
                         .stop = atomic_load_explicit(&loop->stop, memory_order_relaxed)};
    t->orders = kn_orders_take(&loop->orders, &t->in);
    if (t->in.change) take_deadline(loop, &t->in);
    memset(&t->record, 0, offsetof(kn_tick_record, out)); // clear all fields but `out`, which the servo fills in
    t->record.wake = *wake;
    read_poses(loop, &t->in, t->arrival);
}

// --- publish ---

// The servo has adopted a change of the scene. From now on use the energy audit and the time budget of the changed
// scene.
static void adopt_change(kn_loop *loop, kn_scene_change *change)
{
    if (loop->audit && change->audit) kn_audit_follow(change->audit, loop->audit);
    loop->audit = change->audit;
    atomic_store_explicit(&loop->account.budget_s, change->scene->budget_s, memory_order_relaxed);
    atomic_store_explicit(&loop->changed, change, memory_order_release);
}

// Adapt the deadline to the speed of the processor; see KN_LOOP_SLOW_STEPS in loop.h.
static void adapt_deadline(kn_loop *loop, int64_t units)
{
    // Skip a step that used less than half of the deadline's units. From so short a step, the time of one unit cannot
    // be computed well.
    if (loop->deadline <= 0 || 2 * units < loop->deadline) return;
    const double share = (double)loop->execution_ns / (1e9 * loop->servo.scene->budget_s);
    loop->slow_steps = share > KN_LOOP_SLOW_SHARE ? loop->slow_steps + 1 : 0;
    loop->fast_steps = share < KN_LOOP_FAST_SHARE ? loop->fast_steps + 1 : 0;
    loop->slow_share = loop->slow_steps > 1 ? fmin(loop->slow_share, share) : share;
    if (loop->slow_steps == KN_LOOP_SLOW_STEPS) {
        // Steps take too long. Reduce the deadline so that the fastest of these steps would take KN_STEP_SHARE of the
        // budget. Reduce the deadline by half at most, and never below the units of the shortest step.
        const double least = (double)kn_deadline_least(loop->servo.model);
        loop->deadline = (int64_t)fmax(least, (double)loop->deadline * fmax(0.5, KN_STEP_SHARE / loop->slow_share));
        loop->slow_steps = 0;
    } else if (loop->fast_steps == KN_LOOP_FAST_STEPS) {
        // Steps are fast again. Raise the deadline by an eighth of itself, at most to the measured deadline.
        loop->deadline = (int64_t)fmin((double)loop->measured_deadline, 1.125 * (double)loop->deadline);
        loop->fast_steps = 0;
    }
}

// Return whether the main thread must be woken for this tick: for a force, for an event, or to read datagrams again.
static bool waited_for(const kn_loop *loop, const kn_tick_out *out)
{
    bool live = false;
    for (int p = 0; p < out->probes; p++) live |= out->force[p].live;
    return live || out->event_count > 0 || atomic_load_explicit(&loop->paused, memory_order_relaxed);
}

// The forces are ready. Complete the record of the tick, queue it and wake the main thread.
static void publish(kn_loop *loop, turn *t)
{
    kn_tick_record *record = &t->record;
    // End the loop after the first tick in which every gain is zero (the forces have faded), or KN_LOOP_STOP_TICKS
    // ticks after the stop was requested.
    if (!t->in.stop) loop->running_tick = t->wake->tick;
    t->last = record->out.stopped || t->wake->tick - loop->running_tick > KN_LOOP_STOP_TICKS;
    record->utime = kn_stamp_us();
    record->guarded_ns = kn_now_ns();
    record->execution_ns = loop->execution_ns = record->guarded_ns - t->wake->now_ns;
    adapt_deadline(loop, record->out.units);
    for (int p = 0; p < record->out.probes; p++) record->posted_ns[p] = t->arrival[p].arrived_ns;
    // Queue the record without its contacts if the backend identifies no local contact models.
    size_t bytes = record->out.local ? sizeof *record : offsetof(kn_tick_record, out.contact);
    t->published = kn_ring_push_start(&loop->records, record, bytes);
    kn_orders_done(&loop->orders, t->orders, &t->in, &record->out);
    if (t->last) atomic_store_explicit(&loop->done, true, memory_order_release);
    // Each wake-up costs processor time. While no hand is there, let the records wait.
    if (!t->last && !waited_for(loop, &record->out) && ++loop->untold < KN_LOOP_UNTOLD_TICKS) return;
    loop->untold = 0;
    if (loop->notify) loop->notify(loop->notify_arg);
}

// --- jobs in the rest of the tick, while the main thread publishes the forces ---

// Queue the touch patches, every KN_LOOP_TOUCH_TICKS ticks. A touch display tolerates more delay than a force on a
// hand. The main thread is woken once more for the patches.
static void queue_touches(kn_loop *loop, const kn_tick_record *record)
{
    // Missed cycles may skip the tick in which a patch is due, so compare quotients instead of testing the remainder.
    int64_t tick = record->out.tick, before = tick - 1 - record->out.missed;
    if (tick / KN_LOOP_TOUCH_TICKS == before / KN_LOOP_TOUCH_TICKS) return;
    kn_backend *backend = loop->servo.backend;
    bool any = false;
    for (int p = 0; p < record->out.probes; p++) {
        const kn_force *f = &record->out.force[p];
        kn_touch_patch touched = {.utime = record->utime, .session = f->session, .pose_seq = f->seq, .probe = p};
        if (!f->live) continue;
        kn_touch_read(loop->servo.model, kn_backend_shape(backend), backend->scratch(backend->self), p, &touched.touch);
        any |= kn_ring_push(&loop->touches, &touched);
    }
    if (any && loop->notify) loop->notify(loop->notify_arg);
}

static void identify_contacts(kn_loop *loop, const kn_tick_record *record)
{
    (void)record;
    loop->servo.backend->afterwards(loop->servo.backend->self);
}

static void audit_energy(kn_loop *loop, const kn_tick_record *record)
{
    kn_backend *backend = loop->servo.backend;
    if (record->out.replaced) kn_audit_restart(loop->audit);
    kn_audit_tick(loop->audit, backend->state(backend->self), backend->scratch(backend->self));
}

static void leave_copy(kn_loop *loop, const kn_tick_record *record)
{
    kn_keeper_tick(loop->keeper, &loop->servo, &record->wake, record->utime);
}

static void capture_skin(kn_loop *loop, const kn_tick_record *record)
{
    const kn_servo *servo = &loop->servo;
    kn_backend *backend = servo->backend;
    if (record->out.tick < loop->skin->next_tick) return;
    // only measures need the strains
    const kn_state *state = loop->skin->measures ? backend->state(backend->self) : kn_backend_shape(backend);
    kn_skin_capture(loop->skin, servo->model, state, record->out.tick, servo->generation);
}

static bool has_touches(const kn_loop *loop) { return loop->touches.capacity > 0; }
static bool has_afterwards(const kn_loop *loop) { return loop->servo.backend->afterwards; }
static bool has_audit(const kn_loop *loop) { return loop->audit; }
static bool has_keeper(const kn_loop *loop) { return loop->keeper; }
static bool has_skin(const kn_loop *loop) { return loop->skin; }

// The jobs in the order in which they run. `when` returns whether a job is needed.
static const struct after_job {
    bool (*when)(const kn_loop *loop);
    void (*run)(kn_loop *loop, const kn_tick_record *record);
} after_jobs[] = {{has_touches, queue_touches},
                  {has_afterwards, identify_contacts},
                  {has_audit, audit_energy},
                  {has_keeper, leave_copy},
                  {has_skin, capture_skin}};

static void run_after_jobs(kn_loop *loop, const kn_tick_record *record)
{
    for (size_t i = 0; i < sizeof after_jobs / sizeof *after_jobs; i++)
        if (after_jobs[i].when(loop)) after_jobs[i].run(loop, record);
}

// --- account ---

// Move the tick grid towards the arrival of the poses (tick_timing.h).
static void follow_poses(kn_loop *loop, kn_arrival arrival[], const kn_wake *wake)
{
    int probes = loop->servo.model->def.probe_count;
    for (int p = 0; p < probes; p++) arrival[p].engaged = loop->servo.safety[p].attached;
    loop->clock.start_ns += kn_phase_tick(&loop->phase, arrival, probes, wake);
    atomic_store_explicit(&loop->start_ns, loop->clock.start_ns, memory_order_relaxed);
}

// Account for the whole tick, then move the grid for the next one.
static void account(kn_loop *loop, turn *t)
{
    int64_t end_ns = kn_now_ns(), began_ns = t->wake->now_ns;
    kn_busy_tell(&loop->busy, loop->servo.ticks, began_ns, end_ns);
    kn_account_tick(&loop->account, &loop->servo, &t->in, &t->record.out, t->wake, end_ns - began_ns, t->published);
    if (!loop->free) follow_poses(loop, t->arrival, t->wake);
}

bool kn_loop_tick(kn_loop *loop, const kn_wake *wake)
{
    turn t;
    t.wake = wake;
    read_input(loop, &t);
    kn_servo_tick(&loop->servo, &t.in, &t.record.out); // step the lattice and guard the forces
    if (t.record.out.changed) adopt_change(loop, t.record.out.changed);
    publish(loop, &t);
    run_after_jobs(loop, &t.record);
    account(loop, &t);
    return !t.last;
}

// --- wait ---

// Wait a short time for a late pose, so that the pose does not have to wait for the next tick. Do not wait after missed
// cycles. Wait for at most a third of the time that the last tick left unused in its period.
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
