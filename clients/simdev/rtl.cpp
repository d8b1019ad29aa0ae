// The circuit itself, Verilated, behind its word bus. Its time is its own: a transfer is a few clocks, nothing else is.
#include "Vknead_engine.h"
#include "hdl/sim/word_bus.h"
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

struct rtl : word_bus<Vknead_engine> {
    int power_ups = 1; // each leaves something else in memories

    rtl() : word_bus(1) {}
};

bool read_word(void *self, uint32_t address, uint32_t *word)
{
    *word = 0;
    return static_cast<rtl *>(self)->transfer(false, address, word);
}

bool write_word(void *self, uint32_t address, uint32_t word)
{
    return static_cast<rtl *>(self)->transfer(true, address, &word);
}

void blank(void *self)
{
    rtl *it = static_cast<rtl *>(self);
    it->power_up(++it->power_ups);
    it->reset();
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
