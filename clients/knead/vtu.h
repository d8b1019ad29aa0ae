#ifndef KN_CLIENTS_VTU_H
#define KN_CLIENTS_VTU_H
// Points, cells between them and numbers on both, as a VTK XML file (UnstructuredGrid, .vtu) that ParaView and every
// reader of VTK opens; and the collection (.pvd) that says which file is of which time. XML is libxml2's, numbers are
// little-endian binary in base64.
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
    KN_VTK_VERTEX = 1,
    KN_VTK_LINE = 3,
    KN_VTK_TRIANGLE = 5,
    KN_VTK_QUAD = 9,
    KN_VTK_TETRA = 10,
    KN_VTK_HEXAHEDRON = 12
};

typedef struct kn_vtu_array {
    const char *name;   // with its unit: "velocity_m_s"
    int components;     // 1 or 3; of the whole file's any
    const float *value; // [points or cells][components]
} kn_vtu_array;

#define KN_VTU_ARRAYS 6
typedef struct kn_vtu { // borrows all
    double time_s;
    int point_count, cell_count;
    const float (*xyz)[3]; // [point_count] m
    const int32_t *corner; // points of all cells, one cell after the other, in VTK's order
    const int32_t *end;    // [cell_count] where a cell's end in them
    const uint8_t *type;   // [cell_count] KN_VTK_*
    int point_arrays, cell_arrays, field_arrays;
    kn_vtu_array point[KN_VTU_ARRAYS], cell[KN_VTU_ARRAYS], field[KN_VTU_ARRAYS]; // field: one tuple for the whole file
} kn_vtu;

// False and one line in error: memory, or the file cannot be written to its end.
bool kn_vtu_write(const kn_vtu *vtu, const char *path, char *error, size_t error_size);

typedef struct kn_pvd kn_pvd;

// kn_pvd_open -> kn_pvd_add, times ascending -> kn_pvd_close, which says whether all of it is there.
kn_pvd *kn_pvd_open(const char *path, char *error, size_t error_size);
void kn_pvd_add(kn_pvd *pvd, double time_s, int part, const char *name, const char *file); // file: beside the .pvd
bool kn_pvd_close(kn_pvd *pvd, char *error, size_t error_size);

#endif
