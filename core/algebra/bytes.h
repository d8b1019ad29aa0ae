#ifndef KN_CORE_ALGEBRA_BYTES_H
#define KN_CORE_ALGEBRA_BYTES_H
// A codec turns plain values into bytes and back: little-endian, in the order of the calls. The same calls measure,
// write and read a layout, so size, writer and reader cannot differ:
//
//     kn_codec c = {0};                                  measures: c.at grows
//     kn_codec c = {.to = bytes, .size = n};             writes
//     kn_codec c = {.from = bytes, .size = n};           reads
//     kn_codec_i64(&c, &s->tick), kn_codec_f64(&c, s->position_m, 3), ...
//
// A reader checks every value. It sets `wrong` if the bytes end too early, or if a value is outside the range that the
// call allows. `wrong` is never cleared, and every further value is read as 0. Real-time safe.
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct kn_codec {
    uint8_t *to;         // buffer to write to, else NULL
    const uint8_t *from; // buffer to read from, else NULL
    size_t size, at;     // size: size of the buffer; at: offset of the next value in the buffer [bytes]
    bool ended;          // the buffer ended before the last value
    bool wrong;          // the buffer ended too early, or a value was outside its range
} kn_codec;

void kn_codec_bytes(kn_codec *c, uint8_t *bytes, size_t count);
void kn_codec_u64(kn_codec *c, uint64_t *value);
void kn_codec_i64(kn_codec *c, int64_t *value, int64_t least, int64_t most);
void kn_codec_i32(kn_codec *c, int32_t *value, int32_t least, int32_t most); // takes 8 bytes in the buffer
void kn_codec_bool(kn_codec *c, bool *value);
void kn_codec_f64(kn_codec *c, double *value, size_t count);              // all values must be finite
void kn_codec_reals(kn_codec *c, void *value, size_t count, bool single); // floats (single) or doubles, all finite

// An arena hands out pieces of one block of memory, each aligned to 64 bytes. If `base` is NULL, the arena only adds up
// the sizes. So one function can serve twice: a first call with `base` NULL measures a layout, and a second call hands
// out its memory.
typedef struct kn_arena {
    char *base;
    size_t used;
} kn_arena;

static inline void *kn_arena_take(kn_arena *a, size_t bytes)
{
    void *p = a->base ? a->base + a->used : NULL;
    a->used += (bytes + 63) / 64 * 64;
    return p;
}

#endif
