#include "server/account.h"
#include "proto/knead_contact_force_t.h"
#include "tests/check.h"

#define MS KN_PERIOD_NS

static kn_account account;
static kn_servo servo; // an account looks at its counters only
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

TEST("ticks and misses add up to the place on the grid")
{
    start();
    for (int n = 0; n < 50; n++) tick(n % 7 == 0 ? 3 : 0, 1000, 1000);
    CHECK(status().missed_cycles == 24);
    CHECK(status().tick == 50 + 24 - 1);
}

TEST("bucket n of a histogram holds what is below 2^n us, the last one all that is later")
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

TEST("success is the share of the last 100 cycles that ran with a fresh pose of every probe in use")
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
    tick(1000, 0, 0); // a machine that slept
    CHECK_NEAR(status().success_rate, 0.01, 1e-12);
    in.pose[0] = NULL; // nobody is waiting for a pose
    for (int n = 0; n < 100; n++) tick(0, 0, 0);
    CHECK_NEAR(status().success_rate, 1, 0);
}

TEST("the mode is the worst that any probe is in, and stopping stands above all but an emergency stop")
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

TEST("errors are named, and those of the last fault are kept")
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

TEST("the largest force and the largest step of a force are of the hand's, over both probes")
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

TESTS_MAIN
