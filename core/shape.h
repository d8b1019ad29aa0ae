#ifndef KN_CORE_SHAPE_H
#define KN_CORE_SHAPE_H
// The shape of a rigid tool as a signed distance: the distance of a point from the surface, < 0 inside, and the
// direction outwards.
//
// Tool frame, m: the origin is the position of the pose. If the orientation is identity, z points up, away from the
// object.
//
//     sphere     centre at the origin
//     capsule    a finger: ball of `radius` at the origin, its axis runs up along z for `length`
//     cylinder   lower face at the origin, axis up along z for `length`, edges rounded by `edge`
//     box        lower face centred at the origin, x by y by z of `size`, edges rounded by `edge`
//     cross      two such boxes across each other: size is arm length, arm width, height (first paper, Fig. 13)
//     union      up to KN_PARTS_MAX of the others, each at its own position and orientation; the nearest part counts
//
//     field      any closed surface, in the frame of its file, by a grid of distances (field.h)
//
// The distance is exact, except for fields, and except inside a union, where only the nearest part counts. A shape is
// plain data of the caller; only fields are shared and count their holders.
#include <stdbool.h>

#define KN_PARTS_MAX 8

typedef enum kn_solid_kind {
    KN_SOLID_SPHERE,
    KN_SOLID_CAPSULE,
    KN_SOLID_CYLINDER,
    KN_SOLID_BOX,
    KN_SOLID_FIELD
} kn_solid_kind;

struct kn_field;

typedef struct kn_solid {
    kn_solid_kind kind;
    // BOX: half extents without the rounding. CYLINDER: [0] radius and [2] half length, both without the rounding.
    double half_m[3];
    double radius_m;        // radius of the ball, of the capsule or cylinder, or of a box's rounded edges
    double length_m;        // CAPSULE, CYLINDER: length along z
    double at_m[3];         // origin of the part in the tool frame
    bool turned;            // the part is rotated with respect to the tool frame
    double turn[3][3];      // rotation from the part's frame to the tool frame
    struct kn_field *field; // FIELD: grid of distances, see field.h
} kn_solid;

typedef struct kn_shape {
    int part_count;
    bool plain; // the shape is a single part at the origin, without rotation
    kn_solid part[KN_PARTS_MAX];
    double bound_m; // largest distance of a point of the shape from the origin
    double fine_m;  // smallest half width of the shape; the lattice's spacing must be smaller
} kn_shape;

// Make a part at the origin, without rotation. Set at_m, turned and turn to place it.
kn_solid kn_solid_sphere(double radius_m);
kn_solid kn_solid_capsule(double radius_m, double length_m);
kn_solid kn_solid_cylinder(double radius_m, double length_m, double edge_m);
kn_solid kn_solid_box(const double size_m[3], double edge_m);
kn_solid kn_solid_field(struct kn_field *field); // field must outlive the part

// Add a copy of a part to a shape, and update bound_m and fine_m. An empty shape is all 0. Return false if the shape
// already has KN_PARTS_MAX parts.
bool kn_shape_add(kn_shape *shape, const kn_solid *part);

// Return the signed distance of the point `at` in the tool frame, m. Store its gradient, a unit vector that points out
// of the shape. Real-time safe.
double kn_shape_distance(const kn_shape *shape, const double at[3], double gradient[3]);

// Return how far the shape reaches from its origin in the direction `way`, m. `way` is a unit vector in the tool frame.
// For a field the result is an upper bound (kn_field_support). Real-time safe.
double kn_shape_support(const kn_shape *shape, const double way[3]);

// kn_shape_keep adds a reference to each of the shape's fields; call when the shape is copied. kn_shape_drop releases
// the references; call when a copy is no longer used.
void kn_shape_keep(const kn_shape *shape);
void kn_shape_drop(const kn_shape *shape);

// Return the extent of the shape from side to side along an axis of the tool frame (0 x, 1 y, 2 z), m.
double kn_shape_span(const kn_shape *shape, int axis);

#endif
