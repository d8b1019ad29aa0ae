#ifndef KN_TESTS_DATAGRAM_H
#define KN_TESTS_DATAGRAM_H
// LC02 datagrams as any LCM sender makes them, and as none should: for the tests and the fuzz target of the receiver.
#include "proto/knead_probe_pose_t.h"
#include <math.h>
#include <string.h>

#define KN_TEST_DATAGRAM 600 // room, beyond what the receiver keeps

// "LC02" | sequence | channel, NUL | payload; returns the size, 0 when it does not fit
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

// Of the pose's datagram a relative that differs somewhere or nowhere: a poisoned field, a jump, an old seq or stamp,
// bytes overwritten, another magic, no NUL, cut or grown. Structure-aware, so that every later check is reached too.
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

#endif
