#ifndef KN_SIMDEV_SERVE_H
#define KN_SIMDEV_SERVE_H
// An engine's registers, served to a link of server/backend/link.h until *stop. The URI of that link is printed when
// serving begins.
#include "clients/simdev/engine.h"
#include "clients/simdev/fault.h"
#include <signal.h>

typedef struct kn_serve {
    kn_engine engine;
    kn_faults faults;
    volatile sig_atomic_t *stop;
    int64_t requests;
    int64_t byte_ns; // time of a byte on the line; 0: no limit
} kn_serve;

// Serve a pseudo-terminal. link: a name for it, made anew when the terminal changes; NULL: none. Return false with
// errno set.
bool kn_serve_uart(kn_serve *serve, const char *link);
bool kn_serve_bar(kn_serve *serve, const char *name); // /dev/shm/NAME

void kn_serve_sleep_us(uint32_t us);

#endif
