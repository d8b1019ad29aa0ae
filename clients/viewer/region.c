#include "clients/viewer/region.h"
#include <math.h>

typedef struct extent {
    float low[2], high[2]; // low and high corner of a rectangle in the picture, -1..1 from edge to edge
} extent;

// extents of all things drawn on the table, and of the part where the table itself differs from the empty table
typedef struct parts {
    extent all, table;
} parts;

// Extend the extent `e` to include the point `p` of the world.
static void cover(const kn_region_def *d, extent *e, const float p[3])
{
    const float *m = d->camera->matrix;
    float w = m[3] * p[0] + m[7] * p[1] + m[11] * p[2] + m[15];
    for (int i = 0; i < 2; i++) {
        float at = (m[i] * p[0] + m[4 + i] * p[1] + m[8 + i] * p[2] + m[12 + i]) / w;
        bool known = w > 0; // true if the point is in front of the camera; otherwise it may be anywhere in the picture
        e->low[i] = fminf(e->low[i], known ? at : -1);
        e->high[i] = fmaxf(e->high[i], known ? at : 1);
    }
}

// Extend the parts by a point and by its shadow on the table.
static void cover_point(const kn_region_def *d, parts *e, const float p[3])
{
    float q[3], down = fmaxf(0, p[2] - d->level_m) / d->key[2];
    cover(d, &e->all, p);
    for (int i = 0; i < 3; i++) q[i] = p[i] - down * d->key[i];
    cover(d, &e->all, q);
    cover(d, &e->table, q);
}

// Extend the parts by a solid, through the box around its unit shape.
static void cover_solid(const kn_region_def *d, parts *e, const kn_tool_solid *s)
{
    const float *m = s->place, half = s->shape->half;
    for (int corner = 0; corner < 8; corner++) {
        float x = corner & 1 ? half : -half, y = corner & 2 ? half : -half, p[3];
        float z = corner & 4 ? s->shape->high : s->shape->low;
        for (int i = 0; i < 3; i++) p[i] = m[i] * x + m[4 + i] * y + m[8 + i] * z + m[12 + i];
        cover_point(d, e, p);
    }
}

// Extend the parts by the solids of a probe and by its arrow.
static void cover_probe(const kn_region_def *d, const kn_tools *tools, parts *e, const kn_view_probe *p)
{
    kn_tool_solid s[KN_TOOL_SOLIDS_MAX];
    for (int i = 0, n = kn_tool_solids(tools, p, s); i < n; i++) cover_solid(d, e, &s[i]);
    const kn_tool_arrow a = kn_tool_arrow_of(p, d->square_m);
    if (!(a.length > 0)) return;
    float wide = 0.2f * d->square_m; // half width of a box around the arrow, wider than the arrow's head
    for (int end = 0; end < 2; end++) {
        float at[3];
        for (int i = 0; i < 3; i++) at[i] = a.tail[i] + (end ? a.length : 0) * a.direction[i];
        const kn_tool_solid around_end = kn_tool_ball(tools, at, wide);
        cover_solid(d, e, &around_end);
    }
}

// Convert a coordinate -1..1 to a pixel, add a margin, and limit the result to the picture.
static int pixel(float at, int size, int margin)
{
    float p = 0.5f * (at + 1) * (float)size + (float)margin;
    return (int)fminf(fmaxf(p, 0), (float)size);
}

// Convert an extent to pixels, with a margin of two pixels for rounding.
static kn_gl_region around(const kn_region_def *d, const extent *e)
{
    kn_gl_region g = {pixel(e->low[0], d->width, -2), pixel(e->low[1], d->height, -2), 0, 0};
    g.width = pixel(e->high[0], d->width, 3) - g.x;
    g.height = pixel(e->high[1], d->height, 3) - g.y;
    return g.width > 0 && g.height > 0 ? g : (kn_gl_region){0};
}

void kn_region_find(const kn_region_def *d, const kn_tools *tools, const kn_view_scene *scene, int vertex_count,
                    const float foot[4], kn_gl_region *all, kn_gl_region *table)
{
    static const extent nothing = {{INFINITY, INFINITY}, {-INFINITY, -INFINITY}};
    parts e = {nothing, nothing};
    // Include the object, the probes and the hands, each with its shadow.
    for (int v = 0; v < vertex_count; v++) {
        const float *p = scene->xyz[v];
        if (isfinite(p[0] + p[1] + p[2])) cover_point(d, &e, p);
    }
    for (int i = 0; i < scene->probe_count && i < KN_PROBES_MAX; i++)
        if (kn_tool_somewhere(&scene->probe[i])) cover_probe(d, tools, &e, &scene->probe[i]);
    kn_view_probe hand;
    for (int i = 0; i < scene->probe_count && i < KN_PROBES_MAX; i++)
        if (kn_tool_hand(scene, &scene->probe[i], &hand)) cover_probe(d, tools, &e, &hand);
    // Include the table around the object's footprint, where the table is darker.
    const float dim = d->dim_m;
    for (int corner = 0; corner < 4 && foot[0] <= foot[2]; corner++) {
        float p[3] = {corner & 1 ? foot[2] + dim : foot[0] - dim, corner & 2 ? foot[3] + dim : foot[1] - dim,
                      d->level_m};
        cover(d, &e.all, p);
        cover(d, &e.table, p);
    }
    *all = around(d, &e.all);
    *table = around(d, &e.table);
}
