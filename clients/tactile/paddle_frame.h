#ifndef KN_CLIENTS_PADDLE_FRAME_H
#define KN_CLIENTS_PADDLE_FRAME_H
// Frames between a serial paddle and its computer. A frame has 20 bytes, little endian, and the same layout in both
// directions. README.md of this folder draws it, and specifies a paddle's firmware.
//
// The numbers are integers instead of floats for two reasons. A microcontroller without a floating-point unit can
// compute them from its encoder's counts, and no bit pattern is a NaN. position_nm has a resolution of 1 nm, finer than
// any encoder, and a range of +-2.1 m. Frames of both directions have the same length, so that one decoder serves both.
// A valid frame that follows garbage is never lost, because the search for the next K N resumes inside the bytes
// already read.
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define KN_PADDLE_FRAME_SIZE 20

typedef enum kn_paddle_frame_kind {
    KN_PADDLE_FRAME_STATE = 1,  // paddle to computer, at 1 kHz of the paddle's clock
    KN_PADDLE_FRAME_COMMAND = 2 // computer to paddle: force_un is set, position and velocity are 0
} kn_paddle_frame_kind;

enum {                         // flags of a state frame; bits 4..7 are buttons 0..3
    KN_PADDLE_FRAME_MOTOR = 1, // flag of a state frame: the paddle's motor is on
    // The paddle has switched its motor off by itself: no command for 20 ms, a start, or a broken sensor. A command
    // without KN_PADDLE_FRAME_ENABLE clears the trip.
    KN_PADDLE_FRAME_TRIPPED = 2,
    KN_PADDLE_FRAME_SATURATED = 4, // the motor cannot give the commanded force
    KN_PADDLE_FRAME_BUTTON_0 = 16
};
enum { KN_PADDLE_FRAME_ENABLE = 1 }; // flag of a command frame: the motor may give force

typedef struct kn_paddle_frame { // laid out as bytes 2 to 17 of the frame
    uint8_t kind;                // kn_paddle_frame_kind
    uint8_t flags;
    uint16_t seq; // increases by 1 with every frame; 65535 is followed by 0
    int32_t position_nm, velocity_um_s;
    // Force on the hand along the axis of position_nm. Command frame: force that the motor shall give. State frame:
    // force that the motor gives now.
    int32_t force_un;
} kn_paddle_frame;

// Encode a frame, including its CRC.
void kn_paddle_frame_encode(const kn_paddle_frame *frame, uint8_t bytes[KN_PADDLE_FRAME_SIZE]);
// Return the CRC-16/CCITT-FALSE of the bytes.
uint16_t kn_paddle_frame_crc(const uint8_t *bytes, size_t size);
// Return `value` as a multiple of `unit` (1e-9 for nm), rounded and clamped to an int32. Return 0 for a NaN.
int32_t kn_paddle_frame_number(double value, double unit);

// Decoder that finds the frames in a sequence of bytes. The caller sets `kind` and zeroes all other fields.
typedef struct kn_paddle_decoder {
    // Kind of frame that this decoder accepts. A frame of the other kind counts as bad, because it must be an echo of a
    // frame that this side has sent.
    kn_paddle_frame_kind kind;
    int64_t frames;
    int64_t bad;     // number of times that 20 bytes began with the letters K N but had a wrong CRC or kind
    int64_t skipped; // number of bytes outside any valid frame
    int64_t lost;    // number of missing frames, from gaps in the frames' field seq
    // The fields below are private.
    int count;
    uint8_t bytes[KN_PADDLE_FRAME_SIZE];
    uint16_t seq;
} kn_paddle_decoder;

// Pass one received byte to the decoder. If the byte completes a valid frame, write the frame to *frame and return
// true.
bool kn_paddle_decoder_push(kn_paddle_decoder *deframer, uint8_t byte, kn_paddle_frame *frame);

#endif
