#include "server/auth.h"
#include "server/bus.h"
#include "server/clock.h"
#include "server/console.h"
#include <errno.h>
#include <fcntl.h>
#include <sodium.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define DIGITS (2 * KN_AUTH_KEY)

// Read the key from an open file. Return NULL on success; otherwise return the reason why the file is refused.
static const char *read_key(kn_auth *auth, int fd)
{
    struct stat file;
    char text[DIGITS + 2];
    size_t bytes = 0;
    if (fd < 0 || fstat(fd, &file) != 0) return strerror(errno);
    // Refuse a file that another user can read or may have written.
    if (!S_ISREG(file.st_mode)) return "not a regular file";
    if (file.st_uid != geteuid() && file.st_uid != 0) return "owned by another user, expected this user or root";
    if (file.st_mode & 077) return "others may read or write it, expected mode 0600";
    // Read one byte more than a valid file can have, so that a longer file is noticed.
    ssize_t size = read(fd, text, sizeof text);
    if (size == DIGITS + 1 && text[DIGITS] == '\n') size--;
    bool hex = size == DIGITS && sodium_hex2bin(auth->key, sizeof auth->key, text, DIGITS, NULL, &bytes, NULL) == 0 &&
               bytes == sizeof auth->key;
    // Leave no copy of the key on the stack.
    sodium_memzero(text, sizeof text);
    return hex ? NULL : "expected 64 hexadecimal digits, as openssl rand -hex 32 gives them";
}

bool kn_auth_load(kn_auth *auth, const char *path, char *error, size_t error_size)
{
    if (sodium_init() < 0) return kn_refuse(error, error_size, "%s: cannot initialise libsodium", path);
    // O_NONBLOCK: opening a FIFO must not wait for a writer. read_key refuses anything but a regular file.
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    const char *why = read_key(auth, fd);
    if (fd >= 0) close(fd);
    if (why) snprintf(error, error_size, "%s: %s", path, why);
    return !why;
}

int64_t kn_auth_random(void)
{
    int64_t value = 0;
    while (value == 0) randombytes_buf(&value, sizeof value);
    return value;
}

void kn_auth_begin(kn_auth *auth)
{
    auth->life = kn_auth_random();
    auth->born_ns = kn_now_ns();
}

kn_auth_stamp kn_auth_now(const kn_auth *auth, int64_t *last_us)
{
    int64_t age_us = (kn_now_ns() - auth->born_ns) / 1000;
    *last_us = age_us > *last_us ? age_us : *last_us + 1;
    return (kn_auth_stamp){auth->life, *last_us};
}

// Compute the tag over the channel name with its NUL, and over payload, life and age. The NUL separates name and
// payload.
static void make_tag(const kn_auth *auth, const char *channel, const unsigned char *bytes, size_t size,
                     unsigned char tag[KN_AUTH_TAG])
{
    crypto_generichash_state state;
    crypto_generichash_init(&state, auth->key, sizeof auth->key, KN_AUTH_TAG);
    crypto_generichash_update(&state, (const unsigned char *)channel, strlen(channel) + 1);
    crypto_generichash_update(&state, bytes, size);
    crypto_generichash_final(&state, tag, KN_AUTH_TAG);
}

size_t kn_auth_sign(const kn_auth *auth, const char *channel, unsigned char *payload, size_t size, kn_auth_stamp stamp)
{
    kn_bytes_put_64(payload + size, stamp.life);
    kn_bytes_put_64(payload + size + 8, stamp.age_us);
    make_tag(auth, channel, payload, size + 16, payload + size + 16);
    return size + KN_AUTH_TRAILER;
}

bool kn_auth_check(const kn_auth *auth, const char *channel, const unsigned char *payload, size_t size,
                   kn_auth_stamp *stamp)
{
    unsigned char tag[KN_AUTH_TAG];
    if (size < KN_AUTH_TRAILER) return false;
    make_tag(auth, channel, payload, size - KN_AUTH_TAG, tag);
    const unsigned char *trailer = payload + size - KN_AUTH_TRAILER;
    *stamp = (kn_auth_stamp){kn_bytes_64(trailer), kn_bytes_64(trailer + 8)};
    // Ages below 2^62 us can be added or subtracted without overflow of an int64_t.
    return sodium_memcmp(tag, trailer + 16, KN_AUTH_TAG) == 0 && stamp->age_us >= 0 && stamp->age_us < INT64_MAX / 2;
}
