#include "server/servo.h"
#include "core/algebra/algebra.h"
#include "tests/check.h"

static const double pi = 3.14159265358979323846;

static void turn_about(int axis, double radians, double q[4])
{
    memset(q, 0, 4 * sizeof *q);
    q[0] = cos(radians / 2), q[1 + axis] = sin(radians / 2);
}

static void check_same(const double *a, const double *b, int n)
{
    for (int k = 0; k < n; k++) CHECK_NEAR(a[k], b[k], 1e-15);
}

TEST("without the clutch the tool moves like the device")
{
    kn_clutch clutch;
    kn_pose device = {.session = 7, .seq = 3, .position_m = {1, 2, 3}, .velocity_m_s = {4, 5, 6}, .buttons = 2}, tool;
    kn_clutch_open(&clutch);
    turn_about(1, 0.7, device.orientation_wxyz);
    kn_clutch_move(&clutch, &device, &tool);
    check_same(tool.position_m, device.position_m, 3);
    check_same(tool.orientation_wxyz, device.orientation_wxyz, 4);
    check_same(tool.velocity_m_s, device.velocity_m_s, 3);
    CHECK(tool.session == 7 && tool.seq == 3 && tool.buttons == 2);
}

TEST("while the clutch is held the tool stays still; after the release it moves on from there with the device")
{
    kn_clutch clutch;
    kn_pose device = {.position_m = {0.1, 0, 0}, .orientation_wxyz = {1}, .velocity_m_s = {1, 0, 0}}, tool, stays;
    kn_clutch_open(&clutch);
    device.buttons = KN_BUTTON_CLUTCH;
    kn_clutch_move(&clutch, &device, &stays);
    for (int i = 1; i <= 10; i++) { // the hand goes back 20 cm and turns its wrist by a quarter
        device.position_m[0] = 0.1 - 0.02 * i;
        turn_about(2, pi / 20 * i, device.orientation_wxyz);
        kn_clutch_move(&clutch, &device, &tool);
        check_same(tool.position_m, stays.position_m, 3);
        check_same(tool.orientation_wxyz, stays.orientation_wxyz, 4);
        check_same(tool.velocity_m_s, (double[3]){0}, 3);
    }
    device.buttons = 0;
    kn_clutch_move(&clutch, &device, &tool); // no jump
    check_same(tool.position_m, (double[]){0.1, 0, 0}, 3);
    check_same(tool.orientation_wxyz, (double[]){1, 0, 0, 0}, 4);
    CHECK(tool.velocity_m_s[0] == 1);
    device.position_m[0] += 0.03;
    kn_clutch_move(&clutch, &device, &tool);
    check_same(tool.position_m, (double[]){0.13, 0, 0}, 3);
}

TEST("after the clutch, turns of the wrist turn the tool about the room's axes")
{
    kn_clutch clutch;
    kn_pose device = {.orientation_wxyz = {1}, .buttons = KN_BUTTON_CLUTCH}, tool;
    kn_clutch_open(&clutch);
    kn_clutch_move(&clutch, &device, &tool);
    turn_about(2, pi / 2, device.orientation_wxyz); // turned while the clutch is held
    kn_clutch_move(&clutch, &device, &tool);
    device.buttons = 0;
    kn_clutch_move(&clutch, &device, &tool);
    double bend[4], from[4], seen[4];
    memcpy(from, device.orientation_wxyz, sizeof from);
    turn_about(0, 0.3, bend);
    kn_turn_multiply(bend, from, device.orientation_wxyz);
    kn_clutch_move(&clutch, &device, &tool);
    kn_turn_between((double[]){1, 0, 0, 0}, tool.orientation_wxyz, seen);
    check_same(seen, bend, 4);
}

TEST("repeated clutching adds up, and a new hand starts without an offset")
{
    kn_clutch clutch;
    kn_pose device = {.orientation_wxyz = {1}}, tool;
    kn_clutch_open(&clutch);
    for (int stroke = 0; stroke < 5; stroke++) { // rowing: 10 cm forward with the tool, 10 cm back without it
        device.buttons = 0, device.position_m[1] = 0;
        kn_clutch_move(&clutch, &device, &tool);
        CHECK_NEAR(tool.position_m[1], 0.1 * stroke, 1e-15);
        device.position_m[1] = 0.1;
        kn_clutch_move(&clutch, &device, &tool);
        device.buttons = KN_BUTTON_CLUTCH;
        kn_clutch_move(&clutch, &device, &tool);
        CHECK_NEAR(tool.position_m[1], 0.1 * (stroke + 1), 1e-15);
    }
    kn_clutch_open(&clutch);
    device.buttons = 0;
    kn_clutch_move(&clutch, &device, &tool);
    CHECK_NEAR(tool.position_m[1], 0.1, 1e-15);
}

TESTS_MAIN
