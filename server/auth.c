#include "server/auth.h"
#include "server/wire.h"
#include <errno.h>
#include <fcntl.h>
#include <sodium.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define DIGITS (2 * KN_AUTH_KEY)

// What is wrong with it, or NULL.
static const char *read_key(kn_auth *auth, int fd)
{
    struct stat file;
    char text[DIGITS + 2];
    size_t bytes = 0;
    if (fd < 0 || fstat(fd, &file) != 0) return strerror(errno);
    if (!S_ISREG(file.st_mode)) return "not a regular file";
    if (file.st_uid != geteuid() && file.st_uid != 0) return "another user's, expected our own or root's";
    if (file.st_mode & 077) return "others may read or write it, expected mode 0600";
    ssize_t size = read(fd, text, sizeof text);
    if (size == DIGITS + 1 && text[DIGITS] == '\n') size--;
    bool hex = size == DIGITS && sodium_hex2bin(auth->key, sizeof auth->key, text, DIGITS, NULL, &bytes, NULL) == 0 &&
               bytes == sizeof auth->key;
    sodium_memzero(text, sizeof text);
    return hex ? NULL : "expected 64 hexadecimal digits, as openssl rand -hex 32 gives them";
}

bool kn_auth_load(kn_auth *auth, const char *path, char *error, size_t error_size)
{
    if (sodium_init() < 0) return snprintf(error, error_size, "%s: libsodium does not start", path), false;
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    const char *why = read_key(auth, fd);
    if (fd >= 0) close(fd);
    if (why) snprintf(error, error_size, "%s: %s", path, why);
    return !why;
}

static void make_tag(const kn_auth *auth, const char *channel, const unsigned char *payload, size_t size,
                     unsigned char tag[KN_WIRE_MAC])
{
    crypto_generichash_state state;
    crypto_generichash_init(&state, auth->key, sizeof auth->key, KN_WIRE_MAC);
    crypto_generichash_update(&state, (const unsigned char *)channel, strlen(channel) + 1);
    crypto_generichash_update(&state, payload, size);
    crypto_generichash_final(&state, tag, KN_WIRE_MAC);
}

size_t kn_auth_sign(const kn_auth *auth, const char *channel, unsigned char *payload, size_t size)
{
    make_tag(auth, channel, payload, size, payload + size);
    return size + KN_WIRE_MAC;
}

bool kn_auth_check(const kn_auth *auth, const char *channel, const unsigned char *payload, size_t size)
{
    unsigned char tag[KN_WIRE_MAC];
    if (size < KN_WIRE_MAC) return false;
    make_tag(auth, channel, payload, size - KN_WIRE_MAC, tag);
    return sodium_memcmp(tag, payload + size - KN_WIRE_MAC, KN_WIRE_MAC) == 0;
}
