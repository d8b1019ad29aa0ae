#ifndef KN_SERVER_SENTINEL_H
#define KN_SERVER_SENTINEL_H
// The sentinel: a second periodic thread that shows whether a late tick is the machine's fault or kneadd's own. It runs
// on the servo's core at a priority one lower, and its deadlines lie half a period after the servo's. A stall of the
// machine (a hypervisor, firmware, an interrupt storm) delays both threads. When kneadd's own code is slow, only the
// servo is late. Measured on a busy virtual machine: the servo woke >= 1 ms late 61 times, and each time the sentinel
// was late within 2 ms of that wake.
//
// The sentinel runs below the servo, so a long tick would delay the sentinel as well. Time in which the servo was busy
// is therefore not a stall, and cycles missed after a tick that overran are never explained by a stall.
#include "server/clock.h"
#include "server/ring.h"

#define KN_SENTINEL_OFFSET_NS (KN_PERIOD_NS / 2) // from the servo's grid to the sentinel's
#define KN_SENTINEL_STALL_NS 100000   // a wake later than this is a stall, ns; an idle core wakes within 20-60 us
#define KN_SENTINEL_MARGIN_NS 2000000 // a stall explains a missed cycle this close to it, ns
#define KN_SENTINEL_LATE_NS 500000    // lateness from which wakes are counted, and the servo's are judged, ns
#define KN_SENTINEL_RECENT 64         // number of stalls, and of late wakes, that are remembered

typedef struct kn_stall {
    int64_t from_ns, to_ns; // deadline and wake of the sentinel
} kn_stall;

typedef struct kn_lates { // number of late wakes of the servo, and of those that a stall explains
    int64_t count, explained;
} kn_lates;

typedef struct kn_sentinel {
    kn_clock clock;
    const _Atomic int64_t *beside; // start of the servo's grid, which may move; NULL: the grid stands still
    const kn_busy *busy;           // busy times of the servo; NULL: it is never busy
    // Number of wakes of the sentinel: all; late by KN_SENTINEL_LATE_NS or more; late by a period or more. Time in
    // which the servo was busy does not count as lateness.
    _Atomic int64_t wakes, late, later;
    atomic_bool stop;
    kn_ring stalls;                      // from the sentinel to the judging thread
    kn_stall recent[KN_SENTINEL_RECENT]; // this field and all below belong to the judging thread
    unsigned recent_count;
    kn_wake pending[KN_SENTINEL_RECENT]; // late wakes of the servo, not judged yet
    int pending_count;
    int64_t explained;    // missed cycles that a stall explains
    kn_lates half, whole; // wakes of the servo, not after an overrun: late by >= KN_SENTINEL_LATE_NS; by >= a period
} kn_sentinel;

bool kn_sentinel_init(kn_sentinel *s); // false when memory is short
void kn_sentinel_free(kn_sentinel *s);
void *kn_sentinel_run(void *sentinel); // thread body, runs until `stop`; the caller starts the clock

// Return the time from the sentinel's deadline to its wake, without the time in which the servo was busy, ns.
int64_t kn_sentinel_stalled_ns(const kn_sentinel *s, const kn_wake *wake);

// Keep a wake of the servo that was late or missed cycles, until the sentinel has had time to report a stall. Other
// wakes are ignored. Call this and kn_sentinel_judge in one thread.
void kn_sentinel_hear(kn_sentinel *s, const kn_wake *wake);
// Judge the wakes that are older than the margin. Return the number of missed cycles that stalls have explained since
// the start.
int64_t kn_sentinel_judge(kn_sentinel *s, int64_t now_ns);

#endif
