#ifndef KN_SERVER_BYTES_H
#define KN_SERVER_BYTES_H
// Big-endian integers, as LCM encodes them. The caller checks the bounds.
#include <stdint.h>

static inline uint32_t kn_bytes_32(const unsigned char *bytes)
{
    return (uint32_t)bytes[0] << 24 | (uint32_t)bytes[1] << 16 | (uint32_t)bytes[2] << 8 | bytes[3];
}

static inline int64_t kn_bytes_64(const unsigned char *bytes)
{
    return (int64_t)((uint64_t)kn_bytes_32(bytes) << 32 | kn_bytes_32(bytes + 4));
}

static inline void kn_bytes_put_64(unsigned char *bytes, int64_t value)
{
    for (int i = 0; i < 8; i++) bytes[i] = (unsigned char)((uint64_t)value >> (56 - 8 * i));
}

#endif
