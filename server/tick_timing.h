#ifndef KN_SERVER_TICK_TIMING_H
#define KN_SERVER_TICK_TIMING_H
// The timing of the servo's ticks. The phase lock decides when a tick comes. The sentinel finds out whether the machine
// or kneadd caused a late tick.
#include "server/clock.h"
#include "server/ring.h"

// --- phase lock ---
//
// Phase lock: shift the servo's tick grid so that a tick begins just after the driving probe's pose arrives. The pose
// then waits tens of us for its tick. On a tick grid that does not follow the poses, a pose waits half a period on
// average. The clock crystals of sender and server also differ slightly, so on a free grid the wait of a pose drifts
// through a whole period every few seconds. In each such drift, one pose is left out or used twice.
//
//     poses      |     . |       . |     .   |      .  |      arrive with jitter around one place in the period
//     ticks      #       #         #         #                just after most of the poses, held back for the others
//
// For each pose that came since the last tick:
//     wait = tick's wake - pose's arrival, modulo one period        (includes the lateness of the wake)
//     centre += (wait - centre) / 32, spread += (|wait - centre| - spread) / 128      (centre moves <= 0.1 ms / 32)
//     margin += 1 us * (1 - late) if the pose came after its tick was awake, else margin -= 1 us * late
//     shift = margin - centre, limited to +- KN_PHASE_SLEW_NS: move the grid by it, and centre += shift
// The margin settles where the share `late` (KN_PHASE_LATE) of the poses is late. Two crystals 100 ppm apart drift 0.1
// us per tick, and the centre trails by 3 us. If the arrivals jump by half a period, the grid needs 0.25 s to follow.
//
// A late pose would wait a whole period. Usually the next pose arrives in the meantime and replaces the late one, which
// is then never answered. A margin large enough for nearly all poses (0.1 ms for 99.6 % of them on a busy machine)
// would delay every pose by that much. Instead, a tick that is awake before its pose waits for the pose, at most
// KN_PHASE_HOLD_NS. This hold does not move the grid, and the next tick is on time. Ticks are held only while poses
// come steadily, one per tick. While ticks are held, a far larger share of the poses may be late (KN_PHASE_LATE_HELD).
//
// A sender that sends each pose in answer to a force follows the tick grid. Sender and grid would then follow each
// other, and both would run 0.2 % fast or slow. Therefore a session that moves the grid by more than KN_PHASE_RUN_NS
// within KN_PHASE_RUN_TICKS is not followed any more.
//
// The grid stands still, as a free clock, when poses stop or come irregularly (large spread), or when the machine
// stalls. Ticks are never dropped or doubled, and two ticks are due at least one period minus KN_PHASE_SLEW_NS apart.
// The result of a tick does not depend on the phase: a step is one period long, whatever the hardware's clock says. All
// functions are pure and real-time safe.

#define KN_PHASE_SLEW_NS 2000 // largest shift per tick, ns: a tenth of the variation of wakes, 0.2 % of a period
// Share of the poses that may arrive after their tick has begun, while ticks do not wait for late poses. Such a pose
// waits for the next tick.
#define KN_PHASE_LATE 0.004
// Share of the poses that may arrive late, while ticks wait for late poses. This share is larger, because a wait for a
// late pose delays a few poses, but a larger margin would delay all poses.
#define KN_PHASE_LATE_HELD 0.2
// Longest time that a tick waits for a late pose, ns; the wait is also limited to a third of the last tick's unused
// time.
#define KN_PHASE_HOLD_NS 300000
#define KN_PHASE_STEADY 4 // score from which poses count as steady; each tick with a new pose adds 1 to the score
// Score lost by a tick without a new pose. Poses at 500 Hz then count as unsteady, and poses at 1 kHz count as steady
// even if a fifth of them is lost.
#define KN_PHASE_STEADY_LOSS 2
#define KN_PHASE_STEADY_MAX 12 // largest score; when poses stop, at most five ticks wait for a pose in vain
// A session runs away when it moves the grid by more than KN_PHASE_RUN_NS in KN_PHASE_RUN_TICKS poses. The limit is
// half a period for the first approach, plus 500 ppm of KN_PHASE_RUN_TICKS periods. No clock crystal is wrong by 500
// ppm.
#define KN_PHASE_RUN_TICKS 2000
#define KN_PHASE_RUN_NS 1500000
#define KN_PHASE_MARGIN_NS 40000 // initial value of the margin between a pose's usual arrival and its tick, ns
#define KN_PHASE_MARGIN_MIN 10000
// Largest margin, ns; a larger margin would delay all poses more than it helps the late poses.
#define KN_PHASE_MARGIN_MAX 200000
// Poses become rhythmic when their spread (mean distance from the centre) falls below KN_PHASE_LOCK_NS. They remain
// rhythmic until their spread exceeds KN_PHASE_LOSE_NS. Random arrivals have a spread of 0.25 ms, far above both
// limits.
#define KN_PHASE_LOCK_NS 100000
#define KN_PHASE_LOSE_NS 150000

typedef struct kn_arrival { // arrival times of the latest poses of one probe, as known to a tick
    int64_t session;        // 0: the probe has no session
    int64_t arrived_ns;     // time at which the latest pose arrived
    int64_t earlier_ns;     // time at which the pose before the latest one arrived
    bool fresh;             // true: no earlier tick has used the latest pose
    bool engaged;           // true while the probe acts on the object
} kn_arrival;

typedef struct kn_phase {
    bool locked; // true while the tick grid follows the arrivals of the poses
    int probe;   // driver, that is, index of the probe whose poses the tick grid follows; -1: none
    int64_t session;
    double centre_ns, spread_ns, margin_ns;
    int steady;        // score of how steadily poses arrive, 0 .. KN_PHASE_STEADY_MAX
    int64_t before_ns; // time at which the previous tick woke if that tick had no new pose; otherwise 0
    int64_t run_ns;    // sum of the shifts of the tick grid over the last `run` poses, ns
    int run;           // number of shifts summed in run_ns, 0 .. KN_PHASE_RUN_TICKS
    // True if the tick grid no longer follows this session, because the session moved the grid too far.
    bool lost;
    // Numbers of ticks. driven: with a driver; followed: with a driver and a locked grid; held: delayed to wait for a
    // pose.
    int64_t driven, followed, held;
} kn_phase;

void kn_phase_init(kn_phase *phase);

// A tick that is due may wait for a late pose. Return the index of the probe whose pose it should wait for, or -1 for
// no wait.
int kn_phase_awaits(const kn_phase *phase);

// Update the phase lock after a tick has run. Return the shift of the grid, ns; a positive shift makes ticks later. The
// driver is the probe that engaged first, as long as it is engaged. While no probe is engaged, the driver is the first
// probe with a session, so that the grid is already shifted to its poses when that probe touches the object.
int64_t kn_phase_tick(kn_phase *phase, const kn_arrival *arrival, int probes, const kn_wake *wake);

// --- sentinel ---
//
// The sentinel: a second periodic thread that shows whether a late tick is the machine's fault or kneadd's own. It runs
// on the servo's core at a priority one lower, and its deadlines lie half a period after the servo's. A stall of the
// machine (a hypervisor, firmware, an interrupt storm) delays both threads. When kneadd's own code is slow, only the
// servo is late. Measured on a busy virtual machine: the servo woke >= 1 ms late 61 times, and each time the sentinel
// was late within 2 ms of that wake.
//
// The sentinel runs below the servo, so a long tick would delay the sentinel as well. Time in which the servo was busy
// is therefore not a stall, and cycles missed after a tick that overran are never explained by a stall.

#define KN_SENTINEL_OFFSET_NS (KN_PERIOD_NS / 2) // delay of the sentinel's tick grid behind the servo's grid, ns
// If the sentinel wakes later than this after its deadline, the machine has stalled, ns. On an idle core a thread wakes
// within 20-60 us.
#define KN_SENTINEL_STALL_NS 100000
// Largest time between a stall and a missed cycle that the stall still explains, ns.
#define KN_SENTINEL_MARGIN_NS 2000000
// A wake of the servo or of the sentinel counts as late from this lateness on, ns.
#define KN_SENTINEL_LATE_NS 500000
// Number of stalls that are remembered; also the number of late wakes that are remembered.
#define KN_SENTINEL_RECENT 64

typedef struct kn_stall {
    int64_t from_ns, to_ns; // `from_ns`: deadline of the sentinel's wake; `to_ns`: time of the wake
} kn_stall;

// `count`: number of late wakes of the servo; `explained`: number of them that a stall explains.
typedef struct kn_lates {
    int64_t count, explained;
} kn_lates;

typedef struct kn_sentinel {
    kn_clock clock;
    // Time of tick 0 on the servo's grid, which the sentinel follows; NULL: the sentinel's grid does not move.
    const _Atomic int64_t *beside;
    const kn_busy *busy; // times at which the servo was busy; NULL: the servo counts as never busy
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
// wakes are ignored. Call kn_sentinel_hear and kn_sentinel_judge in one thread.
void kn_sentinel_hear(kn_sentinel *s, const kn_wake *wake);
// Judge the late wakes of the servo that happened more than KN_SENTINEL_MARGIN_NS ago. Return the number of missed
// cycles that stalls have explained since the start.
int64_t kn_sentinel_judge(kn_sentinel *s, int64_t now_ns);

#endif
