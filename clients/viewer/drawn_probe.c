#include "clients/viewer/shading.h"
#include "core/field.h"
#include "core/solve/tool.h"
#include <stdlib.h>
#include <string.h>

#define PLATE_THICKNESS_M 0.002
// Thickness of tools, as a fraction of a flat object's thickness. At 1, the sides of tool and object would lie in one
// plane and flicker.
#define FLAT_SHARE 0.99
#define ARROW_SQUARES_PER_N 0.2f // length of the force arrow per force, squares of the table per N
#define ARROW_LEAST_N 0.05f      // smallest force that is drawn as an arrow, N
#define HAND_AWAY_M 0.0005       // distance between a hand and its tool above which the hand is drawn
#define HAND_TURNED_COS 0.9986f  // cosine of 3 degrees, the angle to its tool above which a hand is drawn

// Profiles (radius, z) of the unit solids. z runs from 0 to 1; in the ball, z runs from -1 to 1. The radius is 1. The
// box has sides of length 1.
kn_drawn_shapes kn_drawn_shapes_create(const kn_gl *gl)
{
    static const float box[][2] = {{0, 0}, {0.70710678f, 0}, {0.70710678f, 1}, {0, 1}};
    static const float rod[][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}}, cone[][2] = {{0, 0}, {1, 0}, {0, 1}};
    float ball[17][2];
    for (int i = 0; i < 17; i++) {
        ball[i][0] = i % 16 == 0 ? 0 : sinf(3.1415927f * (float)i / 16);
        ball[i][1] = -cosf(3.1415927f * (float)i / 16);
    }
    kn_drawn_shapes t = {.gl = gl};
    t.box = kn_gl_mesh_revolve(gl, 4, box, 4);
    t.rod = kn_gl_mesh_revolve(gl, 4, rod, 24);
    t.cone = kn_gl_mesh_revolve(gl, 3, cone, 24);
    t.ball = kn_gl_mesh_revolve(gl, 17, (const float(*)[2])ball, 32);
    return t;
}

typedef struct frame { // axes and origin of a tool
    float axis[3][3], at[3];
} frame;

static frame frame_of(const kn_view_probe *p)
{
    static const double level[4] = {1}; // a plate is always level, whatever the orientation of its probe
    frame f;
    double r[3][3];
    kn_tool_matrix(p->def.shape == KN_PROBE_PLATE ? level : p->orientation_wxyz, r);
    for (int i = 0; i < 3; i++) {
        f.at[i] = (float)p->position_m[i];
        for (int k = 0; k < 3; k++) f.axis[k][i] = (float)r[i][k];
    }
    return f;
}

// Place a unit solid on the z axis of the tool. `z`: distance from the tool's origin. `x`, `y`, `height`: factors by
// which the unit solid is scaled along the three axes.
static kn_drawn_solid solid_at(const frame *f, const kn_gl_mesh *s, double z, double x, double y, double height)
{
    const float size[3] = {(float)x, (float)y, (float)height};
    kn_drawn_solid out = {.shape = s, .place[15] = 1};
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) out.place[4 * k + i] = size[k] * f->axis[k][i];
        out.place[12 + i] = f->at[i] + (float)z * f->axis[2][i];
    }
    return out;
}

// Return the axes and the origin of a part of a tool, in the scene.
static frame frame_within(const frame *tool, const kn_solid *part)
{
    frame f = {.at = {tool->at[0], tool->at[1], tool->at[2]}};
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            f.at[i] += (float)part->at_m[k] * tool->axis[k][i];
            for (int j = 0; j < 3; j++) f.axis[k][i] += (float)part->turn[j][k] * tool->axis[j][i];
        }
    return f;
}

float *kn_drawn_probe_corners(const kn_field *f)
{
    float(*x)[3] = malloc((size_t)f->vertex_count * sizeof *x);
    float *corners = malloc((size_t)f->triangle_count * 18 * sizeof *corners);
    for (int i = 0; x && i < f->vertex_count; i++)
        for (int k = 0; k < 3; k++) x[i][k] = (float)f->x_m[i][k];
    kn_shaded_mesh *mesh = x && corners ? kn_shaded_mesh_create(f->vertex_count, (const float(*)[3])x,
                                                                f->triangle_count, (const int(*)[3])f->triangle)
                                        : NULL;
    if (mesh) kn_shaded_mesh_corners(mesh, (const float(*)[3])x, corners);
    if (!mesh) free(corners), corners = NULL;
    kn_shaded_mesh_destroy(mesh);
    free(x);
    return corners;
}

// Upload a mesh tool when it is first seen. If memory is short, the tool has no triangles and is not drawn.
static void load_mesh(kn_drawn_shapes *t, int probe, const kn_field *f)
{
    float *corners = kn_drawn_probe_corners(f);
    if (!t->mesh[probe].array) t->mesh[probe] = kn_gl_mesh_create(t->gl);
    t->mesh[probe].corners = 0;
    t->hash[probe] = f->hash;
    if (corners) kn_gl_mesh_upload(t->gl, &t->mesh[probe], 3 * f->triangle_count, corners, GL_STATIC_DRAW);
    free(corners);
}

// Upload the mesh of a probe if another mesh, or none, is in OpenGL's memory. Two meshes are compared by their hashes.
void kn_drawn_shapes_load(kn_drawn_shapes *t, const kn_view_scene *scene)
{
    t->thickness_m = scene->thickness_m;
    for (int i = 0; i < scene->probe_count && i < KN_PROBES_MAX; i++) {
        const kn_shape *parts = scene->probe[i].def.parts;
        const kn_field *field = parts ? parts->part[0].field : NULL;
        if (field && field->hash != t->hash[i]) load_mesh(t, i, field);
    }
}

// Return the uploaded triangles of a tool that is a mesh.
static const kn_gl_mesh *tool_of(const kn_drawn_shapes *t, const kn_field *field)
{
    int i = 0;
    while (i < KN_PROBES_MAX - 1 && t->hash[i] != field->hash) i++;
    return &t->mesh[i];
}

// Fill in the solids of one part and return their number. Rounded edges are drawn sharp.
static int solids_of_part(const kn_drawn_shapes *t, const frame *tool, const kn_solid *p, kn_drawn_solid *out)
{
    const frame f = frame_within(tool, p);
    const double radius = p->radius_m, length = p->length_m, *half = p->half_m, wide = half[0] + radius;
    switch (p->kind) {
    case KN_SOLID_FIELD: out[0] = solid_at(&f, tool_of(t, p->field), 0, 1, 1, 1); return 1;
    case KN_SOLID_BOX: out[0] = solid_at(&f, &t->box, 0, 2 * wide, 2 * (half[1] + radius), length); return 1;
    case KN_SOLID_CYLINDER: out[0] = solid_at(&f, &t->rod, 0, wide, wide, length); return 1;
    case KN_SOLID_SPHERE: out[0] = solid_at(&f, &t->ball, 0, radius, radius, radius); return 1;
    default:
        out[0] = solid_at(&f, &t->ball, 0, radius, radius, radius);
        out[1] = solid_at(&f, &t->rod, 0, radius, radius, length);
        out[2] = solid_at(&f, &t->ball, length, radius, radius, radius);
        return 3;
    }
}

int kn_drawn_probe_solids(const kn_drawn_shapes *t, const kn_view_probe *p, kn_drawn_solid out[KN_DRAWN_SOLIDS_MAX])
{
    const frame f = frame_of(p);
    const double *size = p->def.size_m, flat = FLAT_SHARE * t->thickness_m;
    int count = 0;
    kn_shape shape = {0};
    // A flat object is a thin slice, so its tools are drawn as slices too: a ball becomes a disc, and a plate becomes a
    // line.
    if (flat > 0 && p->def.shape == KN_PROBE_SPHERE) {
        const frame across = {{{1, 0, 0}, {0, 0, -1}, {0, 1, 0}}, {f.at[0], f.at[1], f.at[2]}};
        out[0] = solid_at(&across, &t->rod, -0.5 * flat, p->def.radius_m, p->def.radius_m, flat);
        return 1;
    }
    if (flat > 0 && p->def.shape == KN_PROBE_PLATE) {
        out[0] = solid_at(&f, &t->box, 0, size[0], flat, PLATE_THICKNESS_M);
        return 1;
    }
    if (p->def.shape == KN_PROBE_PLATE) out[count++] = solid_at(&f, &t->box, 0, size[0], size[1], PLATE_THICKNESS_M);
    kn_tool_shape(&p->def, &shape);
    for (int i = 0; i < shape.part_count; i++) count += solids_of_part(t, &f, &shape.part[i], out + count);
    return count;
}

double kn_drawn_probe_height(const kn_probe_def *def)
{
    kn_shape shape = {0};
    if (def->shape == KN_PROBE_PLATE) return PLATE_THICKNESS_M;
    kn_tool_shape(def, &shape);
    return kn_shape_support(&shape, (double[]){0, 0, 1});
}

// Place the arrow above the tool for both directions of the force. An arrow that points away from the tool begins at
// the tool's upper end. An arrow that points towards the tool ends at the upper end.
kn_drawn_arrow kn_drawn_probe_arrow(const kn_view_probe *p, float square_m)
{
    kn_drawn_arrow a = {.direction = {(float)p->force_n[0], (float)p->force_n[1], (float)p->force_n[2]}};
    float newton = kn_normalizef(a.direction);
    if (!(newton >= ARROW_LEAST_N) || !isfinite(newton)) return (kn_drawn_arrow){0};
    a.length = ARROW_SQUARES_PER_N * newton * square_m;
    const frame f = frame_of(p);
    const bool pull = kn_dotf(a.direction, f.axis[2]) < 0;
    for (int i = 0; i < 3; i++) {
        a.tail[i] = f.at[i] + (float)kn_drawn_probe_height(&p->def) * f.axis[2][i];
        if (pull) a.tail[i] -= a.length * a.direction[i];
    }
    return a;
}

bool kn_drawn_probe_is_finite(const kn_view_probe *p)
{
    const double *x = p->position_m, *q = p->orientation_wxyz;
    return isfinite(x[0] + x[1] + x[2] + q[0] + q[1] + q[2] + q[3]);
}

// Make `hand` a tool without force at the pose of the hand. Return false if the hand needs no outline: if the scene
// draws no hands, no hand holds the tool, the hand's pose is not finite, or hand and tool nearly coincide.
bool kn_drawn_probe_hand(const kn_view_scene *scene, const kn_view_probe *p, kn_view_probe *hand)
{
    const double *x = p->position_m, *y = p->hand_position_m;
    if (!scene->hands || !p->held) return false;
    *hand = *p;
    memcpy(hand->position_m, y, sizeof hand->position_m);
    memcpy(hand->orientation_wxyz, p->hand_orientation_wxyz, sizeof hand->orientation_wxyz);
    memset(hand->force_n, 0, sizeof hand->force_n);
    if (!kn_drawn_probe_is_finite(hand)) return false;
    const frame tool = frame_of(p), held = frame_of(hand);
    float least = 1; // cosine of the largest angle between an axis of the hand and the same axis of the tool
    for (int i = 0; i < 3; i++) least = fminf(least, kn_dotf(tool.axis[i], held.axis[i]));
    return hypot(hypot(x[0] - y[0], x[1] - y[1]), x[2] - y[2]) > HAND_AWAY_M || least < HAND_TURNED_COS;
}
