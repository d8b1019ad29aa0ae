#include "server/account.h"
#include "proto/knead_contact_force_t.h"
#include <math.h>
#include <string.h>

// One writer: a load and a store are enough, and cheaper than a locked add.
#define ADD(counter, n)                                                                                                \
    atomic_store_explicit(counter, atomic_load_explicit(counter, memory_order_relaxed) + (n), memory_order_relaxed)
#define SET(value, to) atomic_store_explicit(value, to, memory_order_relaxed)
#define GET(value) atomic_load_explicit(value, memory_order_relaxed)

void kn_account_init(kn_account *a)
{
    memset(a, 0, sizeof *a);
    SET(&a->success_rate, 1.0);
}

static void count(_Atomic int64_t *histogram, int64_t ns)
{
    int bucket = 0;
    for (int64_t us = ns / 1000; us > 0 && bucket < KN_HISTOGRAM - 1; us /= 2) bucket++;
    ADD(&histogram[bucket], 1);
}

static int32_t errors_of(const kn_force *force)
{
    int32_t errors = 0;
    if (force->flags & KNEAD_CONTACT_FORCE_T_FLAG_CLAMPED) errors |= KNEAD_STATUS_T_ERROR_FORCE_LIMIT;
    if (force->flags & KNEAD_CONTACT_FORCE_T_FLAG_GUARD) errors |= KNEAD_STATUS_T_ERROR_FORCE_IMPULSE_LIMIT;
    if (force->flags & KNEAD_CONTACT_FORCE_T_FLAG_BRAKE) errors |= KNEAD_STATUS_T_ERROR_VELOCITY_LIMIT;
    if (force->fault == KNEAD_CONTACT_FORCE_T_FAULT_POSE_SILENCE) errors |= KNEAD_STATUS_T_ERROR_COMM_LOST;
    if (force->fault == KNEAD_CONTACT_FORCE_T_FAULT_IMPULSE) errors |= KNEAD_STATUS_T_ERROR_FORCE_IMPULSE_LIMIT;
    if (force->fault == KNEAD_CONTACT_FORCE_T_FAULT_NONFINITE) errors |= KNEAD_STATUS_T_ERROR_PHYSICS;
    return errors;
}

// The worst of all probes.
static int32_t mode_of(const kn_tick_in *in, const kn_tick_out *out)
{
    int32_t mode = KNEAD_STATUS_T_MODE_IDLE, flags = 0;
    for (int p = 0; p < out->probes; p++) {
        if (out->force[p].fault == KNEAD_CONTACT_FORCE_T_FAULT_ESTOP) return KNEAD_STATUS_T_MODE_ESTOP;
        if (!out->force[p].live) continue;
        mode = KNEAD_STATUS_T_MODE_RUNNING;
        flags |= out->force[p].flags;
    }
    if (in->stop) return KNEAD_STATUS_T_MODE_STOPPING;
    if (flags & KNEAD_CONTACT_FORCE_T_FLAG_LATCHED) return KNEAD_STATUS_T_MODE_FAULT;
    if (flags & KNEAD_CONTACT_FORCE_T_FLAG_REENGAGE_LIFT) return KNEAD_STATUS_T_MODE_RECOVERING;
    return flags & KNEAD_CONTACT_FORCE_T_FLAG_BRAKE ? KNEAD_STATUS_T_MODE_BRAKE : mode;
}

static void account_forces(kn_account *a, const kn_tick_out *out)
{
    for (int p = 0; p < out->probes; p++) {
        const double *now = out->force[p].force_n;
        double *last = a->last_force_n[p], size = 0, step = 0;
        for (int i = 0; i < 3; i++) {
            size += now[i] * now[i];
            step += (now[i] - last[i]) * (now[i] - last[i]);
            last[i] = now[i];
        }
        if (sqrt(size) > GET(&a->force_max_n)) SET(&a->force_max_n, sqrt(size));
        if (sqrt(step) > GET(&a->force_step_max_n)) SET(&a->force_step_max_n, sqrt(step));
    }
}

static void remember(kn_account *a, bool good)
{
    a->good_count += good - a->good[a->next];
    a->good[a->next] = good;
    a->next = (a->next + 1) % KN_RECENT_TICKS;
}

static void account_success(kn_account *a, const kn_tick_in *in, const kn_wake *wake, int64_t ticks)
{
    bool fresh = true;
    for (int p = 0; p < KN_PROBES_MAX; p++) fresh = fresh && (!in->pose[p] || in->fresh[p]);
    for (int i = 0; i < wake->missed && i < KN_RECENT_TICKS; i++) remember(a, false);
    remember(a, fresh);
    int64_t cycles = ticks + GET(&a->missed);
    SET(&a->success_rate, (double)a->good_count / (double)(cycles < KN_RECENT_TICKS ? cycles : KN_RECENT_TICKS));
}

void kn_account_tick(kn_account *a, const kn_servo *servo, const kn_tick_in *in, const kn_tick_out *out,
                     const kn_wake *wake, int64_t execution_ns, bool published)
{
    SET(&a->tick, wake->tick);
    ADD(&a->ticks, 1);
    ADD(&a->missed, wake->missed);
    ADD(&a->unpublished, !published);
    if (wake->missed) SET(&a->late_loop_ns, wake->now_ns - wake->due_ns + KN_PERIOD_NS);
    count(a->wakeup, wake->late_ns);
    count(a->execution, execution_ns);
    account_success(a, in, wake, GET(&a->ticks));
    account_forces(a, out);

    int32_t errors = 0;
    int64_t clamps = 0, guards = 0, faults = 0;
    for (int p = 0; p < out->probes; p++) {
        errors |= errors_of(&out->force[p]);
        clamps += servo->safety[p].clamps;
        guards += servo->safety[p].guards;
        faults += servo->safety[p].faults;
    }
    if (servo->audit && servo->audit->created > GET(&a->created)) {
        SET(&a->created, servo->audit->created);
        errors |= KNEAD_STATUS_T_ERROR_PHYSICS;
    }
    if (execution_ns > KN_PERIOD_NS) {
        ADD(&a->overruns, 1);
        errors |= KNEAD_STATUS_T_ERROR_OVERRUN;
    }
    if (faults > GET(&a->faults)) SET(&a->last_errors, errors);
    SET(&a->clamps, clamps);
    SET(&a->guards, guards);
    SET(&a->faults, faults);
    SET(&a->capped, servo->capped);
    SET(&a->mode, mode_of(in, out));
    SET(&a->quality, (int32_t)servo->quality);
    SET(&a->asked, (int32_t)servo->asked);
    SET(&a->exhausted, servo->exhausted);
    if (errors) atomic_fetch_or_explicit(&a->errors, errors, memory_order_relaxed);
}

void kn_account_status(const kn_account *a, knead_status_t *status)
{
    status->tick = GET(&a->tick);
    status->missed_cycles = GET(&a->missed);
    status->overruns = GET(&a->overruns);
    for (int i = 0; i < KN_HISTOGRAM; i++) {
        status->wakeup_hist[i] = GET(&a->wakeup[i]);
        status->execution_hist[i] = GET(&a->execution[i]);
    }
    status->success_rate = GET(&a->success_rate);
    status->force_max_n = GET(&a->force_max_n);
    status->force_step_max_n = GET(&a->force_step_max_n);
    status->publish_drops = GET(&a->unpublished);
    status->clamps = GET(&a->clamps);
    status->guards = GET(&a->guards);
    status->faults = GET(&a->faults);
    status->solver_capped = GET(&a->capped);
    status->mode = GET(&a->mode);
    if (GET(&a->quality) != GET(&a->asked)) status->degraded |= KNEAD_STATUS_T_DEGRADED_REDUCED;
    status->current_errors = GET(&a->errors);
    status->last_errors = GET(&a->last_errors);
}

int32_t kn_account_take_errors(kn_account *a)
{
    return atomic_exchange_explicit(&a->errors, 0, memory_order_relaxed);
}
