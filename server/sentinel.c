#include "server/sentinel.h"

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
        // keep the deadlines half a period after the servo's, whose grid may move
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

// Move the reported stalls into the ring of recent ones.
static void take_stalls(kn_sentinel *s)
{
    for (const kn_stall *stall; (stall = kn_ring_front(&s->stalls)); kn_ring_pop(&s->stalls))
        s->recent[s->recent_count++ % KN_SENTINEL_RECENT] = *stall;
}

// Return whether a recent stall is close enough to a late wake to explain it. An overrun is kneadd's own fault.
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
