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

TEST("an overrun is a tick that took longer than the period")
{
    start();
    tick(0, 0, MS);
    CHECK(status().overruns == 0);
    tick(0, 0, MS + 1);
    knead_status_t s = status();
    CHECK(s.overruns == 1 && s.current_errors == KNEAD_STATUS_T_ERROR_OVERRUN);
    CHECK(status().current_errors == 0); // told once
}

TEST("the success rate is the share of the last 100 cycles that ran with a fresh pose of every probe in use")
{
    start();
    for (int n = 0; n < 200; n++) tick(0, 0, 0);
    CHECK_NEAR(status().success_rate, 1, 0);
    in.fresh[0] = false;
    for (int n = 0; n < 10; n++) tick(0, 0, 0);
    CHECK_NEAR(status().success_rate, 0.90, 1e-12);
    in.fresh[0] = true;
    tick(20, 0, 0);
    CHECK_NEAR(status().success_rate, 0.70, 1e-12);
    for (int n = 0; n < 100; n++) tick(0, 0, 0);
    CHECK_NEAR(status().success_rate, 1, 0);
    tick(1000, 0, 0); // the machine slept
    CHECK_NEAR(status().success_rate, 0.01, 1e-12);
    in.pose[0] = NULL; // no hand, so no pose is expected
    for (int n = 0; n < 100; n++) tick(0, 0, 0);
    CHECK_NEAR(status().success_rate, 1, 0);
}

TEST("the mode is the worst mode of any probe; stopping outranks all modes but an emergency stop")
{
    start();
    out.force[0].live = out.force[1].live = false;
    tick(0, 0, 0);
    CHECK(status().mode == KNEAD_STATUS_T_MODE_IDLE);
    out.force[0].live = out.force[1].live = true;
    tick(0, 0, 0);
    CHECK(status().mode == KNEAD_STATUS_T_MODE_RUNNING);
    out.force[0].flags = KNEAD_CONTACT_FORCE_T_FLAG_BRAKE;
    tick(0, 0, 0);
    CHECK(status().mode == KNEAD_STATUS_T_MODE_BRAKE);
    out.force[1].flags = KNEAD_CONTACT_FORCE_T_FLAG_REENGAGE_LIFT;
    tick(0, 0, 0);
    CHECK(status().mode == KNEAD_STATUS_T_MODE_RECOVERING);
    out.force[1].flags = KNEAD_CONTACT_FORCE_T_FLAG_LATCHED;
    tick(0, 0, 0);
    CHECK(status().mode == KNEAD_STATUS_T_MODE_FAULT);
    in.stop = true;
    tick(0, 0, 0);
    CHECK(status().mode == KNEAD_STATUS_T_MODE_STOPPING);
    out.force[0].fault = KNEAD_CONTACT_FORCE_T_FAULT_ESTOP;
    tick(0, 0, 0);
    CHECK(status().mode == KNEAD_STATUS_T_MODE_ESTOP);
}

TEST("errors are named, and the errors of the last fault are kept")
{
    start();
    out.force[0].flags = KNEAD_CONTACT_FORCE_T_FLAG_CLAMPED | KNEAD_CONTACT_FORCE_T_FLAG_BRAKE;
    tick(0, 0, 0);
    CHECK(status().current_errors == (KNEAD_STATUS_T_ERROR_FORCE_LIMIT | KNEAD_STATUS_T_ERROR_VELOCITY_LIMIT));
    CHECK(status().last_errors == 0);
    out.force[0].flags = 0;
    out.force[0].fault = KNEAD_CONTACT_FORCE_T_FAULT_POSE_SILENCE;
    servo.safety[0].faults = 1;
    tick(0, 0, 0);
    out.force[0].fault = 0;
    tick(0, 0, 0);
    CHECK(status().last_errors == KNEAD_STATUS_T_ERROR_COMM_LOST && status().faults == 1);
}

TEST("the status reports the largest force and the largest force step given to the hand")
{
    start();
    out.force[1].force_n[2] = 3;
    out.force[1].force_n[0] = 4;
    tick(0, 0, 0);
    out.force[1].force_n[0] = -4;
    tick(0, 0, 0);
    CHECK_NEAR(status().force_max_n, 5, 1e-12);
    CHECK_NEAR(status().force_step_max_n, 8, 1e-12);
}

static knead_health_t health(void)
{
    knead_health_t h = {0};
    kn_account_health(&account, &h);
    return h;
}

TEST("rates and times cover the last whole second, or the first second while it lasts")
{
    start();
    int64_t at_ns = 0;
    for (int n = 0; n < 2500; n++) {
        wake = (kn_wake){.tick = n, .now_ns = at_ns += n % 2 ? MS / 2 : 3 * MS / 2}; // 1 ms on average
        kn_account_tick(&account, &servo, &in, &out, &wake, n < 1000 ? 20000 : n % 2 ? 100000 : 300000, true);
        knead_health_t h = health();
        if (n == 10) CHECK_NEAR(h.execution_us[0], 20, 1e-9);
        if (n == 1500) CHECK_NEAR(h.execution_us[3], 20, 1e-9);
    }
    knead_health_t h = health();
    CHECK_NEAR(h.execution_us[0], 200, 1e-9);
    CHECK_NEAR(h.execution_us[1], 100, 1e-9);
    CHECK_NEAR(h.execution_us[2], 100, 1e-9);
    CHECK_NEAR(h.execution_us[3], 300, 1e-9);
    CHECK_NEAR(h.periodicity_hz[0], 1000, 1e-6); // the mean of the single rates would be 1333
    CHECK_NEAR(h.periodicity_hz[1], 500, 1e-6);
    CHECK_NEAR(h.periodicity_hz[2], 1000 / 1.5, 1e-6);
    CHECK_NEAR(h.periodicity_hz[3], 2000, 1e-6);
}

TEST("a second in which the loop slept ends the window before it")
{
    start();
    for (int n = 0; n < 1000; n++) tick(0, n, 20000);
    tick(1700, 1000, 50000);
    for (int n = 0; n < 100; n++) tick(0, 2000 + n, 50000);
    CHECK_NEAR(health().execution_us[0], 50, 1e-9);
}

TEST("the latest overrun has its time, and each probe has its success rate")
{
    start();
    tick(0, 0, 5);
    CHECK(health().time_last_overrun == 0);
    int64_t before_us = kn_wall_us();
    wake = (kn_wake){.tick = 1, .now_ns = kn_now_ns()};
    kn_account_tick(&account, &servo, &in, &out, &wake, MS + 1, true);
    int64_t after_us = kn_wall_us(), told_us = health().time_last_overrun;
    CHECK(told_us >= before_us - 10 && told_us <= after_us + 10);

    start();
    in.pose[1] = &pose;
    for (int n = 0; n < 100; n++) in.fresh[1] = n % 4 != 0, tick(0, 0, 0);
    CHECK_NEAR(health().success_rate[0], 1, 0);
    CHECK_NEAR(health().success_rate[1], 0.75, 1e-12);
    CHECK_NEAR(status().success_rate, 0.75, 1e-12);
}

TEST("safety actions are counted by name and summed over the probes; created energy appears among the last errors")
{
    kn_audit_news news = {.windows = 3, .balance_j = 2e-3};
    start();
    servo.audit = &news;
    servo.safety[0].clamps = 1, servo.safety[1].clamps = 2;
    servo.safety[0].guards = 3;
    servo.safety[1].slewed = 4;
    servo.safety[1].brakes = 5;
    servo.safety[0].tripped[KN_FAULT_POSE_SILENCE] = 6;
    servo.safety[1].tripped[KN_FAULT_IMPULSE] = 7;
    servo.safety[1].tripped[KN_FAULT_NONFINITE] = 8;
    servo.safety[0].tripped[KN_FAULT_ESTOP] = 9;
    out.force[1].fault = KNEAD_CONTACT_FORCE_T_FAULT_IMPULSE;
    tick(0, 0, 0);
    knead_health_t h = health();
    const int64_t expected[] = {3, 3, 4, 5, 6, 7, 8, 9, 0};
    for (int i = 0; i <= KNEAD_HEALTH_T_TRIP_PASSIVITY; i++) CHECK(h.trips[i] == expected[i]);
    CHECK(h.fault[1] == KNEAD_CONTACT_FORCE_T_FAULT_IMPULSE && h.fault[0] == 0);
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
