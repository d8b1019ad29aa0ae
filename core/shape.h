#ifndef KN_CORE_SHAPE_H
#define KN_CORE_SHAPE_H
// The shape of a rigid tool as a signed distance: how far a point is from it, < 0 inside, and which way is out.
//
// Tool frame, m: the origin is the pose's position, z points away from the object when the orientation is identity.
//
//     sphere     centre at the origin
//     capsule    a finger: ball of `radius` at the origin, its axis runs up along z for `length`
//     cylinder   lower face at the origin, axis up along z for `length`, edges rounded by `edge`
//     box        lower face centred at the origin, x by y by z of `size`, edges rounded by `edge`
//     cross      two such boxes across each other: size is arm length, arm width, height (first paper, Fig. 13)
//     union      up to KN_PARTS_MAX of the others, each where its `at` and `turn` put it: the nearest counts
//
//     field      any closed surface, in the frame of its file, by a grid of distances (field.h)
//
// Exact but inside of unions (the nearest part's, as always), and fields.
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
    double half_m[3];       // BOX: half extents, without the rounding
    double radius_m;        // of a ball, of an axis, or of rounded edges
    double length_m;        // CAPSULE, CYLINDER: along z
    double at_m[3];         // its origin in the tool frame
    bool turned;            // whether it is at all
    double turn[3][3];      // part to tool
    struct kn_field *field; // FIELD: what it is, see field.h
} kn_solid;

typedef struct kn_shape {
    int part_count;
    bool plain; // one part as it is made, neither turned nor put elsewhere
    kn_solid part[KN_PARTS_MAX];
    double bound_m; // no point of it is farther from the origin
    double fine_m;  // smallest half width: a lattice must be finer
} kn_shape;

// Parts at the origin, not turned.
kn_solid kn_solid_sphere(double radius_m);
kn_solid kn_solid_capsule(double radius_m, double length_m);
kn_solid kn_solid_cylinder(double radius_m, double length_m, double edge_m);
kn_solid kn_solid_box(const double size_m[3], double edge_m);
kn_solid kn_solid_field(struct kn_field *field); // not taken over: it outlives the part

// Adds a part and widens the bound. False when there are KN_PARTS_MAX already.
bool kn_shape_add(kn_shape *shape, const kn_solid *part);

// at: tool frame. gradient: unit, the way out of the shape. Real-time safe.
double kn_shape_distance(const kn_shape *shape, const double at[3], double gradient[3]);

// How far it reaches that way, a unit vector of the tool frame, from its origin; of a mesh its grid. Real-time safe.
double kn_shape_support(const kn_shape *shape, const double way[3]);

// One more copy of a shape whose fields are kept as long as it; and its end.
void kn_shape_keep(const kn_shape *shape);
void kn_shape_drop(const kn_shape *shape);

// From side to side, along an axis of the tool frame.
double kn_shape_span(const kn_shape *shape, int axis);

#endif
