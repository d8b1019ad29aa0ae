#ifndef KN_CORE_HASH_H
#define KN_CORE_HASH_H
// 64-bit hash of plain bytes: four independent multiply lanes over 32-byte blocks, then a mix. It hashes about 8 bytes
// per ns, so a tick has time to hash a whole state. Not cryptographic. All little-endian machines give the same value.
#include <stddef.h>
#include <stdint.h>

// seed for the first call of kn_hash_bytes; later calls may take the last hash as their seed
#define KN_HASH_SEED 0x9e3779b97f4a7c15u

uint64_t kn_hash_bytes(uint64_t seed, const void *bytes, size_t size);

#endif
