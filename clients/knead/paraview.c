#include "clients/knead/paraview.h"
#include "clients/knead/cells.h"
#include "clients/knead/tool_form.h"
#include "clients/knead/vtu.h"
#include "core/measure.h"
#include "core/touch.h"
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct kn_paraview {
    char folder[PATH_MAX - 128];
    kn_pvd *object, *edges;
    int moments;
    // Model that the arrays below belong to. NULL: none yet.
    const kn_model *model;
    int models; // running number of this model, see kn_moment
    kn_cells cells;
    kn_springs springs;
    kn_gauge *gauge;
    kn_tool_form tool[KN_PROBES_MAX];
    double *measure, (*contact)[3];               // one element per node
    float (*xyz)[3], (*moved)[3], (*velocity)[3]; // one element per node
    float *stress, *residual, (*force)[3];        // one element per node
    float *ratio;                                 // one element per cell
    float *edge_stress, *edge_strain, *edge_rest; // one element per edge
    // Cells of the lines: indices of both end points of each edge; for each edge, end of its indices in `line`.
    int32_t *line, *line_end;
    uint8_t *line_type; // one element per edge
};

static bool short_of_memory(char *error, size_t size)
{
    snprintf(error, size, "out of memory");
    return false;
}

// Free everything that depends on the model, and keep the rest.
static void forget_model(kn_paraview *p)
{
    kn_cells_free(&p->cells);
    kn_springs_free(&p->springs);
    kn_gauge_destroy(p->gauge);
    for (int i = 0; i < KN_PROBES_MAX; i++) kn_tool_form_free(&p->tool[i]);
    void *arrays[] = {p->measure,     p->contact,   p->xyz,   p->moved,    p->velocity,
                      p->stress,      p->residual,  p->force, p->ratio,    p->edge_stress,
                      p->edge_strain, p->edge_rest, p->line,  p->line_end, p->line_type};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]);
    kn_paraview kept = {.object = p->object, .edges = p->edges, .moments = p->moments};
    memcpy(kept.folder, p->folder, sizeof kept.folder);
    *p = kept;
}

// Allocate the arrays. The sizes of cells and edges get one more element, because calloc(0) may return NULL.
static bool make_room(kn_paraview *p, size_t nodes, size_t cells, size_t edges)
{
    p->measure = calloc(nodes, sizeof *p->measure);
    p->contact = calloc(nodes, sizeof *p->contact);
    p->xyz = calloc(nodes, sizeof *p->xyz);
    p->moved = calloc(nodes, sizeof *p->moved);
    p->velocity = calloc(nodes, sizeof *p->velocity);
    p->stress = calloc(nodes, sizeof *p->stress);
    p->residual = calloc(nodes, sizeof *p->residual);
    p->force = calloc(nodes, sizeof *p->force);
    p->ratio = calloc(cells + 1, sizeof *p->ratio);
    p->edge_stress = calloc(edges + 1, sizeof *p->edge_stress);
    p->edge_strain = calloc(edges + 1, sizeof *p->edge_strain);
    p->edge_rest = calloc(edges + 1, sizeof *p->edge_rest);
    p->line = calloc(edges + 1, 2 * sizeof *p->line);
    p->line_end = calloc(edges + 1, sizeof *p->line_end);
    p->line_type = calloc(edges + 1, 1);
    return p->measure && p->contact && p->xyz && p->moved && p->velocity && p->stress && p->residual && p->force &&
           p->ratio && p->edge_stress && p->edge_strain && p->edge_rest && p->line && p->line_end && p->line_type;
}

// Prepare the export of a new model: cells, edges, gauge, arrays and the shapes of the tools.
static bool take_model(kn_paraview *p, const kn_model *model)
{
    forget_model(p);
    bool fits = kn_cells_list(&p->cells, model) && kn_springs_init(&p->springs, model) &&
                (p->gauge = kn_gauge_create(model)) &&
                make_room(p, (size_t)model->node_count, (size_t)p->cells.count, (size_t)p->springs.count);
    for (int i = 0; fits && i < model->def.probe_count; i++) fits = kn_tool_form_make(&p->tool[i], model, i);
    // An edge is a line cell of two points.
    for (int e = 0; fits && e < p->springs.count; e++) {
        p->line[2 * e] = p->springs.spring[e].i;
        p->line[2 * e + 1] = p->springs.spring[e].j;
        p->line_end[e] = 2 * (e + 1);
        p->line_type[e] = KN_VTK_LINE;
    }
    if (fits) p->model = model;
    return fits;
}

// Read the numbers of all nodes: positions, velocities, stress, residual strain, contact forces.
static void read_nodes(kn_paraview *p, const kn_moment *m)
{
    const kn_model *model = m->model;
    kn_gauge_read(p->gauge, m->state, KN_MEASURE_STRESS, p->measure);
    for (int i = 0; i < model->node_count; i++) p->stress[i] = (float)p->measure[i];
    kn_gauge_read(p->gauge, m->state, KN_MEASURE_RESIDUAL, p->measure);
    // Contact forces are known only while the state has its solver scratch.
    if (m->state->scratch) kn_touch_nodes(model, m->state, p->contact);
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

// Write one .vtu file and list the file in its collection. part: number of the object or tool within one time.
static bool write_one(const kn_paraview *p, kn_pvd *pvd, const kn_vtu *v, int part, const char *kind, const char *name,
                      char *error, size_t size)
{
    char file[64], path[PATH_MAX];
    snprintf(file, sizeof file, "%s%s_%05d.vtu", kind, name, p->moments);
    snprintf(path, sizeof path, "%s/%s", p->folder, file);
    kn_pvd_add(pvd, v->time_s, part, *name ? name : kind, file);
    return kn_vtu_write(v, path, error, size);
}

// Write the nodes with their numbers, and cells between them. An object without cells is drawn by its edges.
static bool write_object(kn_paraview *p, const kn_moment *m, char *error, size_t size)
{
    const bool solid = p->cells.count > 0;
    kn_vtu v = {.time_s = m->time_s, .point_count = m->model->node_count, .xyz = (const float(*)[3])p->xyz};
    v.cell_count = solid ? p->cells.count : p->springs.count;
    v.corner = solid ? p->cells.corner : p->line;
    v.end = solid ? p->cells.end : p->line_end;
    v.type = solid ? p->cells.type : p->line_type;
    v.point[v.point_arrays++] = (kn_vtu_array){"displacement_m", 3, p->moved[0]};
    v.point[v.point_arrays++] = (kn_vtu_array){"velocity_m_s", 3, p->velocity[0]};
    v.point[v.point_arrays++] = (kn_vtu_array){"von_mises_stress_pa", 1, p->stress};
    v.point[v.point_arrays++] = (kn_vtu_array){"residual_strain", 1, p->residual};
    if (m->state->scratch) v.point[v.point_arrays++] = (kn_vtu_array){"contact_force_n", 3, p->force[0]};
    if (solid) v.cell[v.cell_arrays++] = (kn_vtu_array){"volume_ratio", 1, p->ratio};
    return write_one(p, p->object, &v, 0, "object", "", error, size);
}

static bool write_edges(kn_paraview *p, const kn_moment *m, char *error, size_t size)
{
    const kn_vtu v = {.time_s = m->time_s,
                      .point_count = m->model->node_count,
                      .xyz = (const float(*)[3])p->xyz,
                      .cell_count = p->springs.count,
                      .corner = p->line,
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

// Fill the buffers: cell 0 is the vertex at the tool's position (point 0), then the triangles of the surface.
static void fill_tool(tool_room *r, const kn_tool_form *f, const struct kn_moment_tool *tool, const kn_probe_def *def)
{
    float(*vector)[3] = (float(*)[3])r->vector;
    kn_tool_form_place(f, def, tool->position_m, tool->orientation_wxyz, r->xyz);
    // `vector` holds three arrays one after the other, each with one vector per point. Only point 0 differs from 0.
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
    const struct kn_moment_tool *tool = &m->tool[probe];
    const kn_tool_form *f = &p->tool[probe];
    const size_t points = (size_t)f->point_count, cells = (size_t)f->triangle_count + 1;
    tool_room r = {calloc(points, sizeof *r.xyz), calloc(points, sizeof *r.vector), calloc(cells, 3 * sizeof *r.corner),
                   calloc(cells, sizeof *r.end), calloc(cells, 1)};
    bool fits = r.xyz && r.vector && r.corner && r.end && r.type;
    const float gain = (float)tool->gain;
    float turn[4];
    for (int k = 0; k < 4; k++) turn[k] = (float)tool->orientation_wxyz[k];
    if (fits && tool->live) fill_tool(&r, f, tool, &m->model->def.probe[probe]);
    // A tool that nobody holds is written as an empty file, so that the collection has the same parts at every time.
    const float *vector = (const float *)r.vector;
    const kn_vtu v = {.time_s = m->time_s,
                      .point_count = tool->live ? f->point_count : 0,
                      .xyz = (const float(*)[3])r.xyz,
                      .cell_count = tool->live ? (int)cells : 0,
                      .corner = r.corner,
                      .end = r.end,
                      .type = r.type,
                      .point_arrays = 3,
                      .point = {{"force_n", 3, vector},
                                {"contact_force_n", 3, fits ? vector + 3 * points : NULL},
                                {"torque_n_m", 3, fits ? vector + 6 * points : NULL}},
                      .field_arrays = tool->live ? 2 : 0,
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
    // A new model, such as after a change of the scene, needs new arrays.
    if ((!p->model || p->models != m->models) && !take_model(p, m->model)) return short_of_memory(error, size);
    p->models = m->models;
    read_nodes(p, m);
    read_edges(p, m->state);
    kn_cells_ratio(&p->cells, m->state, p->ratio);
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
