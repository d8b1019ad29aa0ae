#ifndef KN_SIMDEV_ENGINE_H
#define KN_SIMDEV_ENGINE_H
// The engine behind a simulated device's registers: core/fixed.h in real time, or the circuit under a simulator, in a
// time of its own.
#include "server/backend/frame.h"

typedef struct kn_engine_caps {
    int nodes, edges, bounds; // log2
} kn_engine_caps;

typedef struct kn_engine {
    const char *name;
    kn_word_bus bus;           // hdl/registers.h; time passes only in its transfers
    void (*blank)(void *self); // power off and on
    void (*stray)(void *self); // a tick that nobody asked for; NULL: it cannot do that
    // The circuit's own link, for a serial line; NULL: use server/backend/frame.h. It reads bytes up to the end of the
    // first frame that it answers, or all of them; *used is their number. It returns the bytes of the answer, including
    // its 0x00; 0: none. Its transfers to the engine go over `bus`.
    size_t (*hear)(void *self, const kn_word_bus *bus, const uint8_t *bytes, size_t count, size_t *used,
                   uint8_t wire[KN_FRAMER_WIRE]);
    void (*destroy)(void *self);
} kn_engine;

// Create an engine. Return false when memory is short.
bool kn_engine_golden(kn_engine *engine, kn_engine_caps caps);
bool kn_engine_rtl(kn_engine *engine); // if KN_SIMDEV_RTL is defined; caps 10, 13, 8

#endif
