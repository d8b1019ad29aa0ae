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

// The processors of computer and paddle are little endian, as the frame is.
_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__ && sizeof(kn_paddle_frame) == 16, "layout of a frame");
enum { LETTERS = sizeof frame_begin, CHECKED = LETTERS + sizeof(kn_paddle_frame) }; // numbers of bytes

void kn_paddle_frame_encode(const kn_paddle_frame *frame, uint8_t bytes[KN_PADDLE_FRAME_SIZE])
{
    memcpy(bytes, frame_begin, LETTERS);
    memcpy(bytes + LETTERS, frame, sizeof *frame);
    const uint16_t crc = kn_paddle_frame_crc(bytes, CHECKED);
    memcpy(bytes + CHECKED, &crc, sizeof crc);
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
    uint16_t crc;
    // The buffer must begin with the letters K N, or with K if it has one byte.
    if (d->count == 0 && byte != frame_begin[0]) return d->skipped++, false;
    d->bytes[d->count++] = byte;
    if (d->count == 2 && byte != frame_begin[1]) skip(d);
    if (d->count < KN_PADDLE_FRAME_SIZE) return false;
    memcpy(&crc, d->bytes + CHECKED, sizeof crc);
    // If checksum or kind is wrong, search for the next frame inside the bytes already read.
    if (crc != kn_paddle_frame_crc(d->bytes, CHECKED) || d->bytes[LETTERS] != d->kind) {
        d->bad++;
        skip(d);
        return false;
    }
    memcpy(frame, d->bytes + LETTERS, sizeof *frame);
    d->count = 0;
    uint16_t gap = (uint16_t)(frame->seq - d->seq - 1);
    // If seq jumps by half its range or more, the sender has restarted its counter, so count no lost frames.
    if (d->frames++ > 0 && gap < 0x8000) d->lost += gap;
    d->seq = frame->seq;
    return true;
}
