#ifndef KN_HDL_SIM_CIRCUIT_BENCH_H
#define KN_HDL_SIM_CIRCUIT_BENCH_H
// Shared parts of the benches: random numbers from a seed that is printed, a word bus that circuit and C code see
// alike, and a serial line.
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "hdl/sim/word_bus.h"

struct chance : std::mt19937_64 {
    using std::mt19937_64::mt19937_64;
    uint32_t below(uint32_t n) { return uint32_t(((*this)() >> 32) * n >> 32); }
    uint32_t word() { return below(2) ? below(UINT32_MAX) : below(2) ? 0 : below(256); }
};

// Return the number in an environment variable, or otherwise if it is not set.
inline long from_environment(const char *name, long otherwise)
{
    const char *text = getenv(name);
    return text ? atol(text) : otherwise;
}

[[noreturn]] inline void lost(const char *what)
{
    fprintf(stderr, "%s\n", what);
    exit(1);
}

// A memory behind the word bus. Words at 0 to 255 are memory, those from 0x800000 to 0x80ffff are bus errors, all
// others are a function of their address. The word at 16 counts its reads, so that a WAIT for it ends.
struct memory {
    uint32_t words[256] = {};
    std::vector<uint64_t> transfers; // (write, address, word) in order
    bool take(bool write, uint32_t address, uint32_t *word)
    {
        if (write && address < 256) words[address] = *word;
        if (!write) *word = address == 16 ? ++words[16] : address < 256 ? words[address] : address * 0x9e3779b1u;
        transfers.push_back(uint64_t(write) << 56 | uint64_t(address) << 32 | *word);
        return address >> 16 != 0x80;
    }
    kn_word_bus bus()
    {
        return {this,
                [](void *self, uint32_t a, uint32_t *w) { return static_cast<memory *>(self)->take(false, a, w); },
                [](void *self, uint32_t a, uint32_t w) { return static_cast<memory *>(self)->take(true, a, &w); }};
    }
};

// The C code as the device: its answers to the bytes of a line.
struct reference {
    memory words;
    kn_framer framer = {};
    std::vector<uint8_t> answer;
    long statuses[4] = {}; // answers by status
    void hear(const std::vector<uint8_t> &bytes)
    {
        const kn_word_bus bus = words.bus();
        uint8_t payload[KN_FRAMER_PAYLOAD], wire[KN_FRAMER_WIRE];
        for (size_t at = 0, used; at < bytes.size(); at += used) {
            size_t size = kn_framer_read(&framer, bytes.data() + at, bytes.size() - at, &used);
            if (size == 0) continue;
            size = kn_request_execute(framer.bytes, size, &bus, payload);
            statuses[payload[2] & 3]++;
            size = kn_framer_encode(payload, size, wire);
            answer.insert(answer.end(), wire, wire + size);
        }
    }
};

// A circuit on two wires.
template <typename verilated> struct serial_circuit : circuit<verilated> {
    using circuit<verilated>::top;
    const int bit;            // clocks
    double until = 0;         // the level of rx is known up to this clock
    int phase = -1, bits = 0; // of the byte that tx sends: clocks since its start bit began; its bits so far
    std::vector<uint8_t> answer;

    serial_circuit(int seed, int clocks_a_bit) : circuit<verilated>(seed), bit(clocks_a_bit) {}
    virtual void clock(bool level)
    {
        top->rx = level;
        this->settle();
        listen(top->tx);
        this->rise();
    }
    // Receive a byte at tx: sample each bit in its middle.
    void listen(bool level)
    {
        if (phase < 0 && level) return;
        phase++;
        if (phase % bit != bit / 2 || phase < bit) return;
        if (phase < 9 * bit) {
            bits = bits >> 1 | level << 7;
            return;
        }
        if (!level) lost("no stop bit at tx");
        answer.push_back(uint8_t(bits));
        phase = -1;
    }
    void hold(bool level, double count)
    {
        until += count;
        while (double(this->clocks) < until) clock(level);
    }
    // Send a byte at a rate relative to the nominal one.
    void send(uint8_t byte, double rate = 1)
    {
        hold(0, bit / rate);
        for (int i = 0; i < 8; i++) hold(byte >> i & 1, bit / rate);
        hold(1, bit / rate);
    }
};

// ---- random requests ----

inline std::vector<uint8_t> frame_of(const uint8_t *payload, size_t size)
{
    uint8_t wire[KN_FRAMER_WIRE];
    return {wire, wire + kn_framer_encode(payload, size, wire)};
}

inline uint32_t some_address(chance &c)
{
    const uint32_t places[] = {c.below(256), 16, 16, c.below(1 << 24), 0x7fff00 + c.below(257), 0xfffff8 + c.below(8)};
    return places[c.below(6)];
}

inline void some_operation(chance &c, kn_request &r)
{
    uint32_t words[KN_REQUEST_WRITE_MOST], count = 1 + (c.below(4) ? c.below(5) : c.below(255));
    for (uint32_t &word : words) word = c.word();
    switch (c.below(4)) {
    case 0: kn_request_read(&r, some_address(c), count); break;
    case 1: kn_request_write(&r, some_address(c), words, count); break;
    case 2: kn_request_wait(&r, 16, 0xff, c.below(256), uint16_t(c.below(3))); break;
    default: kn_request_wait(&r, some_address(c), c.word(), 0, uint16_t(c.below(2)));
    }
}

// Return a frame with up to five operations. One in eight is cut short, has bytes behind its end, or has a changed
// byte; its checksum is valid all the same.
inline std::vector<uint8_t> some_request(chance &c)
{
    kn_request r;
    kn_request_begin(&r, uint16_t(c.below(1 << 16)));
    for (uint32_t n = c.below(6); n > 0; n--) some_operation(c, r);
    if (c.below(8) == 0) switch (c.below(3)) {
        case 0: r.size = uint16_t(1 + c.below(r.size)); break;
        case 1:
            while (r.size < KN_FRAMER_PAYLOAD && c.below(20)) r.bytes[r.size++] = uint8_t(c.below(4));
            break;
        default: r.bytes[c.below(r.size)] = uint8_t(c.below(6));
        }
    return frame_of(r.bytes, r.size);
}

// Return a frame whose payload fills a block together with its checksum. Half of these get an empty block behind the
// full one and are refused. The others, and those with a 0 in the checksum, are accepted.
inline std::vector<uint8_t> full_block(chance &c)
{
    uint8_t payload[250];
    for (uint8_t &byte : payload) byte = uint8_t(1 + c.below(255));
    std::vector<uint8_t> bytes = frame_of(payload, sizeof payload);
    if (bytes[0] == 255 && c.below(2)) bytes.insert(bytes.end() - 1, 1);
    return bytes;
}

// Return noise: no zeros, few zeros or many zeros.
inline std::vector<uint8_t> some_bytes(chance &c)
{
    if (c.below(20) == 0) return full_block(c);
    std::vector<uint8_t> bytes(1 + c.below(c.below(8) ? 40 : 2500));
    uint32_t zeros = c.below(3);
    for (uint8_t &byte : bytes) byte = uint8_t(zeros == 0 ? 1 + c.below(255) : zeros == 1 ? c.below(256) : c.below(3));
    return bytes;
}

// Return a piece of a line: frames, spoilt frames and noise.
inline std::vector<uint8_t> some_line(chance &c)
{
    std::vector<uint8_t> line;
    for (uint32_t n = 1 + c.below(4); n > 0; n--) {
        std::vector<uint8_t> part = c.below(5) ? some_request(c) : some_bytes(c);
        switch (c.below(10)) {
        case 0: part[c.below(uint32_t(part.size()))] ^= uint8_t(1 << c.below(8)); break;
        case 1: part.resize(1 + c.below(uint32_t(part.size()))); break;
        case 2: part.push_back(0); break;
        default: break;
        }
        line.insert(line.end(), part.begin(), part.end());
    }
    return line;
}

#endif
