// Engine `rtl`: the circuit of hdl/rtl and its serial link, both simulated by Verilator. Each has its own clock, which
// runs only while it is used. The circuit runs for the few cycles of a bus transfer. The link runs one cycle for each
// received byte, and until it has answered a frame.
#include "Vknead_engine.h"
#include "Vknead_link.h"
#include "hdl/sim/word_bus.h"
#include <new>
extern "C" {
#include "clients/simdev/engine.h"
}

namespace
{

struct link : circuit<Vknead_link> {
    uint32_t answers = 0; // number of answers since reset; if smaller than the number of frames, the link is busy
    size_t size = 0;      // number of bytes of the present answer so far

    explicit link(int seed) : circuit(seed)
    {
        top->rst = 1;
        top->rx_valid = 0;
        top->tx_ready = 1;
        for (int i = 0; i < 4; i++) clock();
        top->rst = 0;
    }
    // Run one clock cycle of the link. Return true if the link has sent the last byte of an answer.
    bool run(const kn_word_bus &bus, uint8_t *wire)
    {
        top->bus_ready = 1;
        settle();
        serve(*top, bus);
        if (top->tx_valid && size < KN_FRAMER_WIRE) wire[size++] = top->tx_data;
        const bool last = top->tx_valid && top->tx_data == 0;
        rise();
        return last;
    }
    size_t hear(const kn_word_bus *bus, const uint8_t *bytes, size_t count, size_t *used, uint8_t *wire)
    {
        *used = 0;
        while (*used < count || answers != top->frames) { // the link counts a frame in the clock cycle of its 0x00
            top->rx_valid = *used < count && answers == top->frames && top->rx_ready;
            if (top->rx_valid) top->rx_data = bytes[(*used)++];
            if (!run(*bus, wire)) continue;
            answers++;
            const size_t answer = size;
            size = 0;
            return answer;
        }
        return 0;
    }
};

struct rtl : word_bus<Vknead_engine> {
    const int power_ups; // number of power-ups; after each, the memories have different random contents
    link line;

    explicit rtl(int seed) : word_bus(seed), power_ups(seed), line(seed) {}
    static rtl *of(void *self) { return static_cast<rtl *>(self); }
    static bool read_word(void *self, uint32_t address, uint32_t *word)
    {
        *word = 0;
        return of(self)->transfer(false, address, word);
    }
    static bool write_word(void *self, uint32_t address, uint32_t word)
    {
        return of(self)->transfer(true, address, &word);
    }
    static void blank(void *self)
    {
        const int power_ups = of(self)->power_ups + 1;
        of(self)->~rtl();
        new (self) rtl(power_ups);
    }
    static size_t hear(void *self, const kn_word_bus *bus, const uint8_t *bytes, size_t count, size_t *used,
                       uint8_t *wire)
    {
        return of(self)->line.hear(bus, bytes, count, used, wire);
    }
    static void destroy(void *self) { delete of(self); }
};

} // namespace

extern "C" bool kn_engine_rtl(kn_engine *engine)
{
    rtl *self = new (std::nothrow) rtl(1);
    if (self) *engine = {"rtl", {self, rtl::read_word, rtl::write_word}, rtl::blank, nullptr, rtl::hear, rtl::destroy};
    return self;
}
