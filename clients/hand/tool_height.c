#include "clients/hand/tool_height.h"
#include "core/shape.h"
#include "core/surface.h"
#include <math.h>
#include <string.h>

bool kn_tool_height_flat(kn_probe_shape shape) { return shape != KN_PROBE_SPHERE && shape != KN_PROBE_CAPSULE; }

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

const kn_probe_def *kn_tool_height_choose_tool(const kn_model_def *def, const char *name)
{
    for (int i = 0; i < def->probe_count; i++)
        if (name ? !strcmp(def->probe[i].name, name) : !kn_tool_height_flat(def->probe[i].shape)) return &def->probe[i];
    return name || def->probe_count == 0 ? NULL : &def->probe[0];
}

// Return the distance from the tool's pose down to its underside on a vertical line at (x_m, y_m), m. The search starts
// below the tool and moves up the line. Each step is as long as the distance to the tool's surface. If the line does
// not meet the tool within STEPS_MAX steps, it counts as missing the tool.
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

double kn_tool_height_below(const kn_probe_def *tool, double dx_m, double dy_m)
{
    if (tool->parts) return first_below(tool->parts, dx_m, dy_m);
    if (kn_tool_height_flat(tool->shape)) return covers(tool, fabs(dx_m), fabs(dy_m)) ? 0 : -INFINITY;
    double r = tool->radius_m, r2 = r * r, d2 = dx_m * dx_m + dy_m * dy_m;
    return d2 <= r2 ? sqrt(r2 - d2) : -INFINITY;
}

double kn_tool_height_m(const kn_probe_def *tool)
{
    return tool->parts ? kn_shape_support(tool->parts, (double[]){0, 0, -1}) : kn_tool_height_below(tool, 0, 0);
}

bool kn_tool_height_object(const kn_mesh *mesh, double x_m, double y_m, double *z_m)
{
    bool found = false;
    for (int32_t t = 0; mesh->whole && t < mesh->triangle_count; t++) {
        const float *a = mesh->positions_m + 3 * mesh->triangles[3 * t];
        const float *b = mesh->positions_m + 3 * mesh->triangles[3 * t + 1];
        const float *c = mesh->positions_m + 3 * mesh->triangles[3 * t + 2];
        // Compute the barycentric coordinates of (x, y) in the triangle as seen from above. Skip a vertical triangle,
        // because it has no area in this view.
        double ux = b[0] - a[0], uy = b[1] - a[1], vx = c[0] - a[0], vy = c[1] - a[1], px = x_m - a[0], py = y_m - a[1];
        double area = ux * vy - uy * vx;
        if (area == 0.0) continue;
        double u = (px * vy - py * vx) / area, v = (ux * py - uy * px) / area;
        // The margin of 1e-9 ensures that a point on the common edge of two triangles lies in at least one of them.
        if (u < -1e-9 || v < -1e-9 || u + v > 1.0 + 1e-9) continue;
        double z = a[2] + u * (b[2] - a[2]) + v * (c[2] - a[2]);
        if (!found || z > *z_m) *z_m = z;
        found = true;
    }
    return found;
}

bool kn_tool_height_touch(const kn_mesh *mesh, const uint8_t *top, double spacing_m, const kn_probe_def *tool,
                          double x_m, double y_m, double *first_m, double *last_m)
{
    const bool plate = tool->shape == KN_PROBE_PLATE, flat = kn_tool_height_flat(tool->shape);
    const double slack_m = flat ? 0.1 * spacing_m : 0; // the server adds this margin to the edges of a plate, too
    *first_m = -INFINITY, *last_m = INFINITY;
    for (int32_t v = 0; mesh->whole && v < mesh->vertex_count; v++) {
        const float *at = mesh->positions_m + 3 * v;
        // A plate touches only vertices of the top face, so skip all other vertices.
        if (plate && !top[v]) continue;
        // Signed distance from the tool's axis to the vertex along x and y, reduced by the margin.
        double dx = copysign(fmax(0, fabs(at[0] - x_m) - slack_m), at[0] - x_m);
        double dy = copysign(fmax(0, fabs(at[1] - y_m) - slack_m), at[1] - y_m);
        // Height of the tool at which the underside of the tool touches this vertex.
        double z = at[2] + kn_tool_height_below(tool, dx, dy);
        *first_m = fmax(*first_m, z);
        if (flat && top[v] && isfinite(z)) *last_m = fmin(*last_m, z);
    }
    *last_m = fmin(*last_m, *first_m);
    return isfinite(*first_m);
}

uint8_t *kn_tool_height_top(const kn_model_def *def, int *vertex_count)
{
    char error[256];
    kn_model *model = kn_model_build(def, error, sizeof error);
    kn_surface *surface = model ? kn_surface_create(model) : NULL;
    uint8_t *of_node = model ? calloc((size_t)model->node_count, 1) : NULL;
    uint8_t *top = surface ? calloc((size_t)surface->vertex_count, 1) : NULL;
    if (of_node && top) {
        // Mark the lattice nodes of the top face, then the mesh vertices that belong to these nodes.
        for (int t = 0; t < model->top_count; t++) of_node[model->top[t]] = 1;
        for (int v = 0; v < surface->vertex_count; v++) top[v] = of_node[surface->node[v]];
        *vertex_count = surface->vertex_count;
    } else {
        free(top);
        top = NULL;
    }
    free(of_node);
    kn_surface_destroy(surface);
    kn_model_destroy(model);
    return top;
}
