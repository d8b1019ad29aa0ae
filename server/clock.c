#include "server/clock.h"
#include <errno.h>
#include <time.h>

static kn_time *handed; // clock supplied by a test; NULL: use the kernel's clocks

void kn_clock_hand(kn_time *time) { handed = time; }

int64_t kn_now_ns(void)
{
    if (handed) return handed->now_ns;
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * INT64_C(1000000000) + t.tv_nsec;
}

int64_t kn_wall_us(void)
{
    if (handed) return handed->now_ns / 1000;
    struct timespec t;
    clock_gettime(CLOCK_REALTIME, &t);
    return t.tv_sec * INT64_C(1000000) + t.tv_nsec / 1000;
}

int64_t kn_stamp_us(void)
{
    static _Atomic int64_t start_us; // wall clock minus monotonic clock, us; 0: not measured yet
    int64_t now_us = kn_now_ns() / 1000, at_us = atomic_load_explicit(&start_us, memory_order_relaxed);
    if (handed) return now_us;
    // Two threads may measure the offset at once. The first thread to store the offset wins, and the other takes the
    // stored value.
    if (at_us == 0) {
        int64_t none = 0, wall_us = kn_wall_us() - now_us;
        at_us = atomic_compare_exchange_strong(&start_us, &none, wall_us) ? wall_us : none;
    }
    return at_us + now_us;
}

void kn_clock_start(kn_clock *clock, int64_t start_ns) { *clock = (kn_clock){.start_ns = start_ns, .tick = -1}; }

kn_wake kn_clock_wake(kn_clock *clock, int64_t asked_ns, int64_t now_ns)
{
    // A wake is at or after its deadline. Each whole period of lateness is a missed cycle.
    int64_t due_ns = clock->start_ns + (clock->tick + 1) * KN_PERIOD_NS;
    int64_t late_ns = now_ns - due_ns;
    kn_wake wake = {.tick = clock->tick + 1 + late_ns / KN_PERIOD_NS,
                    .missed = (int32_t)(late_ns / KN_PERIOD_NS),
                    .overrun = asked_ns > due_ns,
                    .due_ns = due_ns,
                    .asked_ns = asked_ns,
                    .now_ns = now_ns,
                    .late_ns = now_ns - (asked_ns > due_ns ? asked_ns : due_ns)};
    clock->tick = wake.tick;
    return wake;
}

int64_t kn_wake_deadline(const kn_wake *wake) { return wake->due_ns + (wake->missed + INT64_C(1)) * KN_PERIOD_NS; }

void kn_clock_sleep(int64_t ns)
{
    if (handed && handed->sleep) handed->sleep(handed, ns);
    else if (handed && ns > handed->now_ns) handed->now_ns = ns;
    if (handed) return;
    struct timespec due = {.tv_sec = ns / 1000000000, .tv_nsec = ns % 1000000000};
    // A signal may interrupt the sleep. The deadline is an absolute time, so call the sleep again with the same
    // deadline.
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL) == EINTR) {
    }
}

kn_wake kn_clock_wait(kn_clock *clock)
{
    int64_t asked_ns = kn_now_ns(), now_ns;
    int64_t due_ns = clock->start_ns + (clock->tick + 1) * KN_PERIOD_NS;
    // Sleep again if the supplied clock or the kernel returns early.
    do {
        kn_clock_sleep(due_ns);
        now_ns = kn_now_ns();
    } while (now_ns < due_ns);
    return kn_clock_wake(clock, asked_ns, now_ns);
}

void kn_busy_tell(kn_busy *busy, int64_t tick, int64_t from_ns, int64_t to_ns)
{
    atomic_store_explicit(&busy->from_ns[tick % KN_BUSY], from_ns, memory_order_relaxed);
    atomic_store_explicit(&busy->to_ns[tick % KN_BUSY], to_ns, memory_order_relaxed);
}

// Sum the overlaps of the recorded ticks with the interval from from_ns to to_ns.
int64_t kn_busy_within(const kn_busy *busy, int64_t from_ns, int64_t to_ns)
{
    int64_t all_ns = 0;
    for (int i = 0; i < KN_BUSY; i++) {
        int64_t begin_ns = atomic_load_explicit(&busy->from_ns[i], memory_order_relaxed);
        int64_t end_ns = atomic_load_explicit(&busy->to_ns[i], memory_order_relaxed);
        if (begin_ns < from_ns) begin_ns = from_ns;
        if (end_ns > to_ns) end_ns = to_ns;
        if (end_ns > begin_ns) all_ns += end_ns - begin_ns;
    }
    return all_ns;
}
