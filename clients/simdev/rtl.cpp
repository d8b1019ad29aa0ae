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

double sc_time_stamp() { return 0; }

namespace
{

struct link : circuit<Vknead_link> {
    uint32_t answers; // number of answers since reset; if smaller than the number of frames, the link is busy
    size_t size;      // number of bytes of the present answer so far

    explicit link(int seed) : circuit(seed) { reset(); }
    void reset()
    {
        top->rst = 1;
        top->rx_valid = 0;
        top->tx_ready = 1;
        for (int i = 0; i < 4; i++) clock(nullptr, nullptr);
        top->rst = 0;
        answers = 0;
        size = 0;
    }
    // Run one clock cycle of the link. Return true if the link has sent the last byte of an answer.
    bool clock(const kn_word_bus *bus, uint8_t *wire)
    {
        top->clk = 0;
        top->eval();
        top->bus_ready = top->bus_valid && bus;
        if (top->bus_ready) transfer(*bus);
        const bool byte = wire && top->tx_valid;
        if (byte && size < KN_FRAMER_WIRE) wire[size++] = top->tx_data;
        const bool last = byte && top->tx_data == 0;
        top->clk = 1;
        top->eval();
        clocks++;
        return last;
    }
    void transfer(const kn_word_bus &bus)
    {
        uint32_t word = 0;
        top->bus_error = !(top->bus_write ? bus.write(bus.self, top->bus_addr, top->bus_wdata)
                                          : bus.read(bus.self, top->bus_addr, &word));
        top->bus_rdata = word;
    }
    size_t hear(const kn_word_bus *bus, const uint8_t *bytes, size_t count, size_t *used, uint8_t *wire)
    {
        *used = 0;
        while (*used < count || answers != top->frames) { // the link counts a frame in the clock cycle of its 0x00
            top->rx_valid = *used < count && answers == top->frames && top->rx_ready;
            if (top->rx_valid) top->rx_data = bytes[(*used)++];
            if (!clock(bus, wire)) continue;
            answers++;
            const size_t answer = size;
            size = 0;
            return answer;
        }
        return 0;
    }
};

struct rtl : word_bus<Vknead_engine> {
    int power_ups = 1; // number of power-ups; after each, the memories have different random contents
    link line{1};

    rtl() : word_bus(1) {}
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
        of(self)->power_up(++of(self)->power_ups);
        of(self)->reset();
        of(self)->line.power_up(of(self)->power_ups);
        of(self)->line.reset();
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
    rtl *self = new (std::nothrow) rtl;
    if (self) *engine = {"rtl", {self, rtl::read_word, rtl::write_word}, rtl::blank, nullptr, rtl::hear, rtl::destroy};
    return self;
}
