#ifndef KN_CLIENTS_SLAB_H
#define KN_CLIENTS_SLAB_H
// Slab: the object of a scene under one of the scene's tools, for use as the object of a rig (rig.h). The whole lattice
// is stepped. A pad (pad.h), in contrast, is one lumped element.
#include "clients/knead/rig.h"
#include "core/coupling.h"
#include "core/scene/scene.h"
#include "core/step.h"

typedef struct kn_slab {
    kn_model *model;
    kn_state *state;
    kn_input input;
    kn_output output;
    double touch_m; // height [m] in the scene at which the tool just touches the middle of the object; the rig's z = 0
    bool diverged;
} kn_slab;

// Build the lattice of `scene` with one of its tools and the virtual coupling `coupling`. tool: name of the tool; NULL:
// the first tool that can be coupled. kn_slab_close frees the memory. Return false and one line in `error` on failure.
bool kn_slab_open(kn_slab *slab, const kn_scene *scene, const char *tool, const kn_coupling *coupling, char *error,
                  size_t error_size);
void kn_slab_close(kn_slab *slab);

// Step the lattice by one time step and write the force on the device to `force_n`. Return -1, because the energy
// stored in the lattice is not known. The function has the type kn_rig_object. slab: a kn_slab.
double kn_slab_touch(void *slab, const double position_m[3], const double velocity_m_s[3], double force_n[3]);

#endif
