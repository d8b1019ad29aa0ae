#ifndef KN_SIMDEV_ENGINE_H
#define KN_SIMDEV_ENGINE_H
// Engine: the part of a simulated circuit board that computes the ticks, behind the registers. There are two engines:
// `golden` computes by core/fixed.h in real time. `rtl` simulates the circuit of hdl/rtl by Verilator. The clock of the
// simulated circuit runs only while the host uses the circuit.
#include "server/backend/frame.h"

typedef struct kn_engine_caps {
    int nodes, edges, bounds; // log2
} kn_engine_caps;

typedef struct kn_engine {
    const char *name;
    // Access to the words of hdl/registers.h; the clock of a simulated circuit runs only in these transfers.
    kn_word_bus bus;
    void (*blank)(void *self); // switch the power off and on; the memory is lost
    void (*stray)(void *self); // step a tick that no host has requested; NULL: this engine cannot
    // Serial link that is part of the circuit. NULL: the circuit has no link, and server/backend/frame.h is used
    // instead. The function reads bytes up to the end of the first frame that it answers, or all bytes if it answers
    // none; *used is the number of bytes read. The function returns the number of bytes of the answer with the final
    // 0x00, or 0 if there is no answer. It reads and writes the engine's words through `bus`.
    size_t (*hear)(void *self, const kn_word_bus *bus, const uint8_t *bytes, size_t count, size_t *used,
                   uint8_t wire[KN_FRAMER_WIRE]);
    void (*destroy)(void *self);
} kn_engine;

// Create an engine. Return false when memory is short.
bool kn_engine_golden(kn_engine *engine, kn_engine_caps caps);
bool kn_engine_rtl(kn_engine *engine); // only if KN_SIMDEV_RTL is defined; --caps is always 10,14,10

#endif
