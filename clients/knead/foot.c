#include "clients/knead/foot.h"
#include "core/shape.h"
#include <math.h>
#include <string.h>

bool kn_foot_flat(kn_probe_shape shape) { return shape != KN_PROBE_SPHERE && shape != KN_PROBE_CAPSULE; }

const kn_probe_def *kn_foot_choose_tool(const kn_model_def *def, const char *name)
{
    for (int i = 0; i < def->probe_count; i++)
        if (name ? !strcmp(def->probe[i].name, name) : !kn_foot_flat(def->probe[i].shape)) return &def->probe[i];
    return name || def->probe_count == 0 ? NULL : &def->probe[0];
}

// Return true if the face of a flat tool covers the point at the horizontal offset (x_m, y_m) from its centre. `x_m`
// and `y_m` must not be negative.
static bool covers(const kn_probe_def *tool, double x_m, double y_m)
{
    const double along = 0.5 * tool->size_m[0], across = 0.5 * tool->size_m[1];
    switch (tool->shape) {
    case KN_PROBE_CYLINDER: return x_m * x_m + y_m * y_m <= tool->radius_m * tool->radius_m;
    case KN_PROBE_CROSS: return (x_m <= along && y_m <= across) || (x_m <= across && y_m <= along);
    default: return x_m <= along && y_m <= across;
    }
}

// Return the distance from the tool's pose down to its underside on a vertical line at (x_m, y_m), m. The search moves
// up the line from below, each step by the distance to the tool's surface. If the line does not meet the tool within
// STEPS_MAX steps, it counts as missing the tool.
static double first_below(const kn_shape *tool, double x_m, double y_m)
{
    enum { STEPS_MAX = 100 };
    // Start the search on the bounding sphere of the tool.
    const double r2 = tool->bound_m * tool->bound_m - x_m * x_m - y_m * y_m;
    double z_m = r2 > 0 ? -sqrt(r2) : INFINITY, way[3];
    for (int i = 0; i < STEPS_MAX && z_m < tool->bound_m; i++) {
        double distance_m = kn_shape_distance(tool, (double[]){x_m, y_m, z_m}, way);
        if (distance_m < 1e-6) return -z_m;
        z_m += distance_m;
    }
    return -INFINITY;
}

double kn_foot_below(const kn_probe_def *tool, double dx_m, double dy_m)
{
    if (tool->parts) return first_below(tool->parts, dx_m, dy_m);
    if (kn_foot_flat(tool->shape)) return covers(tool, fabs(dx_m), fabs(dy_m)) ? 0 : -INFINITY;
    double r = tool->radius_m, r2 = r * r, d2 = dx_m * dx_m + dy_m * dy_m;
    return d2 <= r2 ? sqrt(r2 - d2) : -INFINITY;
}

double kn_foot_m(const kn_probe_def *tool)
{
    return tool->parts ? kn_shape_support(tool->parts, (double[]){0, 0, -1}) : kn_foot_below(tool, 0, 0);
}
