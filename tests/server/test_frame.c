// The frames of the serial link and the operations in them. KN_FRAMES=N: number of frames with a random
// payload (1000000).
#include "server/backend/frame.h"
#include "tests/check.h"
#include "tests/dice.h"

static uint64_t seed = 0x9e3779b97f4a7c15u;

static uint32_t chance(uint32_t below) { return (uint32_t)kn_dice_in(&seed, 0, below); }

// A second COBS encoder, written as in the paper: the length of a block is written when the block has ended.
static size_t stuff(const uint8_t *bytes, size_t size, uint8_t *wire)
{
    size_t length_at = 0, out = 1;
    for (size_t i = 0; i < size; i++) {
        if (bytes[i]) wire[out++] = bytes[i];
        bool full = out - length_at == 255;
        if (bytes[i] && (!full || i + 1 == size)) continue;
        wire[length_at] = (uint8_t)(out - length_at);
        length_at = out++;
        if (full && !bytes[i]) wire[length_at] = 1, length_at = out++;
    }
    wire[length_at] = (uint8_t)(out - length_at);
    wire[out++] = 0;
    return out;
}

static size_t hear(kn_framer *f, const uint8_t *wire, size_t size)
{
    size_t heard = 0;
    for (size_t at = 0, used, payload; at < size; at += used)
        if ((payload = kn_framer_read(f, wire + at, size - at, &used)) != 0) heard = payload;
    return heard;
}

// Fill a payload. kind: 0 zeros, 1 no zeros, 2 few zeros, 3 random bytes.
static void fill(uint8_t *payload, size_t size, int kind)
{
    for (size_t i = 0; i < size; i++)
        payload[i] = (uint8_t)(kind == 0                       ? 0
                               : kind == 1                     ? 1 + chance(255)
                               : kind == 2 && chance(200) == 0 ? 0
                                                               : chance(256));
}

TEST("the standard nine test bytes have the standard checksum on the wire")
{
    const uint8_t expected[] = {14, '1', '2', '3', '4', '5', '6', '7', '8', '9', 0x26, 0x39, 0xf4, 0xcb, 0};
    uint8_t wire[KN_FRAMER_WIRE];
    CHECK(kn_framer_encode((const uint8_t *)"123456789", 9, wire) == sizeof expected);
    CHECK(memcmp(wire, expected, sizeof expected) == 0);
}

TEST("payloads of 1 to 1024 bytes are decoded from chunks of any size, and other sizes are refused")
{
    uint8_t payload[KN_FRAMER_PAYLOAD + 1] = {0}, wire[KN_FRAMER_WIRE];
    kn_framer f = {0};
    int64_t sent = 0;
    CHECK(kn_framer_encode(payload, 0, wire) == 0);
    CHECK(kn_framer_encode(payload, KN_FRAMER_PAYLOAD + 1, wire) == 0);
    for (int kind = 0; kind < 4; kind++)
        for (size_t size = 1; size <= KN_FRAMER_PAYLOAD; size++, sent++) {
            fill(payload, size, kind);
            size_t bytes = kn_framer_encode(payload, size, wire), heard = 0, used = 0;
            CHECK(bytes <= KN_FRAMER_WIRE && memchr(wire, 0, bytes) == wire + bytes - 1);
            for (size_t at = 0; at < bytes; at += used) {
                size_t chunk = 1 + chance(300);
                heard = kn_framer_read(&f, wire + at, chunk < bytes - at ? chunk : bytes - at, &used);
            }
            CHECK(heard == size && memcmp(f.bytes, payload, size) == 0);
        }
    CHECK(f.frames == sent && f.crc + f.cobs + f.length == 0);
}

TEST("an empty block after a final block of 254 bytes is a second encoding of a frame and is refused")
{
    uint8_t payload[250], wire[KN_FRAMER_WIRE];
    kn_framer f = {0};
    size_t bytes;
    do { // repeat until the checksum contains no 0
        fill(payload, sizeof payload, 1);
        bytes = kn_framer_encode(payload, sizeof payload, wire);
    } while (bytes != 256 || wire[0] != 255);
    CHECK(hear(&f, wire, bytes) == sizeof payload);
    wire[255] = 1, wire[256] = 0;
    CHECK(hear(&f, wire, 257) == 0 && f.cobs == 1);
}

TEST("each invalid frame is counted once: as length, coding or checksum")
{
    static uint8_t wire[2 * KN_FRAMER_WIRE];
    uint8_t longest[KN_FRAMER_PAYLOAD + 5];
    kn_framer f = {0};
    const uint8_t empty[] = {0, 0, 0}, four[] = {5, 1, 2, 3, 4, 0}, amid[] = {9, 1, 2, 3, 0};
    CHECK(hear(&f, empty, sizeof empty) == 0 && f.frames + f.crc + f.cobs + f.length == 0);
    CHECK(hear(&f, four, sizeof four) == 0 && f.length == 1);
    CHECK(hear(&f, amid, sizeof amid) == 0 && f.cobs == 1);
    fill(longest, sizeof longest, 3);
    CHECK(hear(&f, wire, stuff(longest, sizeof longest - 1, wire)) == 0 && f.crc == 1);
    CHECK(hear(&f, wire, stuff(longest, sizeof longest, wire)) == 0 && f.length == 2);
    memset(wire, 1, sizeof wire); // more than a thousand zeros, encoded without an end
    CHECK(hear(&f, wire, sizeof wire) == 0 && f.length == 2);
    CHECK(hear(&f, empty, 1) == 0 && f.length == 3);
    CHECK(f.frames == 0 && f.crc == 1 && f.cobs == 1);
}

TEST("a frame with a flipped bit or a cut is rejected, and the next frame is received")
{
    const uint8_t good[] = {5, 'g', 'o', 'o', 'd'};
    uint8_t payload[KN_FRAMER_PAYLOAD], wire[KN_FRAMER_WIRE], after[KN_FRAMER_WIRE];
    size_t sizes[] = {1, 2, 7, 20, 61, 249, 250, 251, 300}, tries = 0, rest = kn_framer_encode(good, 5, after);
    for (size_t s = 0; s < sizeof sizes / sizeof *sizes; s++)
        for (int kind = 0; kind < 4; kind++) {
            fill(payload, sizes[s], kind);
            size_t bytes = kn_framer_encode(payload, sizes[s], wire);
            for (size_t bit = 0; bit < 8 * bytes; bit++, tries++) {
                kn_framer f = {0};
                wire[bit / 8] ^= (uint8_t)(1 << bit % 8);
                CHECK(hear(&f, wire, bytes) == 0 && hear(&f, (const uint8_t[]){0}, 1) == 0 && f.frames == 0);
                CHECK(hear(&f, after, rest) == sizeof good);
                wire[bit / 8] ^= (uint8_t)(1 << bit % 8);
            }
            for (size_t cut = 0; cut + 1 < bytes; cut++, tries++) {
                kn_framer f = {0};
                CHECK(hear(&f, wire, cut) == 0 && hear(&f, (const uint8_t[]){0}, 1) == 0 && f.frames == 0);
                CHECK(hear(&f, after, rest) == sizeof good);
            }
        }
    printf("     %zu flips and cuts\n", tries);
}

TEST("a random payload under the head and the checksum of another frame is rejected")
{
    int64_t count = getenv("KN_FRAMES") ? atoll(getenv("KN_FRAMES")) : 1000000, heard = 0;
    uint8_t bytes[KN_FRAMER_PAYLOAD + 4], wire[KN_FRAMER_WIRE];
    kn_framer good = {0}, f = {0};
    for (int64_t i = 0; i < count; i++) {
        kn_request r;
        uint32_t words[16];
        for (int w = 0; w < 16; w++) words[w] = chance(UINT32_MAX);
        kn_request_begin(&r, (uint16_t)i);
        kn_request_write(&r, chance(1 << 24), words, 1 + chance(16));
        heard += hear(&good, wire, kn_framer_encode(r.bytes, r.size, wire)) == r.size;
        memcpy(bytes, good.bytes, r.size + 4u);
        fill(bytes + 7, r.size - 7u, 3);
        hear(&f, wire, stuff(bytes, r.size + 4u, wire));
    }
    CHECK(heard == count);
    CHECK(f.frames == 0 && f.crc == count && f.cobs + f.length == 0);
    printf("     %lld frames, %lld taken\n", (long long)count, (long long)f.frames);
}

// ---- operations ----

typedef struct memory { // 256 words from address 2^24 - 128 on, wrapping around; other addresses are bus errors
    uint32_t words[256];
    int reads, writes;
    int met_at; // from this read on the word at address 0 is 7
} memory;

static uint32_t *find(memory *m, uint32_t address)
{
    uint32_t i = (address + 128) % (1 << 24);
    return i < 256 ? &m->words[i] : NULL;
}

static bool memory_read(void *self, uint32_t address, uint32_t *word)
{
    memory *m = self;
    m->reads++;
    if (!find(m, address)) return false;
    *word = address == 0 && m->met_at ? (m->reads >= m->met_at ? 7 : 0) : *find(m, address);
    return true;
}

static bool memory_write(void *self, uint32_t address, uint32_t word)
{
    memory *m = self;
    m->writes++;
    if (!find(m, address)) return false;
    *find(m, address) = word;
    return true;
}

static kn_reply asked(memory *m, const kn_request *r)
{
    const kn_word_bus bus = {m, memory_read, memory_write};
    uint8_t bytes[KN_FRAMER_PAYLOAD];
    kn_reply reply;
    CHECK(kn_reply_parse(&reply, r, bytes, kn_request_execute(r->bytes, r->size, &bus, bytes)));
    return reply;
}

TEST("written words are read back, also across the end of the address space")
{
    uint32_t words[KN_REQUEST_WRITE_MOST];
    memory m = {0};
    kn_request r;
    for (uint32_t i = 0; i < 254; i++) words[i] = 0x01020304u * i;
    kn_request_begin(&r, 0xbeef);
    CHECK(kn_request_write(&r, (1 << 24) - 128, words, 254));
    kn_reply reply = asked(&m, &r);
    CHECK(reply.status == KN_REPLY_OK && reply.tag == 0xbeef && reply.count == 0 && m.writes == 254);
    kn_request_begin(&r, 1);
    CHECK(kn_request_read(&r, (1 << 24) - 128, 254) && kn_request_read(&r, 0, 1));
    CHECK(!kn_request_read(&r, 0, 1) && !kn_request_wait(&r, 0, 0, 0, 0));
    reply = asked(&m, &r);
    CHECK(reply.status == KN_REPLY_OK && reply.count == 255 && memcmp(reply.words, words, sizeof words) == 0);
    CHECK(reply.words[254] == words[128]);
}

TEST("operations are executed in order, and their words are returned in order")
{
    memory m = {0};
    kn_request r;
    kn_request_begin(&r, 2);
    CHECK(kn_request_write(&r, 5, (const uint32_t[]){10, 11}, 2) && kn_request_read(&r, 5, 2));
    CHECK(kn_request_write(&r, 5, (const uint32_t[]){12}, 1) && kn_request_wait(&r, 5, 0xff, 12, 0));
    CHECK(kn_request_read(&r, 6, 1) && r.words == 4);
    kn_reply reply = asked(&m, &r);
    CHECK(reply.status == KN_REPLY_OK && reply.count == 4 && reply.words[0] == 10 && reply.words[1] == 11);
    CHECK(reply.words[2] == 12 && reply.words[3] == 11);
}

TEST("a WAIT reads until the word matches or limit times 256 reads have passed; the operations behind it wait")
{
    kn_request r;
    kn_request_begin(&r, 3);
    CHECK(kn_request_wait(&r, 0, 0xf, 7, 2) && kn_request_write(&r, 1, (const uint32_t[]){1}, 1));
    memory soon = {.met_at = 512}, late = {.met_at = 513};
    kn_reply reply = asked(&soon, &r);
    CHECK(reply.status == KN_REPLY_OK && reply.words[0] == 7 && soon.reads == 512 && soon.writes == 1);
    reply = asked(&late, &r);
    CHECK(reply.status == KN_REPLY_TIMEOUT && reply.count == 1 && reply.words[0] == 0);
    CHECK(late.reads == 512 && late.writes == 0);
}

TEST("a bus error ends a request, and the words read before it are returned")
{
    memory m = {.words = {[254] = 4, [255] = 5}};
    kn_request r;
    kn_request_begin(&r, 4);
    CHECK(kn_request_read(&r, 126, 4) && kn_request_write(&r, 1, (const uint32_t[]){1}, 1));
    kn_reply reply = asked(&m, &r);
    CHECK(reply.status == KN_REPLY_BUS && reply.count == 2 && reply.words[0] == 4 && reply.words[1] == 5);
    CHECK(m.reads == 3 && m.writes == 0);
    kn_request_begin(&r, 4);
    CHECK(kn_request_write(&r, 127, (const uint32_t[]){1, 2, 3}, 3));
    reply = asked(&m, &r);
    CHECK(reply.status == KN_REPLY_BUS && reply.count == 0 && m.writes == 2 && m.words[255] == 1);
    kn_request_begin(&r, 4);
    CHECK(kn_request_wait(&r, 128, 0, 0, 1));
    reply = asked(&m, &r);
    CHECK(reply.status == KN_REPLY_BUS && reply.count == 0);
}

TEST("a malformed operation is not executed, and the operations before it are; half a tag is answered, too")
{
    static const struct {
        int size, words;
        uint8_t bytes[24];
    } wrong[] = {
        {0, 0, {0}},                                      // no operation
        {1, 0, {0}},                                      // unknown
        {1, 0, {4}},                                      // unknown
        {1, 0, {0xff}},                                   // unknown
        {1, 0, {1}},                                      // READ, cut off
        {4, 0, {1, 1, 0, 0}},                             // READ without a count
        {5, 0, {1, 1, 0, 0, 0}},                          // READ of no words
        {4, 0, {2, 1, 0, 0}},                             // WRITE without a count
        {5, 0, {2, 1, 0, 0, 0}},                          // WRITE of no words
        {8, 0, {2, 1, 0, 0, 1, 9, 9, 9}},                 // WRITE, a word cut off
        {13, 0, {2, 1, 0, 0, 3, 1, 1, 1, 1, 2, 2, 2, 2}}, // WRITE, a word missing
        {13, 0, {3}},                                     // WAIT, cut off
        {10, 1, {1, 2, 0, 0, 1, 1, 2, 0, 0, 255}},        // READ of more than a reply holds
        {6, 1, {1, 2, 0, 0, 1, 7}},                       // bytes behind the last operation
    };
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        memory m = {0};
        kn_request r;
        kn_request_begin(&r, 5);
        int before = wrong[i].size ? kn_request_write(&r, 3, (const uint32_t[]){42}, 1) : 0;
        memcpy(r.bytes + r.size, wrong[i].bytes, (size_t)wrong[i].size);
        r.size = (uint16_t)(r.size + wrong[i].size);
        r.words = 255;
        kn_reply reply = asked(&m, &r);
        CHECK(reply.status == KN_REPLY_MALFORMED && reply.count == wrong[i].words);
        CHECK(m.writes == before && m.reads == wrong[i].words && *find(&m, 3) == (before ? 42 : 0));
    }
    uint8_t bytes[KN_FRAMER_PAYLOAD];
    CHECK(kn_request_execute((const uint8_t[]){9}, 1, &(kn_word_bus){0}, bytes) == 3);
    CHECK(bytes[0] == 9 && bytes[1] == 0 && bytes[2] == KN_REPLY_MALFORMED);
}

TEST("an operation that does not fit into a request is refused and leaves the request unchanged")
{
    uint32_t words[256] = {0};
    kn_request r;
    kn_request_begin(&r, 6);
    CHECK(!kn_request_write(&r, 0, words, 255) && !kn_request_write(&r, 0, words, 0));
    CHECK(!kn_request_read(&r, 0, 256) && !kn_request_read(&r, 0, 0) && !kn_request_read(&r, 1 << 24, 1));
    CHECK(!kn_request_wait(&r, 1 << 24, 0, 0, 0) && !kn_request_write(&r, UINT32_MAX, words, 1));
    CHECK(r.size == 2 && r.words == 0);
    int waits = 0;
    while (kn_request_wait(&r, 0, 0, 0, 0)) waits++;
    CHECK(waits == 73 && r.size == 1024 && r.words == 73);
}

TEST("a malformed reply and a reply to another request are refused")
{
    const uint8_t good[] = {7, 0, 0, 1, 2, 3, 4};
    kn_request r;
    kn_reply reply;
    kn_request_begin(&r, 7);
    kn_request_read(&r, 0, 1);
    CHECK(kn_reply_parse(&reply, &r, good, 7) && reply.words[0] == 0x04030201);
    for (size_t size = 0; size < 7; size++) CHECK(!kn_reply_parse(&reply, &r, good, size));
    CHECK(!kn_reply_parse(&reply, &r, (const uint8_t[]){8, 0, 0, 1, 2, 3, 4}, 7));
    CHECK(!kn_reply_parse(&reply, &r, (const uint8_t[]){7, 0, 4, 1, 2, 3, 4}, 7));
    CHECK(!kn_reply_parse(&reply, &r, (const uint8_t[]){7, 0, 2, 1, 2, 3, 4, 1, 2, 3, 4}, 11));
    CHECK(kn_reply_parse(&reply, &r, (const uint8_t[]){7, 0, 2}, 3) && reply.status == KN_REPLY_BUS);
}

TESTS_MAIN
