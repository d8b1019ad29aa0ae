#ifndef KN_CORE_SOLVE_TOOL_H
#define KN_CORE_SOLVE_TOOL_H
// Rigid tools: their shapes, their motion, and the virtual coupling that ties a tool to its pose.
//
// Rigid (coupling 0). The tool does not jump to a pose. It moves with v = velocity_m_s + (position_m - x)/20 ms. So a
// late or repeated pose reduces the force by about one per cent only. A tool that stood still at its last pose would
// lose the whole force. The orientation of the tool lags 20 ms behind that of the pose, because poses do not contain
// the angular velocity.
//
// Coupled. The tool has no mass and is an unknown of the implicit step. At its velocity V = (v, w) the coupling and the
// contact balance:
//
//     k (x_pose - x - dt v) + b (v_pose - v) = force on the object,   for turns k l^2 and b l^2, and no v_pose
//
// Contact is linear in V, so V is eliminated: G V + sum dt J'KJ V = drive - sum J'f0. The result is a 6 x 6 system for
// each tool, which is solved exactly in every product of the conjugate gradients. The hand feels k and b in series with
// the object, never a stiffness above k. Rejected: a spring between pose and tool whose force is taken from the
// beginning of the step. Its force chatters at 500 Hz on soft objects at any stiffness.
#include "core/shape.h"
#include "core/state.h"

#define KN_FOLLOW_S 0.020 // time in which a rigid tool catches up with its pose
// arm l, half the width of a palm: a coupling's stiffness for rotations is l^2 times its stiffness for translation
#define KN_COUPLING_ARM_M 0.03
#define KN_RELIEF_M_S 0.020 // speed at which a tool that was attached inside the object grows back

typedef struct kn_tool_step { // one tool in one step
    bool coupled;             // a virtual coupling ties the tool to its pose
    bool turned;              // the tool's orientation matters
    double turn[3][3];        // present rotation from tool to scene, if `turned`
    double velocity[6];       // velocity v and angular velocity w of the tool
    double growth_m_s;        // speed at which the surface of a shrunk tool grows back, along its outward normal
    // dt k + b of the coupling for translation [0] and for rotation [1], on the diagonal of the 6 x 6 matrix
    double give[2];
    double drive[6];     // force and torque that the coupling would have if the tool did not move (V = 0)
    double factor[6][6]; // lower Cholesky factor of the 6 x 6 matrix of coupling and contact
} kn_tool_step;

// Return NULL, or the reason why a lattice of the given spacing is too coarse for the shape of a probe.
const char *kn_tool_unfit(const kn_probe_def *probe, double spacing_m);

// Set `shape` to the shape of a probe. Before the call, `shape` must be empty (all 0). A plate leaves it empty. Return
// false if the shape has more than KN_PARTS_MAX parts.
bool kn_tool_shape(const kn_probe_def *probe, kn_shape *shape);

// Store the rotation matrix of an orientation. If all components of the orientation are 0, the result is the identity.
void kn_tool_matrix(const double orientation_wxyz[4], double turn[3][3]);

// Return true if the orientation of a probe matters. The orientation does not matter for a plate and a smooth ball.
bool kn_tool_turns(const kn_probe_def *def);

// Begin a step of the tool: attach or detach it, and fill in *tool except for `factor`. The velocity of a coupled tool
// is that of the last step, as a first guess.
void kn_tool_begin(const kn_model *model, kn_state *state, int p, const kn_probe_input *in, kn_tool_step *tool);

// Move the tool by its velocity over one step.
void kn_tool_advance(const kn_model *model, kn_state *state, int p, const kn_tool_step *tool);

#endif
