#ifndef KN_CORE_LEVEL_PLATE_H
#define KN_CORE_LEVEL_PLATE_H
// A weight on a level plate. kn_step moves a plate with a prescribed velocity; this module prescribes its force, as a
// creep test, a gauge of constant force or a weight on a block does:
//
//         | W         The plate has no mass. In each step its vertical velocity v is the root of
//     ====v====
//     |       |             F(v) = W         F: force of the object on the plate at the end of the step
//     |       |
//     /////////       F falls as v rises, since a plate that goes down faster meets more resistance.
//
// The root is found by the secant method between bounds (Illinois). Each trial is a kn_step on a copy of the state, and
// the last trial becomes the state. A step takes two to four trials. Real-time safe, but as slow as its trials.
#include "core/step.h"

// A step ends when the force differs from the weight by this share of the weight.
#define KN_LEVEL_PLATE_TOLERANCE 1e-4

// An object is flat when the plate is below this share of the height of the undeformed top.
#define KN_LEVEL_PLATE_FLAT 0.05

typedef struct kn_level_plate {
    int probe;           // index of the probe, whose shape is PLATE
    double x_m, y_m;     // centre of the plate
    double height_m;     // present height of the plate
    double velocity_m_s; // velocity in the last step, upwards positive
    double slope_n_s_m;  // dF/dv of the last step, < 0; 0: not known
} kn_level_plate;

typedef enum kn_plate_status {
    KN_PLATE_CARRIED, // the plate carries the weight
    KN_PLATE_FLAT,    // the object cannot carry the weight before it is flat
    KN_PLATE_DIVERGED // a number is not finite at any velocity
} kn_plate_status;

// Lower the plate until it just touches the object, without a force. Beside the object it stays at the height of the
// undeformed top.
void kn_level_plate_lower(kn_level_plate *plate, const kn_model *model, const kn_state *state);

// Advance the state by one time step under a plate that carries the weight load_n > 0. The input says where the other
// probes are. `trial` is a second state of the model, whose content is overwritten. If nodes come off the plate
// together, so that the force jumps past the weight, the step ends on the side of the smaller force. If the status is
// not KN_PLATE_CARRIED, the state is the one before the step.
kn_plate_status kn_level_plate_step(kn_level_plate *plate, const kn_model *model, kn_state *state, kn_state *trial,
                                    kn_scratch *scratch, double load_n, const kn_input *input, kn_output *output);

#endif
