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

TEST("ticks on time are consecutive and miss no cycle")
{
    kn_clock clock;
    kn_clock_start(&clock, START);
    for (int n = 0; n < 5; n++) {
        kn_wake wake = kn_clock_wake(&clock, START + (n - 1) * MS + 200000, START + n * MS + 999999);
        CHECK(wake.tick == n && wake.missed == 0 && !wake.overrun && wake.due_ns == START + n * MS &&
              wake.late_ns == 999999);
    }
}

TEST("missed cycles are counted and skipped, and the next deadline is in the future")
{
    kn_clock clock;
    kn_clock_start(&clock, START);
    kn_wake wake = kn_clock_wake(&clock, START - 1, START + 10);
    wake = kn_clock_wake(&clock, START + 200000, START + 37 * MS + 5); // slept 36 ms too long
    CHECK(wake.tick == 37 && wake.missed == 36 && !wake.overrun && wake.late_ns == 36 * MS + 5);
    wake = kn_clock_wake(&clock, START + 37 * MS + 300000, START + 38 * MS + 5);
    CHECK(wake.tick == 38 && wake.missed == 0 && wake.due_ns == START + 38 * MS);
}

TEST("a thread that was busy past its deadline is reported as an overrun")
{
    kn_clock clock;
    kn_clock_start(&clock, START);
    kn_wake wake = kn_clock_wake(&clock, START - 1, START);
    wake = kn_clock_wake(&clock, START + 2 * MS + 400000, START + 2 * MS + 400030); // tick 0 took 2.4 ms
    CHECK(wake.tick == 2 && wake.missed == 1 && wake.overrun && wake.late_ns == 30);
}

TEST("the deadline of a tick is the next point of the grid, however late the tick woke")
{
    kn_clock clock;
    const int64_t late_ns[] = {0, 400000, 999999, 36 * MS + 5, 10};
    kn_clock_start(&clock, START);
    for (int i = 0; i < 5; i++) {
        const int64_t due_ns = START + (clock.tick + 1) * MS;
        const kn_wake wake = kn_clock_wake(&clock, due_ns - 1, due_ns + late_ns[i]);
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
