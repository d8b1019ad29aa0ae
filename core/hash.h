#ifndef KN_CORE_HASH_H
#define KN_CORE_HASH_H
// 64-bit hash of plain bytes: four independent multiply lanes over 32-byte blocks, then a mix. Hashing takes about 1 ns
// per 8 bytes, so a tick has time to hash a whole state. The hash is not cryptographic. All little-endian machines give
// the same value.
#include <stddef.h>
#include <stdint.h>

// seed for the first call of kn_hash_bytes; later calls may take the last hash as their seed
#define KN_HASH_SEED 0x9e3779b97f4a7c15u

// Return the hash of `size` bytes. `bytes` need no alignment. Real-time safe.
uint64_t kn_hash_bytes(uint64_t seed, const void *bytes, size_t size);

#endif
