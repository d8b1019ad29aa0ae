#ifndef KN_CORE_CONTACT_H
#define KN_CORE_CONTACT_H
// Contact of rigid tools with the object. This module does the geometry: it lists the held nodes and the pressing
// samples. All solvers use the two lists.
//
// Plate. The plate holds the top nodes that it reaches: they move with the plate's velocity (it sticks). The residual
// that the lattice leaves on a held node is the contact force, unfiltered. A held node that would pull at the plate is
// released.
//
// All other shapes. They use foundation contact (pressure = stiffness x depth) on a smooth skin. The skin is the
// quadratic B-spline through the nodes of each face, or bilinear (kn_skin_form). Each node patch of the skin has
// samples s = sum_a w_a x_a,  depth = -distance of the shape at s,
//
//     f = k A depth n                                   while depth > -adhesion/k, once touched; else while depth > 0
//     t = -k A e, cut to mu f; e: how far s has slid along the tool since it stuck (elastoplastic anchor)
//     k: foundation stiffness, N/m^3;  A: area of the skin that the sample stands for;  n: normal of the tool
//
// Both forces are taken implicitly at the end of the step, active set and friction cone included. Rejected: contact at
// single nodes or closest points. Its force jumps by 60-76 % per millisecond when the support changes, while a pressure
// that fades to zero at the rim does not jump. Rejected, too: friction that follows a measured velocity instead of an
// anchor. It chatters at full amplitude. e belongs to the sample, which is a point of the material, so the skin carries
// e along.
//
// A coupled tool (tool.h) may arrive at 1 m/s and with any force. Its foundation is a layer whose thickness is KN_LAYER
// times the tool's smallest half width:
//     pressure = k depth / (1 - depth / layer)
// So no force can push the skin through the tool. The part of the object that the tool pushes down stops at the table.
//
// Table. With support FRICTION, the plane z = 0 pushes the nodes of the outside up in the same way.
#include "core/tool.h"

#define KN_FOUNDATION_N_M3 2.5e7 // default foundation stiffness: dough's yield pressure 7.8 kPa presses it in by 0.3 mm
#define KN_TABLE_N_M3 1e8        // foundation stiffness of the table: dough as high as a hand sinks in by 0.05 mm
#define KN_LAYER 0.5             // layer thickness of a coupled tool / its smallest half width
#define KN_STICTION 1.2          // static friction / sliding friction
#define KN_TABLE (-1)            // value of kn_sample.probe for the table

static inline double kn_probe_foundation(const kn_probe_def *probe)
{
    return probe->foundation_n_m3 > 0 ? probe->foundation_n_m3 : KN_FOUNDATION_N_M3;
}

typedef struct kn_hold { // a node that a plate holds in this step
    int node, top;       // node id; number within model->top
    int probe;
    double velocity_m_s[3];
    double force_n[3]; // set by the solver: force of the node on the plate
    bool gone;         // set by the solver: the plate let the node go within the step
} kn_hold;

typedef struct kn_sample { // a point of the skin near a tool
    int probe, face;
    int nodes; // number of nodes that carry it: 9 on a block, 3 on a net, 1 at the table
    int node[9];
    size_t offset[9]; // offset of each node's x component, see kn_model.offset
    double weight[9];
    double normal[3];               // unit: the direction in which the tool pushes
    double point_m[3];              // present position
    double arm_m[3];                // from the tool's position to the point
    double depth_m;                 // present depth; > 0 inside the tool
    double lowest_m;                // <= 0: depth at which the sample lets go
    double foundation_n_m;          // k A of this sample
    double layer_m;                 // thickness of the layer; INFINITY: a straight law
    double friction;                // present Coulomb's mu, static or sliding; 0: none; INFINITY: gripped
    double stretch_m[3];            // e, along the skin
    double rate_m_s[3];             // velocity of the skin here, from the velocity field evaluated last
    struct kn_sample_line {         // linearised force, set by the solver
        bool active;                // the sample presses with slope_n_m depth + offset_n
        double slope_n_m, offset_n; // k A and 0 for a straight law, else the tangent
        double side_n_m; // stiffness along the skin: k A while it sticks; while it slides, the force ends on the cone
    } line, last;        // last: `line` as it was before its last update
    double force_n[3];   // set by the solver: force on the skin
    double pressing_n;   // set by the solver: its part along normal; < 0 pulls
    uint64_t key;
    bool bonds; // touched in the last step
} kn_sample;

typedef struct kn_contact { // contacts of one step; lives in the state's scratch
    kn_hold *hold;
    kn_sample *sample;
    int hold_count, hold_max;
    int sample_count, sample_max;
    int64_t samples_lost; // samples that did not fit: counted, never written out of bounds
    kn_tool_step tool[KN_PROBES_MAX];
    bool coupled; // true if any tool is coupled
} kn_contact;

size_t kn_contact_bytes(const kn_model *model);
void kn_contact_init(const kn_model *model, kn_contact *contact, void *memory);

// Return the number of anchors that a state has room for: one per sample if any contact of the model sticks, else 0.
size_t kn_contact_anchors(const kn_model *model);

// Begin the step of every tool (attach or detach it, set its velocity), then list holds and samples at the present
// positions. kn_contact_end moves the tools.
void kn_contact_find(const kn_model *model, kn_state *state, const kn_input *input, kn_contact *contact);

// Return the velocity of a sample's point minus that of its tool, along the sample's normal. `field` holds the nodal
// velocities in the model's precision, as state->velocity does.
double kn_sample_gap_rate(const kn_model *model, const kn_contact *contact, const kn_sample *s, const void *field);

// Set the sample's force from its present depth, along the normal, by a straight law. For explicit solvers.
void kn_sample_push(kn_sample *s);

// Sum the forces on each tool, release nodes that pull, store anchors of sticking samples, and advance the tools by one
// step.
void kn_contact_end(const kn_model *model, kn_state *state, const kn_input *input, kn_contact *contact,
                    kn_output *output);

#endif
