#ifndef KN_SERVER_CLOCK_H
#define KN_SERVER_CLOCK_H
// The 1 ms grid of a periodic thread, on CLOCK_MONOTONIC with absolute deadlines: no drift, whatever a tick takes.
//
//     due(n) = start + n * period        |----n----|---n+1---|---n+2---|---n+3---|
//                                        run n           woken here: tick n+2, missed 1, late_ns from due(n+1)
//
// Whoever owns the clock may move the whole grid a little between two ticks (phase.h).
//
// A tick's number is its place on the grid. Cycles that passed while the thread could not run are counted and skipped,
// never caught up: two ticks at once would push the hand twice.
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#define KN_PERIOD_NS 1000000

typedef struct kn_clock {
    int64_t start_ns; // of tick 0, as if the grid had always stood where it stands now
    int64_t tick;     // of the last wake, -1 before the first
} kn_clock;

typedef struct kn_wake {
    int64_t tick;     // place on the grid
    int32_t missed;   // cycles skipped just before it
    bool overrun;     // the thread was still busy at the deadline: the misses are its own
    int64_t due_ns;   // deadline that was slept for
    int64_t asked_ns; // when the thread was ready to: the tick before had ended
    int64_t late_ns;  // awake this long after it, or after the call when that came later: what the machine added
    int64_t now_ns;   // when the tick began
    int64_t held_ns;  // that a tick was awake before that, waiting for its pose (phase.h)
} kn_wake;

// When a thread was busy, for one that keeps watch beside it: the latest ticks.
#define KN_BUSY 4
typedef struct kn_busy {
    _Atomic int64_t from_ns[KN_BUSY], to_ns[KN_BUSY];
} kn_busy;
// tick: one after the other. Real-time safe.
void kn_busy_tell(kn_busy *busy, int64_t tick, int64_t from_ns, int64_t to_ns);
int64_t kn_busy_within(const kn_busy *busy, int64_t from_ns, int64_t to_ns); // ns of that time

int64_t kn_now_ns(void);  // CLOCK_MONOTONIC; no system call, as the next two
int64_t kn_wall_us(void); // us since 1970, CLOCK_REALTIME; may be set at any time
// us since 1970 when the process first asked, and CLOCK_MONOTONIC from there on: a message's utime. Setting the wall
// clock moves none of them.
int64_t kn_stamp_us(void);

// A time that is handed in, for a process that plays server, link and hands in one thread (tests/rig.h). The three
// functions above tell now_ns, and kn_clock_sleep calls sleep instead of the kernel.
typedef struct kn_time {
    int64_t now_ns;
    void (*sleep)(struct kn_time *time, int64_t until_ns); // sets now_ns to until_ns or later; NULL: to until_ns
} kn_time;
void kn_clock_hand(kn_time *time); // borrowed until the next call; NULL: the kernel's clocks again

void kn_clock_start(kn_clock *clock, int64_t start_ns);
// Sleeps until the next deadline; until ns. Real-time safe.
kn_wake kn_clock_wait(kn_clock *clock);
void kn_clock_sleep(int64_t ns);

// When the tick that woke has to be over: where the grid has the next one, however late this one is.
int64_t kn_wake_deadline(const kn_wake *wake);

// The arithmetic of wait, apart from the sleep: what waking at now_ns means to a thread that asked at asked_ns.
kn_wake kn_clock_wake(kn_clock *clock, int64_t asked_ns, int64_t now_ns);

#endif
