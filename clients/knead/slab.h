#ifndef KN_CLIENTS_SLAB_H
#define KN_CLIENTS_SLAB_H
// A scene's object under one of its tools as the object of a rig (rig.h): the lattice itself instead of one element.
#include "clients/knead/rig.h"
#include "core/coupling.h"
#include "core/scene/scene.h"
#include "core/step.h"

typedef struct kn_slab {
    kn_model *model;
    kn_state *state;
    kn_input input;
    kn_output output;
    double touch_m; // height at which the tool, over the middle, just touches: the rig's 0
    bool diverged;
} kn_slab;

// Of the tool that has that name, NULL: the first one that can be coupled; with this coupling. False and one line in
// error. Allocates.
bool kn_slab_open(kn_slab *slab, const kn_scene *scene, const char *tool, const kn_coupling *coupling, char *error,
                  size_t error_size);
void kn_slab_close(kn_slab *slab);

// A kn_rig_object: one step of the lattice. What it has stored is not known.
double kn_slab_touch(void *slab, const double position_m[3], const double velocity_m_s[3], double force_n[3]);

#endif
