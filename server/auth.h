#ifndef KN_SERVER_AUTH_H
#define KN_SERVER_AUTH_H
// Who shares a key: BLAKE2b, keyed, over channel and payload (libsodium's crypto_generichash), in the KN_WIRE_MAC bytes
// behind the payload, where decoders that know nothing of it do not look. One microsecond a message; nothing is secret.
//
// The tag says that a message is of a holder of the key, not that it is new: see receiver.h for that.
#include <stdbool.h>
#include <stddef.h>

#define KN_AUTH_KEY 32 // bytes

typedef struct kn_auth {
    unsigned char key[KN_AUTH_KEY];
} kn_auth;

// A file of 64 hexadecimal digits (openssl rand -hex 32), ours or root's, that nobody else may read. False and one line
// in error.
bool kn_auth_load(kn_auth *auth, const char *path, char *error, size_t error_size);

// Appends the tag to size bytes of payload: there is room for KN_WIRE_MAC more. Returns the new size. Real-time safe,
// as is check.
size_t kn_auth_sign(const kn_auth *auth, const char *channel, unsigned char *payload, size_t size);

// Whether the last KN_WIRE_MAC of size bytes are the tag of those before them. In constant time.
bool kn_auth_check(const kn_auth *auth, const char *channel, const unsigned char *payload, size_t size);

#endif
