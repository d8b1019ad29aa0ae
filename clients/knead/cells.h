#ifndef KN_CLIENTS_CELLS_H
#define KN_CLIENTS_CELLS_H
// The cells of an object for VTK files, with their corners in VTK's order. Cells are the cubes of a block, the squares
// of a flat object, or the elements of a mesh. An object that is one node wide has no cells. Where the parts of a block
// with two resolutions meet, cells share the nodes that both parts have.
#include "core/state.h"

typedef struct kn_cells {
    const kn_model *model; // must outlive the cells
    int count;
    int32_t *corner, *end; // corner: nodes of all cells, [end[count - 1]]; end: end of each cell in corner, [count]
    uint8_t *type;         // [count]
    double *rest;          // [count] volume at rest, m^3
} kn_cells;

bool kn_cells_list(kn_cells *cells, const kn_model *model); // false: out of memory
void kn_cells_free(kn_cells *cells);                        // all zero is allowed

// Compute V/V0 of every cell, ratio[count]. A negative ratio means that the cell is inside out.
void kn_cells_ratio(const kn_cells *cells, const kn_state *state, float *ratio);

#endif
