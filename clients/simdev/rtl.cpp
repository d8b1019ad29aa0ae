// The circuits themselves, Verilated, behind their word bus. Their time is their own: a transfer is a few clocks, nothing else is.
#include "Vknead_engine.h"
#include "Vknead_nano.h"
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

template <typename verilated> struct rtl : word_bus<verilated> {
    int power_ups = 1; // each leaves something else in memories

    rtl() : word_bus<verilated>(1) {}
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
    }
    static void destroy(void *self) { delete of(self); }
    static bool make(kn_engine *engine, const char *name)
    {
        rtl *self = new (std::nothrow) rtl;
        if (self) *engine = kn_engine{name, {self, read_word, write_word}, blank, nullptr, destroy};
        return self;
    }
};

} // namespace

extern "C" bool kn_engine_rtl(kn_engine *engine)
{
    return rtl<Vknead_engine>::make(engine, "rtl");
}

extern "C" bool kn_engine_nano(kn_engine *engine)
{
    return rtl<Vknead_nano>::make(engine, "nano");
}
