// libFuzzer target: any bytes from a serial line. Each frame between two 0x00 is in one counter. An accepted frame is
// answered by a device, and encoded again gives the same bytes. The same bytes as the payload of a valid frame are
// heard and answered as well.
#include "server/backend/frame.h"
#include "tests/fuzz/fuzz.h"
#include <string.h>

typedef struct memory {
    uint32_t words[64];
    int reads;
} memory;

static bool memory_read(void *self, uint32_t address, uint32_t *word)
{
    memory *m = self;
    *word = m->words[address % 64];
    // more than a reply holds; the limit keeps a WAIT from running for its 16 million reads
    return address % 1024 < 1000 && ++m->reads < 300;
}

static bool memory_write(void *self, uint32_t address, uint32_t word)
{
    ((memory *)self)->words[address % 64] = word;
    return address % 1024 < 1000;
}

static void serve(const uint8_t *payload, size_t size)
{
    memory m = {0};
    const kn_word_bus bus = {&m, memory_read, memory_write};
    uint8_t bytes[KN_FRAMER_PAYLOAD], wire[KN_FRAMER_WIRE];
    kn_request asked = {.size = (uint16_t)size, .words = KN_REQUEST_READ_MOST};
    kn_reply reply;
    kn_framer f = {0};
    size_t used, replied = kn_request_execute(payload, size, &bus, bytes);
    memcpy(asked.bytes, payload, size);
    require(kn_framer_read(&f, wire, kn_framer_encode(bytes, replied, wire), &used) == replied);
    require(memcmp(f.bytes, bytes, replied) == 0);
    asked.words = (uint16_t)((replied - 3) / 4);
    require(kn_reply_parse(&reply, &asked, f.bytes, replied));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    kn_framer f = {0};
    int64_t ended = 0, filled = 0;
    uint8_t payload[KN_FRAMER_PAYLOAD], wire[KN_FRAMER_WIRE];
    for (size_t i = 0; i < size; i++) {
        ended += data[i] == 0 && filled > 0;
        filled = data[i] ? filled + 1 : 0;
    }
    for (size_t at = 0, used, heard; at < size; at += used) {
        heard = kn_framer_read(&f, data + at, size - at, &used);
        require(used > 0 && used <= size - at && heard <= KN_FRAMER_PAYLOAD);
        memcpy(payload, f.bytes, heard);
        if (heard == 0) continue;
        size_t again = kn_framer_encode(payload, heard, wire);
        require(again <= at + used && memcmp(wire, data + at + used - again, again) == 0);
        serve(payload, heard);
    }
    require(f.frames + f.crc + f.cobs + f.length == ended);
    size_t used, most = size < sizeof payload ? size : sizeof payload;
    kn_framer_read(&f, (const uint8_t[]){0}, 1, &used);
    require(kn_framer_read(&f, wire, kn_framer_encode(data, most, wire), &used) == most);
    if (most) serve(data, most);
    return 0;
}
