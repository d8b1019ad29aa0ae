#ifndef KN_CORE_TOUCH_H
#define KN_CORE_TOUCH_H
// The touch patch: the data of a contact that a fingertip, pin or vibrotactile display shows, from the forces of the
// last step. All values are in the tool frame, SI. The message is KNEAD_TOUCH, proto/touch_patch_t.lcm.
//
// Pressure is a map over the tool's face. The face is perpendicular to the mean normal n of the contact, because a
// finger that lies on its side touches with its side. The face is seen from inside the tool. The shortest rotation from
// z to n takes the tool's x and y to u, v:
//
//     u = x - n_x/(1 + n_z) (n + z)      v = y - n_y/(1 + n_z) (n + z)      u x v = n      (n = -z: u = x, v = -y)
//
// So u, v are x, y for a tool that stands on its lower face or tip. They follow n without a jump, except at n = -z.
// Rejected: always x, y, because a contact at the tool's side would have no area. Also rejected: the axes nearest to n,
// because the map of a rolling ball would jump.
//
//     v ^ [7][0] ... [7][7]     8 x 8 cells, [along v][along u], over the rectangle around the whole shape as seen
//       | [0][0] ... [0][7]     along n: a box's lower face, a square of a ball's diameter, a finger's length by its
//       +--------------> u      width
//
// A cell's pressure is the force along n in the cell over the cell's area. The force of a sample is spread over the
// skin that the sample stands for. So up to rounding
//
//     sum of pressure x area of a cell = n . contact_force_n
//
// For a smooth contact this is |contact_force_n|. Pressure is negative where adhesion, or friction on a flank, pulls.
#include "core/state.h"

#define KN_TOUCH_CELLS 8 // number of cells of the pressure map along each side of the face

typedef struct kn_touch { // all 0: nothing touches
    double area_m2;       // area of the skin that carries force, measured on the undeformed object
    double centre_m[3];   // centre of pressure: mean position of the touched skin, weighted by force
    double normal[3];     // unit normal n out of the object: mean over the contact, weighted by force
    // highest pressure of a sample; on curved skin higher than the pressure of any cell of the map
    double peak_pressure_pa;
    // Tangential velocity of the skin relative to the tool: mean over the contact, weighted by force. If the tool
    // slides along +x over resting skin, the velocity points along -x. It is 0 for a plate, which sticks.
    double slip_velocity_m_s[3];
    double pressure_pa[KN_TOUCH_CELLS][KN_TOUCH_CELLS]; // pressure map over the tool's face, [along v][along u]
} kn_touch;

typedef struct kn_touch_face {
    double u[3], v[3]; // unit vectors of the face's two directions, in the tool frame
    // [0] along u, [1] along v. low_m: lowest corner of the face, relative to the tool's position; size_m: sides of the
    // face.
    double low_m[2], size_m[2];
} kn_touch_face;

// Compute the face of probe p that is perpendicular to a unit normal in the tool frame. Real-time safe.
void kn_touch_face_of(const kn_model *model, int p, const double normal[3], kn_touch_face *face);

// Read the touch patch of probe p after a kn_step with this state and this scratch. Return false, with a patch of
// zeros, if the last step with the scratch was of another state, or if the state has diverged or changed since.
// Real-time safe: two passes over the contact's samples.
bool kn_touch_read(const kn_model *model, const kn_state *state, const kn_scratch *scratch, int p, kn_touch *touch);

// Store the force of all tools together on each node in the last step, N: force_n[node_count]. A sample's force goes to
// its nodes by their weights. So the sum over all nodes is the opposite of the force on the tools. Forces of the table
// are not included. Return false, with zeros, where kn_touch_read does. Real-time safe.
bool kn_touch_nodes(const kn_model *model, const kn_state *state, const kn_scratch *scratch, double (*force_n)[3]);

#endif
