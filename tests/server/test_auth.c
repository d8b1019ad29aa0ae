#include "server/auth.h"
#include "server/wire.h"
#include "tests/check.h"
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define DIGITS "000102030405060708090a0b0c0d0e0f101112131415161718191a1b1c1d1e1f"

static char error[256];

static bool load(kn_auth *auth, const char *text, mode_t mode)
{
    FILE *file = fopen("key", "w");
    CHECK(file && fputs(text, file) >= 0 && fclose(file) == 0 && chmod("key", mode) == 0);
    bool loaded = kn_auth_load(auth, "key", error, sizeof error);
    unlink("key");
    return loaded;
}

TEST("a key is 64 hexadecimal digits that nobody else may read")
{
    kn_auth auth;
    CHECK(load(&auth, DIGITS, 0600) && auth.key[0] == 0 && auth.key[31] == 31);
    CHECK(load(&auth, DIGITS "\n", 0400) && auth.key[16] == 16);
    static const char *const bad[] = {"", "\n", DIGITS "00", DIGITS "\n\n", "0" DIGITS, "x" DIGITS, " " DIGITS};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        CHECK(!load(&auth, bad[i], 0600) && strstr(error, "key: expected 64 hexadecimal digits"));
    char text[] = DIGITS;
    text[63] = 'g';
    CHECK(!load(&auth, text, 0600) && strstr(error, "expected 64 hexadecimal digits"));
    static const mode_t open[] = {0640, 0604, 0660, 0620, 0777};
    for (size_t i = 0; i < sizeof open / sizeof *open; i++) {
        CHECK(!load(&auth, DIGITS, open[i]));
        CHECK_STR(error, "key: others may read or write it, expected mode 0600");
    }
    CHECK(!kn_auth_load(&auth, "nowhere", error, sizeof error));
    CHECK_STR(error, "nowhere: No such file or directory");
    CHECK(!kn_auth_load(&auth, ".", error, sizeof error) && strstr(error, "not a regular file"));
}

TEST("the tag is keyed BLAKE2b of 16 bytes over the channel, its NUL and the payload")
{
    // python3: hashlib.blake2b(b"KNEAD_POSE_hand\0" + b"payload", key=bytes(range(32)), digest_size=16)
    static const unsigned char tag[KN_WIRE_MAC] = {0xe2, 0xbd, 0x3c, 0xcb, 0x39, 0xe,  0x2b, 0xe0,
                                                   0x8e, 0x76, 0x1c, 0x70, 0x59, 0xf0, 0xb9, 0xd6};
    kn_auth auth;
    unsigned char bytes[64] = "payload";
    CHECK(load(&auth, DIGITS, 0600));
    CHECK(kn_auth_sign(&auth, "KNEAD_POSE_hand", bytes, 7) == 7 + KN_WIRE_MAC);
    CHECK(memcmp(bytes + 7, tag, sizeof tag) == 0);
    CHECK(kn_auth_check(&auth, "KNEAD_POSE_hand", bytes, 7 + KN_WIRE_MAC));
    CHECK(!kn_auth_check(&auth, "KNEAD_POSE_hane", bytes, 7 + KN_WIRE_MAC));
    CHECK(!kn_auth_check(&auth, "KNEAD_POSE_hand", bytes, 6 + KN_WIRE_MAC));
    for (size_t size = 0; size < KN_WIRE_MAC; size++) CHECK(!kn_auth_check(&auth, "KNEAD_POSE_hand", bytes, size));
}

TESTS_MAIN
