#ifndef KN_SIMDEV_FAULT_H
#define KN_SIMDEV_FAULT_H
// Deliberate faults, by chance from a seed.
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// name, word, whether it only applies to frames (--uart), the fault at each strike
#define KN_FAULTS(FAULT)                                                                                               \
    FAULT(FLIP, flip, true, "one bit of a frame, either way")                                                          \
    FAULT(DROP, drop, true, "a frame, either way")                                                                     \
    FAULT(DUPLICATE, duplicate, true, "a frame comes twice, either way")                                               \
    FAULT(TRUNCATE, truncate, true, "the rest of a frame, either way")                                                 \
    FAULT(DELAY, delay, false, "a request is heard 1 to 4 ms later")                                                   \
    FAULT(HANG, hang, false, "20 ms of nothing, then all that was asked")                                              \
    FAULT(DISCONNECT, disconnect, false, "unplugged for 5 ms; what it holds stays")                                    \
    FAULT(BLANK, blank, false, "power off and on: all it holds is lost")                                               \
    FAULT(TORN, torn, false, "a tick nobody asked for, while results are read")                                        \
    FAULT(REFUSE, refuse, true, "a request whose words the bus neither takes nor gives")                               \
    FAULT(HASH, hash, false, "BUILD_HASH is another, always")

typedef enum kn_fault {
#define KN_FAULT_NAME(name, word, frames, what) KN_FAULT_##name,
    KN_FAULTS(KN_FAULT_NAME)
#undef KN_FAULT_NAME
        KN_FAULT_COUNT
} kn_fault;

typedef struct kn_faults {
    double rate[KN_FAULT_COUNT]; // 0: never
    int64_t done[KN_FAULT_COUNT];
    uint64_t seed;
} kn_faults;

const char *kn_fault_word(kn_fault fault);
bool kn_fault_of_frames(kn_fault fault);

// Parse "NAME[=RATE],...". A rate is 0 .. 1, by default 0.01. Return false with the wrong entry in bad.
bool kn_faults_parse(kn_faults *faults, const char *text, char bad[64]);

uint32_t kn_faults_random(kn_faults *faults, uint32_t below);
bool kn_faults_strike(kn_faults *faults, kn_fault fault); // decide by chance; counts each strike

// Apply flip and truncate to the bytes of a frame; its last byte stays 0x00. Return its new size.
size_t kn_faults_mangle(kn_faults *faults, uint8_t *wire, size_t size);

#endif
