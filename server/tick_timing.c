#include "server/tick_timing.h"
#include <math.h>
#include <stdlib.h>

// --- phase lock ---

static const double period_ns = KN_PERIOD_NS;
// Largest distance of a pose from the centre with which the centre is updated, ns; a larger distance is reduced to this
// value.
static const double outlier_ns = 100000;
// the margin is adapted only while centre and margin differ by less than this, ns
static const double settled_ns = 20000;
// a tick that wakes later than this, in ns, is not used to learn when poses arrive
static const int64_t stall_ns = 500000;

void kn_phase_init(kn_phase *phase) { *phase = (kn_phase){.probe = -1, .margin_ns = KN_PHASE_MARGIN_NS}; }

static double clamp(double x, double limit) { return fmax(-limit, fmin(limit, x)); }

// Reduce a time modulo one period to the range -period/2 .. period/2.
static double wrap(double ns) { return ns - period_ns * rint(ns / period_ns); }

// Choose the driver, that is, the probe whose poses the grid follows. Keep the present driver while it is engaged, or
// while no probe is engaged and it has a session. Otherwise take the first engaged probe. If no probe is engaged, take
// the first probe with a session.
static int choose(const kn_phase *phase, const kn_arrival *arrival, int probes)
{
    int live = -1, engaged = -1;
    for (int p = probes - 1; p >= 0; p--) {
        if (arrival[p].session) live = p;
        if (arrival[p].session && arrival[p].engaged) engaged = p;
    }
    int now = phase->probe;
    bool stays = now >= 0 && now < probes && arrival[now].session && (arrival[now].engaged || engaged < 0);
    return stays ? now : engaged >= 0 ? engaged : live;
}

// Reset the phase lock if the driver or its session has changed. Keep the margin learned so far.
static void take_driver(kn_phase *phase, int probe, int64_t session)
{
    if (probe == phase->probe && session == phase->session) return;
    phase->probe = probe;
    phase->session = session;
    phase->locked = false;
    phase->before_ns = 0;
    phase->steady = 0;
    phase->run_ns = phase->run = 0;
    phase->lost = false;
    // begin with a large spread; a regular sender reduces the spread below the limit in 0.12 s
    phase->spread_ns = period_ns / 4;
    phase->centre_ns = NAN; // the first pose sets the centre
}

// Update centre and spread with the wait of one pose, that is, the time from its arrival to the wake of the tick.
// Decide whether the poses have a rhythm.
static void observe(kn_phase *phase, double wait_ns)
{
    if (isnan(phase->centre_ns)) phase->centre_ns = wait_ns;
    double off_ns = wrap(wait_ns - phase->centre_ns);
    phase->centre_ns = wrap(phase->centre_ns + clamp(off_ns, outlier_ns) / 32);
    phase->spread_ns += (fabs(off_ns) - phase->spread_ns) / 128;
    phase->locked = !phase->lost && phase->spread_ns < (phase->locked ? KN_PHASE_LOSE_NS : KN_PHASE_LOCK_NS);
}

// Learn the margin as a quantile of the waits, without a histogram. The margin rises for a late pose and falls for a
// pose in time. Rise and fall balance when the wanted share of the poses is late.
static void judge_margin(kn_phase *phase, double wait_ns)
{
    if (!phase->locked || fabs(wrap(phase->centre_ns - phase->margin_ns)) > settled_ns) return;
    // ignore a pose so late that even the largest margin would not have been enough
    if (wait_ns < -KN_PHASE_MARGIN_MAX) return;
    double late = phase->steady >= KN_PHASE_STEADY ? KN_PHASE_LATE_HELD : KN_PHASE_LATE;
    double margin_ns = phase->margin_ns + 1000 * (wait_ns < 0 ? 1 - late : -late);
    phase->margin_ns = fmax(KN_PHASE_MARGIN_MIN, fmin(KN_PHASE_MARGIN_MAX, margin_ns));
}

static void take_wait(kn_phase *phase, int64_t ns)
{
    double wait_ns = wrap((double)ns);
    observe(phase, wait_ns);
    judge_margin(phase, wait_ns);
}

// Return the shift of the grid that brings the centre to the margin, at most KN_PHASE_SLEW_NS. Set phase->lost if the
// session has moved the grid too far (see KN_PHASE_RUN_NS).
static int64_t move_grid(kn_phase *phase)
{
    int64_t move_ns = llrint(clamp(wrap(phase->margin_ns - phase->centre_ns), KN_PHASE_SLEW_NS));
    phase->centre_ns = wrap(phase->centre_ns + (double)move_ns);
    phase->run_ns += move_ns;
    if (++phase->run < KN_PHASE_RUN_TICKS) return move_ns;
    phase->lost = llabs(phase->run_ns) > KN_PHASE_RUN_NS;
    phase->run_ns = phase->run = 0;
    return move_ns;
}

int kn_phase_awaits(const kn_phase *phase)
{
    return phase->locked && phase->steady >= KN_PHASE_STEADY ? phase->probe : -1;
}

int64_t kn_phase_tick(kn_phase *phase, const kn_arrival *arrival, int probes, const kn_wake *wake)
{
    // find the driver; if there is no driver, the grid does not move
    int driver = choose(phase, arrival, probes);
    take_driver(phase, driver, driver < 0 ? 0 : arrival[driver].session);
    if (driver < 0) return 0;
    phase->driven++;
    phase->followed += phase->locked;
    phase->held += wake->held_ns > 0;
    // measure waits from the wake, not from the end of a hold (wait for a late pose), because a hold must not move the
    // grid
    int64_t woke_ns = wake->now_ns - wake->held_ns;
    int64_t before_ns = phase->before_ns;
    phase->before_ns = arrival[driver].fresh ? 0 : woke_ns;
    // score how steadily poses come, and learn nothing from a tick without a new pose or after a stall
    phase->steady += arrival[driver].fresh ? 1 : -KN_PHASE_STEADY_LOSS;
    if (phase->steady > KN_PHASE_STEADY_MAX) phase->steady = KN_PHASE_STEADY_MAX;
    if (phase->steady < 0) phase->steady = 0;
    if (!arrival[driver].fresh || wake->missed || wake->late_ns > stall_ns) return 0;

    // If two poses came since a tick that had no new pose, the earlier of the two was late for that tick and was then
    // replaced by the later pose.
    const kn_arrival *a = &arrival[driver];
    if (before_ns && a->earlier_ns > before_ns) take_wait(phase, before_ns - a->earlier_ns);
    take_wait(phase, woke_ns - a->arrived_ns);
    return phase->locked ? move_grid(phase) : 0;
}

// --- sentinel ---

bool kn_sentinel_init(kn_sentinel *s)
{
    *s = (kn_sentinel){0};
    return kn_ring_init(&s->stalls, KN_SENTINEL_RECENT, sizeof(kn_stall));
}

void kn_sentinel_free(kn_sentinel *s) { kn_ring_free(&s->stalls); }

int64_t kn_sentinel_stalled_ns(const kn_sentinel *s, const kn_wake *wake)
{
    int64_t busy_ns = s->busy ? kn_busy_within(s->busy, wake->due_ns, wake->now_ns) : 0;
    return wake->now_ns - wake->due_ns - busy_ns;
}

void *kn_sentinel_run(void *sentinel)
{
    kn_sentinel *s = sentinel;
    while (!atomic_load_explicit(&s->stop, memory_order_relaxed)) {
        // keep the sentinel's deadlines half a period behind those of the servo, whose grid may move
        if (s->beside)
            s->clock.start_ns = atomic_load_explicit(s->beside, memory_order_relaxed) + KN_SENTINEL_OFFSET_NS;
        kn_wake wake = kn_clock_wait(&s->clock);
        kn_stall stall = {wake.due_ns, wake.now_ns};
        int64_t stalled_ns = kn_sentinel_stalled_ns(s, &wake);
        // If the ring is full, this stall is lost; the stalls already in the ring suffice.
        if (stalled_ns >= KN_SENTINEL_STALL_NS) kn_ring_push(&s->stalls, &stall);
        s->wakes++;
        s->late += stalled_ns >= KN_SENTINEL_LATE_NS;
        s->later += stalled_ns >= KN_PERIOD_NS;
    }
    return NULL;
}

// Move the stalls that the sentinel has reported into the array of recent stalls.
static void take_stalls(kn_sentinel *s)
{
    for (const kn_stall *stall; (stall = kn_ring_front(&s->stalls)); kn_ring_pop(&s->stalls))
        s->recent[s->recent_count++ % KN_SENTINEL_RECENT] = *stall;
}

// Return whether a recent stall is close enough to a late wake to explain it. A wake after an overrun is never
// explained, because an overrun is kneadd's own fault.
static bool explained(const kn_sentinel *s, const kn_wake *wake)
{
    if (wake->overrun) return false;
    unsigned count = s->recent_count < KN_SENTINEL_RECENT ? s->recent_count : KN_SENTINEL_RECENT;
    for (unsigned i = 0; i < count; i++)
        if (s->recent[i].from_ns - KN_SENTINEL_MARGIN_NS <= wake->now_ns &&
            wake->due_ns <= s->recent[i].to_ns + KN_SENTINEL_MARGIN_NS)
            return true;
    return false;
}

void kn_sentinel_hear(kn_sentinel *s, const kn_wake *wake)
{
    if (!wake->missed && wake->late_ns < KN_SENTINEL_LATE_NS) return;
    // there is no room for another wake, so judge all pending wakes now
    if (s->pending_count == KN_SENTINEL_RECENT) kn_sentinel_judge(s, INT64_MAX);
    s->pending[s->pending_count++] = *wake;
}

// Count a wake that has been judged.
static void take_verdict(kn_sentinel *s, const kn_wake *wake, bool explained)
{
    bool half = !wake->overrun && wake->late_ns >= KN_SENTINEL_LATE_NS, whole = half && wake->late_ns >= KN_PERIOD_NS;
    if (explained) s->explained += wake->missed;
    s->half.count += half;
    s->half.explained += half && explained;
    s->whole.count += whole;
    s->whole.explained += whole && explained;
}

int64_t kn_sentinel_judge(kn_sentinel *s, int64_t now_ns)
{
    // judge the wakes older than the margin, and keep the younger wakes in order
    int left = 0;
    take_stalls(s);
    for (int i = 0; i < s->pending_count; i++) {
        const kn_wake *wake = &s->pending[i];
        if (now_ns - wake->now_ns <= KN_SENTINEL_MARGIN_NS) s->pending[left++] = *wake;
        else take_verdict(s, wake, explained(s, wake));
    }
    s->pending_count = left;
    return s->explained;
}
