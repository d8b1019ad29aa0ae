#ifndef KN_CLIENTS_CELLS_H
#define KN_CLIENTS_CELLS_H
// The cells of an object for VTK files, with their corners in VTK's order. Cells are the cubes of a block, the squares
// of a flat object, or the elements of a mesh. An object that is one node wide has no cells. Where the parts of a block
// with two resolutions meet, cells share the nodes that both parts have.
#include "core/state.h"

typedef struct kn_cells {
    const kn_model *model; // model of the object; must outlive this list of cells
    int count;
    // corner: node numbers of all cells, [end[count - 1]]; end: index in corner after the last node of each cell,
    // VTK cell type of each cell, [count].
    int32_t *corner, *end;
    uint8_t *type; // VTK cell type of each cell, [count]
    double *rest;  // volume of each cell at rest, m^3, [count] values
} kn_cells;

// List the cells of the object; return false if out of memory.
bool kn_cells_list(kn_cells *cells, const kn_model *model);
void kn_cells_free(kn_cells *cells); // a struct that is all zero is allowed

// Compute the present volume V of every cell relative to its volume V0 at rest, into ratio[count]. A negative ratio
// means that the cell is inside out.
void kn_cells_ratio(const kn_cells *cells, const kn_state *state, float *ratio);

#endif
