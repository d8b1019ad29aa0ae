#include "clients/knead/still.h"
#include "core/measure.h"
#include "core/surface.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Remove all tools, and release the shapes of unions.
static void drop_tools(kn_still *s)
{
    for (int i = 0; i < s->view.probe_count; i++)
        if (s->view.probe[i].def.parts) kn_shape_drop(&s->tool[i]);
    s->view.probe_count = 0;
}

void kn_still_free(kn_still *s)
{
    drop_tools(s);
    free(s->rest);
    free(s->now);
    free(s->triangle);
    free(s->value);
    free(s->edge);
    free(s->edge_value);
    memset(s, 0, sizeof *s);
}

// Allocate and copy the mesh. Use the present shape as the shape at rest until the shape at rest is known.
static bool fill(kn_still *s, int vertex_count, const float *now, int triangle_count, const int *triangle)
{
    s->vertex_count = vertex_count;
    s->triangle_count = triangle_count;
    s->rest = malloc(((size_t)vertex_count + 1) * sizeof *s->rest);
    s->now = malloc(((size_t)vertex_count + 1) * sizeof *s->now);
    s->triangle = malloc(((size_t)triangle_count + 1) * sizeof *s->triangle);
    if (!s->rest || !s->now || !s->triangle) return false;
    memcpy(s->now, now, (size_t)vertex_count * sizeof *s->now);
    memcpy(s->rest, now, (size_t)vertex_count * sizeof *s->rest);
    memcpy(s->triangle, triangle, (size_t)triangle_count * sizeof *s->triangle);
    return true;
}

// Choose the colour by the kind of material, so that dough, jelly and clay differ. A flat object (thickness_m > 0) is
// drawn with flat tools.
static void paint(kn_view_scene *view, const kn_model_def *def)
{
    static const float jelly[3] = {0.80f, 0.33f, 0.40f}, clay[3] = {0.74f, 0.47f, 0.36f};
    const kn_material *m = &def->material;
    view->thickness_m = def->thickness_m;
    memcpy(view->color, kn_view_scene_default().color, sizeof view->color);
    double in, out;
    if (kn_material_stroke(m, &in, &out)) memcpy(view->color, jelly, sizeof jelly);
    else if (m->k1_pa == 0) memcpy(view->color, clay, sizeof clay);
}

// Compute the shape at rest. Return false if the surface of the model is not the mesh of the still.
static bool rest_shape(kn_still *s, const kn_model *model, const kn_surface *surface)
{
    if (surface->vertex_count != s->vertex_count || surface->triangle_count != s->triangle_count) return false;
    if (memcmp(surface->triangle, s->triangle, (size_t)s->triangle_count * sizeof *s->triangle) != 0) return false;
    for (int v = 0; v < s->vertex_count; v++) {
        double x_m[3];
        kn_surface_rest(surface, model, v, x_m);
        for (int i = 0; i < 3; i++) s->rest[v][i] = (float)x_m[i];
    }
    return true;
}

bool kn_still_state(kn_still *s, const kn_model *model, const kn_state *state)
{
    kn_surface *surface = kn_surface_create(model);
    float *xyz = surface ? calloc((size_t)surface->vertex_count, 3 * sizeof *xyz) : NULL;
    bool ok = xyz != NULL;
    if (ok) kn_surface_positions(surface, model, state, xyz);
    ok = ok && fill(s, surface->vertex_count, xyz, surface->triangle_count, surface->triangle) &&
         rest_shape(s, model, surface);
    paint(&s->view, &model->def);
    free(xyz);
    kn_surface_destroy(surface);
    return ok;
}

// Set the value of the measure at each vertex from the value at the vertex's node.
static bool measure(kn_still *s, const kn_model *model, const double *value)
{
    kn_surface *surface = kn_surface_create(model);
    s->value = malloc(((size_t)s->vertex_count + 1) * sizeof *s->value);
    bool ok = surface && s->value && surface->vertex_count == s->vertex_count;
    for (int v = 0; ok && v < s->vertex_count; v++) s->value[v] = (float)value[surface->node[v]];
    kn_surface_destroy(surface);
    return ok;
}

// List all edges of the lattice, with the value of the measure at both ends. If the nodes have no values, edge_value
// stays NULL.
static bool list_edges(kn_still *s, const kn_model *model, const kn_state *state, const double *value)
{
    kn_springs springs;
    if (!kn_springs_init(&springs, model)) return false;
    s->edge_count = springs.count;
    s->edge = malloc(((size_t)springs.count + 1) * sizeof *s->edge);
    s->edge_value = malloc(((size_t)springs.count + 1) * sizeof *s->edge_value);
    for (int e = 0; s->edge && s->edge_value && e < springs.count; e++)
        for (int end = 0; end < 2; end++) {
            const int node = end ? springs.spring[e].j : springs.spring[e].i;
            double x_m[3];
            kn_state_position(model, state, node, x_m);
            for (int k = 0; k < 3; k++) s->edge[e][end][k] = (float)x_m[k];
            s->edge_value[e][end] = value ? (float)value[node] : 0;
        }
    kn_springs_free(&springs);
    if (!value) free(s->edge_value), s->edge_value = NULL;
    return s->edge && (s->edge_value || !value);
}

bool kn_still_measure(kn_still *s, const kn_model *model, const kn_state *state, kn_gauge *gauge, kn_measure what,
                      bool edges)
{
    double *value = gauge ? calloc((size_t)model->node_count, sizeof *value) : NULL;
    bool ok = !gauge || value;
    if (value) kn_gauge_read(gauge, state, what, value);
    if (value) ok = measure(s, model, value);
    if (edges) ok = ok && list_edges(s, model, state, value);
    free(value);
    return ok;
}

bool kn_still_told(kn_still *s, const kn_live *live, kn_measure what)
{
    // The mesh messages contain stress and residual strain only if the scene asks for them.
    const float *told = what == KN_MEASURE_STRESS ? live->mesh.stress_pa : live->mesh.residual_strain;
    if (what != KN_MEASURE_DISPLACEMENT && (!told || s->vertex_count != live->mesh.vertex_count)) return false;
    if (!s->value) s->value = malloc(((size_t)s->vertex_count + 1) * sizeof *s->value);
    for (int v = 0; s->value && v < s->vertex_count; v++) {
        const float *now = s->now[v], *rest = s->rest[v];
        s->value[v] = what == KN_MEASURE_DISPLACEMENT
                          ? hypotf(hypotf(now[0] - rest[0], now[1] - rest[1]), now[2] - rest[2])
                          : told[v];
    }
    return s->value;
}

double kn_still_most(const kn_still *s)
{
    double most = 0;
    for (int v = 0; s->value && v < s->vertex_count; v++) most = fmax(most, s->value[v]);
    for (int e = 0; s->edge_value && e < s->edge_count; e++)
        most = fmax(most, fmax(s->edge_value[e][0], s->edge_value[e][1]));
    return most;
}

void kn_still_scale(kn_still *s, double top)
{
    for (int v = 0; s->value && v < s->vertex_count; v++) s->value[v] /= (float)top;
    for (int e = 0; s->edge_value && e < s->edge_count; e++)
        for (int end = 0; end < 2; end++) s->edge_value[e][end] /= (float)top;
    s->view.value = s->value;
    s->view.edge_count = s->edge_count;
    s->view.edge = (const float(*)[2][3])s->edge;
    s->view.edge_value = (const float(*)[2])s->edge_value;
}

void kn_still_probe(kn_still *s, const kn_probe_def *def, const double position_m[3], const double orientation_wxyz[4],
                    const double force_n[3], double gain)
{
    kn_shape *tool = &s->tool[s->view.probe_count];
    kn_view_probe *p = &s->view.probe[s->view.probe_count++];
    p->def = *def;
    // The shape of a union is shared by reference count.
    if (def->parts) {
        *tool = *def->parts;
        p->def.parts = tool;
        kn_shape_keep(tool);
    }
    p->outside = gain == 0;
    p->held = false;
    memcpy(p->position_m, position_m, sizeof p->position_m);
    memcpy(p->orientation_wxyz, orientation_wxyz, sizeof p->orientation_wxyz);
    memcpy(p->force_n, force_n, sizeof p->force_n);
}

void kn_still_hand(kn_still *s, const double position_m[3], const double orientation_wxyz[4])
{
    kn_view_probe *p = &s->view.probe[s->view.probe_count - 1];
    p->held = true;
    memcpy(p->hand_position_m, position_m, sizeof p->hand_position_m);
    memcpy(p->hand_orientation_wxyz, orientation_wxyz, sizeof p->hand_orientation_wxyz);
}

bool kn_still_live(kn_still *s, const kn_live *live, char *error, size_t error_size)
{
    char why[400];
    // Write the error message beforehand. It is cleared when the mesh has been copied.
    snprintf(error, error_size, "out of memory");
    if (!fill(s, live->mesh.vertex_count, live->mesh.positions_m, live->mesh.triangle_count, live->mesh.triangles))
        return false;
    error[0] = 0;
    // Build the model of the received scene. If its surface differs from the received mesh, the mesh does not belong to
    // this scene.
    kn_model *model = live->scene ? kn_model_build(&live->scene->model, why, sizeof why) : NULL;
    kn_surface *surface = model ? kn_surface_create(model) : NULL;
    bool known = surface && rest_shape(s, model, surface);
    if (!known)
        snprintf(error, error_size, "%s%s",
                 live->scene ? "the mesh does not belong to the received scene" : "no scene was received",
                 live->scene_error);
    if (known) paint(&s->view, &model->def);
    if (known) kn_still_update(s, live);
    kn_surface_destroy(surface);
    kn_model_destroy(model);
    return true;
}

void kn_still_update(kn_still *s, const kn_live *live)
{
    const kn_model_def *def = &live->scene->model;
    memcpy(s->now, live->mesh.positions_m, (size_t)s->vertex_count * sizeof *s->now);
    drop_tools(s);
    for (int i = 0; i < def->probe_count; i++) {
        const kn_live_probe *p = kn_live_find(live, def->probe[i].name);
        if (p) kn_still_probe(s, &def->probe[i], p->position_m, p->orientation_wxyz, p->force_n, p->gain);
        if (p && kn_live_held(p)) kn_still_hand(s, p->hand_position_m, p->hand_orientation_wxyz);
    }
}
