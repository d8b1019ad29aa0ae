#include "clients/tactile/bridge.h"
#include "core/algebra/algebra.h"
#include "tests/check.h"

static kn_device_def mount(const char *basis)
{
    char why[128] = "";
    kn_device_def m;
    kn_mount_init(&m);
    if (!kn_mount_basis(&m, basis, why, sizeof why)) KN_TEST_FAIL("%s: %s", basis, why);
    return m;
}

// Rotate v by the unit quaternion q.
static void rotate(const double q[4], const double v[3], double out[3])
{
    double r[3][3];
    kn_turn_matrix(q, r);
    for (int i = 0; i < 3; i++) out[i] = r[i][0] * v[0] + r[i][1] * v[1] + r[i][2] * v[2];
}

TEST("the n-th letter of a basis names the device axis along the n-th axis of the scene")
{
    double scene[3];
    kn_device_def m = mount("Y-XZ");
    kn_device_velocity(&m, (double[]){1, 2, 3}, scene);
    CHECK(scene[0] == 2 && scene[1] == -1 && scene[2] == 3);
    m = mount("+y+z+x");
    kn_device_velocity(&m, (double[]){1, 2, 3}, scene);
    CHECK(scene[0] == 2 && scene[1] == 3 && scene[2] == 1);
}

TEST("24 right-handed bases are accepted, and left-handed or malformed ones are refused with a reason")
{
    const char *orders[] = {"XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"};
    const char *wrong[] = {"", "X", "XY", "XXZ", "XYZX", "XYW", "--XYZ", "XYZ "};
    int right = 0, mirrors = 0;
    for (int order = 0; order < 6; order++)
        for (int signs = 0; signs < 8; signs++) {
            char text[8], why[128];
            kn_device_def m;
            int n = 0;
            for (int i = 0; i < 3; i++) {
                if (signs >> i & 1) text[n++] = '-';
                text[n++] = orders[order][i];
            }
            text[n] = 0;
            kn_mount_init(&m);
            bool ok = kn_mount_basis(&m, text, why, sizeof why);
            right += ok;
            mirrors += !ok && strstr(why, "left-handed") != NULL;
        }
    CHECK(right == 24 && mirrors == 24);
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        char why[128] = "";
        kn_device_def m;
        kn_mount_init(&m);
        CHECK(!kn_mount_basis(&m, wrong[i], why, sizeof why) && strstr(why, "expected"));
    }
}

TEST("a basis turns vectors and orientations consistently")
{
    const double q[4] = {0.5, 0.1, -0.7, sqrt(1 - 0.25 - 0.01 - 0.49)}, v[3] = {1, 2, 3};
    const char *bases[] = {"Y-XZ", "YZX", "-XZY", "-X-YZ"};
    for (int i = 0; i < 4; i++) {
        double turned[3], first[3], framed[3], framed_q[4], then[3];
        kn_device_def m = mount(bases[i]);
        rotate(q, v, turned);
        kn_device_velocity(&m, turned, first);
        kn_device_velocity(&m, v, framed);
        kn_mount_orientation(&m, q, framed_q);
        rotate(framed_q, framed, then);
        for (int k = 0; k < 3; k++) CHECK_NEAR(first[k], then[k], 1e-12);
    }
}

TESTS_MAIN
