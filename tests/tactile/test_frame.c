#include "clients/tactile/paddle.h"
#include "tests/check.h"

static kn_paddle_decoder deframer;
static kn_paddle_frame got;
static int heard;

static void hear(const uint8_t *bytes, size_t size)
{
    kn_paddle_frame frame;
    for (size_t i = 0; i < size; i++)
        if (kn_paddle_decoder_push(&deframer, bytes[i], &frame)) got = frame, heard++;
}

static void begin(void)
{
    deframer = (kn_paddle_decoder){.kind = KN_PADDLE_FRAME_STATE};
    heard = 0;
}

static const uint8_t *state(uint16_t seq)
{
    static uint8_t bytes[KN_PADDLE_FRAME_SIZE];
    kn_paddle_frame frame = {
        KN_PADDLE_FRAME_STATE, KN_PADDLE_FRAME_MOTOR | KN_PADDLE_FRAME_BUTTON_0, seq, -12345678, 250000, -3300000};
    kn_paddle_frame_encode(&frame, bytes);
    return bytes;
}

TEST("the checksum is CRC-16/CCITT-FALSE, and a frame has the bytes that the README shows")
{
    const uint8_t expected[18] = {'K',  'N',  1,    17,   0x34, 0x12, 0xb2, 0x9e, 0x43,
                                  0xff, 0x90, 0xd0, 0x03, 0,    0x60, 0xa5, 0xcd, 0xff};
    const uint8_t *bytes = state(0x1234);
    CHECK(kn_paddle_frame_crc((const uint8_t *)"123456789", 9) == 0x29b1);
    CHECK(memcmp(bytes, expected, sizeof expected) == 0);
    CHECK(kn_paddle_frame_crc(bytes, 18) == (bytes[18] | bytes[19] << 8));
}

TEST("a frame is decoded as it was encoded")
{
    begin();
    hear(state(7), KN_PADDLE_FRAME_SIZE);
    CHECK(heard == 1 && got.kind == KN_PADDLE_FRAME_STATE && got.flags == 17 && got.seq == 7);
    CHECK(got.position_nm == -12345678 && got.velocity_um_s == 250000 && got.force_un == -3300000);
    CHECK(deframer.frames == 1 && deframer.bad == 0 && deframer.skipped == 0 && deframer.lost == 0);
}

TEST("a number beyond int32 is clamped, and NaN becomes 0")
{
    CHECK(kn_paddle_frame_number(3.0, 1e-9) == INT32_MAX && kn_paddle_frame_number(-INFINITY, 1e-9) == INT32_MIN);
    CHECK(kn_paddle_frame_number(NAN, 1e-9) == 0);
    CHECK(kn_paddle_frame_number(1.4e-9, 1e-9) == 1 && kn_paddle_frame_number(-1.6e-9, 1e-9) == -2);
}

TEST("a frame with any flipped bit is refused, and the next frame is decoded")
{
    for (int bit = 0; bit < 8 * KN_PADDLE_FRAME_SIZE; bit++) {
        uint8_t bytes[KN_PADDLE_FRAME_SIZE];
        memcpy(bytes, state(1), sizeof bytes);
        bytes[bit / 8] ^= (uint8_t)(1 << bit % 8);
        begin();
        hear(bytes, sizeof bytes);
        CHECK(heard == 0);
        hear(state(2), KN_PADDLE_FRAME_SIZE);
        CHECK(heard == 1 && got.seq == 2 && deframer.skipped == KN_PADDLE_FRAME_SIZE);
    }
}

TEST("an echoed command frame is not taken for a state frame")
{
    uint8_t bytes[KN_PADDLE_FRAME_SIZE];
    begin();
    kn_paddle_frame_encode(&(kn_paddle_frame){.kind = KN_PADDLE_FRAME_COMMAND, .flags = KN_PADDLE_FRAME_ENABLE}, bytes);
    hear(bytes, sizeof bytes);
    CHECK(heard == 0 && deframer.bad == 1);
}

TEST("sequence numbers count lost frames, also across the wrap, and a restarted paddle counts none")
{
    static const uint16_t seq[] = {65534, 65535, 0, 4, 0};
    begin();
    for (int i = 0; i < 5; i++) {
        hear(state(seq[i]), KN_PADDLE_FRAME_SIZE);
        CHECK(deframer.lost == (i < 3 ? 0 : 3));
    }
}

TESTS_MAIN
