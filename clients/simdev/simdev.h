#ifndef KN_SIMDEV_SIMDEV_H
#define KN_SIMDEV_SIMDEV_H
// Simulated device: serves the registers of an engine to a host until *stop is set, over a serial line or in shared
// memory. At the beginning it prints the URI by which a host reaches the device (server/backend/link.h).
#include "clients/simdev/engine.h"
#include <signal.h>

// Faults that are injected on purpose. Random numbers from a seed decide which requests a fault strikes. Columns: name
// of the constant; name on the command line; true if the fault applies to frames only (--uart); effect of each strike.
#define KN_LINK_FAULTS(FAULT)                                                                                          \
    FAULT(FLIP, flip, true, "invert one bit of a request or an answer")                                                \
    FAULT(DROP, drop, true, "lose a request or an answer")                                                             \
    FAULT(DUPLICATE, duplicate, true, "deliver a request or an answer twice")                                          \
    FAULT(TRUNCATE, truncate, true, "cut off the end of a request or an answer")                                       \
    FAULT(DELAY, delay, false, "delay a request by 1 to 4 ms")                                                         \
    FAULT(HANG, hang, false, "stop for 20 ms, then handle the requests that wait")                                     \
    FAULT(DISCONNECT, disconnect, false, "unplug the device for 5 ms; its memory is kept")                             \
    FAULT(BLANK, blank, false, "switch the power off and on; the memory is lost")                                      \
    FAULT(TORN, torn, false, "step a tick without a request while the host reads the results")                         \
    FAULT(REFUSE, refuse, true, "refuse to read or write the words of a request")                                      \
    FAULT(HASH, hash, false, "report a wrong BUILD_HASH, always")

typedef enum kn_link_fault {
#define KN_LINK_FAULT_NAME(name, word, frames, what) KN_LINK_FAULT_##name,
    KN_LINK_FAULTS(KN_LINK_FAULT_NAME)
#undef KN_LINK_FAULT_NAME
        KN_LINK_FAULT_COUNT
} kn_link_fault;

typedef struct kn_link_faults {
    double rate[KN_LINK_FAULT_COUNT];  // share of the requests that the fault strikes, 0 .. 1
    int64_t done[KN_LINK_FAULT_COUNT]; // number of strikes
    uint64_t seed;
} kn_link_faults;

typedef struct kn_link_fault_kind {
    const char *word, *what;
    bool frames;
} kn_link_fault_kind;
extern const kn_link_fault_kind kn_link_fault_kinds[KN_LINK_FAULT_COUNT];

// Parse "NAME[=RATE],...". A rate is 0 .. 1, by default 0.01. Return false with the wrong entry in bad.
bool kn_link_faults_parse(kn_link_faults *faults, const char *text, char bad[64]);

// Decide at random whether the fault strikes, and count the strike.
bool kn_link_faults_strike(kn_link_faults *faults, kn_link_fault fault);

// Apply the faults flip and truncate to the bytes of a frame, each at random. The last byte stays 0x00. Return the new
// size of the frame.
size_t kn_link_faults_mangle(kn_link_faults *faults, uint8_t *wire, size_t size);

typedef struct kn_simdev {
    kn_engine engine;
    kn_link_faults faults;
    volatile sig_atomic_t *stop;
    int64_t requests;
    int64_t byte_ns; // time that a byte takes on the line, ns; 0: no limit
} kn_simdev;

// Serve on a pseudo-terminal. link: path of a symbolic link to the terminal, which is created again when the terminal
// changes; NULL: no symbolic link. All three return false with errno set on failure. errno 0: the line is printed.
bool kn_simdev_uart(kn_simdev *simdev, const char *link);
bool kn_simdev_bar(kn_simdev *simdev, const char *name); // /dev/shm/NAME
bool kn_simdev_pci(kn_simdev *simdev, char **qemu);      // in a guest of this command, until the command ends

// Wait until the engine is not busy. Reading its status lets a simulated circuit run.
void kn_simdev_run_out(const kn_engine *engine);

enum { KN_SIMDEV_UNPLUGGED_NS = 5000000 }; // time for which the fault disconnect unplugs the device, ns
// Apply the faults that strike a whole request: delay, hang and blank, in this order. Set *blanked if the engine has
// lost its memory. Return true if the fault disconnect strikes as well. The caller then unplugs the device.
bool kn_simdev_suffer(kn_simdev *simdev, bool *blanked);

#endif
