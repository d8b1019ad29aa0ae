#include "server/account.h"
#include "proto/knead_contact_force_t.h"
#include "tests/check.h"

#define MS KN_PERIOD_NS

static kn_account account;
static kn_servo servo; // an account reads only the servo's counters
static kn_pose pose = {.session = 1};
static kn_tick_in in;
static kn_tick_out out;
static kn_wake wake;

static void start(void)
{
    kn_account_init(&account);
    memset(&servo, 0, sizeof servo);
    in = (kn_tick_in){.pose = {&pose}, .fresh = {true}};
    out = (kn_tick_out){.probes = 2, .force = {{.live = true}}};
    wake = (kn_wake){.tick = -1};
}

static void tick(int32_t missed, int64_t late_ns, int64_t execution_ns)
{
    wake = (kn_wake){.tick = wake.tick + 1 + missed, .missed = missed, .late_ns = late_ns, .now_ns = late_ns};
    kn_account_tick(&account, &servo, &in, &out, &wake, execution_ns, true);
}

static knead_status_t status(void)
{
    knead_status_t s = {0};
    kn_account_status(&account, &s);
    CHECK(kn_account_take_errors(&account) == s.current_errors);
    return s;
}

static knead_health_t health(void)
{
    knead_health_t h = {0};
    kn_account_health(&account, &h);
    return h;
}

TEST("ticks and missed cycles add up to the tick number")
{
    start();
    for (int n = 0; n < 50; n++) tick(n % 7 == 0 ? 3 : 0, 1000, 1000);
    CHECK(status().missed_cycles == 24);
    CHECK(status().tick == 50 + 24 - 1);
}

TEST("bucket n of a histogram counts times below 2^n us, and the last bucket counts all longer times")
{
    const struct {
        int64_t ns;
        int bucket;
    } cases[] = {{0, 0},    {999, 0},      {1000, 1},     {1999, 1},
                 {2000, 2}, {1023999, 10}, {1024000, 11}, {INT64_C(4000000000000000), 31}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        start();
        tick(0, cases[i].ns, 5);
        CHECK(status().wakeup_hist[cases[i].bucket] == 1);
        CHECK(status().execution_hist[0] == 1);
    }
}

TEST("an overrun is a tick that took longer than the period; it is told once, and the latest has its time")
{
    start();
    tick(0, 0, MS);
    CHECK(status().overruns == 0 && health().time_last_overrun == 0);
    int64_t before_us = kn_wall_us();
    wake = (kn_wake){.tick = 1, .now_ns = kn_now_ns()};
    kn_account_tick(&account, &servo, &in, &out, &wake, MS + 1, true);
    int64_t after_us = kn_wall_us(), told_us = health().time_last_overrun;
    CHECK(told_us >= before_us - 10 && told_us <= after_us + 10);
    knead_status_t s = status();
    CHECK(s.overruns == 1 && s.current_errors == KNEAD_STATUS_T_ERROR_OVERRUN);
    CHECK(status().current_errors == 0);
}

TEST("the success rate is the share of the last 100 cycles that ran with a fresh pose of every probe in use")
{
    static const struct {
        bool hand, fresh;
        int missed, ticks;
        double rate;
    } runs[] = {{true, true, 0, 200, 1}, {true, false, 0, 10, 0.90},  {true, true, 20, 1, 0.70},
                {true, true, 0, 100, 1}, {true, true, 1000, 1, 0.01}, // the machine slept
                {false, true, 0, 100, 1}};                            // no hand, so no pose is expected
    start();
    for (size_t i = 0; i < sizeof runs / sizeof *runs; i++) {
        in.pose[0] = runs[i].hand ? &pose : NULL;
        in.fresh[0] = runs[i].fresh;
        for (int n = 0; n < runs[i].ticks; n++) tick(runs[i].missed, 0, 0);
        CHECK_NEAR(status().success_rate, runs[i].rate, 1e-12);
    }
    start();
    in.pose[1] = &pose;
    for (int n = 0; n < 100; n++) in.fresh[1] = n % 4 != 0, tick(0, 0, 0);
    CHECK_NEAR(health().success_rate[0], 1, 0);
    CHECK_NEAR(health().success_rate[1], 0.75, 1e-12);
    CHECK_NEAR(status().success_rate, 0.75, 1e-12);
}

TEST("the mode is the worst mode of any probe; stopping outranks all modes but an emergency stop")
{
    static const struct {
        bool live, stop;
        int32_t flags[2], fault, mode;
    } cases[] = {{false, false, {0, 0}, 0, KNEAD_STATUS_T_MODE_IDLE},
                 {true, false, {0, 0}, 0, KNEAD_STATUS_T_MODE_RUNNING},
                 {true, false, {KN_FLAG_BRAKE, 0}, 0, KNEAD_STATUS_T_MODE_BRAKE},
                 {true, false, {KN_FLAG_BRAKE, KN_FLAG_REENGAGE_LIFT}, 0, KNEAD_STATUS_T_MODE_RECOVERING},
                 {true, false, {KN_FLAG_BRAKE, KN_FLAG_LATCHED}, 0, KNEAD_STATUS_T_MODE_FAULT},
                 {true, true, {KN_FLAG_BRAKE, KN_FLAG_LATCHED}, 0, KNEAD_STATUS_T_MODE_STOPPING},
                 {true, true, {KN_FLAG_BRAKE, KN_FLAG_LATCHED}, KN_FAULT_ESTOP, KNEAD_STATUS_T_MODE_ESTOP}};
    start();
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        for (int p = 0; p < 2; p++) out.force[p].live = cases[i].live, out.force[p].flags = cases[i].flags[p];
        in.stop = cases[i].stop;
        out.force[0].fault = cases[i].fault;
        tick(0, 0, 0);
        CHECK(status().mode == cases[i].mode);
    }
}

TEST("errors are named, and the errors of the last fault are kept")
{
    start();
    out.force[0].flags = KN_FLAG_CLAMPED | KN_FLAG_BRAKE;
    tick(0, 0, 0);
    CHECK(status().current_errors == (KNEAD_STATUS_T_ERROR_FORCE_LIMIT | KNEAD_STATUS_T_ERROR_VELOCITY_LIMIT));
    CHECK(status().last_errors == 0);
    static const int32_t named[][2] = {{KN_FAULT_OVERLOAD, KNEAD_STATUS_T_ERROR_OVERRUN},
                                       {KN_FAULT_NONFINITE, KNEAD_STATUS_T_ERROR_PHYSICS},
                                       {KN_FAULT_POSE_SILENCE, KNEAD_STATUS_T_ERROR_COMM_LOST}};
    out.force[0].flags = 0;
    for (int i = 0; i < 3; i++) {
        out.force[0].fault = named[i][0];
        servo.safety[0].faults = i == 2;
        tick(0, 0, 0);
        CHECK(status().current_errors == named[i][1]);
    }
    out.force[0].fault = 0;
    tick(0, 0, 0);
    CHECK(status().last_errors == KNEAD_STATUS_T_ERROR_COMM_LOST && status().faults == 1);
}

TEST("the status reports the largest force and the largest force step given by either probe")
{
    for (int probe = 0; probe < 2; probe++) {
        kn_force *larger = &out.force[probe], *smaller = &out.force[!probe];
        start();
        larger->force_n[2] = smaller->force_n[2] = 3;
        larger->force_n[0] = 4;
        tick(0, 0, 0);
        larger->force_n[0] = -4;
        smaller->force_n[0] = -1;
        tick(0, 0, 0);
        CHECK_NEAR(status().force_max_n, 5, 1e-12);
        CHECK_NEAR(status().force_step_max_n, 8, 1e-12);
    }
}

TEST(
    "rates and times cover the last whole second, or the first second while it lasts; a second in which the loop slept "
    "ends the window before it")
{
    start();
    int64_t at_ns = 0;
    for (int n = 0; n < 2500; n++) {
        wake = (kn_wake){.tick = n, .now_ns = at_ns += n % 2 ? MS / 2 : 3 * MS / 2}; // 1 ms on average
        kn_account_tick(&account, &servo, &in, &out, &wake, n < 1000 ? 20000 : n % 2 ? 100000 : 300000, true);
        if (n == 10) CHECK_NEAR(health().execution_us[0], 20, 1e-9);
        if (n == 1500) CHECK_NEAR(health().execution_us[3], 20, 1e-9);
    }
    knead_health_t h = health();
    const double execution_us[] = {200, 100, 100, 300};
    const double periodicity_hz[] = {1000, 500, 1000 / 1.5, 2000}; // the mean of the single rates would be 1333
    for (int i = 0; i < 4; i++) {
        CHECK_NEAR(h.execution_us[i], execution_us[i], 1e-9);
        CHECK_NEAR(h.periodicity_hz[i], periodicity_hz[i], 1e-6);
    }
    start();
    for (int n = 0; n < 1000; n++) tick(0, n, 20000);
    tick(1700, 1000, 50000);
    for (int n = 0; n < 100; n++) tick(0, 2000 + n, 50000);
    CHECK_NEAR(health().execution_us[0], 50, 1e-9);
}

TEST("safety actions are counted by name and summed over the probes; created energy appears among the last errors")
{
    kn_audit_news news = {.windows = 3, .balance_j = 2e-3};
    start();
    servo.audit = &news;
    servo.safety[0] = (kn_safety){.clamps = 1, .guards = 3, .tripped[KN_FAULT_POSE_SILENCE] = 6};
    servo.safety[0].tripped[KN_FAULT_ESTOP] = 9;
    servo.safety[1] = (kn_safety){.clamps = 2, .slewed = 4, .brakes = 5, .tripped[KN_FAULT_IMPULSE] = 7};
    servo.safety[1].tripped[KN_FAULT_NONFINITE] = 8;
    out.force[1].fault = KN_FAULT_IMPULSE;
    tick(0, 0, 0);
    knead_health_t h = health();
    const int64_t expected[] = {3, 3, 4, 5, 6, 7, 8, 9, 0};
    for (int i = 0; i <= KNEAD_HEALTH_T_TRIP_PASSIVITY; i++) CHECK(h.trips[i] == expected[i]);
    CHECK(h.fault[1] == KN_FAULT_IMPULSE && h.fault[0] == 0);
    CHECK(h.audited_s == 3);
    CHECK_NEAR(h.energy_balance_mj, 2, 1e-12);
    CHECK(status().current_errors == KNEAD_STATUS_T_ERROR_FORCE_IMPULSE_LIMIT);
    news.created = 1;
    out.force[1].fault = 0;
    tick(0, 0, 0);
    tick(0, 0, 0);
    knead_status_t s = status();
    CHECK(s.current_errors == KNEAD_STATUS_T_ERROR_PASSIVITY && s.last_errors == KNEAD_STATUS_T_ERROR_PASSIVITY);
    CHECK(health().trips[KNEAD_HEALTH_T_TRIP_PASSIVITY] == 1);
    tick(0, 0, 0);
    CHECK(status().current_errors == 0);
}

TESTS_MAIN
