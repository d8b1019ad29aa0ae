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
    kn_sentinel_missed(&sentinel, &wake);
    wake = late(200, 7);
    kn_sentinel_missed(&sentinel, &wake);
    wake = late(300, 2);
    kn_sentinel_missed(&sentinel, &wake);
    stall(101, 105); // in the middle of the first
    stall(210, 215); // 3 ms after the second
    stall(295, 298); // 2 ms before the third
    CHECK(kn_sentinel_judge(&sentinel, 1000 * MS) == 5 + 2);
    CHECK(kn_sentinel_judge(&sentinel, 2000 * MS) == 5 + 2); // each is judged once
    kn_sentinel_free(&sentinel);
}

TEST("our own overrun is never excused, though it delays the sentinel as well")
{
    CHECK(kn_sentinel_init(&sentinel));
    kn_wake wake = late(100, 5);
    wake.overrun = true;
    kn_sentinel_missed(&sentinel, &wake);
    stall(100, 105);
    CHECK(kn_sentinel_judge(&sentinel, 1000 * MS) == 0);
    kn_sentinel_free(&sentinel);
}

TEST("judgement waits until the witness has had time to speak")
{
    CHECK(kn_sentinel_init(&sentinel));
    kn_wake wake = late(100, 3);
    kn_sentinel_missed(&sentinel, &wake);
    CHECK(kn_sentinel_judge(&sentinel, 104 * MS) == 0);
    stall(103, 104);
    CHECK(kn_sentinel_judge(&sentinel, 106 * MS) == 3);
    kn_sentinel_free(&sentinel);
}

TESTS_MAIN
