#ifndef KN_CLIENTS_PADDLE_H
#define KN_CLIENTS_PADDLE_H
// A paddle with one degree of freedom behind a serial line (Hapkit class): its position is the device's z, upwards.
// Untested on hardware; what it was tested with is tests/tactile/tool_paddle.c behind a pty.
#include "clients/tactile/bridge.h"
#include "clients/tactile/frame.h"

#define KN_PADDLE_BAUD 921600
#define KN_PADDLE_BAUDS "230400, 460800, 500000, 576000, 921600, 1000000, 1500000, 2000000, 3000000 or 4000000"

typedef struct kn_paddle {
    kn_tactile base;
    const char *tty;
    int baud;
    // private
    kn_bridge *bridge;
    int fd;
    ev_io readable;
    kn_deframer deframer;
    uint16_t seq;
    bool unwatched, armed; // armed: its motor was on in this proof, or is still to be rearmed
    int proofs;
    int64_t begun_ns, given_ns; // of this proof; of the last command in it
    int64_t held_back;          // commands that were not sent because older ones still waited in the line
} kn_paddle;

// A line that cannot carry 1 kHz of frames both ways is not known.
bool kn_paddle_baud_known(int baud);

// tty: borrowed. unwatched: give force though the paddle has not shown its own watchdog.
void kn_paddle_init(kn_paddle *paddle, const char *tty, int baud, bool unwatched);

#endif
