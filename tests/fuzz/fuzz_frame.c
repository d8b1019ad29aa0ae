// libFuzzer target: bytes from a serial line are valid frames, or skipped and counted, each byte once. A whole frame
// after any bytes is heard once, at the latest when twenty more bytes have come.
#include "clients/tactile/paddle.h"
#include "tests/fuzz/fuzz.h"
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    kn_paddle_decoder d = {.kind = KN_PADDLE_FRAME_STATE};
    kn_paddle_frame frame;
    uint8_t again[KN_PADDLE_FRAME_SIZE], last[2 * KN_PADDLE_FRAME_SIZE];
    for (size_t i = 0; i < size; i++) {
        if (kn_paddle_decoder_push(&d, data[i], &frame)) {
            kn_paddle_frame_encode(&frame, again);
            require(i + 1 >= sizeof again && memcmp(again, data + i + 1 - sizeof again, sizeof again) == 0);
        }
        require(d.count >= 0 && d.count < KN_PADDLE_FRAME_SIZE);
        require(d.frames * KN_PADDLE_FRAME_SIZE + d.skipped + d.count == (int64_t)i + 1);
    }
    const kn_paddle_frame sent = {.kind = KN_PADDLE_FRAME_STATE, .seq = 4711, .position_nm = -1};
    kn_paddle_frame_encode(&sent, last);
    kn_paddle_frame_encode(&sent, last + KN_PADDLE_FRAME_SIZE);
    bool heard = false;
    for (size_t i = 0; i < sizeof last; i++)
        if (kn_paddle_decoder_push(&d, last[i], &frame)) heard |= frame.seq == 4711;
    require(heard);
    return 0;
}
