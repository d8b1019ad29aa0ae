#ifndef KN_SERVER_CLOCK_H
#define KN_SERVER_CLOCK_H
// The 1 ms grid of a periodic thread. Deadlines are absolute times of CLOCK_MONOTONIC, so the grid does not drift,
// however long a tick takes.
//
//     due(n) = start + n * period        |----n----|---n+1---|---n+2---|---n+3---|
//                                        run n           woken here: tick n+2, missed 1, late_ns from due(n+1)
//
// The owner of the clock may move the whole grid a little between two ticks (tick_timing.h).
//
// A tick's number is its place on the grid. Cycles that pass while the thread cannot run are counted and skipped, never
// caught up, because two ticks at once would push the hand twice.
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#define KN_PERIOD_NS 1000000

typedef struct kn_clock {
    int64_t start_ns; // time of tick 0 on the grid, ns; changes when the grid is moved
    int64_t tick;     // number of the tick of the last wake; -1: no wake yet
} kn_clock;

typedef struct kn_wake {
    int64_t tick;     // number of the tick on the 1 ms grid
    int32_t missed;   // number of cycles skipped just before this tick
    bool overrun;     // true: the thread was still busy at the deadline, so it caused the missed cycles itself
    int64_t due_ns;   // deadline until which the thread slept, ns
    int64_t asked_ns; // time at which the thread began to wait, after the previous tick had ended, ns
    int64_t late_ns;  // delay added by the machine: time from the later of due_ns and asked_ns to the wake, ns
    int64_t now_ns;   // time at which the tick started, ns
    // Time for which the thread, already awake, waited for a late pose before now_ns (tick_timing.h), ns.
    int64_t held_ns;
} kn_wake;

// Start and end of a thread's latest KN_BUSY ticks. The sentinel thread reads these times of the servo thread.
#define KN_BUSY 4
typedef struct kn_busy {
    _Atomic int64_t from_ns[KN_BUSY], to_ns[KN_BUSY];
} kn_busy;
// Record that the thread was busy with a tick from `from_ns` to `to_ns`. `tick` must rise by 1 from call to call.
// Real-time safe.
void kn_busy_tell(kn_busy *busy, int64_t tick, int64_t from_ns, int64_t to_ns);
// Return the time between from_ns and to_ns in which the thread was busy, ns.
int64_t kn_busy_within(const kn_busy *busy, int64_t from_ns, int64_t to_ns);

// Return CLOCK_MONOTONIC, ns. kn_now_ns, kn_wall_us and kn_stamp_us make no system call.
int64_t kn_now_ns(void);
// Return CLOCK_REALTIME, us since 1970. The wall clock may be set at any time.
int64_t kn_wall_us(void);
// Return the utime of a message, us since 1970. The first call in the process reads the wall clock; from then on the
// time follows CLOCK_MONOTONIC. Setting the wall clock later does not change the utime.
int64_t kn_stamp_us(void);

// A clock supplied by a test that simulates server, link and hands in one thread (tests/rig.h). With such a clock,
// kn_now_ns, kn_wall_us and kn_stamp_us return now_ns (or now_ns / 1000). kn_clock_sleep calls `sleep` instead of the
// kernel.
typedef struct kn_time {
    int64_t now_ns;
    // Advance now_ns to until_ns or later. If `sleep` is NULL, kn_clock_sleep sets now_ns to until_ns.
    void (*sleep)(struct kn_time *time, int64_t until_ns);
} kn_time;
// Replace the kernel's clocks by `time`, which must live until the next call of this function. NULL: use the kernel's
// clocks again.
void kn_clock_hand(kn_time *time);

// Start the grid: tick 0 is due at start_ns (CLOCK_MONOTONIC, ns).
void kn_clock_start(kn_clock *clock, int64_t start_ns);
// Sleep until the next deadline of the grid. Return the tick to run, with its missed cycles and times. Real-time safe.
kn_wake kn_clock_wait(kn_clock *clock);
// Sleep until CLOCK_MONOTONIC is `ns`. Real-time safe.
void kn_clock_sleep(int64_t ns);

// Return the time by which the tick must be over: the first deadline of the grid after the wake, however late the wake
// was.
int64_t kn_wake_deadline(const kn_wake *wake);

// Return the wake (tick number and times) of a thread that began to wait at `asked_ns` and woke at `now_ns`. This
// function does not sleep; kn_clock_wait calls it after its sleep.
kn_wake kn_clock_wake(kn_clock *clock, int64_t asked_ns, int64_t now_ns);

#endif
