#ifndef KN_CLIENTS_SPACENAV_H
#define KN_CLIENTS_SPACENAV_H
// A 3Dconnexion SpaceNavigator (any puck that spacenavd knows) through libspnav: a hand of six degrees of freedom that
// gives no force. Button n of the puck is button n of the pose. spacenavd's axes are x to the right, y up, z away from
// the user; they become x to the right, y forward, z up. Untested on hardware: tests/tactile/tool_spacenavd.c speaks
// the daemon's protocol (versions 0 and 1, libspnav 1.0) to the real library.
#include "clients/tactile/puck.h"

typedef struct kn_spacenav {
    kn_tactile base;
    kn_puck puck;
    // private
    kn_bridge *bridge;
    ev_io readable;
    int counts[6]; // newest, in the device's frame
} kn_spacenav;

void kn_spacenav_init(kn_spacenav *spacenav, const kn_puck_def *def);

// Where libspnav looks first: $SPNAV_SOCKET, else /var/run/spnav.sock.
const char *kn_spacenav_socket(void);
bool kn_spacenav_reach(void); // whether somebody takes a connection there; errno tells why not

#endif
