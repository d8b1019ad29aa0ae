#ifndef KN_SERVER_AUTH_H
#define KN_SERVER_AUTH_H
// Authentication of messages between holders of one key, with proof that a message is recent. A trailer follows the
// payload. A decoder that does not know the trailer stops at the end of the payload.
//
//     payload | life i64 | age_us i64 | tag, 16 bytes        big-endian; KN_AUTH_TRAILER = 32 bytes
//
// The tag is a keyed BLAKE2b hash (libsodium's crypto_generichash) over channel, payload, life and age. Signing or
// checking a message takes one microsecond. Nothing is encrypted.
//
// A life is one run of kneadd, or the part of a run that follows a `load` command. A stamp names the life by a random
// number and gives the microseconds since the life began (age). The tag proves that a holder of the key made the
// message; life and age prove when:
//
//     listener                                          kneadd
//        KNEAD_HELLO: nonce           -->                   signed; life and age are 0
//                                     <--               KNEAD_LIFE: the same nonce; life and age of now
//        accepts only messages of this life, each with a greater age than the last
//        KNEAD_POSE_*                 -->               accepts poses of its own life, at most 0.8 s old
//
// A recording from another life is refused. A recording from the same life is refused after 0.9 s. Wall clocks are not
// used.
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define KN_AUTH_KEY 32     // length of the key, bytes
#define KN_AUTH_TAG 16     // length of the tag, bytes
#define KN_AUTH_TRAILER 32 // length of the trailer after a signed payload, bytes
// Length of a nonce, bytes; a nonce is the payload of the messages KNEAD_HELLO and KNEAD_LIFE.
#define KN_AUTH_NONCE 8
#define KN_HELLO_CHANNEL "KNEAD_HELLO"
#define KN_LIFE_CHANNEL "KNEAD_LIFE"

// Limits for the age in the stamp of a pose, us. kneadd's own age is the time since its life began. The age of a pose
// may be at most KN_AUTH_BEHIND_US below kneadd's own. This limit is shorter than the silence (1 s) that ends a
// session, so a recorded session cannot be replayed after its end. The age of a pose may be at most KN_AUTH_AHEAD_US
// above kneadd's own, because the sender computes the age with its own clock, which may run fast.
#define KN_AUTH_BEHIND_US 800000
#define KN_AUTH_AHEAD_US 100000

typedef struct kn_auth {
    unsigned char key[KN_AUTH_KEY];
    // `life`: number of the present life (run) of kneadd, never 0; `born_ns`: CLOCK_MONOTONIC when this life began.
    int64_t life, born_ns;
} kn_auth;

typedef struct kn_auth_stamp {
    int64_t life, age_us;
} kn_auth_stamp;

// Read the key from a file of 64 hexadecimal digits (openssl rand -hex 32). The file must belong to the user of this
// process or to root, and nobody else may have access to it. On failure return false and put one line in error.
bool kn_auth_load(kn_auth *auth, const char *path, char *error, size_t error_size);

// Begin a new life (run) of kneadd: choose its random number and note its start time.
void kn_auth_begin(kn_auth *auth);

// Return a random number other than 0.
int64_t kn_auth_random(void);

// Return a stamp (life and age) of the present moment. Its age is greater than *last_us, the age of the sender's last
// stamp; *last_us is then set to the new age. Set *last_us to 0 before the first call. kn_auth_now, kn_auth_sign and
// kn_auth_check are real-time safe.
kn_auth_stamp kn_auth_now(const kn_auth *auth, int64_t *last_us);

// Append the trailer, which is the stamp and the authentication tag, to a payload of `size` bytes. The buffer must have
// room for KN_AUTH_TRAILER more bytes. Return the new size.
size_t kn_auth_sign(const kn_auth *auth, const char *channel, unsigned char *payload, size_t size, kn_auth_stamp stamp);

// Check a message of `size` bytes, whose last KN_AUTH_TRAILER bytes are the trailer, and read its stamp. Return whether
// the tag is right and 0 <= age_us < 2^62. The comparison of the tags takes constant time.
bool kn_auth_check(const kn_auth *auth, const char *channel, const unsigned char *payload, size_t size,
                   kn_auth_stamp *stamp);

// Return whether a message of `size` bytes can hold a payload of the length `payload`, without or with a trailer.
static inline bool kn_auth_fits(size_t size, size_t payload)
{
    return size == payload || size == payload + KN_AUTH_TRAILER;
}

#endif
