#ifndef KN_TESTS_DATAGRAM_H
#define KN_TESTS_DATAGRAM_H
// LC02 datagrams, valid and invalid, for the tests and the fuzz target of the receiver.
#include "proto/knead_probe_pose_t.h"
#include "server/auth.h"
#include "server/wire.h"
#include <math.h>
#include <string.h>

#define KN_TEST_DATAGRAM 600 // size of the buffer, more than the receiver keeps

// Write "LC02" | sequence | channel, NUL | payload. Return the size, or 0 if the datagram does not fit.
static inline size_t kn_lc02(unsigned char *bytes, size_t room, const char *channel, const void *payload,
                             size_t payload_size)
{
    size_t name = strlen(channel) + 1, size = 8 + name + payload_size;
    if (size > room) return 0;
    memcpy(bytes, "LC02\0\0\0", 8);
    memcpy(bytes + 8, channel, name);
    memcpy(bytes + 8 + name, payload, payload_size);
    return size;
}

static inline size_t kn_pose_datagram(unsigned char *bytes, size_t room, const char *channel,
                                      const knead_probe_pose_t *pose)
{
    unsigned char payload[256];
    int size = knead_probe_pose_t_encode(payload, 0, sizeof payload, pose);
    return size < 0 ? 0 : kn_lc02(bytes, room, channel, payload, (size_t)size);
}

static inline uint64_t kn_random_bits(uint64_t *state) // splitmix64
{
    uint64_t z = *state += 0x9e3779b97f4a7c15u;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return z ^ z >> 31;
}

// Make a random variant of the pose's datagram: a poisoned field, a jump, an old seq or stamp, overwritten bytes,
// another magic, no NUL, cut or grown, or no change. The variants follow the structure of the message, so that later
// checks are reached too.
static inline size_t kn_random_datagram(unsigned char bytes[KN_TEST_DATAGRAM], uint64_t *random, const char *channel,
                                        knead_probe_pose_t pose)
{
    double *field[] = {pose.position_m, pose.orientation_wxyz, pose.velocity_m_s};
    uint64_t bits = kn_random_bits(random), size;
    if (kn_random_bits(random) % 4 == 0) memcpy(field[bits % 3] + bits / 3 % 3, &bits, 8);
    if (kn_random_bits(random) % 32 == 0) pose.orientation_wxyz[bits % 4] = bits % 8 < 4 ? NAN : INFINITY;
    if (kn_random_bits(random) % 64 == 0) pose.position_m[0] = 0.5;
    if (kn_random_bits(random) % 64 == 0) pose.seq -= (int64_t)(bits % 100);
    if (kn_random_bits(random) % 64 == 0) pose.utime -= (int64_t)(bits % 100000);
    if (kn_random_bits(random) % 64 == 0) pose.session = 0;
    size = kn_pose_datagram(bytes, KN_TEST_DATAGRAM, channel, &pose);
    for (uint64_t n = kn_random_bits(random) % 4 ? 0 : bits % 9; n > 0; n--)
        bytes[kn_random_bits(random) % size] = (unsigned char)kn_random_bits(random);
    if (kn_random_bits(random) % 32 == 0) bytes[3] = '3';
    if (kn_random_bits(random) % 32 == 0) memset(bytes + 8, 'K', 8 + bits % 100);
    if (kn_random_bits(random) % 8 == 0) size = bits % (KN_TEST_DATAGRAM + 1);
    return size;
}

// --- with a key ---

// Sign a datagram. The buffer has room for KN_AUTH_TRAILER more bytes.
static inline size_t kn_sign_datagram(unsigned char *bytes, size_t size, const char *channel, const kn_auth *auth,
                                      kn_auth_stamp stamp)
{
    size_t head = 8 + strlen(channel) + 1;
    return head + kn_auth_sign(auth, channel, bytes + head, size - head, stamp);
}

// --- messages in parts ---

static inline void kn_put32(unsigned char *bytes, uint32_t value)
{
    for (int i = 0; i < 4; i++) bytes[i] = (unsigned char)(value >> (24 - 8 * i));
}

// LC03: "LC03" | sequence | size of the message | offset of this part | number of this part u16 | parts u16 |
// channel, NUL in part 0 | data
static inline size_t kn_lc03(unsigned char *bytes, uint32_t sequence, uint32_t whole, uint32_t offset, uint16_t part,
                             uint16_t parts, const char *channel, size_t data)
{
    size_t name = part == 0 ? strlen(channel) + 1 : 0;
    memcpy(bytes, "LC03", 4);
    kn_put32(bytes + 4, sequence);
    kn_put32(bytes + 8, whole);
    kn_put32(bytes + 12, offset);
    kn_put32(bytes + 16, (uint32_t)part << 16 | parts);
    memcpy(bytes + 20, channel, name);
    memset(bytes + 20 + name, 0x5a, data);
    return 20 + name + data;
}

#endif
