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

#define KN_SENTINEL_OFFSET_NS (KN_PERIOD_NS / 2) // delay of the sentinel's tick grid behind the servo's grid, ns
// A wake of the sentinel that is later than this counts as a stall, ns; on an idle core a thread wakes within 20-60 us.
#define KN_SENTINEL_STALL_NS 100000
// Largest time between a stall and a missed cycle that the stall still explains, ns.
#define KN_SENTINEL_MARGIN_NS 2000000
// Lateness from which the sentinel's wakes are counted and the servo's wakes are judged, ns.
#define KN_SENTINEL_LATE_NS 500000
// Number of stalls that are remembered; also the number of late wakes that are remembered.
#define KN_SENTINEL_RECENT 64

typedef struct kn_stall {
    int64_t from_ns, to_ns; // `from_ns`: the sentinel's deadline; `to_ns`: its wake
} kn_stall;

// `count`: number of late wakes of the servo; `explained`: number of them that a stall explains.
typedef struct kn_lates {
    int64_t count, explained;
} kn_lates;

typedef struct kn_sentinel {
    kn_clock clock;
    const _Atomic int64_t *beside; // time of tick 0 on the servo's grid, which may move; NULL: the grid does not move
    const kn_busy *busy;           // times at which the servo was busy; NULL: the servo counts as never busy
    // Numbers of wakes of the sentinel: `wakes`: all; `late`: late by KN_SENTINEL_LATE_NS or more; `later`: late by a
    // period or more. Time in which the servo was busy does not count as lateness.
    _Atomic int64_t wakes, late, later;
    atomic_bool stop;
    kn_ring stalls; // queue of stalls from the sentinel to the thread that calls kn_sentinel_judge
    // Latest stalls; this field and all below are used only by the thread that calls kn_sentinel_judge.
    kn_stall recent[KN_SENTINEL_RECENT];
    unsigned recent_count;
    kn_wake pending[KN_SENTINEL_RECENT]; // late wakes of the servo that have not been judged yet
    int pending_count;
    int64_t explained; // number of missed cycles that a stall explains
    // Late wakes of the servo that do not follow an overrun; `half`: late by KN_SENTINEL_LATE_NS or more; `whole`: late
    // by a period or more.
    kn_lates half, whole;
} kn_sentinel;

bool kn_sentinel_init(kn_sentinel *s); // prepare the sentinel; return false when memory is short
void kn_sentinel_free(kn_sentinel *s);
// Body of the sentinel's thread, runs until `stop` is set; the caller must start the clock before.
void *kn_sentinel_run(void *sentinel);

// Return the time from the sentinel's deadline to its wake, minus the time in which the servo was busy, ns.
int64_t kn_sentinel_stalled_ns(const kn_sentinel *s, const kn_wake *wake);

// Keep a wake of the servo that was late or missed cycles, until the sentinel has had time to report a stall. Other
// wakes are ignored. Call this and kn_sentinel_judge in one thread.
void kn_sentinel_hear(kn_sentinel *s, const kn_wake *wake);
// Judge the wakes that are older than the margin. Return the number of missed cycles that stalls have explained since
// the start.
int64_t kn_sentinel_judge(kn_sentinel *s, int64_t now_ns);

#endif
