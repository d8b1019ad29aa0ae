#include "clients/knead/cells.h"
#include "clients/knead/vtu.h"
#include "core/lattice.h"
#include <stdlib.h>
#include <string.h>

// Append one cell with its corner nodes to the list. kn_cell numbers its corners in binary order, and VTK numbers them
// around each face.
static void add(kn_cells *c, const kn_cell *cell, uint8_t type, int count, int node)
{
    static const int round[8] = {0, 1, 3, 2, 4, 5, 7, 6};
    const bool square = type == KN_VTK_HEXAHEDRON || type == KN_VTK_QUAD;
    int32_t at = c->count > 0 ? c->end[c->count - 1] : 0;
    for (int i = 0; i < count; i++) {
        const int corner = cell->corner[square ? round[i] : i] + node;
        // In a composite (a lattice with two resolutions) several nodes stand for the same point: use the master node.
        c->corner[at++] = c->model->composite ? kn_composite_master(c->model, corner) : corner;
    }
    c->type[c->count] = type;
    c->end[c->count++] = at;
}

// Append all cells of one grid of nodes. `node` is the number of the grid's first node.
static bool add_grid(kn_cells *c, const kn_grid *grid, int node)
{
    const int count = kn_grid_cells(grid, NULL);
    kn_cell *cell = malloc(((size_t)count + 1) * sizeof *cell);
    if (!cell) return false;
    kn_grid_cells(grid, cell);
    for (int i = 0; i < count; i++)
        add(c, &cell[i], grid->flat ? KN_VTK_QUAD : KN_VTK_HEXAHEDRON, grid->flat ? 4 : 8, node);
    free(cell);
    return true;
}

static void add_mesh(kn_cells *c, const kn_simplices *mesh)
{
    const bool flat = mesh->dimension == 2;
    for (int i = 0; i < mesh->element_count; i++) {
        kn_cell cell;
        memcpy(cell.corner, mesh->element[i], sizeof mesh->element[i]);
        add(c, &cell, flat ? KN_VTK_TRIANGLE : KN_VTK_TETRA, flat ? 3 : 4, 0);
    }
}

// Return the number of cells of a model: a mesh, a grid, or a composite of several grids.
static int count_of(const kn_model *m)
{
    int count = 0;
    if (m->def.mesh) return m->def.mesh->element_count;
    if (!m->composite) return kn_grid_cells(&m->grid, NULL);
    for (int p = 0; p < m->composite->part_count; p++) count += kn_grid_cells(&m->composite->part[p].grid, NULL);
    return count;
}

// Return the volume of a cell in a state, or at rest if state is NULL.
static double volume(const kn_cells *c, const kn_state *state, int number)
{
    static const int binary[8] = {0, 1, 3, 2, 4, 5, 7, 6};
    const kn_model *m = c->model;
    const int first = number > 0 ? c->end[number - 1] : 0, corners = c->end[number] - first;
    double x[8][3], gradient[8][3];
    // Convert the corners from the VTK order back to the binary order, which the volume functions expect.
    for (int i = 0; i < corners; i++) {
        double *to = x[m->def.mesh ? i : binary[i]];
        const int node = c->corner[first + i];
        if (state) kn_state_position(m, state, node, to);
        else memcpy(to, m->rest_m[node], sizeof m->rest_m[node]);
    }
    if (!m->def.mesh) return kn_cell_volume(&m->grid, (const double(*)[3])x, gradient);
    return kn_simplex_volume(m->def.mesh->dimension == 2 ? m->def.thickness_m : 0, (const double(*)[3])x, gradient);
}

bool kn_cells_list(kn_cells *c, const kn_model *m)
{
    const size_t count = (size_t)count_of(m) + 1;
    *c = (kn_cells){.model = m};
    c->corner = malloc(8 * count * sizeof *c->corner);
    c->end = malloc(count * sizeof *c->end);
    c->type = malloc(count);
    c->rest = malloc(count * sizeof *c->rest);
    // Append the cells of a mesh, of a grid, or of a composite of grids, whichever the object is.
    bool fits = c->corner && c->end && c->type && c->rest;
    if (fits && m->def.mesh) add_mesh(c, m->def.mesh);
    else if (fits && !m->composite) fits = add_grid(c, &m->grid, 0);
    for (int p = 0; fits && m->composite && p < m->composite->part_count; p++)
        fits = add_grid(c, &m->composite->part[p].grid, m->composite->node_first[p]);
    for (int i = 0; fits && i < c->count; i++) c->rest[i] = volume(c, NULL, i);
    if (!fits) kn_cells_free(c);
    return fits;
}

void kn_cells_free(kn_cells *c)
{
    free(c->corner);
    free(c->end);
    free(c->type);
    free(c->rest);
    *c = (kn_cells){0};
}

void kn_cells_ratio(const kn_cells *c, const kn_state *state, float *ratio)
{
    for (int i = 0; i < c->count; i++) ratio[i] = (float)(volume(c, state, i) / c->rest[i]);
}
