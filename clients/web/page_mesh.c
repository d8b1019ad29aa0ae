#include "clients/web/page_mesh.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define STEPS 65534      // number of steps of a coordinate from one side of the box to the other
#define NOT_FINITE 65535 // written for each coordinate of a vertex whose position is not finite
#define VALUE_STEPS 254  // number of steps of a value from 0 to the top of the colour scale
#define NO_VALUE 255

static void drop(kn_page_mesh *m)
{
    kn_object_still_free(&m->still);
    kn_shaded_mesh_destroy(m->shaded);
    m->shaded = NULL;
    for (int i = 0; i < KN_MEASURES; i++) {
        free(m->value[i]);
        m->value[i] = NULL;
        m->valued[i] = 0;
    }
}

void kn_page_mesh_forget(kn_page_mesh *m)
{
    m->mesh_id = m->refused = 0;
    memset(m->top, 0, sizeof m->top);
}

// Return true if two stills have the same topology and rest shape.
static bool alike(const kn_object_still *a, const kn_object_still *b)
{
    const size_t vertices = (size_t)a->vertex_count, triangles = (size_t)a->triangle_count;
    return a->vertex_count == b->vertex_count && a->triangle_count == b->triangle_count &&
           memcmp(a->rest, b->rest, vertices * sizeof *a->rest) == 0 &&
           memcmp(a->triangle, b->triangle, triangles * sizeof *a->triangle) == 0;
}

// Take a mesh after another scene or another mesh has come. If its surface is new, determine creases and lines.
static bool take_surface(kn_page_mesh *m)
{
    kn_object_still next = {0};
    char error[400];
    if (m->refused == m->live->mesh.mesh_id) return false;
    if (!kn_object_still_live(&next, m->live, error, sizeof error) || error[0]) {
        m->refused = m->live->mesh.mesh_id;
        return kn_object_still_free(&next), false;
    }
    const bool same = m->shaded && alike(&next, &m->still);
    if (same) kn_object_still_free(&m->still);
    else drop(m);
    m->still = next;
    const kn_object_still *s = &m->still;
    if (!same)
        m->shaded = kn_shaded_mesh_create(s->vertex_count, (const float(*)[3])s->rest, s->triangle_count,
                                          (const int(*)[3])s->triangle);
    bool ok = m->shaded != NULL;
    for (int i = 0; ok && !same && i < KN_MEASURES; i++) ok = (m->value[i] = malloc((size_t)s->vertex_count)) != NULL;
    if (!ok) return drop(m), false;
    m->mesh_id = m->live->mesh.mesh_id;
    m->surface += !same;
    return true;
}

bool kn_page_mesh_take(kn_page_mesh *m)
{
    if (!m->live->scene || !m->live->mesh.whole) return false;
    if (m->mesh_id && m->mesh_id == m->live->mesh.mesh_id) kn_object_still_update(&m->still, m->live);
    else if (!take_surface(m)) return false;
    m->shape++;
    return true;
}

double kn_page_mesh_next_top(double top, int measure, double most)
{
    // Smallest value at the top of the colour scale for each measure, in SI units. Smaller values are rounding errors.
    static const double least[KN_MEASURES] = {1e-3, 100, 0.01};
    const double wanted = kn_scale_round(fmax(most, least[measure]));
    // Raise the top of the scale at once, but lower it only if the largest value is below 30 % of the top.
    return wanted > top || wanted < 0.3 * top ? wanted : top;
}

double kn_page_mesh_top(kn_page_mesh *m, int measure)
{
    kn_object_still *s = &m->still;
    if (measure < 0 || !m->shaded) return 0;
    if (m->valued[measure] == m->shape) return m->top[measure];
    if (!kn_object_still_told(s, m->live, (kn_measure)measure)) return 0;
    const double top = kn_page_mesh_next_top(m->top[measure], measure, kn_object_still_most(s));
    for (int v = 0; v < s->vertex_count; v++) {
        const float share = s->value[v] / (float)top;
        m->value[measure][v] = share >= 0 ? (uint8_t)lrintf(VALUE_STEPS * fminf(share, 1)) : NO_VALUE;
    }
    m->valued[measure] = m->shape;
    return m->top[measure] = top;
}

// Copy an array to `*to` and move `*to` behind it.
static void put(uint8_t **to, const void *from, size_t size)
{
    memcpy(*to, from, size);
    *to += size;
}

size_t kn_page_mesh_largest(const kn_page_mesh *m)
{
    return kn_page_mesh_write_surface(m, NULL) + sizeof(float[2][3]) + 7 * (size_t)m->still.vertex_count;
}

size_t kn_page_mesh_write_surface(const kn_page_mesh *m, uint8_t *bytes)
{
    const kn_shaded_mesh *s = m->shaded;
    if (!s) return 0;
    const uint32_t head[4] = {(uint32_t)s->vertex_count, (uint32_t)s->triangle_count, (uint32_t)s->group_count, 0};
    const size_t corners = 3 * (size_t)s->triangle_count, padding = (4 - corners % 4) % 4;
    if (bytes) {
        put(&bytes, head, sizeof head);
        put(&bytes, s->triangle, corners * sizeof *s->triangle);
        put(&bytes, s->group, corners * sizeof *s->group);
        put(&bytes, s->line, corners);
        memset(bytes, 0, padding);
    }
    return sizeof head + 8 * corners + corners + padding;
}

// Find the box around all vertices whose positions are finite.
static void find_box(const kn_object_still *s, float low[3], float high[3])
{
    for (int i = 0; i < 3; i++) low[i] = INFINITY, high[i] = -INFINITY;
    for (int v = 0; v < s->vertex_count; v++) {
        const float *x = s->now[v];
        for (int i = 0; i < 3 && isfinite(x[0] + x[1] + x[2]); i++)
            low[i] = fminf(low[i], x[i]), high[i] = fmaxf(high[i], x[i]);
    }
    for (int i = 0; i < 3; i++)
        if (low[i] > high[i]) low[i] = high[i] = 0;
}

size_t kn_page_mesh_write_shape(kn_page_mesh *m, int measure, uint8_t *bytes)
{
    const kn_object_still *s = &m->still;
    if (!m->shaded) return 0;
    const bool colored = kn_page_mesh_top(m, measure) > 0;
    const size_t vertices = (size_t)s->vertex_count;
    if (bytes) {
        float box[2][3];
        find_box(s, box[0], box[1]);
        put(&bytes, box, sizeof box);
        for (size_t v = 0; v < vertices; v++) {
            const float *x = s->now[v];
            uint16_t at[3] = {NOT_FINITE, NOT_FINITE, NOT_FINITE};
            for (int i = 0; i < 3 && isfinite(x[0] + x[1] + x[2]); i++) {
                const float side = box[1][i] - box[0][i];
                at[i] = side > 0 ? (uint16_t)lrintf(STEPS * ((x[i] - box[0][i]) / side)) : 0;
            }
            put(&bytes, at, sizeof at);
        }
        if (colored) put(&bytes, m->value[measure], vertices);
    }
    return sizeof(float[2][3]) + 6 * vertices + (colored ? vertices : 0);
}

// Describe a tool as unit solids, placed in the tool's own frame. kind: 1 box, 2 rod, 3 ball, 0 the triangles of a
// mesh.
static json_t *describe_tool(const kn_drawn_shapes *shapes, const kn_probe_def *def)
{
    const kn_view_probe probe = {.def = *def, .orientation_wxyz = {1}};
    kn_drawn_solid solid[KN_DRAWN_SOLIDS_MAX];
    const int count = kn_drawn_probe_solids(shapes, &probe, solid);
    json_t *solids = json_array();
    for (int i = 0; i < count; i++) {
        const kn_gl_mesh *s = solid[i].shape;
        json_t *place = json_array();
        for (int k = 0; k < 16; k++) json_array_append_new(place, json_real((double)solid[i].place[k]));
        json_array_append_new(solids, json_pack("{s:i, s:o}", "kind",
                                                s == &shapes->box    ? 1
                                                : s == &shapes->rod  ? 2
                                                : s == &shapes->ball ? 3
                                                                     : 0,
                                                "place", place));
    }
    const kn_field *field = def->parts ? def->parts->part[0].field : NULL;
    return json_pack("{s:s, s:I, s:f, s:b, s:o}", "name", def->name, "mesh",
                     field ? (json_int_t)(field->hash >> 1) : (json_int_t)0, "height", kn_drawn_probe_height(def),
                     "level", def->shape == KN_PROBE_PLATE || shapes->thickness_m > 0, "solids", solids);
}

json_t *kn_page_mesh_describe(const kn_page_mesh *m)
{
    if (!m->shaded || !m->live->scene) return NULL;
    const kn_model_def *def = &m->live->scene->model;
    const float *low = m->shaded->rest_low, *high = m->shaded->rest_high, *color = m->still.view.color;
    const kn_drawn_shapes shapes = {.thickness_m = m->still.view.thickness_m};
    json_t *tools = json_array();
    for (int i = 0; i < def->probe_count; i++) json_array_append_new(tools, describe_tool(&shapes, &def->probe[i]));
    return json_pack("{s:[f, f, f], s:[f, f, f], s:[f, f, f], s:f, s:o}", "low", (double)low[0], (double)low[1],
                     (double)low[2], "high", (double)high[0], (double)high[1], (double)high[2], "color",
                     (double)color[0], (double)color[1], (double)color[2], "spacing", def->spacing_m, "tools", tools);
}

bool kn_page_mesh_tool(const kn_page_mesh *m, int index, kn_web_file *file)
{
    const kn_model_def *def = m->live->scene ? &m->live->scene->model : NULL;
    const kn_shape *parts = def && index < def->probe_count ? def->probe[index].parts : NULL;
    if (!parts || !parts->part[0].field) return false;
    file->bytes = (char *)kn_drawn_probe_corners(parts->part[0].field);
    file->size = (size_t)parts->part[0].field->triangle_count * 18 * sizeof(float);
    return file->bytes;
}

void kn_page_mesh_close(kn_page_mesh *m) { drop(m); }
