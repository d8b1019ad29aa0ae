// Checks that a scene message must pass before a decoder may see it.
#include "proto/knead_health_t.h"
#include "proto/knead_status_t.h"
#include "server/auth.h"
#include "server/wire.h"
#include "tests/check.h"

static unsigned char bytes[512];

static size_t encode(void)
{
    knead_scene_t scene = {.version = (char *)"0.9.0", .name = (char *)"dough.yaml", .text = (char *)"version: 1\n"};
    return (size_t)knead_scene_t_encode(bytes, 0, sizeof bytes, &scene);
}

TEST(
    "a scene message is accepted with and without an authentication trailer; with another size, type, string length or "
    "terminator it is refused")
{
    static const uint32_t lies[] = {0, 1, 5, 7, 0x7fffffff, 0x80000000, 0xffffffff, 0xfffffff0};
    const size_t at = 8 + 3 * 8 + 4, size = encode(); // offset of the first string's length, which is 6
    for (size_t n = 0; n <= size + KN_AUTH_TRAILER; n++)
        CHECK(kn_wire_scene_fits(bytes, n) == (n == size || n == size + KN_AUTH_TRAILER));
    for (size_t i = 0; i < sizeof lies / sizeof *lies; i++) {
        encode();
        for (int b = 0; b < 4; b++) bytes[at + (size_t)b] = (unsigned char)(lies[i] >> (24 - 8 * b));
        CHECK(!kn_wire_scene_fits(bytes, size));
    }
    for (int type = 0; type < 2; type++) { // the text's NUL, or the type
        encode();
        bytes[type ? 7 : size - 1] ^= 1;
        CHECK(!kn_wire_scene_fits(bytes, size));
    }
}

TEST("a contact unit is decoded exactly as it was encoded")
{
    kn_contact_unit in = {.utime = 1,
                          .session = 2,
                          .pose_seq = 3,
                          .generation = 4,
                          .flags = 5,
                          .contact_index = 6,
                          .contact_count = 7,
                          .proxy_m = {8, 9, 10},
                          .normal = {11, 12, 13},
                          .force_n = 14,
                          .proxy_velocity_m_s = 15,
                          .a_n_s_per_m = 16,
                          .h_n = 17,
                          .c2_n_s_per_m = 18,
                          .k1_n_per_m = 19,
                          .k_vc_n_per_m = 20,
                          .b_vc_n_s_per_m = 21,
                          .friction = 22,
                          .friction_anchor_m = {23, 24, 25},
                          .valid_ms = 26},
                    out;
    knead_contact_model_t sent, heard;
    kn_wire_contact(&sent, &in, in.utime);
    int size = knead_contact_model_t_encode(bytes, 0, sizeof bytes, &sent);
    CHECK(size > 0 && knead_contact_model_t_decode(bytes, 0, size, &heard) == size);
    kn_wire_unit(&out, &heard);
    CHECK(memcmp(&in, &out, sizeof in) == 0);
}

TEST("a touch patch is decoded as it was encoded, in the tool's frame")
{
    kn_touch touch = {.area_m2 = 1,
                      .centre_m = {2, 3, 4},
                      .normal = {5, 6, 7},
                      .peak_pressure_pa = 8,
                      .slip_velocity_m_s = {9, 10, 11}};
    for (int i = 0; i < 64; i++) touch.pressure_pa[i / 8][i % 8] = 12 + i;
    knead_touch_patch_t sent, heard;
    uint8_t wire[1024];
    kn_wire_touch(&sent, &touch, 20, 21, 22);
    int size = knead_touch_patch_t_encode(wire, 0, sizeof wire, &sent);
    CHECK(size > 0 && knead_touch_patch_t_decode(wire, 0, size, &heard) == size);
    CHECK(heard.session == 20 && heard.pose_seq == 21 && heard.utime == 22 && heard.frame == 1);
    CHECK(heard.area_m2 == 1 && heard.peak_pressure_pa == 8 && heard.centre_m[1] == 3 && heard.normal[2] == 7);
    CHECK(heard.slip_velocity_m_s[0] == 9);
    CHECK(memcmp(heard.pressure_pa, touch.pressure_pa, sizeof touch.pressure_pa) == 0);
}

TEST("every message of fixed size fits into one datagram with its trailer and the longest channel name")
{
    const int room = 1435 - 8 - 64 - KN_AUTH_TRAILER; // LCM's limit, less its header and a channel's name
    CHECK(knead_status_t_encoded_size(&(knead_status_t){0}) <= room);
    CHECK(knead_health_t_encoded_size(&(knead_health_t){0}) <= room);
    CHECK(knead_contact_force_t_encoded_size(&(knead_contact_force_t){0}) <= room);
    CHECK(knead_contact_model_t_encoded_size(&(knead_contact_model_t){0}) <= room);
    CHECK(knead_touch_patch_t_encoded_size(&(knead_touch_patch_t){0}) <= room);
    CHECK(knead_event_t_encoded_size(&(knead_event_t){0}) <= room);
    CHECK(knead_probe_pose_t_encoded_size(&(knead_probe_pose_t){0}) <= room);
    printf("     status %d bytes, health %d\n", knead_status_t_encoded_size(&(knead_status_t){0}),
           knead_health_t_encoded_size(&(knead_health_t){0}));
}

TESTS_MAIN
