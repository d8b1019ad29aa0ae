#ifndef KN_CLIENTS_SPACENAV_H
#define KN_CLIENTS_SPACENAV_H
// Driver of a 3Dconnexion SpaceNavigator, or any puck that spacenavd knows, through libspnav: six degrees of freedom
// without force. Button n of the puck is button n of the pose. spacenavd's axes are x to the right, y up, z away from
// the user. The driver turns them to x to the right, y forward, z up. The driver has not been tested on hardware.
// tests/tactile/tool_spacenavd.c imitates the daemon: it speaks the daemon's protocol (versions 0 and 1, libspnav 1.0)
// to the real library.
#include "clients/tactile/puck.h"

typedef struct kn_spacenav {
    kn_tactile base;
    kn_puck puck;
    // private
    kn_bridge *bridge;
    ev_io readable;
    int counts[6]; // newest deflection and twist of the puck, in the device's axes
} kn_spacenav;

void kn_spacenav_init(kn_spacenav *spacenav, const kn_puck_def *def);

// Return the socket path that libspnav tries first: $SPNAV_SOCKET, else /var/run/spnav.sock.
const char *kn_spacenav_socket(void);
// Returns true if a connection to spacenavd's socket succeeds; on failure, errno has the reason.
bool kn_spacenav_reach(void);

#endif
