#ifndef KN_CLIENTS_PARAVIEW_H
#define KN_CLIENTS_PARAVIEW_H
// Moments of an object as files for ParaView, in one folder:
//
//     object.pvd    what to open: the object and its tools through time
//     edges.pvd     every edge of the lattice, a line each
//     object_00000.vtu, edges_00000.vtu, tool_<probe>_00000.vtu ... : the moments
//
//   object   points are all nodes, in the lattice's order    displacement_m, velocity_m_s, von_mises_stress_pa,
//                                                            residual_strain, contact_force_n (of the tools on it)
//            cells (cells.h; lines where it has none)        volume_ratio, V/V0
//   edges    the same points                                 displacement_m
//            lines                                           stress_pa, strain, residual_strain
//   tool     its surface, and its own point as a vertex      there force_n, contact_force_n, torque_n_m; 0 elsewhere
//            no points while nobody holds it                 field: orientation_wxyz, gain
#include "core/state.h"

typedef struct kn_moment { // borrows all
    const kn_model *model;
    int models;            // counts up where model is another than before: an address may come back
    const kn_state *state; // without scratch: no forces on nodes are told
    double time_s;
    struct kn_moment_tool {
        bool live;
        double position_m[3], orientation_wxyz[4];
        double contact_force_n[3];        // on the tool, before any limit
        double force_n[3], torque_n_m[3]; // what the hand is given
        double gain;
    } tool[KN_PROBES_MAX];
} kn_moment;

typedef struct kn_paraview kn_paraview;

// Into a folder that is there. NULL, or false: one line in error. close frees it either way.
kn_paraview *kn_paraview_open(const char *folder, char *error, size_t error_size);
bool kn_paraview_add(kn_paraview *p, const kn_moment *moment, char *error, size_t error_size);
bool kn_paraview_close(kn_paraview *p, char *error, size_t error_size);

#endif
