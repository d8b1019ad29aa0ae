#ifndef KN_SIMDEV_ENGINE_H
#define KN_SIMDEV_ENGINE_H
// What answers behind a simulated device's registers: core/fixed.h in real time, or the circuit under a simulator, in a
// time of its own.
#include "server/backend/frame.h"

typedef struct kn_engine_caps {
    int nodes, edges, bounds; // log2
} kn_engine_caps;

typedef struct kn_engine {
    const char *name;
    kn_word_bus bus;           // hdl/registers.h; time goes by in its transfers alone
    void (*blank)(void *self); // power off and on
    void (*stray)(void *self); // a tick that nobody asked for; NULL: it has none
    // The circuit's own link, for a serial line; NULL: server/backend/frame.h is it. Takes bytes up to the end of the
    // first frame that it answers, or all of them, and tells how many in used. Returns the answer's bytes, its 0x00
    // included; 0: none. What it asks the engine for goes over that bus.
    size_t (*hear)(void *self, const kn_word_bus *bus, const uint8_t *bytes, size_t count, size_t *used,
                   uint8_t wire[KN_FRAMER_WIRE]);
    void (*destroy)(void *self);
} kn_engine;

// False: memory is short.
bool kn_engine_golden(kn_engine *engine, kn_engine_caps caps);
bool kn_engine_rtl(kn_engine *engine); // where KN_SIMDEV_RTL is defined; caps 10, 13, 8
bool kn_engine_nano(kn_engine *engine); // there, too: the small circuit; caps 5, 7, 4

#endif
