#ifndef KN_CORE_TOUCH_H
#define KN_CORE_TOUCH_H
// The touch patch: what a fingertip, pin or vibrotactile display shows of a contact, from the forces of the last step.
// All of it in the tool frame, SI. On the wire it is KNEAD_TOUCH, proto/touch_patch_t.lcm.
//
// Pressure is a map over the tool's face. The face lies across the mean normal n, since a finger on its side touches
// with its side, and is seen from inside of the tool; the tool's x and y come onto it by the shortest turn from z to n,
//
//     u = x - n_x/(1 + n_z) (n + z)      v = y - n_y/(1 + n_z) (n + z)      u x v = n      (n = -z: u = x, v = -y)
//
// so that it is x, y for a tool that stands on its lower face or tip, and follows n without a jump but at n = -z.
// Rejected: always x, y (what touches from the side has no area there); the nearest axis (a rolling ball's map jumps).
//
//     v ^ [7][0] ... [7][7]     8 x 8 cells, [along v][along u], over the rectangle around the whole shape as seen
//       | [0][0] ... [0][7]     along n: a box's lower face, a square of a ball's diameter, a finger's length by its
//       +--------------> u      width
//
// A cell holds the force along n that acts in it over its area, a sample's spread over the skin that it stands for. So
//
//     sum of pressure x area of a cell = n . contact_force_n
//
// to rounding, which is |contact_force_n| of a smooth contact. Negative where adhesion, or friction on a flank, pulls.
#include "core/state.h"

#define KN_TOUCH_CELLS 8

typedef struct kn_touch {        // all 0: nothing touches
    double area_m2;              // of skin, undeformed, that carries force
    double centre_m[3];          // of pressure: a point of the skin on average, not of the face
    double normal[3];            // n: unit, mean of the contact by its pressure, out of the object
    double peak_pressure_pa;     // of a sample; where the skin is curved more than any cell has
    double slip_velocity_m_s[3]; // of the skin against the tool, along skin and face, mean by pressure: a tool that is
                                 // drawn along +x over what stays behind has -x. A plate sticks: 0
    double pressure_pa[KN_TOUCH_CELLS][KN_TOUCH_CELLS];
} kn_touch;

typedef struct kn_touch_face {
    double u[3], v[3];
    double low_m[2], size_m[2]; // of the rectangle, along u and v, from the tool's position
} kn_touch_face;

// The face of probe p for a unit normal in the tool frame.
void kn_touch_face_of(const kn_model *model, int p, const double normal[3], kn_touch_face *face);

// Of probe p, after a kn_step with this state. Real-time safe: two passes over the samples of the contact.
void kn_touch_read(const kn_model *model, const kn_state *state, int p, kn_touch *touch);

// What all tools together did to each node in that step, N: force_n[node_count]. A sample's force goes to the nodes that
// it hangs on, by its weights, so that the sum is that on the tools, the other way. The table's is not among them.
void kn_touch_nodes(const kn_model *model, const kn_state *state, double (*force_n)[3]);

#endif
