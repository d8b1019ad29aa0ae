// What a scene message must hold before a decoder may see it.
#include "server/wire.h"
#include "tests/check.h"

static unsigned char bytes[512];

static size_t encode(void)
{
    knead_scene_t scene = {.version = (char *)"0.1.0", .name = (char *)"dough.yaml", .text = (char *)"version: 1\n"};
    return (size_t)knead_scene_t_encode(bytes, 0, sizeof bytes, &scene);
}

TEST("a scene message that holds what it says fits, with and without a code behind it")
{
    size_t size = encode();
    CHECK(kn_wire_scene_fits(bytes, size));
    CHECK(kn_wire_scene_fits(bytes, size + KN_WIRE_MAC));
    CHECK(!kn_wire_scene_fits(bytes, size + 1));
}

TEST("a cut one does not, nor one of another type")
{
    size_t size = encode();
    for (size_t cut = 0; cut < size; cut++) CHECK(!kn_wire_scene_fits(bytes, cut));
    bytes[7] ^= 1;
    CHECK(!kn_wire_scene_fits(bytes, size));
}

TEST("strings of a negative, huge or empty length, or without their end, do not")
{
    static const uint32_t lies[] = {0, 1, 5, 7, 0x7fffffff, 0x80000000, 0xffffffff, 0xfffffff0};
    const size_t at = 8 + 3 * 8 + 4; // of the first string's length, 6
    for (size_t i = 0; i < sizeof lies / sizeof *lies; i++) {
        size_t size = encode();
        for (int b = 0; b < 4; b++) bytes[at + (size_t)b] = (unsigned char)(lies[i] >> (24 - 8 * b));
        CHECK(!kn_wire_scene_fits(bytes, size));
    }
    size_t size = encode();
    bytes[size - 1] = 'x'; // the text's NUL
    CHECK(!kn_wire_scene_fits(bytes, size));
}

TESTS_MAIN
