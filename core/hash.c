#include "core/hash.h"

#include <string.h>

// Mix the bits of h, so that each bit of h affects all bits of the result.
static uint64_t mix(uint64_t h)
{
    h ^= h >> 32;
    h *= 0xd6e8feb86659fd93u;
    h ^= h >> 32;
    h *= 0xd6e8feb86659fd93u;
    return h ^ (h >> 32);
}

static uint64_t word(const unsigned char *p, size_t size)
{
    uint64_t w = 0;
    memcpy(&w, p, size);
    return w;
}

uint64_t kn_hash_bytes(uint64_t seed, const void *bytes, size_t size)
{
    // an odd constant of xxh3; any odd number with well-mixed bits would do
    const uint64_t k = 0x9fb21c651e98df25u;
    const unsigned char *p = bytes;
    uint64_t lane[4] = {seed, seed ^ k, seed + k, ~seed};
    size_t left = size;
    // hash whole blocks of 32 bytes in four lanes, then the last bytes (at most 31), then combine the lanes
    for (; left >= 32; left -= 32, p += 32)
        for (int i = 0; i < 4; i++) {
            uint64_t h = (lane[i] ^ word(p + 8 * i, 8)) * k;
            lane[i] = h ^ (h >> 29);
        }
    for (int i = 0; left > 0; i++) {
        size_t n = left < 8 ? left : 8;
        lane[i] = mix((lane[i] ^ word(p, n)) * k);
        p += n;
        left -= n;
    }
    uint64_t h = mix((uint64_t)size ^ seed);
    for (int i = 0; i < 4; i++) h = mix(h ^ lane[i]) * k;
    return mix(h);
}
