#include "core/shape.h"
#include "core/field.h"
#include "core/algebra/algebra.h"

#include <math.h>
#include <string.h>

static kn_solid part_of(kn_solid_kind kind, double radius_m, double length_m)
{
    return (kn_solid){
        .kind = kind, .radius_m = radius_m, .length_m = length_m, .turn = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
}

kn_solid kn_solid_sphere(double radius_m) { return part_of(KN_SOLID_SPHERE, radius_m, 0); }
kn_solid kn_solid_capsule(double radius_m, double length_m) { return part_of(KN_SOLID_CAPSULE, radius_m, length_m); }

// A cylinder with rounded edges is all points within the distance edge_m of a smaller cylinder, whose radius is
// half_m[0] and whose half length is half_m[2].
kn_solid kn_solid_cylinder(double radius_m, double length_m, double edge_m)
{
    kn_solid p = part_of(KN_SOLID_CYLINDER, edge_m, length_m);
    p.half_m[0] = radius_m - edge_m;
    p.half_m[2] = 0.5 * length_m - edge_m;
    return p;
}

kn_solid kn_solid_box(const double size_m[3], double edge_m)
{
    kn_solid p = part_of(KN_SOLID_BOX, edge_m, size_m[2]);
    for (int k = 0; k < 3; k++) p.half_m[k] = 0.5 * size_m[k] - edge_m;
    return p;
}

kn_solid kn_solid_field(kn_field *field)
{
    kn_solid p = part_of(KN_SOLID_FIELD, 0, 0);
    p.field = field;
    return p;
}

// Compute the distance from a part's origin to its farthest point, and the part's smallest half width.
static void extent(const kn_solid *p, double *bound_m, double *fine_m)
{
    double far[3] = {0};
    switch (p->kind) {
    // far: the coordinates of the part's farthest point from its origin
    case KN_SOLID_SPHERE: far[0] = p->radius_m; break;
    case KN_SOLID_CAPSULE: far[2] = p->length_m + p->radius_m; break;
    case KN_SOLID_CYLINDER: far[0] = p->half_m[0] + p->radius_m, far[2] = p->length_m; break;
    case KN_SOLID_FIELD: *bound_m = p->field->bound_m, *fine_m = p->field->fine_m; return;
    case KN_SOLID_BOX:
        for (int k = 0; k < 3; k++) far[k] = (k == 2 ? 2 : 1) * (p->half_m[k] + p->radius_m);
        break;
    }
    *bound_m = sqrt(kn_dot(far, far));
    double across = p->kind == KN_SOLID_BOX ? fmin(p->half_m[0], p->half_m[1]) : p->half_m[0];
    bool round = p->kind == KN_SOLID_SPHERE || p->kind == KN_SOLID_CAPSULE;
    *fine_m = round ? p->radius_m : fmin(across, p->half_m[2]) + p->radius_m;
}

// kn_shape_distance does not transform points for a plain shape, a single part at the origin without rotation.
bool kn_shape_add(kn_shape *shape, const kn_solid *part)
{
    double bound_m, fine_m;
    if (shape->part_count == KN_PARTS_MAX) return false;
    extent(part, &bound_m, &fine_m);
    shape->bound_m = fmax(shape->bound_m, bound_m + sqrt(kn_dot(part->at_m, part->at_m)));
    shape->fine_m = shape->part_count == 0 ? fine_m : fmin(shape->fine_m, fine_m);
    shape->part[shape->part_count++] = *part;
    shape->plain = shape->part_count == 1 && !part->turned && kn_dot(part->at_m, part->at_m) == 0;
    return true;
}

// --- distances, in the part's own frame -----------------------------------------------------------------------------

// Return the distance from the origin minus r. At the origin itself, the gradient is z.
static double round_about(const double from[3], double r, double gradient[3])
{
    double length = sqrt(kn_dot(from, from));
    for (int k = 0; k < 3; k++) gradient[k] = length > 0 ? from[k] / length : k == 2;
    return length - r;
}

static double capsule(const kn_solid *p, const double at[3], double gradient[3])
{
    double from[3] = {at[0], at[1], at[2] - fmin(fmax(at[2], 0), p->length_m)};
    return round_about(from, p->radius_m, gradient);
}

// Return the distance of a point from the solid that is smaller by the rounding radius `edge`, minus `edge`. over[i] is
// the distance by which the point is beyond face i of the smaller solid, in the direction way[i]. If the point is
// inside, or beyond one face only, the nearest place of the smaller solid is on a face. If the point is beyond more
// faces, the nearest place is on an edge or a corner.
static double rounded(const double over[], const double way[][3], int n, double edge, double gradient[3])
{
    double outside = 0, most = over[0];
    int nearest = 0;
    for (int i = 0; i < n; i++) {
        if (over[i] > most) most = over[i], nearest = i;
        if (over[i] > 0) outside += over[i] * over[i];
    }
    outside = sqrt(outside);
    for (int k = 0; k < 3; k++) {
        gradient[k] = outside > 0 ? 0 : way[nearest][k];
        for (int i = 0; i < n && outside > 0; i++)
            if (over[i] > 0) gradient[k] += over[i] / outside * way[i][k];
    }
    return (outside > 0 ? outside : most) - edge;
}

static double box(const kn_solid *p, const double at[3], double gradient[3])
{
    double over[3], way[3][3] = {{0}};
    for (int k = 0; k < 3; k++) {
        double from = k == 2 ? at[2] - 0.5 * p->length_m : at[k];
        over[k] = fabs(from) - p->half_m[k];
        way[k][k] = from < 0 ? -1 : 1;
    }
    return rounded(over, (const double(*)[3])way, 3, p->radius_m, gradient);
}

static double cylinder(const kn_solid *p, const double at[3], double gradient[3])
{
    double across = sqrt(at[0] * at[0] + at[1] * at[1]), up = at[2] - 0.5 * p->length_m;
    double over[2] = {across - p->half_m[0], fabs(up) - p->half_m[2]};
    double way[2][3] = {{across > 0 ? at[0] / across : 1, across > 0 ? at[1] / across : 0, 0}, {0, 0, up < 0 ? -1 : 1}};
    return rounded(over, (const double(*)[3])way, 2, p->radius_m, gradient);
}

static double distance_of(const kn_solid *p, const double at[3], double gradient[3])
{
    switch (p->kind) {
    case KN_SOLID_SPHERE: return round_about(at, p->radius_m, gradient);
    case KN_SOLID_CAPSULE: return capsule(p, at, gradient);
    case KN_SOLID_CYLINDER: return cylinder(p, at, gradient);
    case KN_SOLID_FIELD: return kn_field_distance(p->field, at, gradient);
    default: return box(p, at, gradient);
    }
}

double kn_shape_distance(const kn_shape *shape, const double at[3], double gradient[3])
{
    // the distance of a union is the distance of its nearest part
    double nearest = INFINITY;
    if (shape->plain) return distance_of(&shape->part[0], at, gradient);
    for (int i = 0; i < shape->part_count; i++) {
        const kn_solid *p = &shape->part[i];
        double from[3], own[3], way[3];
        // transform the point into the part's frame, and the gradient back
        for (int k = 0; k < 3; k++) own[k] = from[k] = at[k] - p->at_m[k];
        for (int k = 0; k < 3 && p->turned; k++)
            own[k] = p->turn[0][k] * from[0] + p->turn[1][k] * from[1] + p->turn[2][k] * from[2];
        double distance = distance_of(p, own, way);
        if (distance >= nearest) continue;
        nearest = distance;
        for (int k = 0; k < 3; k++) gradient[k] = p->turned ? kn_dot(p->turn[k], way) : way[k];
    }
    return nearest;
}

// --- extent in a direction ------------------------------------------------------------------------------------------

// Return how far a part reaches from its own origin in a direction, m.
static double support_of(const kn_solid *p, const double way[3])
{
    if (p->kind == KN_SOLID_FIELD) return kn_field_support(p->field, way);
    double far = 0, axis = p->kind == KN_SOLID_CAPSULE ? fmax(0, way[2]) * p->length_m : 0.5 * p->length_m * way[2];
    switch (p->kind) {
    case KN_SOLID_CYLINDER:
        far = p->half_m[0] * sqrt(way[0] * way[0] + way[1] * way[1]) + p->half_m[2] * fabs(way[2]);
        break;
    case KN_SOLID_BOX:
        for (int k = 0; k < 3; k++) far += p->half_m[k] * fabs(way[k]);
        break;
    default: break;
    }
    return far + axis + p->radius_m;
}

// The extent of a union is the extent of the part that reaches farthest. Each part is evaluated in its own frame.
double kn_shape_support(const kn_shape *shape, const double way[3])
{
    double farthest = -INFINITY;
    for (int i = 0; i < shape->part_count; i++) {
        const kn_solid *p = &shape->part[i];
        double own[3];
        for (int k = 0; k < 3; k++) own[k] = p->turn[0][k] * way[0] + p->turn[1][k] * way[1] + p->turn[2][k] * way[2];
        farthest = fmax(farthest, kn_dot(p->at_m, way) + support_of(p, own));
    }
    return farthest;
}

double kn_shape_span(const kn_shape *shape, int axis)
{
    double way[3] = {0}, back[3] = {0};
    way[axis] = 1, back[axis] = -1;
    return kn_shape_support(shape, way) + kn_shape_support(shape, back);
}

// Copies of a shape share only the fields of its parts, so a field counts the shapes that hold it.
void kn_shape_keep(const kn_shape *shape)
{
    for (int i = 0; i < shape->part_count; i++)
        if (shape->part[i].field) shape->part[i].field->holders++;
}

void kn_shape_drop(const kn_shape *shape)
{
    for (int i = 0; i < shape->part_count; i++) kn_field_drop(shape->part[i].field);
}
