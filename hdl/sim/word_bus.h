#ifndef KN_HDL_SIM_WORD_BUS_H
#define KN_HDL_SIM_WORD_BUS_H
// A Verilated circuit, and both ends of a word bus (hdl/REGISTERS.md): a host, and what a circuit has access to.
#include <cstdint>
#include <memory>

#include "verilated.h"
extern "C" {
#include "server/backend/frame.h"
}

// A Verilated circuit, powered up with random memories and registers from the seed; seed 0: zeros.
template <typename verilated> struct circuit {
    VerilatedContext context;
    std::unique_ptr<verilated> top;
    uint64_t clocks = 0;

    explicit circuit(int seed)
    {
        context.randReset(seed ? 2 : 0);
        context.randSeed(seed);
        top.reset(new verilated(&context));
    }
    ~circuit() { top->final(); }
    void settle() // first half of a clock: the outputs follow the inputs
    {
        top->clk = 0;
        top->eval();
    }
    void rise() // second half: the registers take their next values
    {
        top->clk = 1;
        top->eval();
        clocks++;
    }
    void clock()
    {
        settle();
        rise();
    }
};

template <typename verilated> struct word_bus : circuit<verilated> {
    using circuit<verilated>::top;
    using circuit<verilated>::clock;

    explicit word_bus(int seed) : circuit<verilated>(seed)
    {
        top->rst = 1;
        top->bus_valid = 0;
        for (int i = 0; i < 4; i++) clock();
        top->rst = 0;
    }
    // Transfer one word. Return true if it was taken; *word is written or, when !write, read.
    bool transfer(bool write, uint32_t address, uint32_t *word)
    {
        top->bus_valid = 1;
        top->bus_write = write;
        top->bus_addr = address;
        top->bus_wdata = *word;
        int waited = 0;
        do {
            clock();
            if (++waited > 100) return false;
        } while (!top->bus_ready);
        if (!write) *word = top->bus_rdata;
        const bool taken = !top->bus_error;
        clock(); // the clock with valid and ready
        top->bus_valid = 0;
        return taken;
    }
};

// Answer the transfer that a circuit asks for in this clock, if it does.
template <typename verilated> void serve(verilated &top, const kn_word_bus &bus)
{
    if (!top.bus_valid || !top.bus_ready) return;
    uint32_t word = 0;
    top.bus_error =
        !(top.bus_write ? bus.write(bus.self, top.bus_addr, top.bus_wdata) : bus.read(bus.self, top.bus_addr, &word));
    top.bus_rdata = word;
}

#endif
