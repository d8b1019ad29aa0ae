#ifndef KN_CORE_CONTACT_H
#define KN_CORE_CONTACT_H
// Rigid probes against the block. Geometry only: what is held and what presses, for either solver to use.
//
// Following. The model's probe never jumps to a pose. It moves with v = velocity_m_s + (position_m - x)/20 ms, so a
// late or repeated pose costs a per cent of force where a probe pinned to the last pose would lose all of it.
//
// Plate. Top nodes that it reaches are held: their velocity is the plate's (it sticks), what the lattice's residual
// leaves on them is the contact force, unfiltered. A node that would pull is let go.
//
// Sphere. Foundation contact (pressure = stiffness x depth) on a smooth skin: 4 x 4 samples per node patch on the
// quadratic B-spline through each face,  s = sum_a w_a x_a,  depth = r - |s - c|,  f = k A max(0, depth) n,
// taken implicitly at the end of the step, active set included. Single nodes or closest points instead jump by
// 60-76 % of the force per millisecond when the support changes; pressure that fades to zero at the rim does not.
#include "core/step.h"

#define KN_FOLLOW_S 0.020        // time in which the probe catches up with its pose
#define KN_FOUNDATION_N_M3 2.5e7 // default stiffness: dough's yield pressure 7.8 kPa takes 0.3 mm of it

typedef struct kn_hold { // a node held by a plate in this step
    int node, top;       // node id; number within model->top
    int probe;
    double velocity_m_s[3];
    double force_n[3]; // out of the solver: what the node does to the plate
    bool gone;         // out of the solver: let go within the step
} kn_hold;

typedef struct kn_sample { // a point of the skin near a sphere
    int probe, face;
    int node[9];
    size_t offset[9];       // of each node's x component, see kn_model.offset
    double weight[9];
    double normal[3];       // unit, from the sphere's centre to the point: the way the sphere pushes
    double depth_m;         // now; > 0 inside
    double stiffness_n_m;   // k A of this sample
    double force_n;         // out of the solver: >= 0
    bool active;
} kn_sample;

typedef struct kn_contact { // one step's contacts; lives in the state's scratch
    kn_hold *hold;
    kn_sample *sample;
    int hold_count, hold_max;
    int sample_count, sample_max;
    int64_t samples_lost; // did not fit: counted, never written out of bounds
} kn_contact;

size_t kn_contact_bytes(const kn_model *model);
void kn_contact_init(const kn_model *model, kn_contact *contact, void *memory);

// Moves attached probes' velocities after their poses, then lists holds and samples at the positions of now.
void kn_contact_find(const kn_model *model, kn_state *state, const kn_input *input, kn_contact *contact);

// Normal velocity of a sample's point minus its sphere's, along the sphere's push, for nodal velocities `field`
// (the model's reals, as state->velocity).
double kn_sample_gap_rate(const kn_model *model, const kn_state *state, const kn_sample *s, const void *field);

// Sums forces on each probe, releases nodes that pull, advances the probes by one step.
void kn_contact_end(const kn_model *model, kn_state *state, const kn_input *input, kn_contact *contact,
                    kn_output *output);

#endif
