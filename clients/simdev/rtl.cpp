// The circuit itself, Verilated, behind its word bus. Its time is its own: a transfer is a few clocks, nothing else is.
#include "Vknead_engine.h"
#include "verilated.h"
#include <memory>
#include <new>
extern "C" {
#include "clients/simdev/engine.h"
}

double sc_time_stamp()
{
    return 0;
}

namespace
{

struct rtl {
    VerilatedContext context;
    std::unique_ptr<Vknead_engine> top;
    int power_ups = 0;

    rtl() { power_up(); }
    void power_up()
    {
        context.randReset(2); // memories hold anything
        context.randSeed(++power_ups);
        top.reset(new Vknead_engine(&context));
        top->rst = 1;
        top->bus_valid = 0;
        for (int i = 0; i < 4; i++) clock();
        top->rst = 0;
    }
    void clock()
    {
        top->clk = 0;
        top->eval();
        top->clk = 1;
        top->eval();
    }
    bool transfer(bool write, uint32_t address, uint32_t &word)
    {
        top->bus_valid = 1;
        top->bus_write = write;
        top->bus_addr = address;
        top->bus_wdata = word;
        do clock();
        while (!top->bus_ready);
        word = top->bus_rdata;
        const bool taken = !top->bus_error;
        clock(); // the one with valid and ready
        top->bus_valid = 0;
        return taken;
    }
};

bool read_word(void *self, uint32_t address, uint32_t *word)
{
    *word = 0;
    return static_cast<rtl *>(self)->transfer(false, address, *word);
}

bool write_word(void *self, uint32_t address, uint32_t word)
{
    return static_cast<rtl *>(self)->transfer(true, address, word);
}

void blank(void *self)
{
    static_cast<rtl *>(self)->power_up();
}

void destroy(void *self)
{
    delete static_cast<rtl *>(self);
}

} // namespace

extern "C" bool kn_engine_rtl(kn_engine *engine)
{
    rtl *self = new (std::nothrow) rtl;
    if (!self) return false;
    *engine = kn_engine{"rtl", {self, read_word, write_word}, blank, nullptr, destroy};
    return true;
}
