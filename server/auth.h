#ifndef KN_SERVER_AUTH_H
#define KN_SERVER_AUTH_H
// Authentic and fresh messages between holders of one key. A trailer stands behind the payload, where decoders that know
// nothing of it do not look:
//
//     payload | life i64 | age_us i64 | tag, 16 bytes        big-endian; KN_AUTH_TRAILER = 32 bytes
//
// The tag is BLAKE2b (libsodium's crypto_generichash), keyed, over channel, payload, life and age. A message costs one
// microsecond. Nothing is secret.
//
// A life is one run of kneadd, or what follows one `load`: a random number, and microseconds since its start. A tag
// proves that a holder of the key made the message; life and age prove when:
//
//     listener                                          kneadd
//        KNEAD_HELLO: nonce           -->                   signed; life and age are 0
//                                     <--               KNEAD_LIFE: the same nonce; life and age of now
//        believes messages of this life alone, each older than the next
//        KNEAD_POSE_*                 -->               takes poses of its own life, aged within 0.8 s of now
//
// A recording of another life is refused. One of this life is refused after 0.9 s. Wall clocks are not used.
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define KN_AUTH_KEY 32     // bytes
#define KN_AUTH_TAG 16     // bytes; the whole trailer of messages in logs of version 0.1.0
#define KN_AUTH_TRAILER 32 // bytes
#define KN_AUTH_NONCE 8    // bytes: the payload of the next two
#define KN_HELLO_CHANNEL "KNEAD_HELLO"
#define KN_LIFE_CHANNEL "KNEAD_LIFE"

// A pose's age may lie so far behind kneadd's, us: less than the second of silence that ends a session, so that an ended
// session cannot be played again. It may lie ahead by the drift of two clocks since the last message.
#define KN_AUTH_BEHIND_US 800000
#define KN_AUTH_AHEAD_US 100000

typedef struct kn_auth {
    unsigned char key[KN_AUTH_KEY];
    int64_t life, born_ns; // kneadd's own: not 0; CLOCK_MONOTONIC when it began
} kn_auth;

typedef struct kn_auth_stamp {
    int64_t life, age_us;
} kn_auth_stamp;

// Read a file of 64 hexadecimal digits (openssl rand -hex 32), ours or root's, that nobody else may read. False and one
// line in error.
bool kn_auth_load(kn_auth *auth, const char *path, char *error, size_t error_size);

// Begin a life of kneadd.
void kn_auth_begin(kn_auth *auth);

// Return a random number that is not 0.
int64_t kn_auth_random(void);

// Return the stamp of now, older than the last one of this sender: *last_us, which is 0 at first. Real-time safe, as are
// sign and check.
kn_auth_stamp kn_auth_now(const kn_auth *auth, int64_t *last_us);

// Append stamp and tag to size bytes of payload, which has room for KN_AUTH_TRAILER more. Return the new size.
size_t kn_auth_sign(const kn_auth *auth, const char *channel, unsigned char *payload, size_t size, kn_auth_stamp stamp);

// Return whether the last KN_AUTH_TRAILER of size bytes are authentic, and read the stamp: 0 <= age_us < 2^62. In
// constant time.
bool kn_auth_check(const kn_auth *auth, const char *channel, const unsigned char *payload, size_t size,
                   kn_auth_stamp *stamp);

// Return whether size bytes are a payload of that many, with or without a trailer.
static inline bool kn_auth_fits(size_t size, size_t payload)
{
    return size == payload || size == payload + KN_AUTH_TAG || size == payload + KN_AUTH_TRAILER;
}

#endif
