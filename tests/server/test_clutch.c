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

// Move the device to x along an axis, with or without the clutch, and return the tool.
static kn_pose moved(kn_clutch *clutch, kn_pose *device, int axis, double x_m, bool held)
{
    kn_pose tool;
    device->position_m[axis] = x_m;
    device->buttons = held ? KN_BUTTON_CLUTCH : 0;
    kn_clutch_move(clutch, device, &tool);
    return tool;
}

TEST("without the clutch the tool moves like the device")
{
    kn_clutch clutch;
    kn_pose device = {.session = 7, .seq = 3, .position_m = {1, 2, 3}, .velocity_m_s = {4, 5, 6}, .buttons = 2}, tool;
    kn_clutch_open(&clutch);
    turn_about(1, 0.7, device.orientation_wxyz);
    kn_clutch_move(&clutch, &device, &tool);
    CHECK(memcmp(&tool, &device, sizeof tool) == 0);
}

TEST("while the clutch is held the tool stays still; after the release it moves on from there with the device")
{
    kn_clutch clutch;
    kn_pose device = {.orientation_wxyz = {1}, .velocity_m_s = {1, 0, 0}}, tool;
    kn_clutch_open(&clutch);
    for (int i = 0; i <= 10; i++) { // the hand goes back 20 cm and turns its wrist by a quarter
        turn_about(2, pi / 20 * i, device.orientation_wxyz);
        tool = moved(&clutch, &device, 0, 0.1 - 0.02 * i, true);
        check_same(tool.position_m, (double[]){0.1, 0, 0}, 3);
        check_same(tool.orientation_wxyz, (double[]){1, 0, 0, 0}, 4);
        check_same(tool.velocity_m_s, (double[3]){0}, 3);
    }
    tool = moved(&clutch, &device, 0, -0.1, false); // no jump
    check_same(tool.position_m, (double[]){0.1, 0, 0}, 3);
    check_same(tool.orientation_wxyz, (double[]){1, 0, 0, 0}, 4);
    CHECK(tool.velocity_m_s[0] == 1);
    tool = moved(&clutch, &device, 0, -0.07, false);
    check_same(tool.position_m, (double[]){0.13, 0, 0}, 3);
}

TEST("after the clutch, turns of the wrist turn the tool about the room's axes")
{
    kn_clutch clutch;
    kn_pose device = {.orientation_wxyz = {1}}, tool;
    double bend[4], from[4], seen[4];
    kn_clutch_open(&clutch);
    moved(&clutch, &device, 0, 0, true);
    turn_about(2, pi / 2, from); // turned while the clutch is held
    memcpy(device.orientation_wxyz, from, sizeof from);
    moved(&clutch, &device, 0, 0, true);
    moved(&clutch, &device, 0, 0, false);
    turn_about(0, 0.3, bend);
    kn_turn_multiply(bend, from, device.orientation_wxyz);
    tool = moved(&clutch, &device, 0, 0, false);
    kn_turn_between((double[]){1, 0, 0, 0}, tool.orientation_wxyz, seen);
    check_same(seen, bend, 4);
}

TEST("repeated clutching adds up, and a new hand starts without an offset")
{
    kn_clutch clutch;
    kn_pose device = {.orientation_wxyz = {1}};
    kn_clutch_open(&clutch);
    for (int stroke = 0; stroke < 5; stroke++) { // rowing: 10 cm forward with the tool, 10 cm back without it
        CHECK_NEAR(moved(&clutch, &device, 1, 0, false).position_m[1], 0.1 * stroke, 1e-15);
        moved(&clutch, &device, 1, 0.1, false);
        CHECK_NEAR(moved(&clutch, &device, 1, 0.1, true).position_m[1], 0.1 * (stroke + 1), 1e-15);
    }
    kn_clutch_open(&clutch);
    CHECK_NEAR(moved(&clutch, &device, 1, 0.1, false).position_m[1], 0.1, 1e-15);
}

TESTS_MAIN
