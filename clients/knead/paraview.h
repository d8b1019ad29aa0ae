#ifndef KN_CLIENTS_PARAVIEW_H
#define KN_CLIENTS_PARAVIEW_H
// Export of an object to ParaView. A moment is the state of the object and its tools at one time. All files of an
// export are in one folder:
//
//     object.pvd    the file to open: the object and its tools through time
//     edges.pvd     every edge of the lattice as a line
//     object_00000.vtu, edges_00000.vtu, tool_<probe>_00000.vtu ... : the moments
//
//   object   points: all nodes, in the order of the lattice  displacement_m, velocity_m_s, von_mises_stress_pa,
//                                                            residual_strain, contact_force_n (from the tools)
//            cells (cells.h; lines if there are no cells)    volume_ratio, V/V0
//   edges    the same points                                 displacement_m
//            lines                                           stress_pa, strain, residual_strain
//   tool     surface, and the tool's position as a vertex    force_n, contact_force_n, torque_n_m: set at this vertex,
//                                                            0 at all other points
//            no points while nobody holds the tool           field: orientation_wxyz, gain
#include "core/state.h"

// Moment: state of the object and its tools at one time. The caller owns all objects to which the pointers refer.
typedef struct kn_moment {
    const kn_model *model;
    int models;            // running number of the model; two models can have the same address, but not the same number
    const kn_state *state; // if `state` has no solver scratch, contact forces of the nodes are unknown and not exported
    double time_s;
    // tool[i]: pose and forces of the tool of probe i. live: a hand holds this tool.
    struct kn_moment_tool {
        bool live;
        double position_m[3], orientation_wxyz[4];
        double contact_force_n[3];        // contact force on the tool, before any force limit
        double force_n[3], torque_n_m[3]; // force and torque that kneadd gives to the hand
        double gain;
    } tool[KN_PROBES_MAX];
} kn_moment;

typedef struct kn_paraview kn_paraview;

// Open an export into an existing folder, add moments in time order, and close the export. On failure the functions
// return NULL or false and write one line to `error`. kn_paraview_close frees `p` even if it fails.
kn_paraview *kn_paraview_open(const char *folder, char *error, size_t error_size);
bool kn_paraview_add(kn_paraview *p, const kn_moment *moment, char *error, size_t error_size);
bool kn_paraview_close(kn_paraview *p, char *error, size_t error_size);

#endif
