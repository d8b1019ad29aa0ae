#include "clients/picture/object_still.h"
#include "clients/viewer/label.h"
#include "core/lattice/measure.h"
#include "core/surface.h"
#include "server/option_table.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Remove all tools from a still. Release the shapes of the tools that are unions of several parts.
static void drop_tools(kn_object_still *s)
{
    for (int i = 0; i < s->view.probe_count; i++)
        if (s->view.probe[i].def.parts) kn_shape_drop(&s->tool[i]);
    s->view.probe_count = 0;
}

void kn_object_still_free(kn_object_still *s)
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
static bool fill(kn_object_still *s, int vertex_count, const float *now, int triangle_count, const int *triangle)
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

bool kn_object_still_copy(kn_object_still *to, const kn_object_still *from)
{
    if (!fill(to, from->vertex_count, from->now[0], from->triangle_count, from->triangle[0])) return false;
    memcpy(to->rest, from->rest, (size_t)from->vertex_count * sizeof *to->rest);
    to->value = malloc(((size_t)from->vertex_count + 1) * sizeof *to->value);
    return to->value;
}

// Choose the colour by the kind of material, so that dough, jelly and clay differ. Also copy the thickness: if it is
// above 0, the object is flat and is drawn with flat tools.
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

// Compute the shape at rest. Return false if the surface of the model and the mesh of the still are different meshes.
static bool rest_shape(kn_object_still *s, const kn_model *model, const kn_surface *surface)
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

bool kn_object_still_state(kn_object_still *s, const kn_model *model, const kn_state *state)
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
static bool measure(kn_object_still *s, const kn_model *model, const double *value)
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
static bool list_edges(kn_object_still *s, const kn_model *model, const kn_state *state, const double *value)
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

bool kn_object_still_measure(kn_object_still *s, const kn_model *model, const kn_state *state, kn_gauge *gauge,
                             kn_measure what, bool edges)
{
    double *value = gauge ? calloc((size_t)model->node_count, sizeof *value) : NULL;
    bool ok = !gauge || value;
    if (value) kn_gauge_read(gauge, state, what, value);
    if (value) ok = measure(s, model, value);
    if (edges) ok = ok && list_edges(s, model, state, value);
    free(value);
    return ok;
}

bool kn_object_still_told(kn_object_still *s, const kn_live_server *live, kn_measure what)
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

double kn_object_still_most(const kn_object_still *s)
{
    double most = 0;
    for (int v = 0; s->value && v < s->vertex_count; v++) most = fmax(most, s->value[v]);
    for (int e = 0; s->edge_value && e < s->edge_count; e++)
        most = fmax(most, fmax(s->edge_value[e][0], s->edge_value[e][1]));
    return most;
}

void kn_object_still_scale(kn_object_still *s, double top)
{
    for (int v = 0; s->value && v < s->vertex_count; v++) s->value[v] /= (float)top;
    for (int e = 0; s->edge_value && e < s->edge_count; e++)
        for (int end = 0; end < 2; end++) s->edge_value[e][end] /= (float)top;
    s->view.value = s->value;
    s->view.edge_count = s->edge_count;
    s->view.edge = (const float(*)[2][3])s->edge;
    s->view.edge_value = (const float(*)[2])s->edge_value;
}

void kn_object_still_probe(kn_object_still *s, const kn_probe_def *def, const double position_m[3],
                           const double orientation_wxyz[4], const double force_n[3], double gain)
{
    kn_shape *tool = &s->tool[s->view.probe_count];
    kn_view_probe *p = &s->view.probe[s->view.probe_count++];
    p->def = *def;
    // A union shares its shape with the scene: the reference count keeps the shape until the last user drops it.
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

void kn_object_still_hand(kn_object_still *s, const double position_m[3], const double orientation_wxyz[4])
{
    kn_view_probe *p = &s->view.probe[s->view.probe_count - 1];
    p->held = true;
    memcpy(p->hand_position_m, position_m, sizeof p->hand_position_m);
    memcpy(p->hand_orientation_wxyz, orientation_wxyz, sizeof p->hand_orientation_wxyz);
}

bool kn_object_still_live(kn_object_still *s, const kn_live_server *live, char *error, size_t error_size)
{
    char why[400];
    // Only lack of memory can make fill() fail. So set the error message before the call, and clear it after the call.
    snprintf(error, error_size, "out of memory");
    if (!fill(s, live->mesh.vertex_count, live->mesh.positions_m, live->mesh.triangle_count, live->mesh.triangles))
        return false;
    error[0] = 0;
    // Build the model of the received scene. If the surface of this model differs from the received mesh, the mesh does
    // not belong to the scene.
    kn_model *model = live->scene ? kn_model_build(&live->scene->model, why, sizeof why) : NULL;
    kn_surface *surface = model ? kn_surface_create(model) : NULL;
    bool known = surface && rest_shape(s, model, surface);
    if (!known)
        snprintf(error, error_size, "%s%s",
                 live->scene ? "the mesh does not belong to the received scene" : "no scene was received",
                 live->scene_error);
    if (known) paint(&s->view, &model->def);
    if (known) kn_object_still_update(s, live);
    kn_surface_destroy(surface);
    kn_model_destroy(model);
    return true;
}

void kn_object_still_update(kn_object_still *s, const kn_live_server *live)
{
    const kn_model_def *def = &live->scene->model;
    memcpy(s->now, live->mesh.positions_m, (size_t)s->vertex_count * sizeof *s->now);
    drop_tools(s);
    for (int i = 0; i < def->probe_count; i++) {
        const kn_live_server_probe *p = kn_live_server_find(live, def->probe[i].name);
        if (p) kn_object_still_probe(s, &def->probe[i], p->position_m, p->orientation_wxyz, p->force_n, p->gain);
        if (p && kn_live_server_held(p)) kn_object_still_hand(s, p->hand_position_m, p->hand_orientation_wxyz);
    }
}

// Two positions at rest count as equal up to this distance, m. It allows for rounding errors, because the positions
// have single precision.
#define SAME_M 1e-6
// Largest allowed distance at rest between two matched vertices, as a share of the longest triangle side. In an
// equilateral triangle, no point is farther from the nearest corner than 0.58 times the side. In a square of two
// triangles, no point is farther than 0.5 times the diagonal.
#define COARSE 0.6

// A vertex in a list that is sorted by x, for the search of the nearest vertex.
typedef struct spot {
    float x[3];
    int vertex;
} spot;

static int by_x(const void *a, const void *b)
{
    const spot *p = a, *q = b;
    if (p->x[0] != q->x[0]) return p->x[0] < q->x[0] ? -1 : 1;
    return (p->vertex > q->vertex) - (p->vertex < q->vertex);
}

static float squared(const float a[3], const float b[3])
{
    const float d[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
    return d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
}

// Compare one vertex with the nearest vertex found so far. Return false if the search in this direction can end,
// because the distance along x alone is already larger than the distance of the nearest vertex found.
static bool nearer(const spot *s, const float x[3], const spot **best, float *least)
{
    const float across = s->x[0] - x[0], d = squared(s->x, x);
    if (across * across > *least) return false; // all vertices that lie further along x are further away as well
    if (d < *least || !*best) *least = d, *best = s;
    return true;
}

// Find the nearest vertex in a list that is sorted by x. Search upwards and then downwards from the position of the
// point `x` in the list. In each direction, stop when the distance along x alone exceeds the distance of the nearest
// vertex found.
static const spot *nearest(const spot *s, int count, const float x[3])
{
    const spot *best = NULL;
    float least = INFINITY;
    int low = 0, high = count;
    // Find by binary search the first vertex whose x coordinate is not below that of the given point.
    while (low < high) {
        const int middle = low + (high - low) / 2;
        if (s[middle].x[0] < x[0]) low = middle + 1;
        else high = middle;
    }
    for (int i = low; i < count && nearer(&s[i], x, &best, &least); i++) continue;
    for (int i = low - 1; i >= 0 && nearer(&s[i], x, &best, &least); i--) continue;
    return best;
}

// Return the length of the longest triangle side in the shape at rest, m.
static double longest_side(const kn_object_still *s)
{
    float most = 0;
    for (int t = 0; t < s->triangle_count; t++)
        for (int i = 0; i < 3; i++)
            most = fmaxf(most, squared(s->rest[s->triangle[t][i]], s->rest[s->triangle[t][(i + 1) % 3]]));
    return sqrt(most);
}

// Return the vertices of a still, sorted by their x coordinate at rest. Return NULL if out of memory.
static spot *sorted(const kn_object_still *s)
{
    spot *out = malloc(((size_t)s->vertex_count + 1) * sizeof *out);
    for (int v = 0; out && v < s->vertex_count; v++) out[v] = (spot){{s->rest[v][0], s->rest[v][1], s->rest[v][2]}, v};
    if (out) qsort(out, (size_t)s->vertex_count, sizeof *out, by_x);
    return out;
}

// Find the nearest vertex of `from` for each vertex of `to`. If the largest distance between a vertex and its nearest
// vertex exceeds `*apart_m`, store this distance in `*apart_m`.
static bool find_nearest(const kn_object_still *from, const kn_object_still *to, int *vertex, double *apart_m)
{
    spot *s = sorted(from);
    for (int v = 0; s && v < to->vertex_count; v++) {
        const spot *beside = nearest(s, from->vertex_count, to->rest[v]);
        if (vertex) vertex[v] = beside->vertex;
        *apart_m = fmax(*apart_m, sqrt(squared(beside->x, to->rest[v])));
    }
    const bool found = s != NULL;
    free(s);
    return found;
}

bool kn_vertex_match_make(kn_vertex_match *m, const kn_object_still *first, const kn_object_still *second, char *error,
                          size_t error_size)
{
    *m = (kn_vertex_match){.count = second->vertex_count};
    m->first = malloc(((size_t)m->count + 1) * sizeof *m->first);
    snprintf(error, error_size, "out of memory");
    // Search in both directions, because a part that only one of the objects has must be detected.
    bool ok = m->first && first->vertex_count > 0 && m->count > 0 &&
              find_nearest(first, second, m->first, &m->apart_m) && find_nearest(second, first, NULL, &m->apart_m);
    m->same = ok && first->vertex_count == second->vertex_count && m->apart_m < SAME_M;
    if (ok && m->apart_m > COARSE * fmax(longest_side(first), longest_side(second))) {
        snprintf(error, error_size,
                 "at rest the two objects are up to %.3g mm apart, expected objects of the same shape, "
                 "because points that coincide at rest are compared",
                 1e3 * m->apart_m);
        ok = false;
    }
    if (!ok) kn_vertex_match_free(m);
    return ok;
}

// Check the number of vertices and the range of the indices, because the meshes may have changed since the vertices
// were matched.
bool kn_vertex_match_fits(const kn_vertex_match *m, const kn_object_still *first, const kn_object_still *second)
{
    if (m->count != second->vertex_count || !m->first) return false;
    for (int v = 0; v < m->count; v++)
        if (m->first[v] >= first->vertex_count) return false;
    return true;
}

// Compare displacements and not positions, because two matched vertices may have different positions at rest.
void kn_vertex_match_distance(const kn_vertex_match *m, const kn_object_still *first, const kn_object_still *second,
                              float *value)
{
    for (int v = 0; v < m->count; v++) {
        const int u = m->first[v];
        float moved[2][3];
        for (int i = 0; i < 3; i++) {
            moved[0][i] = first->now[u][i] - first->rest[u][i];
            moved[1][i] = second->now[v][i] - second->rest[v][i];
        }
        value[v] = sqrtf(squared(moved[0], moved[1]));
    }
}

void kn_vertex_match_free(kn_vertex_match *m)
{
    free(m->first);
    *m = (kn_vertex_match){0};
}

struct kn_object_picture {
    kn_renderer *renderer;
    int width, height;
    int vertex_count, triangle_count; // numbers of vertices and triangles in the mesh that the renderer holds
    float (*rest)[3];
    int (*triangle)[3];
};

kn_object_picture *kn_object_picture_open(int width, int height, int samples, char *error, size_t error_size)
{
    kn_object_picture *shot = calloc(1, sizeof *shot);
    if (!shot) return snprintf(error, error_size, "out of memory"), NULL;
    shot->width = width;
    shot->height = height;
    shot->renderer = kn_renderer_open(width, height, samples, error, error_size);
    if (shot->renderer) return shot;
    kn_object_picture_close(shot);
    return NULL;
}

// Return true if the renderer already holds this mesh.
static bool same_mesh(const kn_object_picture *shot, const kn_object_still *s)
{
    return shot->vertex_count == s->vertex_count && shot->triangle_count == s->triangle_count &&
           memcmp(shot->rest, s->rest, (size_t)s->vertex_count * sizeof *s->rest) == 0 &&
           memcmp(shot->triangle, s->triangle, (size_t)s->triangle_count * sizeof *s->triangle) == 0;
}

static void forget_mesh(kn_object_picture *shot)
{
    free(shot->rest);
    free(shot->triangle);
    shot->vertex_count = shot->triangle_count = 0;
    shot->rest = NULL;
    shot->triangle = NULL;
}

// Give the mesh to the renderer, unless the renderer already holds it. For a new mesh, the renderer must determine the
// creases and the lines, so a film of one object loads its mesh only once.
static bool load_mesh(kn_object_picture *shot, const kn_object_still *s)
{
    if (same_mesh(shot, s)) return true;
    forget_mesh(shot);
    if (!kn_renderer_mesh(shot->renderer, s->vertex_count, (const float(*)[3])s->rest, s->triangle_count,
                          (const int(*)[3])s->triangle))
        return false;
    shot->rest = malloc((size_t)s->vertex_count * sizeof *s->rest);
    shot->triangle = malloc((size_t)s->triangle_count * sizeof *s->triangle);
    // If memory for the copies of the mesh is short, the renderer gets the mesh again with the next picture.
    if (!shot->rest || !shot->triangle) return true;
    shot->vertex_count = s->vertex_count;
    shot->triangle_count = s->triangle_count;
    memcpy(shot->rest, s->rest, (size_t)s->vertex_count * sizeof *s->rest);
    memcpy(shot->triangle, s->triangle, (size_t)s->triangle_count * sizeof *s->triangle);
    return true;
}

// Write caption, scale bar and legend on the picture.
static bool write_on(const kn_object_picture *shot, const kn_object_still *s, const kn_scale *scale, uint8_t *rgba,
                     char *error, size_t error_size)
{
    char bar[32];
    kn_label label = {.caption = s->caption, .scale = s->view.value ? scale : NULL};
    const double bar_m = kn_renderer_bar(shot->renderer, label.bar_at);
    kn_label_bar(&label, bar, bar_m, shot->width, shot->height);
    return kn_label_draw(&label, shot->width, shot->height, rgba, error, error_size);
}

bool kn_object_picture_take(kn_object_picture *shot, kn_object_still *s, const kn_scale *scale,
                            kn_object_picture_words words, uint8_t *rgba, char *error, size_t error_size)
{
    if (!load_mesh(shot, s)) {
        snprintf(error, error_size, "a mesh of %d vertices and %d triangles cannot be drawn", s->vertex_count,
                 s->triangle_count);
        return false;
    }
    kn_object_still_scale(s, scale ? scale->top : 1);
    s->view.xyz = (const float(*)[3])s->now;
    kn_renderer_draw(shot->renderer, &s->view, rgba);
    return words == KN_OBJECT_PICTURE_PLAIN ||
           write_on(shot, s, words == KN_OBJECT_PICTURE_LEGEND ? scale : NULL, rgba, error, error_size);
}

void kn_object_picture_close(kn_object_picture *shot)
{
    if (!shot) return;
    kn_renderer_close(shot->renderer);
    forget_mesh(shot);
    free(shot);
}

const char *kn_moment_take(void *at_s, const char *text)
{
    *(double *)at_s = INFINITY;
    return strcmp(text, "end") == 0 || kn_quantity_read(text, "s", true, -1e9, 1e9, at_s) ? NULL : "a time, or end";
}

double kn_measure_top(kn_measure measure, const char *text)
{
    double top = 0;
    // A number without a unit is accepted only if the measure itself has no unit.
    const char *unit = *kn_measure_names[measure].unit ? kn_measure_names[measure].unit : "1";
    return kn_quantity_read(text, unit, !strcmp(unit, "1"), 1e-9, 1e12, &top) ? top : 0;
}

const char *kn_measure_top_example(kn_measure measure)
{
    static const char *const example[KN_MEASURES] = {"'2 mm'", "'5 kPa'", "0.1"};
    return example[measure];
}

double kn_measure_scale(kn_measure measure, double asked, double most)
{
    // Smallest upper end of the colour scale for each measure, in SI units.
    static const double least[KN_MEASURES] = {1e-5, 1, 1e-3};
    return asked > 0 ? asked : kn_scale_top(fmax(most, least[measure]));
}
