#ifndef KN_CLIENTS_CELLS_H
#define KN_CLIENTS_CELLS_H
// The cells of an object in VTK's order, for files: cubes of a block, squares of a flat one, elements of a mesh. One that
// is a node wide has none. Where parts of a block of two resolutions meet, cells share the nodes that both have.
#include "core/state.h"

typedef struct kn_cells {
    const kn_model *model; // borrowed
    int count;
    int32_t *corner, *end; // [end[count - 1]] nodes, [count]: see vtu.h
    uint8_t *type;         // [count]
    double *rest;          // [count] volume at rest, m^3
} kn_cells;

bool kn_cells_list(kn_cells *cells, const kn_model *model); // false: memory is short
void kn_cells_free(kn_cells *cells);                        // zeroed is fine

// V/V0 of every cell, ratio[count]: below 0 it has turned inside out.
void kn_cells_ratio(const kn_cells *cells, const kn_state *state, float *ratio);

#endif
