#include "clients/picture/paraview.h"
#include "core/algebra/algebra.h"
#include "core/field.h"
#include "core/lattice/lattice.h"
#include "core/lattice/measure.h"
#include "core/shape.h"
#include "core/touch.h"
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// The cells of an object for VTK files, with their corners in VTK's order. Cells are the cubes of a block, the squares
// of a flat object, or the elements of a mesh. An object that is one node wide has no cells. A block can have two parts
// with different resolutions. Where the parts meet, their cells share the common nodes.

typedef struct cell_list {
    const kn_model *model; // model of the object; must outlive this list of cells
    int count;
    // corner: node numbers of the corners of all cells, end[count - 1] elements. end: [count] elements, for each cell
    // the index in `corner` after the cell's last corner.
    int32_t *corner, *end;
    uint8_t *type; // VTK cell type of each cell, [count]
    double *rest;  // volume of each cell at rest, m^3, [count] values
} cell_list;

// Append one cell with its corner nodes to the list. kn_cell numbers its corners in binary order, and VTK numbers them
// around each face.
static void add_cell(cell_list *c, const kn_cell *cell, uint8_t type, int count, int node)
{
    static const int round[8] = {0, 1, 3, 2, 4, 5, 7, 6};
    const bool square = type == KN_VTK_HEXAHEDRON || type == KN_VTK_QUAD;
    int32_t at = c->count > 0 ? c->end[c->count - 1] : 0;
    for (int i = 0; i < count; i++) {
        const int corner = cell->corner[square ? round[i] : i] + node;
        // In a composite (a lattice with two resolutions) several nodes can stand for the same point. One of them is
        // the master node; use this node.
        c->corner[at++] = c->model->composite ? kn_composite_master(c->model, corner) : corner;
    }
    c->type[c->count] = type;
    c->end[c->count++] = at;
}

// Append all cells of one grid of nodes. `node` is the number of the grid's first node.
static bool add_grid(cell_list *c, const kn_grid *grid, int node)
{
    const int count = kn_grid_cells(grid, NULL);
    kn_cell *cell = malloc(((size_t)count + 1) * sizeof *cell);
    if (!cell) return false;
    kn_grid_cells(grid, cell);
    for (int i = 0; i < count; i++)
        add_cell(c, &cell[i], grid->flat ? KN_VTK_QUAD : KN_VTK_HEXAHEDRON, grid->flat ? 4 : 8, node);
    free(cell);
    return true;
}

static void add_mesh(cell_list *c, const kn_simplices *mesh)
{
    const bool flat = mesh->dimension == 2;
    for (int i = 0; i < mesh->element_count; i++) {
        kn_cell cell;
        memcpy(cell.corner, mesh->element[i], sizeof mesh->element[i]);
        add_cell(c, &cell, flat ? KN_VTK_TRIANGLE : KN_VTK_TETRA, flat ? 3 : 4, 0);
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
static double cell_volume(const cell_list *c, const kn_state *state, int number)
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

// Free a list of cells. A struct that is all zero is allowed.
static void cells_free(cell_list *c)
{
    free(c->corner);
    free(c->end);
    free(c->type);
    free(c->rest);
    *c = (cell_list){0};
}

// List the cells of the object; return false if out of memory.
static bool cells_list(cell_list *c, const kn_model *m)
{
    const size_t count = (size_t)count_of(m) + 1;
    *c = (cell_list){.model = m};
    c->corner = malloc(8 * count * sizeof *c->corner);
    c->end = malloc(count * sizeof *c->end);
    c->type = malloc(count);
    c->rest = malloc(count * sizeof *c->rest);
    // Append all cells. The object is a mesh, a grid, or a composite of several grids.
    bool fits = c->corner && c->end && c->type && c->rest;
    if (fits && m->def.mesh) add_mesh(c, m->def.mesh);
    else if (fits && !m->composite) fits = add_grid(c, &m->grid, 0);
    for (int p = 0; fits && m->composite && p < m->composite->part_count; p++)
        fits = add_grid(c, &m->composite->part[p].grid, m->composite->node_first[p]);
    for (int i = 0; fits && i < c->count; i++) c->rest[i] = cell_volume(c, NULL, i);
    if (!fits) cells_free(c);
    return fits;
}

// Compute the present volume V of every cell relative to its volume V0 at rest, into ratio[count]. A negative ratio
// means that the cell is inside out.
static void cells_ratio(const cell_list *c, const kn_state *state, float *ratio)
{
    for (int i = 0; i < c->count; i++) ratio[i] = (float)(cell_volume(c, state, i) / c->rest[i]);
}

#define PLATE_THICKNESS_M 0.002
#define STEPS 12 // number of steps that divide a quarter turn
// Number of points of a ring: 4 quarters of STEPS + 1 points each. A quarter includes both of its end points.
#define AROUND (4 * (STEPS + 1))
// Number of rings: STEPS + 1 in the lower half and STEPS + 1 in the upper half of the surface.
#define RINGS (2 * (STEPS + 1))
#define POINTS (RINGS * AROUND + 2) // number of points: those of all rings, and one point at each end of the axis
#define TRIANGLES (2 * AROUND * RINGS)

// Every solid of shape.h except a mesh is the space that a ball covers while its centre moves through a core: a box, a
// disc, a line or a point. half_m: half extents of the box or line. disc_m: radius of the disc. roll_m: radius of the
// ball. up_m: height of the core's middle above the origin of the solid.
typedef struct core {
    double half_m[3], disc_m, roll_m, up_m;
} core;

static core core_of(const kn_solid *p)
{
    switch (p->kind) {
    case KN_SOLID_CAPSULE: return (core){{0, 0, 0.5 * p->length_m}, 0, p->radius_m, 0.5 * p->length_m};
    case KN_SOLID_CYLINDER: return (core){{0, 0, p->half_m[2]}, p->half_m[0], p->radius_m, 0.5 * p->length_m};
    case KN_SOLID_BOX: return (core){{p->half_m[0], p->half_m[1], p->half_m[2]}, 0, p->radius_m, 0.5 * p->length_m};
    default: return (core){{0}, 0, p->radius_m, 0};
    }
}

// Compute a point of the surface. `around`: index within the ring. `ring`: index of the ring, counted from the bottom.
// The points of each quarter turn lie around one corner of the core. Flat strips join the quarters.
static void point_of(const core *c, int ring, int around, float out[3])
{
    static const double quarter = 1.5707963267948966;
    const int quadrant = around / (STEPS + 1), upper = ring > STEPS;
    const double phi = quarter * (quadrant + around % (STEPS + 1) / (double)STEPS);
    const double theta = quarter * ((ring - upper * (STEPS + 1)) / (double)STEPS - !upper);
    const double x = quadrant == 0 || quadrant == 3 ? c->half_m[0] : -c->half_m[0];
    const double y = quadrant < 2 ? c->half_m[1] : -c->half_m[1];
    const double across = c->disc_m + c->roll_m * cos(theta);
    out[0] = (float)(x + across * cos(phi));
    out[1] = (float)(y + across * sin(phi));
    out[2] = (float)(c->up_m + (upper ? c->half_m[2] : -c->half_m[2]) + c->roll_m * sin(theta));
}

// Append a triangle to the surface, unless its area is 0.
static void add_triangle(kn_tool_form *f, int a, int b, int c)
{
    double ab[3], ac[3], across[3];
    for (int k = 0; k < 3; k++) {
        ab[k] = (double)f->xyz[b][k] - (double)f->xyz[a][k];
        ac[k] = (double)f->xyz[c][k] - (double)f->xyz[a][k];
    }
    kn_cross(ab, ac, across);
    // Leave out a triangle without area. Such triangles occur at the poles of a sphere and at sharp edges.
    if (kn_dot(across, across) < 1e-24) return;
    f->triangle[f->triangle_count][0] = a;
    f->triangle[f->triangle_count][1] = b;
    f->triangle[f->triangle_count++][2] = c;
}

// Append a solid: rings of points, a point at each end, and triangles between them.
static void add_solid(kn_tool_form *f, const kn_solid *part)
{
    const core c = core_of(part);
    const int first = f->point_count, middle = first + RINGS * AROUND;
    for (int r = 0; r < RINGS; r++)
        for (int a = 0; a < AROUND; a++) point_of(&c, r, a, f->xyz[f->point_count++]);
    for (int end = 0; end < 2; end++) {
        const float z = (float)(c.up_m + (end ? 1 : -1) * (c.half_m[2] + c.roll_m));
        memcpy(f->xyz[f->point_count++], (float[]){0, 0, z}, 3 * sizeof(float));
    }
    // Append strips of triangles, each from the lower end through all rings to the upper end.
    for (int a = 0; a < AROUND; a++) {
        const int b = (a + 1) % AROUND, top = first + (RINGS - 1) * AROUND;
        add_triangle(f, middle, first + b, first + a);
        for (int r = first; r < top; r += AROUND) {
            add_triangle(f, r + a, r + b, r + AROUND + b);
            add_triangle(f, r + a, r + AROUND + b, r + AROUND + a);
        }
        add_triangle(f, middle + 1, top + a, top + b);
    }
}

// Append the triangles of a tool that is a mesh.
static void add_field(kn_tool_form *f, const kn_field *field)
{
    const int first = f->point_count;
    for (int i = 0; i < field->vertex_count; i++)
        for (int k = 0; k < 3; k++) f->xyz[first + i][k] = (float)field->x_m[i][k];
    f->point_count += field->vertex_count;
    for (int i = 0; i < field->triangle_count; i++)
        add_triangle(f, first + field->triangle[i][0], first + field->triangle[i][1], first + field->triangle[i][2]);
}

// Move points from the frame of the part to the frame of the tool.
static void put_part(const kn_solid *part, float (*xyz)[3], int count)
{
    for (int i = 0; i < count; i++) {
        const float at[3] = {xyz[i][0], xyz[i][1], xyz[i][2]};
        for (int k = 0; k < 3; k++) {
            double sum = part->at_m[k];
            for (int j = 0; j < 3; j++) sum += part->turn[k][j] * (double)at[j];
            xyz[i][k] = (float)sum;
        }
    }
}

// Return the shape of a tool. A plate becomes a thin box.
static kn_shape shape_of(const kn_model *model, int probe)
{
    const kn_probe_def *def = &model->def.probe[probe];
    if (def->shape != KN_PROBE_PLATE) return model->shape[probe];
    kn_shape plate = {0};
    const kn_solid box = kn_solid_box((double[]){def->size_m[0], def->size_m[1], PLATE_THICKNESS_M}, 0);
    kn_shape_add(&plate, &box);
    return plate;
}

void kn_tool_form_free(kn_tool_form *f)
{
    free(f->xyz);
    free(f->triangle);
    *f = (kn_tool_form){0};
}

bool kn_tool_form_make(kn_tool_form *f, const kn_model *model, int probe)
{
    // Count the points and triangles first, so that the arrays are allocated once.
    const kn_shape shape = shape_of(model, probe);
    size_t points = 1, triangles = 0;
    for (const kn_solid *p = shape.part; p < shape.part + shape.part_count; p++) {
        points += p->kind == KN_SOLID_FIELD ? (size_t)p->field->vertex_count : POINTS;
        triangles += p->kind == KN_SOLID_FIELD ? (size_t)p->field->triangle_count : TRIANGLES;
    }
    *f = (kn_tool_form){.point_count = 1};
    f->xyz = calloc(points, sizeof *f->xyz);
    f->triangle = calloc(triangles, sizeof *f->triangle);
    if (!f->xyz || !f->triangle) {
        kn_tool_form_free(f);
        return false;
    }
    for (const kn_solid *p = shape.part; p < shape.part + shape.part_count; p++) {
        const int first = f->point_count;
        if (p->kind == KN_SOLID_FIELD) add_field(f, p->field);
        else add_solid(f, p);
        put_part(p, f->xyz + first, f->point_count - first);
    }
    return true;
}

// Move the surface of a tool to a pose and write its points to out[point_count][3] [m]. orientation_wxyz: unit
// quaternion; four zeros mean a level tool. A plate is always level.
static void tool_form_place(const kn_tool_form *f, const kn_probe_def *def, const double position_m[3],
                            const double orientation_wxyz[4], float (*out)[3])
{
    static const double level[4] = {1};
    double unit[4], turn[3][3];
    kn_turn_unit(def->shape == KN_PROBE_PLATE ? level : orientation_wxyz, unit);
    kn_turn_matrix(unit, turn);
    for (int i = 0; i < f->point_count; i++)
        for (int k = 0; k < 3; k++) {
            double sum = position_m[k];
            for (int j = 0; j < 3; j++) sum += turn[k][j] * (double)f->xyz[i][j];
            out[i][k] = (float)sum;
        }
}

// Arrays that depend on the model, and their numbers of elements. An array with one element per cell or edge gets one
// spare element, because there may be no cells, and calloc may return NULL for a size of 0.
#define ARRAYS(X)                                                                                                      \
    X(measure, nodes)                                                                                                  \
    X(contact, nodes)                                                                                                  \
    X(xyz, nodes)                                                                                                      \
    X(moved, nodes)                                                                                                    \
    X(velocity, nodes)                                                                                                 \
    X(stress, nodes)                                                                                                   \
    X(residual, nodes)                                                                                                 \
    X(force, nodes)                                                                                                    \
    X(ratio, cells + 1)                                                                                                \
    X(edge_stress, edges + 1)                                                                                          \
    X(edge_strain, edges + 1)                                                                                          \
    X(edge_rest, edges + 1)                                                                                            \
    X(line, edges + 1)                                                                                                 \
    X(line_end, edges + 1)                                                                                             \
    X(line_type, edges + 1)

struct kn_paraview {
    char folder[PATH_MAX - 128];
    kn_pvd *object, *edges;
    int moments;
    // Model to which the arrays below belong. NULL: no model yet.
    const kn_model *model;
    int models; // running number of `model`, see kn_moment
    cell_list cells;
    kn_springs springs;
    kn_gauge *gauge;
    kn_tool_form tool[KN_PROBES_MAX];
    double *measure, (*contact)[3];               // one element per node
    float (*xyz)[3], (*moved)[3], (*velocity)[3]; // one element per node
    float *stress, *residual, (*force)[3];        // one element per node
    float *ratio;                                 // one element per cell
    float *edge_stress, *edge_strain, *edge_rest; // one element per edge
    // Edges of the lattice as line cells. line: indices of both end points of each edge. line_end: for each edge, the
    // index in `line` after its second end point.
    int32_t (*line)[2], *line_end;
    uint8_t *line_type; // one element per edge
};

static bool short_of_memory(char *error, size_t size)
{
    snprintf(error, size, "out of memory");
    return false;
}

// Free everything that depends on the model. Keep the folder, the collections and the number of moments.
static void forget_model(kn_paraview *p)
{
    cells_free(&p->cells);
    kn_springs_free(&p->springs);
    kn_gauge_destroy(p->gauge);
    for (int i = 0; i < KN_PROBES_MAX; i++) kn_tool_form_free(&p->tool[i]);
#define FREE(name, count) free(p->name);
    ARRAYS(FREE)
#undef FREE
    kn_paraview kept = {.object = p->object, .edges = p->edges, .moments = p->moments};
    memcpy(kept.folder, p->folder, sizeof kept.folder);
    *p = kept;
}

// Allocate the arrays.
static bool make_room(kn_paraview *p, size_t nodes, size_t cells, size_t edges)
{
    bool all = true;
#define MAKE(name, count) p->name = calloc(count, sizeof *p->name), all &= p->name != NULL;
    ARRAYS(MAKE)
#undef MAKE
    return all;
}

// Prepare the export of a new model: cells, edges, gauge, arrays and the shapes of the tools.
static bool take_model(kn_paraview *p, const kn_model *model)
{
    forget_model(p);
    bool fits = cells_list(&p->cells, model) && kn_springs_init(&p->springs, model) &&
                (p->gauge = kn_gauge_create(model)) &&
                make_room(p, (size_t)model->node_count, (size_t)p->cells.count, (size_t)p->springs.count);
    for (int i = 0; fits && i < model->def.probe_count; i++) fits = kn_tool_form_make(&p->tool[i], model, i);
    // An edge is a line cell of two points.
    for (int e = 0; fits && e < p->springs.count; e++) {
        p->line[e][0] = p->springs.spring[e].i;
        p->line[e][1] = p->springs.spring[e].j;
        p->line_end[e] = 2 * (e + 1);
        p->line_type[e] = KN_VTK_LINE;
    }
    if (fits) p->model = model;
    return fits;
}

// Read the quantities of all nodes: positions, velocities, stress, residual strain, contact forces.
static void read_nodes(kn_paraview *p, const kn_moment *m)
{
    const kn_model *model = m->model;
    kn_gauge_read(p->gauge, m->state, KN_MEASURE_STRESS, p->measure);
    for (int i = 0; i < model->node_count; i++) p->stress[i] = (float)p->measure[i];
    kn_gauge_read(p->gauge, m->state, KN_MEASURE_RESIDUAL, p->measure);
    if (m->scratch) kn_touch_nodes(model, m->state, m->scratch, p->contact);
    else memset(p->contact, 0, (size_t)model->node_count * sizeof *p->contact);
    for (int i = 0; i < model->node_count; i++) {
        double x[3], v[3];
        p->residual[i] = (float)p->measure[i];
        kn_state_position(model, m->state, i, x);
        kn_state_velocity(model, m->state, i, v);
        for (int k = 0; k < 3; k++) {
            p->xyz[i][k] = (float)x[k];
            p->moved[i][k] = (float)(x[k] - model->rest_m[i][k]);
            p->velocity[i][k] = (float)v[k];
            p->force[i][k] = (float)p->contact[i][k];
        }
    }
}

// Copy stress, strain and residual strain of every lattice edge into the arrays to export.
static void read_edges(kn_paraview *p, const kn_state *state)
{
    for (int e = 0; e < p->springs.count; e++) {
        const kn_spring_now now = kn_spring_look(&p->springs, state, e);
        p->edge_stress[e] = (float)now.stress_pa;
        p->edge_strain[e] = (float)(now.length_m / p->springs.spring[e].rest_m - 1);
        p->edge_rest[e] = (float)now.residual;
    }
}

// Write one .vtu file and list the file in its collection. part: number of the object or tool among the files of one
// time.
static bool write_one(const kn_paraview *p, kn_pvd *pvd, const kn_vtu *v, int part, const char *kind, const char *name,
                      char *error, size_t size)
{
    char file[64], path[PATH_MAX];
    snprintf(file, sizeof file, "%s%s_%05d.vtu", kind, name, p->moments);
    snprintf(path, sizeof path, "%s/%s", p->folder, file);
    kn_pvd_add(pvd, v->time_s, part, *name ? name : kind, file);
    return kn_vtu_write(v, path, error, size);
}

// Write the nodes with their quantities, and the cells between the nodes. If an object has no cells, write its edges.
static bool write_object(kn_paraview *p, const kn_moment *m, char *error, size_t size)
{
    const bool solid = p->cells.count > 0;
    kn_vtu v = {.time_s = m->time_s, .point_count = m->model->node_count, .xyz = (const float(*)[3])p->xyz};
    v.cell_count = solid ? p->cells.count : p->springs.count;
    v.corner = solid ? p->cells.corner : p->line[0];
    v.end = solid ? p->cells.end : p->line_end;
    v.type = solid ? p->cells.type : p->line_type;
    v.point[v.point_arrays++] = (kn_vtu_array){"displacement_m", 3, p->moved[0]};
    v.point[v.point_arrays++] = (kn_vtu_array){"velocity_m_s", 3, p->velocity[0]};
    v.point[v.point_arrays++] = (kn_vtu_array){"von_mises_stress_pa", 1, p->stress};
    v.point[v.point_arrays++] = (kn_vtu_array){"residual_strain", 1, p->residual};
    v.point[v.point_arrays++] = (kn_vtu_array){"contact_force_n", 3, p->force[0]};
    if (solid) v.cell[v.cell_arrays++] = (kn_vtu_array){"volume_ratio", 1, p->ratio};
    return write_one(p, p->object, &v, 0, "object", "", error, size);
}

static bool write_edges(kn_paraview *p, const kn_moment *m, char *error, size_t size)
{
    const kn_vtu v = {.time_s = m->time_s,
                      .point_count = m->model->node_count,
                      .xyz = (const float(*)[3])p->xyz,
                      .cell_count = p->springs.count,
                      .corner = p->line[0],
                      .end = p->line_end,
                      .type = p->line_type,
                      .point_arrays = 1,
                      .point = {{"displacement_m", 3, p->moved[0]}},
                      .cell_arrays = 3,
                      .cell = {{"stress_pa", 1, p->edge_stress},
                               {"strain", 1, p->edge_strain},
                               {"residual_strain", 1, p->edge_rest}}};
    return write_one(p, p->edges, &v, 0, "edges", "", error, size);
}

// Buffers of one tool at one moment. These buffers are much smaller than the object's and are allocated for each file.
typedef struct tool_room {
    float (*xyz)[3], (*vector)[3][3]; // xyz: positions of the points; vector: three arrays of one vector per point
    int32_t *corner, *end;
    uint8_t *type;
} tool_room;

// Fill the buffers. Cell 0 is a vertex at the tool's position (point 0). The other cells are the triangles of the
// surface.
static void fill_tool(tool_room *r, const kn_tool_form *f, const kn_force *tool, const kn_probe_def *def)
{
    float(*vector)[3] = (float(*)[3])r->vector;
    tool_form_place(f, def, tool->proxy_position_m, tool->proxy_orientation_wxyz, r->xyz);
    // `vector` holds three arrays one after the other, each with one vector per point. Only the vectors of point 0 are
    // set; all others stay 0.
    for (int k = 0; k < 3; k++) {
        vector[0][k] = (float)tool->force_n[k];
        vector[f->point_count][k] = (float)tool->contact_force_n[k];
        vector[2 * f->point_count][k] = (float)tool->torque_n_m[k];
    }
    r->corner[0] = 0;
    r->end[0] = 1;
    r->type[0] = KN_VTK_VERTEX;
    for (int t = 0; t < f->triangle_count; t++) {
        memcpy(&r->corner[1 + 3 * t], f->triangle[t], sizeof f->triangle[t]);
        r->end[1 + t] = 1 + 3 * (t + 1);
        r->type[1 + t] = KN_VTK_TRIANGLE;
    }
}

static bool write_tool(kn_paraview *p, const kn_moment *m, int probe, char *error, size_t size)
{
    const kn_force *tool = m->tool[probe]; // NULL: no hand holds the tool
    const kn_tool_form *f = &p->tool[probe];
    const size_t points = (size_t)f->point_count, cells = (size_t)f->triangle_count + 1;
    tool_room r = {calloc(points, sizeof *r.xyz), calloc(points, sizeof *r.vector), calloc(cells, 3 * sizeof *r.corner),
                   calloc(cells, sizeof *r.end), calloc(cells, 1)};
    bool fits = r.xyz && r.vector && r.corner && r.end && r.type;
    const float gain = tool ? (float)tool->gain : 0;
    float turn[4] = {0};
    for (int k = 0; k < 4 && tool; k++) turn[k] = (float)tool->proxy_orientation_wxyz[k];
    if (fits && tool) fill_tool(&r, f, tool, &m->model->def.probe[probe]);
    // A tool that nobody holds is written as an empty file, so that the collection has the same parts at every time.
    const float *vector = (const float *)r.vector;
    const kn_vtu v = {.time_s = m->time_s,
                      .point_count = tool ? f->point_count : 0,
                      .xyz = (const float(*)[3])r.xyz,
                      .cell_count = tool ? (int)cells : 0,
                      .corner = r.corner,
                      .end = r.end,
                      .type = r.type,
                      .point_arrays = 3,
                      .point = {{"force_n", 3, vector},
                                {"contact_force_n", 3, fits ? vector + 3 * points : NULL},
                                {"torque_n_m", 3, fits ? vector + 6 * points : NULL}},
                      .field_arrays = tool ? 2 : 0,
                      .field = {{"orientation_wxyz", 4, turn}, {"gain", 1, &gain}}};
    bool ok = fits ? write_one(p, p->object, &v, 1 + probe, "tool_", m->model->def.probe[probe].name, error, size)
                   : short_of_memory(error, size);
    free(r.xyz);
    free(r.vector);
    free(r.corner);
    free(r.end);
    free(r.type);
    return ok;
}

kn_paraview *kn_paraview_open(const char *folder, char *error, size_t size)
{
    char path[PATH_MAX];
    kn_paraview *p = calloc(1, sizeof *p);
    if (!p) return short_of_memory(error, size), NULL;
    snprintf(p->folder, sizeof p->folder, "%s", folder);
    snprintf(path, sizeof path, "%s/object.pvd", p->folder);
    p->object = kn_pvd_open(path, error, size);
    snprintf(path, sizeof path, "%s/edges.pvd", p->folder);
    if (p->object) p->edges = kn_pvd_open(path, error, size);
    if (p->edges) return p;
    if (p->object) kn_pvd_close(p->object, path, 0);
    free(p);
    return NULL;
}

bool kn_paraview_add(kn_paraview *p, const kn_moment *m, char *error, size_t size)
{
    // When the model has changed, for example by a change of the scene, prepare new arrays.
    if ((!p->model || p->models != m->models) && !take_model(p, m->model)) return short_of_memory(error, size);
    p->models = m->models;
    read_nodes(p, m);
    read_edges(p, m->state);
    cells_ratio(&p->cells, m->state, p->ratio);
    bool ok = write_object(p, m, error, size) && write_edges(p, m, error, size);
    for (int i = 0; ok && i < m->model->def.probe_count; i++) ok = write_tool(p, m, i, error, size);
    p->moments++;
    return ok;
}

bool kn_paraview_close(kn_paraview *p, char *error, size_t size)
{
    bool whole = kn_pvd_close(p->object, error, size);
    // Report the first error only, but close both collections.
    whole = kn_pvd_close(p->edges, whole ? error : (char[1]){0}, whole ? size : 0) && whole;
    forget_model(p);
    free(p);
    return whole;
}
