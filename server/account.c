#include "server/account.h"
#include "proto/knead_contact_force_t.h"
#include <math.h>
#include <string.h>

// Add n to a counter. Only one thread writes the counters, so a separate load and store are enough. They are cheaper
// than an atomic addition.
#define ADD(counter, n)                                                                                                \
    atomic_store_explicit(counter, atomic_load_explicit(counter, memory_order_relaxed) + (n), memory_order_relaxed)
#define SET(value, to) atomic_store_explicit(value, to, memory_order_relaxed)
#define GET(value) atomic_load_explicit(value, memory_order_relaxed)

void kn_account_init(kn_account *a)
{
    memset(a, 0, sizeof *a);
    SET(&a->success_rate, 1.0);
}

// Count a duration in a histogram. The bucket number is the bit length of the duration in us; the last bucket takes all
// longer durations.
static void count(_Atomic int64_t *histogram, int64_t ns)
{
    int bucket = 0;
    for (int64_t us = ns / 1000; us > 0 && bucket < KN_HISTOGRAM - 1; us /= 2) bucket++;
    ADD(&histogram[bucket], 1);
}

// Translate the flags and the fault of one probe into ERROR_* bits.
static int32_t errors_of(const kn_force *force)
{
    int32_t errors = 0;
    if (force->flags & KNEAD_CONTACT_FORCE_T_FLAG_CLAMPED) errors |= KNEAD_STATUS_T_ERROR_FORCE_LIMIT;
    if (force->flags & KNEAD_CONTACT_FORCE_T_FLAG_GUARD) errors |= KNEAD_STATUS_T_ERROR_FORCE_IMPULSE_LIMIT;
    if (force->flags & KNEAD_CONTACT_FORCE_T_FLAG_BRAKE) errors |= KNEAD_STATUS_T_ERROR_VELOCITY_LIMIT;
    if (force->fault == KNEAD_CONTACT_FORCE_T_FAULT_POSE_SILENCE) errors |= KNEAD_STATUS_T_ERROR_COMM_LOST;
    if (force->fault == KNEAD_CONTACT_FORCE_T_FAULT_OVERLOAD) errors |= KNEAD_STATUS_T_ERROR_OVERRUN;
    if (force->fault == KNEAD_CONTACT_FORCE_T_FAULT_IMPULSE) errors |= KNEAD_STATUS_T_ERROR_FORCE_IMPULSE_LIMIT;
    if (force->fault == KNEAD_CONTACT_FORCE_T_FAULT_NONFINITE) errors |= KNEAD_STATUS_T_ERROR_PHYSICS;
    return errors;
}

// Return the most severe mode (MODE_*) of all probes.
static int32_t mode_of(const kn_tick_in *in, const kn_tick_out *out)
{
    int32_t mode = KNEAD_STATUS_T_MODE_IDLE, flags = 0;
    for (int p = 0; p < out->probes; p++) {
        if (out->force[p].fault == KNEAD_CONTACT_FORCE_T_FAULT_ESTOP) return KNEAD_STATUS_T_MODE_ESTOP;
        if (!out->force[p].live) continue;
        mode = KNEAD_STATUS_T_MODE_RUNNING;
        flags |= out->force[p].flags;
    }
    // Check the other modes, most severe first. The most severe mode of all, MODE_ESTOP, has already been returned.
    if (in->stop) return KNEAD_STATUS_T_MODE_STOPPING;
    if (flags & KNEAD_CONTACT_FORCE_T_FLAG_LATCHED) return KNEAD_STATUS_T_MODE_FAULT;
    if (flags & KNEAD_CONTACT_FORCE_T_FLAG_REENGAGE_LIFT) return KNEAD_STATUS_T_MODE_RECOVERING;
    return flags & KNEAD_CONTACT_FORCE_T_FLAG_BRAKE ? KNEAD_STATUS_T_MODE_BRAKE : mode;
}

// Update two maxima over all probes: the force on a hand, and its change from one tick to the next.
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

#define ALL_GOOD ((1 << KN_PROBES_MAX) - 1)

// Shift one tick into the ring of the last KN_RECENT_TICKS ticks, and update the numbers of good ticks in the ring. Bit
// p of `good` is set if the tick was on time and probe p either had a fresh pose or had no session.
static void remember(kn_account *a, int good)
{
    int before = a->good[a->next];
    a->good_count += (good == ALL_GOOD) - (before == ALL_GOOD);
    for (int p = 0; p < KN_PROBES_MAX; p++) a->probe_good[p] += (good >> p & 1) - (before >> p & 1);
    a->good[a->next] = (uint8_t)good;
    a->next = (a->next + 1) % KN_RECENT_TICKS;
}

// Update the success rates of the server and of each probe. A missed cycle counts as a failure of every probe.
static void account_success(kn_account *a, const kn_tick_in *in, const kn_wake *wake, int64_t ticks)
{
    int fresh = 0;
    for (int p = 0; p < KN_PROBES_MAX; p++) fresh |= (!in->pose[p] || in->fresh[p]) << p;
    for (int i = 0; i < wake->missed && i < KN_RECENT_TICKS; i++) remember(a, 0);
    remember(a, fresh);
    // in the first KN_RECENT_TICKS cycles the ring is not full, so divide by the number of cycles since the start
    int64_t cycles = ticks + GET(&a->missed);
    double of = (double)(cycles < KN_RECENT_TICKS ? cycles : KN_RECENT_TICKS);
    SET(&a->success_rate, (double)a->good_count / of);
    for (int p = 0; p < KN_PROBES_MAX; p++) SET(&a->probe_success[p], (double)a->probe_good[p] / of);
}

// Add a value to the statistics by Welford's method, which needs no second pass and loses no digits.
static void take(kn_spread *s, double value)
{
    double off = value - s->mean;
    s->min = s->count ? fmin(s->min, value) : value;
    s->max = s->count ? fmax(s->max, value) : value;
    s->mean += off / (double)++s->count;
    s->square += off * (value - s->mean);
}

static double deviation(const kn_spread *s) { return sqrt(s->square / (double)s->count); }

// Publish the statistics of the present window of ticks. The mean rate is the number of ticks divided by their total
// time, so that a short period after a long one does not raise the mean.
static void tell_window(kn_account *a)
{
    const kn_spread *s = &a->busy_us, *t = &a->period_s;
    const double busy[4] = {s->mean, deviation(s), s->min, s->max};
    for (int i = 0; i < 4; i++) SET(&a->execution_us[i], busy[i]);
    if (t->count == 0) return;
    // t is the period of a tick. To first order, the standard deviation of the rate is std(1/t) = std(t) / mean(t)^2.
    const double rate[4] = {1 / t->mean, deviation(t) / (t->mean * t->mean), 1 / t->max, 1 / t->min};
    for (int i = 0; i < 4; i++) SET(&a->periodicity_hz[i], rate[i]);
}

// Update the statistics of the present window of ticks. A window ends where the tick number passes a multiple of
// KN_WINDOW_TICKS. The first window is also published while it is still open, so that a reader does not see zeros for a
// second.
static void account_window(kn_account *a, const kn_wake *wake, int64_t execution_ns)
{
    // Measure the period from the start of one tick to the start of the next.
    int64_t since_ns = wake->now_ns - a->began_ns;
    if (a->began_ns && since_ns > 0) take(&a->period_s, 1e-9 * (double)since_ns);
    take(&a->busy_us, 1e-3 * (double)execution_ns);
    a->began_ns = wake->now_ns;
    // Missed cycles may skip the last tick of a window, so compare the numbers of the windows (tick / KN_WINDOW_TICKS)
    // instead of testing a remainder.
    bool whole = (wake->tick + 1) / KN_WINDOW_TICKS != (wake->tick - wake->missed) / KN_WINDOW_TICKS;
    if (!whole && a->windowed) return;
    tell_window(a);
    if (!whole) return;
    a->windowed = true;
    a->period_s = a->busy_us = (kn_spread){0};
}

// Sum the counters of the output stage (core/safety.h) over all probes.
static void account_trips(kn_account *a, const kn_servo *servo, const kn_tick_out *out)
{
    int64_t trips[KN_TRIPS] = {0};
    for (int p = 0; p < out->probes; p++) {
        const kn_safety *s = &servo->safety[p];
        trips[KNEAD_HEALTH_T_TRIP_CLAMP] += s->clamps;
        trips[KNEAD_HEALTH_T_TRIP_GUARD] += s->guards;
        trips[KNEAD_HEALTH_T_TRIP_SLEW] += s->slewed;
        trips[KNEAD_HEALTH_T_TRIP_BRAKE] += s->brakes;
        trips[KNEAD_HEALTH_T_TRIP_POSE_SILENCE] += s->tripped[KN_FAULT_POSE_SILENCE];
        trips[KNEAD_HEALTH_T_TRIP_IMPULSE] += s->tripped[KN_FAULT_IMPULSE];
        trips[KNEAD_HEALTH_T_TRIP_NONFINITE] += s->tripped[KN_FAULT_NONFINITE];
        trips[KNEAD_HEALTH_T_TRIP_ESTOP] += s->tripped[KN_FAULT_ESTOP];
        trips[KNEAD_HEALTH_T_TRIP_OVERLOAD] += s->tripped[KN_FAULT_OVERLOAD];
        SET(&a->fault[p], out->force[p].fault);
    }
    trips[KNEAD_HEALTH_T_TRIP_PASSIVITY] = GET(&a->created);
    for (int i = 0; i < KN_TRIPS; i++) SET(&a->trips[i], trips[i]);
}

// Copy the counters of the energy audit. Return true if the object has created energy since the last tick.
static bool account_audit(kn_account *a, const kn_audit_news *audit)
{
    if (!audit) return false;
    bool created = audit->created > GET(&a->created);
    SET(&a->created, audit->created);
    SET(&a->audited, audit->windows);
    SET(&a->balance_j, audit->balance_j);
    return created;
}

void kn_account_tick(kn_account *a, const kn_servo *servo, const kn_tick_in *in, const kn_tick_out *out,
                     const kn_wake *wake, int64_t execution_ns, bool published)
{
    SET(&a->tick, wake->tick);
    ADD(&a->ticks, 1);
    ADD(&a->missed, wake->missed);
    ADD(&a->unpublished, !published);
    // The last turn of the servo loop ended so late that cycles were missed. Record how long the turn took. It began
    // one period before the first missed deadline.
    if (wake->missed) SET(&a->late_loop_ns, wake->now_ns - wake->due_ns + KN_PERIOD_NS);
    count(a->wakeup, wake->late_ns);
    count(a->execution, execution_ns);
    account_window(a, wake, execution_ns);
    account_success(a, in, wake, GET(&a->ticks));
    account_forces(a, out);

    // Collect the errors of this tick and the counters of all probes.
    int32_t errors = 0;
    int64_t clamps = 0, guards = 0, faults = 0;
    for (int p = 0; p < out->probes; p++) {
        errors |= errors_of(&out->force[p]);
        clamps += servo->safety[p].clamps;
        guards += servo->safety[p].guards;
        faults += servo->safety[p].faults;
    }
    // last_errors changes only when a probe is latched. Energy that the object creates latches no probe, so add the
    // passivity bit to last_errors here.
    if (account_audit(a, servo->audit)) {
        errors |= KNEAD_STATUS_T_ERROR_PASSIVITY;
        SET(&a->last_errors, GET(&a->last_errors) | KNEAD_STATUS_T_ERROR_PASSIVITY);
    }
    account_trips(a, servo, out);
    // The time of an overrun is the start of its tick.
    if (execution_ns > KN_PERIOD_NS) {
        ADD(&a->overruns, 1);
        SET(&a->overrun_us, kn_stamp_us() - (kn_now_ns() - wake->now_ns) / 1000);
        errors |= KNEAD_STATUS_T_ERROR_OVERRUN;
    }
    // A new fault replaces the error bits stored for the previous fault.
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

void kn_account_health(const kn_account *a, knead_health_t *health)
{
    for (int i = 0; i < 4; i++) {
        health->periodicity_hz[i] = GET(&a->periodicity_hz[i]);
        health->execution_us[i] = GET(&a->execution_us[i]);
    }
    health->time_last_overrun = GET(&a->overrun_us);
    for (int p = 0; p < KN_PROBES_MAX; p++) {
        health->success_rate[p] = GET(&a->probe_success[p]);
        health->fault[p] = GET(&a->fault[p]);
    }
    for (int i = 0; i < KN_TRIPS; i++) health->trips[i] = GET(&a->trips[i]);
    health->energy_balance_mj = 1e3 * GET(&a->balance_j);
    health->audited_s = GET(&a->audited);
}

int32_t kn_account_take_errors(kn_account *a) { return atomic_exchange_explicit(&a->errors, 0, memory_order_relaxed); }
