#ifndef KN_SERVER_BACKEND_FRAME_H
#define KN_SERVER_BACKEND_FRAME_H
// What a computer and a board say to each other over a serial line: frames, and the word-bus operations in them.
// Driver and simulated device use this file, and the circuit (hdl/rtl/knead_link*.v) is held to it byte for byte.
//
//     wire      COBS( payload | CRC-32 of the payload, u32 ) 0x00
//     request   tag u16 | operations ...                              1..1024 bytes, as every payload
//               0x01 READ  address u24 | count u8                     -> count words
//               0x02 WRITE address u24 | count u8 | words u32 ...     -> nothing
//               0x03 WAIT  address u24 | mask u32 | value u32 | limit u16  -> one word: the last read
//     reply     tag u16 | status u8 | words u32 ...
//
// Everything little-endian. Addresses count 32-bit words and wrap behind 2^24 - 1. COBS (Cheshire and Baker 1999)
// leaves no 0x00 in a frame, so whatever came before, a receiver hears the next whole frame behind a 0x00. The checksum
// is zlib's. Nothing here allocates, locks or calls the kernel: real-time safe, each call bounded by the bytes it is
// given, kn_request_execute by the reads that its WAITs ask for.
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define KN_FRAMER_PAYLOAD 1024 // bytes at most; the circuit's buffers hold one payload and its checksum
#define KN_FRAMER_WIRE 1034    // of the longest payload, its checksum and their five block lengths, and the 0x00

// Returns the bytes of the frame, its 0x00 included; 0 when size is 0 or above KN_FRAMER_PAYLOAD.
size_t kn_framer_encode(const uint8_t *payload, size_t size, uint8_t wire[KN_FRAMER_WIRE]);

// A receiver; zeroed it is ready. What is wrong is dropped whole and counted once, as the first that holds: length
// (more than 1028 bytes within the coding), cobs (ended amid a block, or with an empty block behind a full one, so that
// no two strings of bytes are the same frame), length (fewer than 5), crc. A 0x00 behind a 0x00 is nothing at all, so
// that a sender may begin with one.
typedef struct kn_framer {
    int64_t frames, crc, cobs, length; // counters
    // private
    uint16_t size; // of what bytes holds; one more than they are: too long
    uint8_t left;  // bytes of the block that have not come
    uint8_t code;  // the block's length byte; 0: no block yet
    bool hollow;   // the block is empty and follows a full one
    uint8_t bytes[KN_FRAMER_PAYLOAD + 4];
} kn_framer;

// Takes bytes up to the end of the first good frame or of the chunk, and tells how many in used. Returns the size of
// that frame's payload, which stands in framer->bytes until the next call; 0: no frame ended here.
size_t kn_framer_read(kn_framer *framer, const uint8_t *bytes, size_t count, size_t *used);

// ---- requests, at the driver ----

#define KN_REQUEST_READ_MOST 255  // words in one request, all its READs and WAITs together: what a reply can carry
#define KN_REQUEST_WRITE_MOST 254 // words in one request when it is one WRITE

typedef struct kn_request { // ro
    uint16_t size;          // bytes of the payload
    uint16_t words;         // that a reply of status ok carries
    uint8_t bytes[KN_FRAMER_PAYLOAD];
} kn_request;

void kn_request_begin(kn_request *request, uint16_t tag);
// Each adds an operation. False, and nothing is added: it or its reply would not fit, count is not 1..255, or the
// address is above 2^24 - 1.
bool kn_request_read(kn_request *request, uint32_t address, uint32_t count);
bool kn_request_write(kn_request *request, uint32_t address, const uint32_t *words, uint32_t count);
// Reads until (word & mask) == value, limit * 256 times at most, once when limit is 0.
bool kn_request_wait(kn_request *request, uint32_t address, uint32_t mask, uint32_t value, uint16_t limit);

typedef enum kn_reply_status {
    KN_REPLY_OK,
    KN_REPLY_MALFORMED, // nothing of the offending operation and of those behind it was done
    KN_REPLY_BUS,       // the bus refused a word: nothing behind that word was done
    KN_REPLY_TIMEOUT    // a WAIT ran out, its last read is the last word; nothing behind it was done
} kn_reply_status;

typedef struct kn_reply {
    uint16_t tag, count;
    kn_reply_status status;
    uint32_t words[KN_REQUEST_READ_MOST]; // count of them: of what was done, in order
} kn_reply;

// False: these bytes are no reply, or none to this request: its tag, and as many words as it asked for or, where status
// is not ok, at most as many. reply is then as it happens.
bool kn_reply_parse(kn_reply *reply, const kn_request *request, const uint8_t *payload, size_t size);

// ---- requests, at the device ----

typedef struct kn_word_bus {
    void *self;
    bool (*read)(void *self, uint32_t address, uint32_t *word); // false: a bus error
    bool (*write)(void *self, uint32_t address, uint32_t word);
} kn_word_bus;

// Does what a payload of 1..1024 bytes asks for, in order, and makes the reply. Returns its size, 3..1023. Malformed
// are an operation that is unknown, cut off or of no words, one whose words would no longer fit into the reply, a
// payload without any; one of a single byte is answered as if its tag had gone on with 0.
size_t kn_request_execute(const uint8_t *payload, size_t size, const kn_word_bus *bus,
                          uint8_t reply[KN_FRAMER_PAYLOAD]);

#endif
