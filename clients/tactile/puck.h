#ifndef KN_CLIENTS_PUCK_H
#define KN_CLIENTS_PUCK_H
// A tool that is steered, not held: how far a puck is pushed is how fast the tool goes. Pure; one call per ms.
//
//     speed |            .---    each axis apart: nothing inside the dead zone, then straight up to full deflection;
//           |         .-'        a first-order lag of 50 ms between the hand and the tool, because a puck's news come
//        0  |______.-'           60 to 120 times a second in steps, and a step of speed is a blow to dough
//           +-----+------+---> deflection
//              dead     full
//
// It carries no force: the tool goes where it is steered, and the object cannot stop it. So it stays within `reach` of
// its zero, and above `floor_m`. It stands still when the puck is let go, and where the walls are.
#include "clients/tactile/bridge.h"

#define KN_PUCK_FULL 350 // counts at full deflection of a SpaceNavigator, with spacenavd's sensitivity 1

typedef struct kn_puck_def { // zero means default, but for turn_rad_s and floor_m
    double speed_m_s;        // at full deflection, default 0.05
    double turn_rad_s;       // at full twist; 0: the tool keeps its orientation
    int dead;                // counts, default 15; < KN_PUCK_FULL
    double reach_m;          // default 0.08, along each axis
    double floor_m;          // lowest z; -reach_m when that is higher
} kn_puck_def;

typedef struct kn_puck {
    kn_puck_def def;
    kn_tactile_pose pose; // where the tool is, in the device's frame: x to the right, y forward, z up
    double turning_rad_s[3];
} kn_puck;

void kn_puck_init(kn_puck *puck, const kn_puck_def *def); // at its zero, at rest

// elapsed_ms of steering. counts: deflection along x, y, z and twist about them, in the device's frame, any int.
void kn_puck_tick(kn_puck *puck, const int counts[6], int elapsed_ms);

#endif
