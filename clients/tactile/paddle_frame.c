#include "clients/tactile/paddle_frame.h"
#include <math.h>
#include <string.h>

static const uint8_t frame_begin[2] = {'K', 'N'};

uint16_t kn_paddle_frame_crc(const uint8_t *bytes, size_t size)
{
    // Shift a whole byte at a time, without a table: the polynomial has bits 12, 5 and 0. A paddle's firmware has neither
    // time for single bits nor room for a table.
    uint16_t crc = 0xffff;
    for (size_t i = 0; i < size; i++) {
        crc = (uint16_t)(crc << 8 | crc >> 8) ^ bytes[i];
        crc ^= (uint8_t)crc >> 4;
        crc ^= (uint16_t)(crc << 12);
        crc ^= (uint16_t)((uint8_t)crc << 5);
    }
    return crc;
}

// Clamp instead of casting directly: casting a NaN or an out-of-range double is undefined in C.
int32_t kn_paddle_frame_number(double value, double unit)
{
    double n = round(value / unit);
    if (isnan(n)) return 0;
    return n >= INT32_MAX ? INT32_MAX : n <= INT32_MIN ? INT32_MIN : (int32_t)n;
}

// Write and read single bytes, so that the code does not depend on the host's byte order.
static void put16(uint8_t *at, uint16_t value)
{
    at[0] = (uint8_t)value;
    at[1] = (uint8_t)(value >> 8);
}

static void put32(uint8_t *at, int32_t value)
{
    put16(at, (uint16_t)value);
    put16(at + 2, (uint16_t)((uint32_t)value >> 16));
}

static uint16_t get16(const uint8_t *at) { return (uint16_t)(at[0] | at[1] << 8); }

static int32_t get32(const uint8_t *at) { return (int32_t)((uint32_t)get16(at) | (uint32_t)get16(at + 2) << 16); }

void kn_paddle_frame_encode(const kn_paddle_frame *frame, uint8_t bytes[KN_PADDLE_FRAME_SIZE])
{
    memcpy(bytes, frame_begin, sizeof frame_begin);
    bytes[2] = (uint8_t)frame->kind;
    bytes[3] = frame->flags;
    put16(bytes + 4, frame->seq);
    put32(bytes + 6, frame->position_nm);
    put32(bytes + 10, frame->velocity_um_s);
    put32(bytes + 14, frame->force_un);
    put16(bytes + 18, kn_paddle_frame_crc(bytes, 18));
}

// Drop the first byte of the buffer and all following bytes that cannot begin a frame.
static void skip(kn_paddle_decoder *d)
{
    int at = 1;
    while (at < d->count &&
           (d->bytes[at] != frame_begin[0] || (at + 1 < d->count && d->bytes[at + 1] != frame_begin[1])))
        at++;
    d->skipped += at;
    d->count -= at;
    memmove(d->bytes, d->bytes + at, (size_t)d->count);
}

bool kn_paddle_decoder_push(kn_paddle_decoder *d, uint8_t byte, kn_paddle_frame *frame)
{
    const uint8_t *b = d->bytes;
    // The buffer must begin with the letters K N, or with K if it has one byte.
    if (d->count == 0 && byte != frame_begin[0]) return d->skipped++, false;
    d->bytes[d->count++] = byte;
    if (d->count == 2 && byte != frame_begin[1]) skip(d);
    if (d->count < KN_PADDLE_FRAME_SIZE) return false;
    // If checksum or kind is wrong, search for the next frame inside the bytes already read.
    if (get16(b + 18) != kn_paddle_frame_crc(b, 18) || b[2] != d->kind) {
        d->bad++;
        skip(d);
        return false;
    }
    *frame = (kn_paddle_frame){.kind = d->kind,
                               .flags = b[3],
                               .seq = get16(b + 4),
                               .position_nm = get32(b + 6),
                               .velocity_um_s = get32(b + 10),
                               .force_un = get32(b + 14)};
    d->count = 0;
    uint16_t gap = (uint16_t)(frame->seq - d->seq - 1);
    // If seq jumps by half its range or more, the sender has restarted its counter, so count no lost frames.
    if (d->frames++ > 0 && gap < 0x8000) d->lost += gap;
    d->seq = frame->seq;
    return true;
}
