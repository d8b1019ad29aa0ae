#include "core/algebra/bytes.h"

#include <math.h>
#include <string.h>

// Advance the offset by `count` bytes. Return true if there is a buffer that holds these bytes. Return false if the
// codec only measures, or if the buffer ends too early.
static bool reach(kn_codec *c, size_t count)
{
    bool fits = !(c->to || c->from) || (!c->ended && count <= c->size - c->at);
    if (fits) c->at += count;
    else c->ended = c->wrong = true;
    return fits && (c->to || c->from);
}

// Write or read bytes. Bytes that are read past the end of the buffer become 0.
void kn_codec_bytes(kn_codec *c, uint8_t *bytes, size_t count)
{
    bool there = reach(c, count);
    if (c->to && there) memcpy(c->to + c->at - count, bytes, count);
    if (!c->from) return;
    if (there) memcpy(bytes, c->from + c->at - count, count);
    else memset(bytes, 0, count);
}

// Write or read the low `size` bytes of a value, little-endian on every machine.
static void word(kn_codec *c, uint64_t *value, size_t size)
{
    uint8_t bytes[8] = {0};
    for (size_t i = 0; i < size; i++) bytes[i] = (uint8_t)(*value >> 8 * i);
    kn_codec_bytes(c, bytes, size);
    if (!c->from) return;
    *value = 0;
    for (size_t i = 0; i < size; i++) *value |= (uint64_t)bytes[i] << 8 * i;
}

void kn_codec_u64(kn_codec *c, uint64_t *value) { word(c, value, 8); }

void kn_codec_i64(kn_codec *c, int64_t *value, int64_t least, int64_t most)
{
    uint64_t bits;
    memcpy(&bits, value, sizeof bits);
    word(c, &bits, 8);
    if (!c->from) return;
    memcpy(value, &bits, sizeof bits);
    // replace a value outside its range by the lowest value of the range
    if (*value >= least && *value <= most) return;
    *value = least;
    c->wrong = true;
}

void kn_codec_i32(kn_codec *c, int32_t *value, int32_t least, int32_t most)
{
    int64_t wide = *value;
    kn_codec_i64(c, &wide, least, most);
    *value = (int32_t)wide;
}

void kn_codec_bool(kn_codec *c, bool *value)
{
    int64_t wide = c->from ? 0 : *value;
    kn_codec_i64(c, &wide, 0, 1);
    *value = wide != 0;
}

static void real64(kn_codec *c, double *value)
{
    uint64_t bits;
    memcpy(&bits, value, sizeof bits);
    word(c, &bits, sizeof bits);
    if (c->from) memcpy(value, &bits, sizeof bits);
}

static void real32(kn_codec *c, float *value)
{
    uint32_t bits;
    memcpy(&bits, value, sizeof bits);
    uint64_t wide = bits;
    word(c, &wide, sizeof bits);
    bits = (uint32_t)wide;
    if (c->from) memcpy(value, &bits, sizeof bits);
}

void kn_codec_f64(kn_codec *c, double *value, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        real64(c, &value[i]);
        if (!c->from || isfinite(value[i])) continue;
        value[i] = 0;
        c->wrong = true;
    }
}

void kn_codec_reals(kn_codec *c, void *value, size_t count, bool single)
{
    float *f = value;
    if (!single) kn_codec_f64(c, value, count);
    for (size_t i = 0; single && i < count; i++) {
        real32(c, &f[i]);
        if (!c->from || isfinite(f[i])) continue;
        f[i] = 0;
        c->wrong = true;
    }
}
