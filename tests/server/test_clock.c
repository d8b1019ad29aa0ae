#include "server/clock.h"
#include "tests/check.h"
#include <stdlib.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#define MS KN_PERIOD_NS
#define START (70 * (int64_t)MS)

static int64_t step_s; // step of the wall clock, s

int clock_gettime(clockid_t clock, struct timespec *t)
{
    long failed = syscall(SYS_clock_gettime, clock, t);
    if (clock == CLOCK_REALTIME) t->tv_sec += step_s;
    return (int)failed;
}

TEST("setting the wall clock back or ahead changes no time stamp")
{
    int64_t first_us = kn_stamp_us(), wall_us = kn_wall_us(), last_us = first_us;
    for (step_s = -3600; step_s <= 3600; step_s += 1200) {
        int64_t now_us = kn_stamp_us();
        CHECK(now_us >= last_us && now_us - first_us < 600000000);
        CHECK(step_s == 0 || llabs(kn_wall_us() - wall_us) > 600000000);
        last_us = now_us;
    }
    step_s = 0;
}

TEST(
    "ticks on time are consecutive; missed cycles are counted and skipped, a thread that was busy past its deadline is "
    "an overrun, and the next deadline is the next point of the grid")
{
    static const struct {
        int64_t asleep_ns, woke_ns; // since the start: the thread goes to sleep, and wakes
        int64_t tick, missed, late_ns;
        bool overrun;
    } wakes[] = {{-800000, 999999, 0, 0, 999999, false},
                 {200000, MS + 999999, 1, 0, 999999, false},
                 {MS + 200000, 2 * MS + 10, 2, 0, 10, false},
                 {2 * MS + 200000, 39 * MS + 5, 39, 36, 36 * MS + 5, false}, // slept 36 ms too long
                 {39 * MS + 300000, 40 * MS + 5, 40, 0, 5, false},
                 {42 * MS + 400000, 42 * MS + 400030, 42, 1, 30, true}, // tick 40 took 2.4 ms
                 {42 * MS + 500000, 43 * MS + 999999, 43, 0, 999999, false}};
    kn_clock clock;
    kn_clock_start(&clock, START);
    for (size_t i = 0; i < sizeof wakes / sizeof *wakes; i++) {
        kn_wake wake = kn_clock_wake(&clock, START + wakes[i].asleep_ns, START + wakes[i].woke_ns);
        CHECK(wake.tick == wakes[i].tick && wake.missed == wakes[i].missed && wake.overrun == wakes[i].overrun);
        CHECK(wake.late_ns == wakes[i].late_ns);
        CHECK(wake.missed || wake.due_ns == START + wake.tick * MS);
        CHECK(kn_wake_deadline(&wake) == START + (wake.tick + 1) * MS && kn_wake_deadline(&wake) > wake.now_ns);
    }
}

TEST("waiting never ends before the deadline and loses no tick of the count")
{
    kn_clock clock;
    kn_clock_start(&clock, kn_now_ns() + 2 * MS);
    int64_t early = 0, expected = 0;
    for (int n = 0; n < 50; n++) {
        kn_wake wake = kn_clock_wait(&clock);
        early += wake.now_ns < clock.start_ns + wake.tick * MS || wake.late_ns < 0;
        CHECK(wake.tick == expected + wake.missed);
        expected = wake.tick + 1;
    }
    CHECK(early == 0);
}

TESTS_MAIN
