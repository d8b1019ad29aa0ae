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
    bool engaged;
    struct {
        double lost, repeated, waits, waited_ns;
    } n; // counts since the start of the run
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
    *r = (rig){.random = 42, .shortest_ns = INT64_MAX, .probes = 1};
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
        s->earlier_ns = s->arrived_ns;
        s->arrived_ns = (int64_t)(s->next_ns + s->late_ns);
        // half of the delays within 2 % of jitter_ns, 1 in 16 beyond two thirds
        s->late_ns = s->jitter_ns * pow(kn_dice(&r->random), 6);
        s->next_ns += s->period_ns;
        s->seq++;
    }
    s->n.repeated += s->seq == seq;
    s->n.lost += s->seq > seq ? (double)(s->seq - seq - 1) : 0;
    s->n.waits += s->seq > seq;
    if (s->seq > seq) s->n.waited_ns += now_ns - (double)s->arrived_ns;
    return (kn_arrival){s->session, s->arrived_ns, s->earlier_ns, s->seq > seq, s->engaged};
}

static void run(rig *r, int ticks)
{
    for (int p = 0; p < 2; p++) memset(&r->sender[p].n, 0, sizeof r->sender[p].n);
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
    return r->sender[probe].n.waited_ns / 1e3 / r->sender[probe].n.waits;
}

static void check_slew(const rig *r)
{
    CHECK(r->shortest_ns >= MS - KN_PHASE_SLEW_NS && r->longest_ns <= MS + KN_PHASE_SLEW_NS);
}

TEST("from any phase, with a drift of 100 ppm, at 5 kHz and at 500 Hz, the ticks move to a place just behind the "
     "poses, by "
     "at most 2 us per tick")
{
    static const struct {
        const char *name;
        int phases;
        double period_ns, jitter_ns;
        int warm, ticks;
        double wait_us, few; // mean wait; share of lost and repeated poses
    } rows[] = {{"any phase", 20, 1e6, 60e3, 2500, 3000, 80, 4 * KN_PHASE_LATE},
                {"100 ppm slow", 1, 1e6 * (1 + 100e-6), 60e3, 1000, 20000, 80, 3 * KN_PHASE_LATE}, // two periods
                {"100 ppm fast", 1, 1e6 * (1 - 100e-6), 60e3, 1000, 20000, 80, 3 * KN_PHASE_LATE},
                {"5 kHz", 1, 0.2e6, 10e3, 10, 5000, 200, 5},   // the newest pose is recent enough
                {"500 Hz", 1, 2e6, 60e3, 2000, 5000, 120, 1}}; // late poses wait a whole period
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
        for (int phase = 0; phase < rows[i].phases; phase++) {
            rig r;
            start(&r);
            sender *s = &r.sender[0];
            s->next_ns += 50e3 * phase;
            s->period_ns = rows[i].period_ns, s->jitter_ns = rows[i].jitter_ns;
            run(&r, rows[i].warm);
            run(&r, rows[i].ticks);
            if (!(mean_wait_us(&r, 0) < rows[i].wait_us && s->n.lost + s->n.repeated < rows[i].ticks * rows[i].few))
                KN_TEST_FAIL("%s: a wait of %g us, %g and %g poses", rows[i].name, mean_wait_us(&r, 0), s->n.lost,
                             s->n.repeated);
            if (s->period_ns < 0.9e6) CHECK(s->n.repeated == 0);
            else CHECK(r.phase.locked);
            if (s->period_ns > 1.1e6) CHECK(r.phase.held == 0);
            else CHECK(s->period_ns < 0.9e6 || r.phase.followed > r.phase.driven - 500);
            check_slew(&r);
        }
}

TEST("the margin grows for a jittering sender, so that late poses are few, and shrinks for a punctual one")
{
    static const double jitter_ns[] = {5e3, 300e3, 5e3};
    double margin_ns[3];
    rig r;
    start(&r);
    for (int i = 0; i < 3; i++) {
        r.sender[0].jitter_ns = jitter_ns[i];
        run(&r, 40000);
        run(&r, 20000);
        margin_ns[i] = r.phase.margin_ns;
        CHECK(r.sender[0].n.repeated < 20000 * 2 * KN_PHASE_LATE && (i == 1 || mean_wait_us(&r, 0) < 50));
    }
    CHECK(margin_ns[1] > 2 * margin_ns[0] && margin_ns[2] < margin_ns[1] / 2);
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
        CHECK(r.phase.held > held && r.sender[0].n.repeated == (late_us > 300) &&
              r.sender[0].n.lost == (late_us > 300));
        CHECK(llabs(r.clock.start_ns - start_ns) < 15 * US);
    }
    check_slew(&r);
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

TEST("a missed cycle is excused if the machine stalled the sentinel within 2 ms of it, an overrun of the servo never")
{
    static const struct {
        int64_t due_ms;
        int32_t missed;
        bool overrun;
        int64_t from_ms, to_ms; // stall of the sentinel
        int32_t excused;
    } rows[] = {{100, 5, false, 101, 105, 5}, // in the middle of the stall
                {200, 7, false, 210, 215, 0}, // 3 ms before it
                {300, 2, false, 295, 298, 2}, // 2 ms behind it
                {400, 5, true, 400, 405, 0}}; // the overrun delays the sentinel
    CHECK(kn_sentinel_init(&sentinel));
    int64_t excused = 0;
    for (int again = 0; again < 2; again++) // each miss is judged once
        for (int i = 0; i < 4; i++) {
            kn_wake wake = {.due_ns = rows[i].due_ms * MS, .missed = rows[i].missed, .overrun = rows[i].overrun};
            wake.now_ns = wake.due_ns + wake.missed * MS;
            if (!again) {
                kn_sentinel_hear(&sentinel, &wake);
                CHECK(kn_sentinel_judge(&sentinel, wake.now_ns + MS) == excused); // too early for a stall to be known
                stall(rows[i].from_ms, rows[i].to_ms);
                excused += rows[i].excused;
            }
            CHECK(kn_sentinel_judge(&sentinel, (again ? 1000 : 20) * MS + wake.now_ns) == excused);
        }
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
