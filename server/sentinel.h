#ifndef KN_SERVER_SENTINEL_H
#define KN_SERVER_SENTINEL_H
// Who is to blame for a late tick. A second periodic thread, on the servo's core, one priority below, half a period
// beside: when the machine stalls (a hypervisor, firmware, an interrupt storm) it stalls both; when our own code is
// late, only us. Measured on a busy virtual machine: 61 of 61 wakes that came >= 1 ms late had such a witness within
// 2 ms.
//
// It runs below the servo, so a long tick delays it as well: what the servo was busy is no stall, and misses after a
// tick that overran are never excused.
#include "server/clock.h"
#include "server/ring.h"

#define KN_SENTINEL_OFFSET_NS (KN_PERIOD_NS / 2)
#define KN_SENTINEL_STALL_NS 100000   // later than this is a stall: an idle core wakes within 20-60 us
#define KN_SENTINEL_MARGIN_NS 2000000 // a stall explains a miss this close to it
#define KN_SENTINEL_LATE_NS 500000    // from here on a late wake of the servo is judged, and counted of both
#define KN_SENTINEL_RECENT 64

typedef struct kn_stall {
    int64_t from_ns, to_ns; // deadline and wake of the sentinel
} kn_stall;

typedef struct kn_lates {
    int64_t count, explained;
} kn_lates;

typedef struct kn_sentinel {
    kn_clock clock;
    const _Atomic int64_t *beside; // start of the servo's grid, which may move; NULL: it stands still
    const kn_busy *busy;           // the servo's ticks; NULL: it is never busy
    // of its own: all, late by KN_SENTINEL_LATE_NS, late by a period, without what the servo took
    _Atomic int64_t wakes, late, later;
    atomic_bool stop;
    kn_ring stalls;                      // from the sentinel to whoever judges
    kn_stall recent[KN_SENTINEL_RECENT]; // the judge's, as all below
    unsigned recent_count;
    kn_wake pending[KN_SENTINEL_RECENT]; // late wakes of the servo, not judged yet
    int pending_count;
    int64_t explained;    // missed cycles that a stall explains
    kn_lates half, whole; // of the servo's wakes, but those after an overrun: late by KN_SENTINEL_LATE_NS, by a period
} kn_sentinel;

bool kn_sentinel_init(kn_sentinel *s); // false when memory is short
void kn_sentinel_free(kn_sentinel *s);
void *kn_sentinel_run(void *sentinel); // thread body, until stop; clock started by the caller

// How long it did not run after its deadline though the servo let it.
int64_t kn_sentinel_stalled_ns(const kn_sentinel *s, const kn_wake *wake);

// Judge's side, one thread. A tick of the servo that came late or missed cycles is kept until its witness had time to
// speak; others are passed over.
void kn_sentinel_hear(kn_sentinel *s, const kn_wake *wake);
// Judges what is older than the margin; returns explained.
int64_t kn_sentinel_judge(kn_sentinel *s, int64_t now_ns);

#endif
