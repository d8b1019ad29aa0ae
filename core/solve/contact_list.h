#ifndef KN_CORE_SOLVE_CONTACT_LIST_H
#define KN_CORE_SOLVE_CONTACT_LIST_H
// The lists of a step's contact: held nodes, samples, and patches of samples; see contact.h. They are part of the
// scratch and are filled anew in each step.
#include "core/solve/tool.h"

#define KN_FOUNDATION_N_M3 2.5e7 // default stiffness: the yield pressure of dough, 7.8 kPa, gives a depth of 0.3 mm
// foundation stiffness of the table: a block of dough 10 cm high sinks into the table by 0.01 mm under its own weight
#define KN_TABLE_N_M3 1e8
#define KN_LAYER 0.5    // ratio of a coupled tool's layer thickness to the tool's smallest half width
#define KN_STICTION 1.2 // ratio of static to sliding friction
#define KN_TABLE (-1)   // value of kn_sample.probe for the table

static inline double kn_probe_foundation(const kn_probe_def *probe)
{
    return probe->foundation_n_m3 > 0 ? probe->foundation_n_m3 : KN_FOUNDATION_N_M3;
}

typedef struct kn_held_node { // a node that a plate holds in this step
    int node, top;            // node: id of the held node; top: index of the node in model->top
    int probe;                // probe whose plate holds the node
    bool slides;              // the plate prescribes only the node's vertical velocity
    double velocity_m_s[3];
    double lowest_n;   // force_n[2] below which the plate releases the node: 0, or < 0 with adhesion
    double force_n[3]; // set by the solver: force of the node on the plate
    bool gone;         // set by the solver: the plate released the node within the step
} kn_held_node;

// Samples that share their nodes, as they do in a patch of skin under one tool.
typedef struct kn_contact_patch {
    int probe;
    int first, count;   // first sample and number of samples, at most sixteen
    int nodes, node[9]; // nodes that carry the samples: 9 on a block, 3 on a net, 1 at the table
    size_t offset[9];   // offset of each node's x component, see kn_model.offset
    // The samples as lanes of sixteen, in the model's precision, for the products of the conjugate gradients. First the
    // vectors KN_CONTACT_*, then the weight of each node, then for each sample the weights of all nodes.
    void *lanes;
} kn_contact_patch;

enum { // vectors of kn_contact_patch.lanes
    KN_CONTACT_NORMAL = 0,
    KN_CONTACT_ALONG = 3,               // dt times the stiffness along the normal, less that along the skin
    KN_CONTACT_SIDE = 4,                // dt times the stiffness along the skin
    KN_CONTACT_ARM = 5,                 // vector from the tool's position to the sample
    KN_CONTACT_RATE = 8,                // velocity of the skin in the last field that contact_rates was given
    KN_CONTACT_FORCE = KN_CONTACT_RATE, // only while contact_add is called: the forces to add
    KN_CONTACT_WEIGHT = 11
};

typedef struct kn_sample { // a point of the skin near a tool
    int probe;
    const kn_contact_patch *patch;
    double weight[9];      // share of each node in the sample's position and force; the sum is 1
    double normal[3];      // unit vector in the direction in which the tool pushes the skin
    double point_m[3];     // present position of the sample in the scene [m]
    double arm_m[3];       // vector from the tool's position to the sample [m]
    double depth_m;        // present depth of the sample below the tool's surface; > 0: inside the tool [m]
    double lowest_m;       // depth at which the tool releases the sample: 0, or < 0 with adhesion or grip [m]
    double foundation_n_m; // foundation stiffness k times the sample's skin area A [N/m]
    // thickness of the foundation layer of a coupled tool; INFINITY: pressure is proportional to depth
    double layer_m;
    // present coefficient of Coulomb friction, static or sliding; 0: no friction; INFINITY: the tool grips the sample
    double friction;
    double stretch_m[3];    // tangential displacement e on the tool since the sample began to stick [m]
    double rate_m_s[3];     // velocity of the skin at the sample in the last field of velocities passed to look()
    struct kn_sample_line { // linearised contact force of the sample, set by the solver
        bool active;        // the force along the normal is slope_n_m * depth + offset_n, or 0 if not active
        double slope_n_m, offset_n; // tangent of the pressure law; without a layer the slope is k A and the offset is 0
        // Stiffness along the skin. It is k A while the sample sticks. While the sample slides, it is a secant
        // stiffness, chosen so that the friction force at the end of the step lies on Coulomb's cone.
        double side_n_m;
    } line, last;      // line: present linearisation; last: linearisation before the last update
    double force_n[3]; // set by the solver: force on the skin
    double pressing_n; // set by the solver: part of force_n along the normal; < 0: the sample pulls
    uint64_t key;      // number by which the next step finds this sample again, see key_of in contact.c
    bool bonds;        // the sample touched the tool in the last step, so adhesion may hold it
} kn_sample;

typedef struct kn_contact { // contact of all tools and the table in one step; part of the state's scratch
    kn_held_node *hold;
    kn_sample *sample;
    kn_contact_patch *patch;
    int hold_count, hold_max;
    int sample_count, sample_max;
    int patch_count, patch_max;
    char *lanes, *lanes_free; // memory of all kn_contact_patch.lanes; it ends where `sample` begins
    int64_t samples_lost;     // number of samples dropped because `sample` or `patch` was full
    kn_tool_step tool[KN_PROBES_MAX];
    bool coupled; // at least one tool is tied to its pose by a virtual coupling (tool.h)
} kn_contact;

// Return the largest number of samples that all tools and the table together can have in one step.
int kn_contact_samples(const kn_model *model);

size_t kn_contact_bytes(const kn_model *model);
void kn_contact_init(const kn_model *model, kn_contact *contact, void *memory);

// Return the number of anchors for which a state has room: one per sample if any contact of the model sticks, else 0.
size_t kn_contact_anchors(const kn_model *model);

// Return the number of samples along each side of a node's patch, 2 to 4, for a tool with this smallest half width. If
// samples are at most an eighth of a ball's radius apart, the force of the sliding ball ripples by only 0.3 % per ms.
int kn_samples_per_patch(double spacing_m, double fine_m);

// Return the largest distance from the tool, m, at which a sample can still come into contact in this step, with the
// tool at rest.
double kn_contact_margin(const kn_model *model, const kn_probe_def *def);

// Empty all lists. Real-time safe, as are all functions below.
void kn_contact_clear(kn_contact *contact);

// Begin a patch of the given nodes with at most `samples` samples. Return NULL if there is no room.
kn_contact_patch *kn_contact_patch_begin(const kn_model *model, kn_contact *contact, int probe, int nodes,
                                         const int *node, int samples);
#define KN_PATCH_SIDE_MAX 4 // largest number of samples along a side of a patch

// Take the next sample of a patch, all 0 but for `probe` and `patch`. Return NULL if there is no room. A sample that
// finds no room, or whose patch found none (NULL), is counted as lost.
kn_sample *kn_sample_begin(kn_contact *contact, kn_contact_patch *patch);

// Store what the kernels need of the newest sample of a patch, whose members are set.
void kn_sample_end(const kn_model *model, kn_contact *contact, kn_sample *sample);

// Store the velocity of the skin at a sample in a field of node velocities, m/s.
void kn_sample_velocity(const kn_model *model, const kn_sample *sample, const void *field, double v_m_s[3]);

#endif
