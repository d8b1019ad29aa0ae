#ifndef KN_CLIENTS_SPACENAV_H
#define KN_CLIENTS_SPACENAV_H
// Driver of a 3Dconnexion SpaceNavigator, or any puck that spacenavd knows, through libspnav: six degrees of freedom
// without force. Button n of the puck is button n of the pose. spacenavd's axes are x to the right, y up, z away from
// the user. The driver turns them to x to the right, y forward, z up. tests/tactile/tool_spacenavd.c imitates the
// daemon.
#include "clients/tactile/bridge.h"

// Steering of a tool by a puck (a 3D mouse): the puck's deflection sets the speed of the tool. The functions are pure.
// Call kn_puck_tick once per ms.
//
//     speed |            .---    Each axis for itself: 0 inside the dead zone, then linear up to full deflection.
//           |         .-'        A first-order lag of 50 ms smooths the speed. A puck's values come in steps, 60 to
//        0  |______.-'           120 times a second, and a step of the speed would be an impact on dough.
//           +-----+------+---> deflection
//              dead     full
//
// The puck gives no force to the hand, so the object cannot stop the tool. Therefore the tool is kept within reach_m of
// its zero position and above floor_m. The tool stops at these limits, and when the puck is released.
#define KN_PUCK_FULL 350 // counts at full deflection of a SpaceNavigator, with spacenavd's sensitivity 1

typedef struct kn_puck_def { // if a field is 0, its default is used, except for turn_rad_s and floor_m
    double speed_m_s;        // speed of the tool at full deflection of the puck, default 0.05
    double turn_rad_s;       // angular speed of the tool at full twist of the puck; 0: the tool keeps its orientation
    int dead;                // half width of the dead zone [counts], default 15, less than KN_PUCK_FULL
    double reach_m;          // largest distance of the tool from its zero position along each axis, default 0.08
    double floor_m;          // lowest z of the tool, limited to the range -reach_m .. reach_m
} kn_puck_def;

typedef struct kn_puck {
    kn_puck_def def;
    kn_tactile_pose pose; // pose of the tool, in the device's axes: x to the right, y forward, z up
    double turning_rad_s[3];
} kn_puck;

void kn_puck_init(kn_puck *puck, const kn_puck_def *def); // put the tool at its zero position, at rest

// Move the tool for elapsed_ms. counts: deflection of the puck along x, y, z, then twist about x, y, z, in the device's
// axes. Each count may be any int.
void kn_puck_tick(kn_puck *puck, const int counts[6], int elapsed_ms);

typedef struct kn_spacenav {
    kn_tactile base;
    kn_puck puck;
    // The fields below are used by spacenav.c only.
    kn_bridge *bridge;
    ev_io readable;
    int counts[6]; // newest deflection and twist of the puck, in the device's axes
} kn_spacenav;

void kn_spacenav_init(kn_spacenav *spacenav, const kn_puck_def *def);

// Return the path of the socket that libspnav tries first: $SPNAV_SOCKET, or /var/run/spnav.sock if the variable is not
// set.
const char *kn_spacenav_socket(void);
// Return true if a connection to spacenavd's socket succeeds. On failure, errno has the reason.
bool kn_spacenav_reach(void);

#endif
