#ifndef KN_SERVER_BACKEND_FRAME_H
#define KN_SERVER_BACKEND_FRAME_H
// Frames between a computer and a board on a serial line, and the word-bus operations in them. The driver and the
// simulated device use this file; the circuit (hdl/rtl/knead_link*.v) is tested to do the same, byte for byte.
//
//     wire      COBS( payload | CRC-32 of the payload, u32 ) 0x00
//     request   tag u16 | operations ...                              1..1024 bytes, as every payload
//               0x01 READ  address u24 | count u8                     -> count words
//               0x02 WRITE address u24 | count u8 | words u32 ...     -> nothing
//               0x03 WAIT  address u24 | mask u32 | value u32 | limit u16  -> one word: the last read
//     reply     tag u16 | status u8 | words u32 ...
//
// Everything is little-endian. Addresses count 32-bit words and wrap after 2^24 - 1. COBS (Cheshire and Baker 1999)
// leaves no 0x00 in a frame, so a receiver finds the next whole frame behind a 0x00, whatever came before. The checksum
// is zlib's. No function here allocates, locks or calls the kernel, so all are real-time safe. The time of a call is
// bounded by the bytes that it is given, that of kn_request_execute also by the reads of its WAITs.
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define KN_FRAMER_PAYLOAD 1024 // largest payload, bytes; the circuit's buffers hold one payload and its checksum
// Largest frame, bytes: the largest payload, its checksum, five length bytes of COBS blocks, and the final 0x00.
#define KN_FRAMER_WIRE 1034

// Encode a payload as a frame. Return the length of the frame including its final 0x00, bytes; 0 if `size` is 0 or
// above KN_FRAMER_PAYLOAD.
size_t kn_framer_encode(const uint8_t *payload, size_t size, uint8_t wire[KN_FRAMER_WIRE]);

uint32_t kn_framer_number(const uint8_t *from, int bytes); // return a little-endian number of 1 to 4 bytes

// A receiver, ready when zeroed. A faulty frame is dropped whole and counted once, under the first fault that it has:
// length (more than 1028 bytes after decoding); cobs (it ended within a block, or has an empty block behind a full one,
// which is refused so that a string of bytes has only one frame); length (fewer than 5); crc. A 0x00 behind a 0x00 has
// no effect, so a sender may begin with one.
typedef struct kn_framer {
    // Numbers of good frames, and of frames dropped for a wrong checksum, COBS coding or length.
    int64_t frames, crc, cobs, length;
    // Private.
    uint16_t size; // number of bytes decoded so far; one more than `bytes` can hold marks a frame that is too long
    uint8_t left;  // number of bytes of the present COBS block that have not arrived yet
    uint8_t code;  // length byte of the present COBS block; 0: no block has begun
    bool hollow;   // true if the present COBS block is empty and follows a full block
    uint8_t bytes[KN_FRAMER_PAYLOAD + 4];
} kn_framer;

// Read bytes up to the end of the first good frame, or all bytes if there is no good frame. Set *used to the number of
// bytes read. Return the size of that frame's payload, which stays in framer->bytes until the next call; 0: no good
// frame ended here.
size_t kn_framer_read(kn_framer *framer, const uint8_t *bytes, size_t count, size_t *used);

// ---- requests, at the driver ----

// Largest number of words of all READs and WAITs in one request; a reply cannot hold more.
#define KN_REQUEST_READ_MOST 255
#define KN_REQUEST_WRITE_MOST 254 // largest number of words in a request that consists of one WRITE

// A request. The fields are read-only.
typedef struct kn_request {
    uint16_t size;  // size of the payload, bytes
    uint16_t words; // number of words in a reply with status ok
    uint8_t bytes[KN_FRAMER_PAYLOAD];
} kn_request;

void kn_request_begin(kn_request *request, uint16_t tag);
// Add an operation. Return false and add nothing if the operation or its reply would not fit, if count is not 1..255,
// or if the address is above 2^24 - 1.
bool kn_request_read(kn_request *request, uint32_t address, uint32_t count);
bool kn_request_write(kn_request *request, uint32_t address, const uint32_t *words, uint32_t count);
// Add a read that is repeated until (word & mask) == value, limit * 256 times at most, or once if limit is 0.
bool kn_request_wait(kn_request *request, uint32_t address, uint32_t mask, uint32_t value, uint16_t limit);

typedef enum kn_reply_status {
    KN_REPLY_OK,
    KN_REPLY_MALFORMED, // the request has a faulty operation; this operation and all later ones were not executed
    KN_REPLY_BUS,       // the register bus refused a word; nothing after this word was executed
    // A WAIT reached its limit; the last word of the reply is the last one that the WAIT read, and no later operation
    // was executed.
    KN_REPLY_TIMEOUT
} kn_reply_status;

typedef struct kn_reply {
    uint16_t tag, count;
    kn_reply_status status;
    uint32_t words[KN_REQUEST_READ_MOST]; // [count] words read by the executed operations, in order
} kn_reply;

// Parse a reply. Return false if the bytes are no reply to this request. A reply has the request's tag and exactly the
// requested number of words; if the status is not ok, at most that number. When the return value is false, *reply is
// undefined.
bool kn_reply_parse(kn_reply *reply, const kn_request *request, const uint8_t *payload, size_t size);

// ---- requests, at the device ----

typedef struct kn_word_bus {
    void *self;
    bool (*read)(void *self, uint32_t address, uint32_t *word); // return false on a bus error
    bool (*write)(void *self, uint32_t address, uint32_t word);
} kn_word_bus;

// Execute the operations of a payload of 1..1024 bytes in order, and write the reply. Return the size of the reply,
// 3..1023 bytes. A request is malformed if an operation is unknown, is cut off, has no words, or needs more words than
// fit into the reply. A payload without operations is malformed as well. A payload of a single byte is answered as if
// the upper byte of its tag were 0.
size_t kn_request_execute(const uint8_t *payload, size_t size, const kn_word_bus *bus,
                          uint8_t reply[KN_FRAMER_PAYLOAD]);

#endif
