#ifndef KN_CORE_CONTACT_H
#define KN_CORE_CONTACT_H
// Rigid tools against the object. Geometry only: what is held and what presses, for either solver to use.
//
// Plate. Top nodes that it reaches are held: their velocity is the plate's (it sticks), what the lattice's residual
// leaves on them is the contact force, unfiltered. A node that would pull is let go.
//
// Every other shape. Foundation contact (pressure = stiffness x depth) on a smooth skin: samples of each node patch on
// the quadratic B-spline through each face (or bilinear, kn_skin_form),  s = sum_a w_a x_a,  depth = -distance of the
// shape at s,
//
//     f = k A depth n                                   while depth > -adhesion/k, once touched; else while depth > 0
//     t = -k A e, cut to mu f; e: how far s has slid along the tool since it stuck (elastoplastic anchor)
//
// taken implicitly at the end of the step, active set and cone included. Single nodes or closest points instead jump by
// 60-76 % of the force per millisecond when the support changes; pressure that fades to zero at the rim does not. And
// friction that follows a measured velocity instead of an anchor chatters at full amplitude. e belongs to the sample,
// which is a point of the material: the skin carries it along.
//
// A coupled tool may come at 1 m/s, by any force. Its foundation is a layer KN_LAYER of its half width thick,
//     pressure = k depth / (1 - depth / layer)
// so that no force takes the skin through it, and what it drives before it stops at the table.
//
// Table. With support FRICTION the nodes of the outside are pushed up by the plane z = 0 in the same way.
#include "core/tool.h"

#define KN_FOUNDATION_N_M3 2.5e7 // default stiffness: dough's yield pressure 7.8 kPa takes 0.3 mm of it
#define KN_TABLE_N_M3 1e8        // of the table: dough as high as a hand rests 0.05 mm in it
#define KN_LAYER 0.5             // of a coupled tool's smallest half width
#define KN_STICTION 1.2          // friction that holds, of friction that slides
#define KN_TABLE (-1)            // as a sample's probe

static inline double kn_probe_foundation(const kn_probe_def *probe)
{
    return probe->foundation_n_m3 > 0 ? probe->foundation_n_m3 : KN_FOUNDATION_N_M3;
}

typedef struct kn_hold { // a node held by a plate in this step
    int node, top;       // node id; number within model->top
    int probe;
    double velocity_m_s[3];
    double force_n[3]; // out of the solver: what the node does to the plate
    bool gone;         // out of the solver: let go within the step
} kn_hold;

typedef struct kn_sample { // a point of the skin near a tool
    int probe, face;
    int nodes; // that it hangs on: 9, on a net 3, at the table 1
    int node[9];
    size_t offset[9]; // of each node's x component, see kn_model.offset
    double weight[9];
    double normal[3];       // unit: the way the tool pushes
    double point_m[3];      // where it is now
    double arm_m[3];        // from the tool's position
    double depth_m;         // now; > 0 inside
    double lowest_m;        // <= 0: depth at which it lets go
    double foundation_n_m;  // k A of this sample
    double layer_m;         // INFINITY: a straight law
    double friction;        // Coulomb's mu now, as it holds or slides; 0: none; INFINITY: gripped
    double stretch_m[3];    // e, along the skin
    double rate_m_s[3];     // of the skin here, at the velocities last looked at
    struct kn_sample_line { // out of the solver
        bool active;        // it presses, with slope_n_m depth + offset_n: k A and 0 of a straight law, else a tangent
        double slope_n_m, offset_n;
        double side_n_m; // k A where it sticks, what leaves the cone's force where it slides
    } line, last;        // and before it was judged last
    double force_n[3];   // out of the solver: on the skin
    double pressing_n;   // out of the solver: of it along normal; < 0 pulls
    uint64_t key;
    bool bonds; // touched in the last step
} kn_sample;

typedef struct kn_contact { // one step's contacts; lives in the state's scratch
    kn_hold *hold;
    kn_sample *sample;
    int hold_count, hold_max;
    int sample_count, sample_max;
    int64_t samples_lost; // did not fit: counted, never written out of bounds
    kn_tool_step tool[KN_PROBES_MAX];
    bool coupled; // any of them
} kn_contact;

size_t kn_contact_bytes(const kn_model *model);
void kn_contact_init(const kn_model *model, kn_contact *contact, void *memory);

// Anchors that a state has room for: one per sample of a model whose contact sticks, else 0.
size_t kn_contact_anchors(const kn_model *model);

// Moves attached tools after their poses, then lists holds and samples at the positions of now.
void kn_contact_find(const kn_model *model, kn_state *state, const kn_input *input, kn_contact *contact);

// Normal velocity of a sample's point minus its tool's, along the tool's push, for nodal velocities `field` (the
// model's reals, as state->velocity).
double kn_sample_gap_rate(const kn_model *model, const kn_contact *contact, const kn_sample *s, const void *field);

// Explicit: the force of its depth now, straight and along the normal.
void kn_sample_push(kn_sample *s);

// Sums forces on each tool, releases nodes that pull, remembers what sticks, advances the tools by one step.
void kn_contact_end(const kn_model *model, kn_state *state, const kn_input *input, kn_contact *contact,
                    kn_output *output);

#endif
