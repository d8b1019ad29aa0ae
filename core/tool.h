#ifndef KN_CORE_TOOL_H
#define KN_CORE_TOOL_H
// Rigid tools: how they move, and the virtual coupling that ties one to its pose.
//
// Rigid (coupling 0). The tool never jumps to a pose. It moves with v = velocity_m_s + (position_m - x)/20 ms, so a late
// or repeated pose costs a per cent of force where one pinned to its last pose would lose all. It turns 20 ms behind its
// orientation: poses say nothing of how fast that changes.
//
// Coupled. The tool, without mass, is an unknown of the implicit step: its velocity V = (v, w) is where the coupling
// and the contact balance,
//
//     k (x_pose - x - dt v) + b (v_pose - v) = force on the object,   for turns k l^2 and b l^2, and no v_pose
//
// Contact is linear in V, so V is eliminated: G V + sum dt J'KJ V = drive - sum J'f0, a 6 x 6 system per tool, solved
// exactly in every product of the gradients. The hand then feels k and b in series with the object, never stiffer than
// k, and free of the 500 Hz chatter that an explicit spring on the pose has on soft objects at any stiffness.
#include "core/step.h"

#define KN_FOLLOW_S 0.020      // time in which a rigid tool catches up with its pose
#define KN_COUPLING_ARM_M 0.03 // l: half a palm; makes of a coupling's N/m its N m/rad
#define KN_RELIEF_M_S 0.020    // a tool that met the object from inside pushes its way out this fast

typedef struct kn_tool_step { // one tool in one step
    bool coupled;
    bool turned;
    double turn[3][3];   // tool to frame, now, when turned
    double velocity[6];  // v, w
    double growth_m_s;   // of a relieved tool, everywhere outwards
    double give[2];      // dt k + b, and of turns; what the coupling adds to the matrix
    double drive[6];     // coupling at V = 0
    double factor[6][6]; // Cholesky's, lower, of give and contact
} kn_tool_step;

// Of an orientation; all 0: identity.
void kn_tool_matrix(const double orientation_wxyz[4], double turn[3][3]);

// Whether a probe's orientation means anything: not a plate's, nor a smooth ball's.
bool kn_tool_turns(const kn_probe_def *def);

// Attaches, detaches; fills velocity (of a coupled one: the last), turn, give and drive.
void kn_tool_begin(const kn_model *model, kn_state *state, int p, const kn_probe_input *in, kn_tool_step *tool);

// Velocity of a tool's point `arm` from its position.
void kn_tool_velocity(const kn_tool_step *tool, const double arm_m[3], double v_m_s[3]);

// Moves it by its velocity.
void kn_tool_advance(const kn_model *model, kn_state *state, int p, const kn_tool_step *tool);

#endif
