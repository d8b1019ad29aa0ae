#ifndef KN_TESTS_DATAGRAM_H
#define KN_TESTS_DATAGRAM_H
// LC02 datagrams as any LCM sender makes them, for the tests and the fuzz target of the receiver.
#include "proto/knead_probe_pose_t.h"
#include "server/bus.h"
#include <string.h>

// "LC02" | sequence | channel, NUL | payload; returns the size, 0 when it does not fit
static inline size_t kn_lc02(unsigned char *bytes, size_t room, const char *channel, const void *payload, size_t payload_size)
{
    size_t name = strlen(channel) + 1, size = 8 + name + payload_size;
    if (size > room) return 0;
    memcpy(bytes, "LC02\0\0\0", 8);
    memcpy(bytes + 8, channel, name);
    memcpy(bytes + 8 + name, payload, payload_size);
    return size;
}

static inline size_t kn_pose_datagram(unsigned char *bytes, size_t room, const char *channel, const knead_probe_pose_t *pose)
{
    unsigned char payload[256];
    int size = knead_probe_pose_t_encode(payload, 0, sizeof payload, pose);
    return size < 0 ? 0 : kn_lc02(bytes, room, channel, payload, (size_t)size);
}

#endif
