#include "server/backend/frame.h"
#include <string.h>
#include <zlib.h>

enum { READ = 1, WRITE = 2, WAIT = 3 };
// Bytes of a tag, of a reply's head, of a READ or WRITE without words, of a WAIT, of the checksum; the length byte of a
// full block; the number of addresses.
enum { TAG = 2, HEAD = 3, ACCESS = 5, POLL = 14, CHECKSUM = 4, BLOCK = 0xff, ADDRESSES = 1 << 24 };

// Little-endian numbers of 1 to 4 bytes.
static void put(uint8_t *to, uint32_t value, int bytes)
{
    for (int i = 0; i < bytes; i++) to[i] = (uint8_t)(value >> 8 * i);
}

uint32_t kn_framer_number(const uint8_t *from, int bytes)
{
    uint32_t value = 0;
    for (int i = 0; i < bytes; i++) value |= (uint32_t)from[i] << 8 * i;
    return value;
}

// ---- frames ----

// Append the checksum, then replace zeros by the lengths of blocks (COBS).
size_t kn_framer_encode(const uint8_t *payload, size_t size, uint8_t wire[KN_FRAMER_WIRE])
{
    uint8_t bytes[KN_FRAMER_PAYLOAD + CHECKSUM];
    if (size == 0 || size > KN_FRAMER_PAYLOAD) return 0;
    memcpy(bytes, payload, size);
    put(bytes + size, (uint32_t)crc32(0, payload, (uInt)size), CHECKSUM);
    size_t at = 0, end = size + CHECKSUM, out = 0;
    // A block has up to 254 bytes other than 0. A block of fewer than 254 bytes stands for these bytes and a 0 after
    // them.
    for (bool more = true; more;) {
        size_t run = 0;
        while (at + run < end && run < BLOCK - 1 && bytes[at + run]) run++;
        wire[out++] = (uint8_t)(run + 1);
        memcpy(wire + out, bytes + at, run);
        out += run, at += run;
        bool zero = at < end && run < BLOCK - 1;
        at += zero;
        // continue after a 0 at the very end of the payload, which needs an empty block after it
        more = zero || at < end;
    }
    wire[out++] = 0;
    return out;
}

// Store a decoded byte. `size` stops at one above the room, which marks the frame as too long.
static void append(kn_framer *f, uint8_t byte)
{
    if (f->size < sizeof f->bytes) f->bytes[f->size] = byte;
    if (f->size <= sizeof f->bytes) f->size++;
}

// Decode one byte of the line: data of a block, or the length byte of the next block, which stands for a 0 unless the
// block before was full.
static void decode(kn_framer *f, uint8_t byte)
{
    if (f->left > 0) {
        append(f, byte);
        f->left--;
        return;
    }
    if (f->code != 0 && f->code != BLOCK) append(f, 0);
    f->hollow = f->code == BLOCK && byte == 1;
    f->code = byte;
    f->left = (uint8_t)(byte - 1);
}

// Count the frame that has ended, under its first fault. Return the size of its payload; 0 if it is faulty or empty.
static size_t judge(kn_framer *f)
{
    size_t payload = f->size - (size_t)CHECKSUM;
    int64_t *counter = &f->frames;
    if (f->code == 0) return 0;
    if (f->size > sizeof f->bytes) counter = &f->length;
    else if (f->left > 0 || f->hollow) counter = &f->cobs;
    else if (f->size <= CHECKSUM) counter = &f->length;
    else if ((uint32_t)crc32(0, f->bytes, (uInt)payload) != kn_framer_number(f->bytes + payload, CHECKSUM))
        counter = &f->crc;
    ++*counter;
    return counter == &f->frames ? payload : 0;
}

size_t kn_framer_read(kn_framer *framer, const uint8_t *bytes, size_t count, size_t *used)
{
    for (size_t i = 0; i < count; i++) {
        if (bytes[i] != 0) {
            decode(framer, bytes[i]);
            continue;
        }
        // A 0x00 always ends the frame, so reset the receiver for the next frame.
        size_t payload = judge(framer);
        framer->size = 0;
        framer->code = framer->left = 0;
        framer->hollow = false;
        if (payload == 0) continue;
        *used = i + 1;
        return payload;
    }
    *used = count;
    return 0;
}

// ---- at the driver ----

void kn_request_begin(kn_request *request, uint16_t tag)
{
    put(request->bytes, tag, TAG);
    request->size = TAG;
    request->words = 0;
}

// Add an operation of `bytes` bytes that adds `words` words to the reply. Return its place, or NULL if the operation or
// the reply's words do not fit.
static uint8_t *place(kn_request *r, uint8_t operation, uint32_t address, uint32_t bytes, uint32_t words)
{
    if (address >= ADDRESSES || r->size + bytes > KN_FRAMER_PAYLOAD || r->words + words > KN_REQUEST_READ_MOST)
        return NULL;
    uint8_t *at = r->bytes + r->size;
    at[0] = operation;
    put(at + 1, address, 3);
    r->size = (uint16_t)(r->size + bytes);
    r->words = (uint16_t)(r->words + words);
    return at;
}

bool kn_request_read(kn_request *request, uint32_t address, uint32_t count)
{
    if (count == 0 || count > KN_REQUEST_READ_MOST) return false;
    uint8_t *at = place(request, READ, address, ACCESS, count);
    if (at) at[4] = (uint8_t)count;
    return at;
}

bool kn_request_write(kn_request *request, uint32_t address, const uint32_t *words, uint32_t count)
{
    if (count == 0 || count > KN_REQUEST_WRITE_MOST) return false;
    uint8_t *at = place(request, WRITE, address, ACCESS + 4 * count, 0);
    if (!at) return false;
    at[4] = (uint8_t)count;
    for (uint32_t i = 0; i < count; i++) put(at + ACCESS + 4 * i, words[i], 4);
    return true;
}

bool kn_request_wait(kn_request *request, uint32_t address, uint32_t mask, uint32_t value, uint16_t limit)
{
    uint8_t *at = place(request, WAIT, address, POLL, 1);
    if (!at) return false;
    put(at + 4, mask, 4);
    put(at + 8, value, 4);
    put(at + 12, limit, 2);
    return true;
}

bool kn_reply_parse(kn_reply *reply, const kn_request *request, const uint8_t *payload, size_t size)
{
    if (size < HEAD || (size - HEAD) % 4 || size > KN_FRAMER_PAYLOAD || payload[TAG] > KN_REPLY_TIMEOUT) return false;
    reply->tag = (uint16_t)kn_framer_number(payload, TAG);
    reply->status = (kn_reply_status)payload[TAG];
    reply->count = (uint16_t)((size - HEAD) / 4);
    for (int i = 0; i < reply->count; i++) reply->words[i] = kn_framer_number(payload + HEAD + 4 * i, 4);
    // A reply to an older request has another tag.
    return reply->tag == kn_framer_number(request->bytes, TAG) &&
           (reply->status == KN_REPLY_OK ? reply->count == request->words : reply->count <= request->words);
}

// ---- at the device ----

// A payload that is being executed.
typedef struct execution {
    const uint8_t *at, *end;
    const kn_word_bus *bus;
    uint8_t *reply;
    uint32_t words;
} execution;

// Take a number from the payload.
static uint32_t take(execution *e, int bytes)
{
    e->at += bytes;
    return kn_framer_number(e->at - bytes, bytes);
}

static void answer(execution *e, uint32_t word) { put(e->reply + HEAD + 4 * e->words++, word, 4); }

static kn_reply_status execute_read(execution *e)
{
    uint32_t address = take(e, 3), count = take(e, 1), word;
    if (count == 0 || e->words + count > KN_REQUEST_READ_MOST) return KN_REPLY_MALFORMED;
    for (uint32_t i = 0; i < count; i++) {
        if (!e->bus->read(e->bus->self, (address + i) % ADDRESSES, &word)) return KN_REPLY_BUS;
        answer(e, word);
    }
    return KN_REPLY_OK;
}

static kn_reply_status execute_write(execution *e)
{
    uint32_t address = take(e, 3), count = take(e, 1);
    if (count == 0 || (size_t)(e->end - e->at) < 4 * (size_t)count) return KN_REPLY_MALFORMED;
    for (uint32_t i = 0; i < count; i++)
        if (!e->bus->write(e->bus->self, (address + i) % ADDRESSES, take(e, 4))) return KN_REPLY_BUS;
    return KN_REPLY_OK;
}

// A WAIT that reaches its limit answers with the last word that it read.
static kn_reply_status execute_wait(execution *e)
{
    uint32_t address = take(e, 3), mask = take(e, 4), value = take(e, 4), limit = take(e, 2), word = 0;
    if (e->words + 1 > KN_REQUEST_READ_MOST) return KN_REPLY_MALFORMED;
    uint32_t reads = limit ? limit * 256 : 1;
    bool met = false;
    for (uint32_t i = 0; i < reads && !met; i++) {
        if (!e->bus->read(e->bus->self, address, &word)) return KN_REPLY_BUS;
        met = (word & mask) == value;
    }
    answer(e, word);
    return met ? KN_REPLY_OK : KN_REPLY_TIMEOUT;
}

// Execute one operation if all its arguments are present.
static kn_reply_status execute(execution *e)
{
    static const int sizes[] = {[READ] = ACCESS, [WRITE] = ACCESS, [WAIT] = POLL};
    uint32_t operation = take(e, 1);
    if (operation < READ || operation > WAIT || e->end - e->at < sizes[operation] - 1) return KN_REPLY_MALFORMED;
    if (operation == READ) return execute_read(e);
    if (operation == WRITE) return execute_write(e);
    return execute_wait(e);
}

size_t kn_request_execute(const uint8_t *payload, size_t size, const kn_word_bus *bus, uint8_t reply[KN_FRAMER_PAYLOAD])
{
    execution e = {payload, payload + size, bus, reply, 0};
    put(reply, size < TAG ? take(&e, 1) : take(&e, TAG), TAG);
    kn_reply_status status = e.at < e.end ? KN_REPLY_OK : KN_REPLY_MALFORMED;
    while (status == KN_REPLY_OK && e.at < e.end) status = execute(&e);
    reply[TAG] = (uint8_t)status;
    return HEAD + 4 * e.words;
}
