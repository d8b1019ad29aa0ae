#ifndef KN_CLIENTS_DEVICES_H
#define KN_CLIENTS_DEVICES_H
// What could be a hand on this machine: looked for, not opened, since opening a serial line resets many a board.
//
//     spacenavd's socket    whether a connection is taken           -> knead hand spacenav
//     the Inverse Service   whether a connection is taken           -> knead hand haply
//     /dev/ttyACM*, USB*    what is behind them, /sys; permission   -> knead hand paddle --tty
//     USB devices, /sys     haptic ones that nothing here drives    -> clients/examples/hand.c
#include <stdbool.h>
#include <stddef.h>

#define KN_DEVICES_MAX 64
#define KN_DEVICES_TEXT 192

typedef struct kn_found {
    char kind[16];                 // spacenavd, haply, tty, usb
    char where[KN_DEVICES_TEXT];   // socket, address, device file, place on the bus
    char usb[10];                  // "2341:0043"; "": not of USB
    char name[KN_DEVICES_TEXT];    // as the device says it, printable
    bool ready;                    // can be used as it is
    char use[KN_DEVICES_TEXT];     // the command that does
    const char *profile;           // `device:` of a scene that fits best; NULL: none asked for
    char missing[KN_DEVICES_TEXT]; // "": nothing
    char fix[KN_DEVICES_TEXT];
} kn_found;

// root: "" or a folder to look for dev and sys in, for tests. found: KN_DEVICES_MAX. How many; more than fit are left.
int kn_devices_find(const char *root, kn_found *found);

#endif
