#ifndef KN_CLIENTS_PUCK_H
#define KN_CLIENTS_PUCK_H
// Steering of a tool by a puck (a 3D mouse): the puck's deflection sets the speed of the tool. The functions are pure.
// kn_puck_tick is called once per ms.
//
//     speed |            .---    Each axis for itself: 0 inside the dead zone, then linear up to full deflection.
//           |         .-'        A first-order lag of 50 ms smooths the speed. A puck's values come in steps, 60 to
//        0  |______.-'           120 times a second, and a step of the speed would be an impact on dough.
//           +-----+------+---> deflection
//              dead     full
//
// The puck gives no force to the hand, so the object cannot stop the tool. Therefore the tool is kept within reach_m of
// its zero position and above floor_m. The tool stops at these limits, and when the puck is released.
#include "clients/tactile/bridge.h"

#define KN_PUCK_FULL 350 // counts at full deflection of a SpaceNavigator, with spacenavd's sensitivity 1

typedef struct kn_puck_def { // a field of 0 selects its default, except turn_rad_s and floor_m
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

void kn_puck_init(kn_puck *puck, const kn_puck_def *def); // puts the tool at its zero position, at rest

// Move the tool for elapsed_ms. counts: deflection of the puck along x, y, z, then twist about x, y, z, in the device's
// axes. Any int is allowed.
void kn_puck_tick(kn_puck *puck, const int counts[6], int elapsed_ms);

#endif
