// libFuzzer target: any bytes as a range image give usable heights, or one sentence of error. Checksums of chunks are
// corrected first: otherwise they would keep the fuzzer out of the code behind them.
#include "clients/viewer/range.h"
#include "tests/fuzz/memory_file.h"
#include <math.h>
#include <string.h>
#include <zlib.h>

enum { HEAD = 8, FRAME = 12 }; // a PNG's signature; length, name and checksum of a chunk

static uint32_t read_u32(const uint8_t *at)
{
    return (uint32_t)at[0] << 24 | (uint32_t)at[1] << 16 | (uint32_t)at[2] << 8 | at[3];
}

static void put_checksums_right(uint8_t *png, size_t size)
{
    for (size_t at = HEAD; at + FRAME <= size;) {
        const size_t bytes = read_u32(png + at);
        if (bytes > size - at - FRAME) return;
        const uint32_t sum = (uint32_t)crc32(0, png + at + 4, (uInt)(bytes + 4));
        for (int i = 0; i < 4; i++) png[at + 8 + bytes + (size_t)i] = (uint8_t)(sum >> (24 - 8 * i));
        at += bytes + FRAME;
    }
}

static void judge(const char *file, const kn_range_given *given)
{
    kn_range range;
    uint16_t *level = NULL;
    char error[300] = "";
    if (!kn_range_load(file, given, &range, &level, error, sizeof error)) {
        require(*error && level == NULL);
        return;
    }
    require(range.width > 0 && range.width <= KN_RANGE_MOST && range.height > 0 && range.height <= KN_RANGE_MOST);
    require(range.step_m > 0 && range.pixel_m > 0 && isfinite(range.left_m) && isfinite(range.top_m));
    require(range.lowest_m >= 0 && range.highest_m >= range.lowest_m &&
            range.highest_m <= 65534 * range.step_m * 1.0001);
    int seen = 0;
    for (int i = 0; i < range.width * range.height; i++) seen += level[i] > 0; // read every pixel
    require(seen > 0);
    free(level);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static uint8_t png[1 << 16];
    if (size > sizeof png) return 0;
    memcpy(png, data, size);
    put_checksums_right(png, size);
    const char *file = memory_file(png, size);
    judge(file, &(kn_range_given){NAN, NAN, NAN, NAN});
    judge(file, &(kn_range_given){1e-6, 1e-3, 0, 0});
    return 0;
}
