#ifndef KN_SIMDEV_ENGINE_H
#define KN_SIMDEV_ENGINE_H
// What answers behind a simulated device's registers. The golden one is core/fixed.h in real time; a circuit under a
// simulator is another, in a time of its own.
#include "server/backend/frame.h"

typedef struct kn_engine_caps {
    int nodes, edges, bounds; // log2
} kn_engine_caps;

typedef struct kn_engine {
    const char *name;
    kn_word_bus bus;           // hdl/registers.h
    void (*clock)(void *self); // lets time go by while nobody asks; may be NULL
    void (*blank)(void *self); // power off and on
    void (*stray)(void *self); // a tick that nobody asked for; may be NULL
    void (*destroy)(void *self);
} kn_engine;

bool kn_engine_golden(kn_engine *engine, kn_engine_caps caps); // false: memory is short

#endif
