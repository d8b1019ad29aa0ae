#ifndef KN_CLIENTS_FRAME_H
#define KN_CLIENTS_FRAME_H
// What a serial paddle and its computer say to each other: frames of 20 bytes, the same in both directions. Little
// endian; README.md of this folder has the drawing and what a paddle's firmware has to do.
//
//     0      2      3       4     6             10             14          18    20
//     | K  N | kind | flags | seq | position_nm | velocity_um_s | force_un | CRC |
//
// Integers with units instead of floats: a microcontroller without a floating-point unit makes them of its encoder's
// counts, no bit pattern of them is a NaN, and 1 nm resolves every encoder over +-2.1 m. Neither direction has a frame
// longer than the other, so that one decoder serves both. CRC-16/CCITT-FALSE (polynomial 0x1021, begins with 0xffff,
// "123456789" gives 0x29b1) over the first 18 bytes.
//
// Bytes that are no frame are skipped: after a wrong checksum the search for K N goes on one byte behind the last one,
// inside what has been read already, so that a frame behind garbage is never lost with it.
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define KN_FRAME_SIZE 20

typedef enum kn_frame_kind {
    KN_FRAME_STATE = 1,  // paddle to computer, 1 kHz of its own clock
    KN_FRAME_COMMAND = 2 // computer to paddle: force_un; position and velocity are 0
} kn_frame_kind;

enum {                      // flags of a state; bits 4..7 are buttons 0..3
    KN_FRAME_MOTOR = 1,     // gives force
    KN_FRAME_TRIPPED = 2,   // its own watchdog has: no command for 20 ms; cleared by a command without KN_FRAME_ENABLE
    KN_FRAME_SATURATED = 4, // the motor cannot give what it was asked for
    KN_FRAME_BUTTON_0 = 16
};
enum { KN_FRAME_ENABLE = 1 }; // flags of a command: the motor may give force

typedef struct kn_frame {
    kn_frame_kind kind;
    uint8_t flags;
    uint16_t seq; // counts up by 1, wraps
    int32_t position_nm, velocity_um_s;
    int32_t force_un; // on the hand, along the position's axis; of a state: what the motor gives now
} kn_frame;

void kn_frame_encode(const kn_frame *frame, uint8_t bytes[KN_FRAME_SIZE]);
uint16_t kn_frame_crc(const uint8_t *bytes, size_t size);
// value in multiples of unit (1e-9 for nm), rounded, held within an int32. 0 for a NaN.
int32_t kn_frame_number(double value, double unit);

typedef struct kn_deframer { // zeroed but for kind
    kn_frame_kind kind;      // which it hears; its own echo, or a paddle set up as a computer, is counted as bad
    int64_t frames;
    int64_t bad;     // 20 bytes that begin with K N and have a wrong checksum or kind
    int64_t skipped; // bytes that were in no frame
    int64_t lost;    // by seq, frames that never came
    // private
    int count;
    uint8_t bytes[KN_FRAME_SIZE];
    uint16_t seq;
} kn_deframer;

// Takes one byte. True: it completed frame.
bool kn_deframer_push(kn_deframer *deframer, uint8_t byte, kn_frame *frame);

#endif
