#include "server/auth.h"
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

TEST("the tag is keyed BLAKE2b of 16 bytes over the channel, its NUL, the payload, life and age")
{
    // From python3:
    //     hashlib.blake2b(b"KNEAD_POSE_hand\0" + b"payload" + struct.pack(">qq", 7, 1000000), key=bytes(range(32)),
    //                     digest_size=16)
    static const unsigned char tag[KN_AUTH_TAG] = {0x69, 0xb4, 0xbc, 0xf9, 0x6a, 0x2f, 0x43, 0x25,
                                                   0xae, 0xee, 0x0f, 0x20, 0xd1, 0x66, 0x46, 0xbe};
    kn_auth auth;
    kn_auth_stamp stamp;
    unsigned char bytes[64] = "payload";
    CHECK(load(&auth, DIGITS, 0600));
    CHECK(kn_auth_sign(&auth, "KNEAD_POSE_hand", bytes, 7, (kn_auth_stamp){7, 1000000}) == 7 + KN_AUTH_TRAILER);
    CHECK(memcmp(bytes + 7 + 16, tag, sizeof tag) == 0);
    CHECK(kn_auth_check(&auth, "KNEAD_POSE_hand", bytes, 7 + KN_AUTH_TRAILER, &stamp));
    CHECK(stamp.life == 7 && stamp.age_us == 1000000);
    CHECK(!kn_auth_check(&auth, "KNEAD_POSE_hane", bytes, 7 + KN_AUTH_TRAILER, &stamp));
    CHECK(!kn_auth_check(&auth, "KNEAD_POSE_hand", bytes, 6 + KN_AUTH_TRAILER, &stamp));
    for (size_t size = 0; size < KN_AUTH_TRAILER; size++)
        CHECK(!kn_auth_check(&auth, "KNEAD_POSE_hand", bytes, size, &stamp));
}

TEST("each life has another number, and the ages within a life rise at every call")
{
    kn_auth auth = {0};
    kn_auth_begin(&auth);
    int64_t life = auth.life, last_us = 0, before_us = 0;
    for (int i = 0; i < 100000; i++, before_us = last_us) {
        kn_auth_stamp now = kn_auth_now(&auth, &last_us);
        CHECK(now.life == life && now.age_us == last_us && last_us > before_us);
    }
    kn_auth_begin(&auth);
    CHECK(life != 0 && auth.life != 0 && auth.life != life);
}

TESTS_MAIN
