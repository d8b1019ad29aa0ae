#include "clients/knead/tool_form.h"
#include "core/field.h"
#include "core/shape.h"
#include "core/algebra.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define PLATE_THICKNESS_M 0.002
#define STEPS 12 // number of steps that divide a quarter turn
// Number of points of a ring: each of 4 quarters has STEPS + 1 points, both of its ends included.
#define AROUND (4 * (STEPS + 1))
// number of rings: STEPS + 1 in the lower half and STEPS + 1 in the upper half of the surface.
#define RINGS (2 * (STEPS + 1))
#define POINTS (RINGS * AROUND + 2) // number of points: those of all rings, and one point at each end of the axis
#define TRIANGLES (2 * AROUND * RINGS)

// Every solid of shape.h except a mesh is the space that a ball covers while its centre moves through a core: a box, a
// disc, a line or a point.
// half_m: half extents of the box or line. disc_m: radius of the disc. roll_m: radius of the ball. up_m: height of the
// core's middle.
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
// Each quarter of a turn belongs to one corner of the core, so quarters are joined by flat strips.
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
    // The triangle has no area, as at the pole of a sphere or at a sharp edge.
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
    // A strip of triangles from the lower end through all rings to the upper end.
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

bool kn_tool_form_make(kn_tool_form *f, const kn_model *model, int probe)
{
    // Count first, so that the arrays are allocated once.
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

void kn_tool_form_free(kn_tool_form *f)
{
    free(f->xyz);
    free(f->triangle);
    *f = (kn_tool_form){0};
}

void kn_tool_form_place(const kn_tool_form *f, const kn_probe_def *def, const double position_m[3],
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
