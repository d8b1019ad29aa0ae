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
//            cells (lines if there are no cells)             volume_ratio, V/V0
//   edges    the same points                                 displacement_m
//            lines                                           stress_pa, strain, residual_strain
//   tool     surface, and the tool's position as a vertex    force_n, contact_force_n, torque_n_m: set at this vertex,
//                                                            0 at all other points
//            no points while nobody holds the tool           field: orientation_wxyz, gain
#include "core/state.h"
#include "server/servo.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// Moment: state of the object and its tools at one time. The caller owns all objects to which the pointers refer.
typedef struct kn_moment {
    const kn_model *model;
    int models; // running number of the model; two models can have the same address, but not the same number
    const kn_state *state;
    const kn_scratch *scratch; // scratch of the last step, for the contact forces; NULL: nothing touches the object
    double time_s;
    const kn_force *tool[KN_PROBES_MAX]; // pose and forces of the tool of each probe; NULL: no hand holds this tool
} kn_moment;

// Surface of a tool as triangles, in the tool's own coordinates [m]. The surface is the one that the contact computation
// uses (core/shape.h). A round tool is divided in steps of 7.5 degrees. The contact computation gives a plate no
// thickness; here a plate is 2 mm thick, as in the pictures.
typedef struct kn_tool_form {
    int point_count, triangle_count;
    float (*xyz)[3];        // point 0 is the origin of the coordinates and belongs to no triangle
    int32_t (*triangle)[3]; // three indices in `xyz` per triangle, counter-clockwise as seen from outside
} kn_tool_form;

// Make the surface of a tool. On failure (out of memory) return false with a zeroed form.
bool kn_tool_form_make(kn_tool_form *form, const kn_model *model, int probe);
void kn_tool_form_free(kn_tool_form *form); // a zeroed struct is allowed

typedef struct kn_paraview kn_paraview;

// Open an export into an existing folder, add moments in time order, and close the export. On failure the functions
// return NULL or false and write one line to `error`. kn_paraview_close frees `p` even if it fails.
kn_paraview *kn_paraview_open(const char *folder, char *error, size_t error_size);
bool kn_paraview_add(kn_paraview *p, const kn_moment *moment, char *error, size_t error_size);
bool kn_paraview_close(kn_paraview *p, char *error, size_t error_size);

// Writer of VTK XML files for ParaView and every other VTK reader. A .vtu file (UnstructuredGrid) holds points, cells
// between the points, and arrays of numbers on points and on cells. A .pvd file is a collection: it lists which .vtu
// file belongs to which time. libxml2 writes the XML. Numbers are little-endian binary in base64.

enum {
    KN_VTK_VERTEX = 1,
    KN_VTK_LINE = 3,
    KN_VTK_TRIANGLE = 5,
    KN_VTK_QUAD = 9,
    KN_VTK_TETRA = 10,
    KN_VTK_HEXAHEDRON = 12
};

typedef struct kn_vtu_array {
    const char *name;   // name of the quantity with its unit, such as "velocity_m_s"
    int components;     // numbers per point or cell: 1 or 3; in `field`: any number
    const float *value; // `components` numbers for each point or cell, one point after the other
} kn_vtu_array;

#define KN_VTU_ARRAYS 6
typedef struct kn_vtu { // contents of one .vtu file; the caller owns the arrays to which the pointers refer
    double time_s;
    int point_count, cell_count;
    const float (*xyz)[3]; // coordinates of the points [m], point_count elements
    const int32_t *corner; // indices of the corner points of all cells, one cell after the other, in VTK's order
    const int32_t *end;    // for each cell, the index in `corner` after the cell's last corner
    const uint8_t *type;   // for each cell, its shape as KN_VTK_*
    int point_arrays, cell_arrays, field_arrays;
    // point, cell: arrays with `components` numbers for each point or each cell. field: arrays with `components`
    // numbers for the whole file.
    kn_vtu_array point[KN_VTU_ARRAYS], cell[KN_VTU_ARRAYS], field[KN_VTU_ARRAYS];
} kn_vtu;

// Write a .vtu file. Return false and one line in `error` if memory is short or the file cannot be written completely.
bool kn_vtu_write(const kn_vtu *vtu, const char *path, char *error, size_t error_size);

typedef struct kn_pvd kn_pvd;

// Open a collection, add files in ascending order of time, and close the collection. kn_pvd_close always frees the
// collection. It returns false and one line in error if the file is not complete.
kn_pvd *kn_pvd_open(const char *path, char *error, size_t error_size);
// Add a .vtu file to the collection. part: number of the object or tool among the files of one time. file: file name
// relative to the folder of the .pvd file.
void kn_pvd_add(kn_pvd *pvd, double time_s, int part, const char *name, const char *file);
bool kn_pvd_close(kn_pvd *pvd, char *error, size_t error_size);

#endif
