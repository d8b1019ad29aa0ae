#ifndef KN_CORE_STATE_H
#define KN_CORE_STATE_H
// The state: everything that changes. One allocation; copying it is a snapshot, hashing it is a test.
#include "core/model.h"
#include <stdint.h>

// What a probe is to the lattice.
typedef struct kn_probe_state {
    double position_m[3];   // where the model's probe is (it follows the pose, see contact.h)
    double velocity_m_s[3]; // over the last step
    double work_j;          // done by the probe on the object since it was attached
    int32_t attached;       // 0: the probe is lifted out of the model and touches nothing
    int32_t contacts;       // nodes (plate) or samples (sphere) that carried load in the last step
} kn_probe_state;

// What a tool that turns or is coupled adds to that. Hashed for such tools only.
typedef struct kn_tool_state {
    double orientation_wxyz[4]; // of the model's tool, unit
    double turn_rad_s[3];       // over the last step
    double relief_m;            // how much smaller it still is: it met the object from inside, and grows back slowly
    double grip_n;              // 0, or the force up to which `grip` holds on: gone when that was too much
} kn_tool_state;

// What contact that sticks remembers of one of its samples: a point of the skin under one tool.
typedef struct kn_anchor {
    uint64_t key;        // of the sample, see contact.c; ascending
    double stretch_m[3]; // elastic slip: of the skin against the tool, since it stuck
    int64_t flags;       // KN_ANCHOR_*
} kn_anchor;
#define KN_ANCHOR_SLIPS 1 // beyond the cone in the last step
#define KN_ANCHOR_BONDS 2 // touched in the last step: adhesion may hold it

// Saved and hashed, in this order: name, type, components. Node fields have 3, edge fields 13 reals per lane.
#define KN_STATE_FIELDS(X)                                                                                             \
    X(displacement, 3)    /* m, from rest: keeps 1e-9 m in f32 where a coordinate could not */                         \
    X(velocity, 3)        /* m/s, over the last step */                                                                \
    X(change, 3)          /* m/s, of the velocity in the last step */                                                  \
    X(strain, KN_FORWARD) /* u of each forward edge, before the last step; absent (NULL) under KN_LAW_VOIGT */

#define KN_SECANT_REST 500 // steps on the secant after chatter

typedef struct kn_state {
    int64_t tick; // steps since reset; not hashed: an object that nobody touched is the same at every tick
    kn_probe_state probe[KN_PROBES_MAX];
    // chatter watch: sign changes of the force's increment in the last 64 steps; steps left on the secant
    uint64_t chatter_bits;
    double last_force_n, last_delta_n;
    double residual_scale; // largest preconditioned residual norm of the recent steps, decaying over 1 s
    int64_t secant_steps;
    int32_t bad; // 1 after a non-finite force or displacement: kn_step then does nothing until reset
    int32_t anchor_count;
    kn_tool_state tool[KN_PROBES_MAX];
#define KN_FIELD(name, components) void *name; // float or double, as the model's precision says
    KN_STATE_FIELDS(KN_FIELD)
#undef KN_FIELD
    uint8_t *held;     // [KN_PROBES_MAX][top_count] 1 where a plate holds the node
    kn_anchor *anchor; // [of the contact's samples] when the model has contact that sticks, else NULL
    void *scratch;     // solver vectors; not saved, not hashed; NULL in one that is only kept
    size_t bytes;      // of the arena that starts at this struct
} kn_state;

size_t kn_state_size(const kn_model *model);      // bytes of a state, arena and all; what kn_model_build stores
kn_state *kn_state_create(const kn_model *model); // reset already; NULL when memory is short
// One to copy to and from, to read, write and hash, a tenth as large: without scratch it cannot be stepped or reset.
kn_state *kn_state_keep(const kn_model *model);              // all 0; NULL when memory is short
size_t kn_state_kept(const kn_model *model);                 // its bytes
void kn_state_destroy(kn_state *state);                      // NULL is fine
void kn_state_reset(const kn_model *model, kn_state *state); // object at rest, undeformed
void kn_state_copy(const kn_model *model, kn_state *dst, const kn_state *src);

// 64-bit hash of everything saved but the tick. Equal across compilers, optimisation levels and instruction sets.
// Real-time safe.
uint64_t kn_state_hash(const kn_model *model, const kn_state *state);

// Position of a node now, m. Real-time safe.
void kn_state_position(const kn_model *model, const kn_state *state, int node, double x_m[3]);
// Velocity of a node over the last step, m/s. Real-time safe.
void kn_state_velocity(const kn_model *model, const kn_state *state, int node, double v_m_s[3]);

#endif
