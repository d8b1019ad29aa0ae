#include "server/sentinel.h"
#include "tests/check.h"

#define MS INT64_C(1000000)

static kn_sentinel sentinel;

static void stall(int64_t from_ms, int64_t to_ms)
{
    kn_stall s = {from_ms * MS, to_ms * MS};
    CHECK(kn_ring_push(&sentinel.stalls, &s));
}

static kn_wake late(int64_t due_ms, int32_t missed)
{
    return (kn_wake){.due_ns = due_ms * MS, .now_ns = (due_ms + missed) * MS, .missed = missed};
}

TEST("a miss is explained when the machine stalled the sentinel too, within 2 ms")
{
    CHECK(kn_sentinel_init(&sentinel));
    kn_wake wake = late(100, 5);
    kn_sentinel_hear(&sentinel, &wake);
    wake = late(200, 7);
    kn_sentinel_hear(&sentinel, &wake);
    wake = late(300, 2);
    kn_sentinel_hear(&sentinel, &wake);
    stall(101, 105); // in the middle of the first
    stall(210, 215); // 3 ms after the second
    stall(295, 298); // 2 ms before the third
    CHECK(kn_sentinel_judge(&sentinel, 1000 * MS) == 5 + 2);
    CHECK(kn_sentinel_judge(&sentinel, 2000 * MS) == 5 + 2); // each miss is judged once
    kn_sentinel_free(&sentinel);
}

TEST("our own overrun is never excused, though it delays the sentinel as well")
{
    CHECK(kn_sentinel_init(&sentinel));
    kn_wake wake = late(100, 5);
    wake.overrun = true;
    kn_sentinel_hear(&sentinel, &wake);
    stall(100, 105);
    CHECK(kn_sentinel_judge(&sentinel, 1000 * MS) == 0);
    kn_sentinel_free(&sentinel);
}

TEST("judgement waits until the witness has had time to speak")
{
    CHECK(kn_sentinel_init(&sentinel));
    kn_wake wake = late(100, 3);
    kn_sentinel_hear(&sentinel, &wake);
    CHECK(kn_sentinel_judge(&sentinel, 104 * MS) == 0);
    stall(103, 104);
    CHECK(kn_sentinel_judge(&sentinel, 106 * MS) == 3);
    kn_sentinel_free(&sentinel);
}

TEST("what the servo was busy is no stall of the machine, however long it took")
{
    kn_busy busy = {0};
    kn_sentinel s = {.busy = &busy};
    kn_wake wake = {.due_ns = 100500000, .now_ns = 100900000}; // 0.4 ms late
    kn_busy_tell(&busy, 1, 100 * MS, 100880000);
    CHECK(kn_sentinel_stalled_ns(&s, &wake) == 20000);
    CHECK(kn_sentinel_stalled_ns(&(kn_sentinel){0}, &wake) == 400000);

    wake = (kn_wake){.due_ns = 200500000, .now_ns = 203300000}; // after an overrun of 3 ms and the tick that followed
    kn_busy_tell(&busy, 2, 200 * MS, 203 * MS);
    kn_busy_tell(&busy, 3, 203 * MS, 203250000);
    CHECK(kn_sentinel_stalled_ns(&s, &wake) == 50000);

    wake = (kn_wake){.due_ns = 300500000, .now_ns = 305300000}; // the machine stood still for 5 ms, then the servo ran
    kn_busy_tell(&busy, 4, 305 * MS, 305250000);
    CHECK(kn_sentinel_stalled_ns(&s, &wake) == 4550000);
}

TEST("late wakes are counted from half a millisecond on, those after an overrun are not the machine's")
{
    CHECK(kn_sentinel_init(&sentinel));
    for (int i = 0; i < 6; i++) {
        kn_wake wake = {.due_ns = 100 * i * MS, .late_ns = i * MS / 4, .missed = i / 4, .overrun = i == 5};
        wake.now_ns = wake.due_ns + wake.late_ns;
        kn_sentinel_hear(&sentinel, &wake);
    }
    stall(200, 201); // 0.5 ms
    stall(400, 402); // 1 ms
    stall(500, 502);
    CHECK(kn_sentinel_judge(&sentinel, 1000 * MS) == 1);
    CHECK(sentinel.half.count == 3 && sentinel.half.explained == 2);
    CHECK(sentinel.whole.count == 1 && sentinel.whole.explained == 1);
    kn_sentinel_free(&sentinel);
}

TESTS_MAIN
