#ifndef KN_CLIENTS_PADDLE_H
#define KN_CLIENTS_PADDLE_H
// Driver of a paddle with one degree of freedom on a serial line (such as a Hapkit). The paddle's position is the z
// coordinate of the device, upwards. tests/tactile/tool_paddle.c runs the program of firmware/ behind a pty.
#include "clients/tactile/bridge.h"
#include "clients/tactile/paddle_frame.h"

typedef struct kn_paddle {
    kn_tactile base;
    const char *tty;
    int baud;
    // The fields below are used by paddle.c only.
    kn_bridge *bridge;
    int fd;
    ev_io readable;
    kn_paddle_decoder deframer;
    uint16_t seq;
    // clears: no command has the flag enable, until the paddle reports that the trip of the test is over. enabled: the
    // last command has it.
    bool clears, enabled;
    int off_ms; // number of state frames in which the paddle was off, although the commands had the flag enable
    // Number of force commands that were not sent, because older commands still waited in the serial line.
    int64_t held_back;
} kn_paddle;

// Prepare the driver without opening the line. tty: the text must outlive the driver.
void kn_paddle_init(kn_paddle *paddle, const char *tty, int baud);

#endif
