#include "server/tick_timing.h"
#include "tests/check.h"
#include "tests/dice.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

// --- phase lock ---

#define MS INT64_C(1000000)
#define US INT64_C(1000)

// A servo whose ticks wake 5 to 30 us late, and one sender for each probe. All times in ns of one clock.
typedef struct sender {
    double next_ns, period_ns, jitter_ns; // poses come at next_ns plus up to jitter_ns, mostly nearly on time
    double late_ns;                       // delay of the next pose
    int64_t session, arrived_ns, earlier_ns, seq;
    double dropped, lost, repeated, waits, waited_ns; // counts since the start of the run; dropped: by the link
    double loss;                                      // share that the link drops
    bool engaged;
} sender;

typedef struct rig {
    kn_phase phase;
    kn_clock clock;
    uint64_t random;
    int64_t last_due_ns, shortest_ns, longest_ns, ticks;
    int probes;
    sender sender[2];
} rig;

static void start(rig *r)
{
    memset(r, 0, sizeof *r);
    r->random = 42;
    r->shortest_ns = INT64_MAX;
    r->probes = 1;
    kn_phase_init(&r->phase);
    kn_clock_start(&r->clock, 70 * MS);
    for (int p = 0; p < 2; p++)
        r->sender[p] = (sender){.next_ns = 70e6 + 300e3, .period_ns = 1e6, .jitter_ns = 60e3, .session = 1 + p};
    r->sender[0].engaged = true;
}

// Wait as the servo does: look for a late pose every 15 us.
static void hold(const rig *r, kn_wake *wake)
{
    int probe = kn_phase_awaits(&r->phase);
    const sender *s = probe < 0 ? NULL : &r->sender[probe];
    int64_t woke_ns = wake->now_ns;
    while (s && wake->now_ns - woke_ns < KN_PHASE_HOLD_NS &&
           (!s->session || s->next_ns + s->late_ns > (double)wake->now_ns))
        wake->now_ns += 15 * US;
    wake->held_ns = wake->now_ns - woke_ns;
}

static kn_arrival arrival(rig *r, sender *s, double now_ns)
{
    int64_t seq = s->seq;
    while (s->session != 0 && s->next_ns + s->late_ns <= now_ns) {
        bool drop = s->loss > 0 && kn_dice(&r->random) < s->loss;
        if (!drop) s->earlier_ns = s->arrived_ns;
        if (!drop) s->arrived_ns = (int64_t)(s->next_ns + s->late_ns);
        s->late_ns =
            // half of the delays within 2 % of jitter_ns, 1 in 16 beyond two thirds
            s->jitter_ns * pow(kn_dice(&r->random), 6);
        s->next_ns += s->period_ns;
        s->seq += !drop;
        s->dropped += drop;
    }
    s->repeated += s->seq == seq;
    s->lost += s->seq > seq ? (double)(s->seq - seq - 1) : 0;
    s->waits += s->seq > seq;
    if (s->seq > seq) s->waited_ns += now_ns - (double)s->arrived_ns;
    return (kn_arrival){s->session, s->arrived_ns, s->earlier_ns, s->seq > seq, s->engaged};
}

static void run(rig *r, int ticks)
{
    for (int p = 0; p < 2; p++)
        r->sender[p].dropped = r->sender[p].lost = r->sender[p].repeated = r->sender[p].waits = r->sender[p].waited_ns =
            0;
    for (int n = 0; n < ticks; n++, r->ticks++) {
        int64_t due_ns = r->clock.start_ns + (r->clock.tick + 1) * MS, tick = r->clock.tick;
        int64_t now_ns = due_ns + (int64_t)(5e3 + 25e3 * kn_dice(&r->random));
        kn_wake wake = kn_clock_wake(&r->clock, due_ns - 500 * US, now_ns);
        CHECK(wake.tick == tick + 1 && wake.missed == 0);
        if (r->ticks > 0) {
            int64_t apart_ns = wake.due_ns - r->last_due_ns;
            r->shortest_ns = apart_ns < r->shortest_ns ? apart_ns : r->shortest_ns;
            r->longest_ns = apart_ns > r->longest_ns ? apart_ns : r->longest_ns;
        }
        r->last_due_ns = wake.due_ns;
        hold(r, &wake);
        kn_arrival a[2];
        for (int p = 0; p < r->probes; p++) a[p] = arrival(r, &r->sender[p], (double)wake.now_ns);
        r->clock.start_ns += kn_phase_tick(&r->phase, a, r->probes, &wake);
    }
}

static double mean_wait_us(const rig *r, int probe)
{
    return r->sender[probe].waited_ns / 1e3 / r->sender[probe].waits;
}

static void check_slew(const rig *r)
{
    CHECK(r->shortest_ns >= MS - KN_PHASE_SLEW_NS && r->longest_ns <= MS + KN_PHASE_SLEW_NS);
}

TEST("from any phase the ticks move to a place just behind the poses, by at most 2 us per tick")
{
    for (int place = 0; place < 20; place++) {
        rig r;
        start(&r);
        r.sender[0].next_ns = 70e6 + 50e3 * place;
        run(&r, 500);
        CHECK(r.phase.locked);
        run(&r, 2000);
        run(&r, 3000);
        CHECK(mean_wait_us(&r, 0) < 80);
        CHECK(r.sender[0].lost + r.sender[0].repeated < 3000 * 4 * KN_PHASE_LATE);
        check_slew(&r);
    }
}

TEST("the phase lock follows a clock drift of 100 ppm in either direction, with a mean wait below 80 us")
{
    for (int sign = -1; sign <= 1; sign += 2) {
        rig r;
        start(&r);
        r.sender[0].period_ns = 1e6 * (1 + sign * 100e-6);
        run(&r, 1000);
        run(&r, 20000); // two whole periods of drift
        CHECK(mean_wait_us(&r, 0) < 80);
        CHECK(r.sender[0].lost + r.sender[0].repeated < 20000 * 3 * KN_PHASE_LATE);
        CHECK(r.phase.followed > r.phase.driven - 500);
        check_slew(&r);
    }
}

TEST("the margin keeps late poses few for a jittering sender, and shrinks for a punctual one")
{
    rig r;
    start(&r);
    r.sender[0].jitter_ns = 150e3;
    run(&r, 20000);
    double wide_ns = r.phase.margin_ns;
    run(&r, 20000);
    CHECK(r.sender[0].repeated < 20000 * 2 * KN_PHASE_LATE);
    r.sender[0].jitter_ns = 5e3;
    run(&r, 40000);
    run(&r, 10000);
    CHECK(r.phase.margin_ns < wide_ns / 2 && mean_wait_us(&r, 0) < 50);
    check_slew(&r);
}

TEST("if the poses have no rhythm, the clock is free and the grid does not move")
{
    rig r;
    start(&r);
    r.sender[0].period_ns = 1e6 / 1.37; // a device at 1.37 kHz
    run(&r, 200);
    int64_t start_ns = r.clock.start_ns, followed = r.phase.followed;
    run(&r, 20000);
    CHECK(!r.phase.locked && r.clock.start_ns == start_ns && r.phase.followed == followed);
}

TEST("a sender that answers the ticks drifts away from them and is not followed for long")
{
    for (int after_us = 100; after_us <= 900; after_us += 100) {
        rig r;
        start(&r);
        int64_t start_ns = r.clock.start_ns;
        for (int n = 0; n < 20000; n++) {
            r.sender[0].next_ns = (double)(r.last_due_ns + after_us * US);
            run(&r, 1);
        }
        CHECK(llabs(r.clock.start_ns - start_ns) < 3 * KN_PHASE_RUN_NS);
        check_slew(&r);
    }
}

TEST("when poses stop, the grid stands still, and it locks again at its old place when poses return")
{
    rig r;
    start(&r);
    run(&r, 2000);
    int64_t session = r.sender[0].session, start_ns = r.clock.start_ns;
    int64_t held = r.phase.held;
    r.sender[0].next_ns += 500e6; // half a second of silence
    run(&r, 500);
    CHECK(r.clock.start_ns == start_ns && r.phase.locked && r.phase.held <= held + 5);
    r.sender[0].session = 0; // then the session ends
    r.sender[0].next_ns += 1000e6;
    run(&r, 1000);
    CHECK(r.clock.start_ns == start_ns && !r.phase.locked && r.phase.probe == -1);
    r.sender[0].session = session + 1;
    run(&r, 1000);
    CHECK(r.phase.locked && llabs(r.clock.start_ns - start_ns) < 50 * US);
    check_slew(&r);
}

TEST("poses at 5 kHz and at 500 Hz keep the slew bounded and the wait short")
{
    rig r;
    start(&r);
    r.sender[0].period_ns = 0.2e6;
    r.sender[0].jitter_ns = 10e3;
    run(&r, 10);
    run(&r, 5000);
    CHECK(mean_wait_us(&r, 0) < 200 && r.sender[0].repeated == 0); // the newest pose is recent enough
    check_slew(&r);
    start(&r);
    r.sender[0].period_ns = 2e6;
    run(&r, 2000);
    run(&r, 5000);
    CHECK(r.phase.locked && r.phase.held == 0 && mean_wait_us(&r, 0) < 120); // late poses wait a whole period
    check_slew(&r);
}

TEST("the sender engaged first drives the phase until it disengages; before any is engaged, the first one present "
     "drives")
{
    rig r;
    start(&r);
    r.probes = 2;
    r.sender[0].engaged = false;
    r.sender[1].next_ns = 70e6 + 800e3;
    run(&r, 1000);
    CHECK(r.phase.probe == 0 && r.phase.locked);
    r.sender[1].engaged = true;
    run(&r, 1000);
    CHECK(r.phase.probe == 1 && r.phase.locked);
    r.sender[0].engaged = true; // engaged second
    run(&r, 3000);
    CHECK(r.phase.probe == 1 && mean_wait_us(&r, 1) < 80 && mean_wait_us(&r, 0) > 300);
    r.sender[1].engaged = false;
    run(&r, 1000);
    run(&r, 3000);
    CHECK(r.phase.probe == 0 && mean_wait_us(&r, 0) < 80 && mean_wait_us(&r, 1) > 300);
    check_slew(&r);
}

TEST("a late pose is awaited for at most 0.3 ms, and the next tick is due at its usual time")
{
    rig r;
    start(&r);
    r.sender[0].jitter_ns = 5e3;
    run(&r, 3000);
    for (int late_us = 60; late_us <= 420; late_us += 90) { // 240 us is waited for, 330 us is not
        run(&r, 50);
        int64_t held = r.phase.held, start_ns = r.clock.start_ns;
        r.sender[0].late_ns = late_us * 1e3;
        run(&r, 2);
        CHECK(r.phase.held > held && r.sender[0].repeated == (late_us > 300) && r.sender[0].lost == (late_us > 300));
        CHECK(llabs(r.clock.start_ns - start_ns) < 15 * US);
    }
    check_slew(&r);
}

TEST("behind a lossy link a tick lacks only the lost poses, within 1 %")
{
    static const double losses[] = {0.01, 0.05, 0.2};
    for (int i = 0; i < 3; i++) {
        rig r;
        start(&r);
        r.sender[0].loss = losses[i];
        run(&r, 3000);
        run(&r, 20000);
        double more = r.sender[0].repeated - r.sender[0].dropped;
        if (more > 0.01 * 20000) KN_TEST_FAIL("%g lost, and %g %% of the ticks more", losses[i], more / 200);
        check_slew(&r);
    }
}

TEST("a tick delayed by the machine does not change the estimate of the poses' phase")
{
    rig r;
    start(&r);
    run(&r, 2000);
    kn_phase before = r.phase;
    kn_arrival a = {.session = 1, .arrived_ns = 5 * MS, .fresh = true, .engaged = true};
    CHECK(kn_phase_tick(&r.phase, &a, 1, &(kn_wake){.missed = 3, .now_ns = 6 * MS}) == 0);
    CHECK(kn_phase_tick(&r.phase, &a, 1, &(kn_wake){.late_ns = 700 * US, .now_ns = 6 * MS}) == 0);
    a.fresh = false;
    CHECK(kn_phase_tick(&r.phase, &a, 1, &(kn_wake){.now_ns = 6 * MS}) == 0);
    CHECK(r.phase.centre_ns == before.centre_ns && r.phase.margin_ns == before.margin_ns);
}

// --- sentinel ---

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

TEST("a missed cycle is excused if the machine stalled the sentinel within 2 ms of it")
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

TEST("an overrun of the servo is never excused, although it delays the sentinel")
{
    CHECK(kn_sentinel_init(&sentinel));
    kn_wake wake = late(100, 5);
    wake.overrun = true;
    kn_sentinel_hear(&sentinel, &wake);
    stall(100, 105);
    CHECK(kn_sentinel_judge(&sentinel, 1000 * MS) == 0);
    kn_sentinel_free(&sentinel);
}

TEST("a miss is judged only after the sentinel has had time to report a stall")
{
    CHECK(kn_sentinel_init(&sentinel));
    kn_wake wake = late(100, 3);
    kn_sentinel_hear(&sentinel, &wake);
    CHECK(kn_sentinel_judge(&sentinel, 104 * MS) == 0);
    stall(103, 104);
    CHECK(kn_sentinel_judge(&sentinel, 106 * MS) == 3);
    kn_sentinel_free(&sentinel);
}

TEST("the time in which the servo was busy is no stall of the machine")
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

TEST("late wakes of half a millisecond and more are counted; a wake after an overrun is not the machine's fault")
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
