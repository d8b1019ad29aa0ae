#include "clients/knead/reach.h"
#include "clients/knead/foot.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double hover_m = 0.004; // height of the hovering tool above the highest point of the object
// Largest distance from the object's edge at which the tool may be beside the object.
static const double beside_m = 0.02;
static const double uneven_m = 2e-3; // largest dent that a flat tool sinks into before it presses
// Fraction of the object's height that must remain under the tool, because thinner cells turn inside out.
static const double thinnest = 0.5;

bool kn_reach_open(kn_reach *r, const kn_model_def *def, const kn_probe_def *tool, const kn_camera_view *view)
{
    *r = (kn_reach){.def = def, .tool = tool};
    r->top = kn_dent_top(def, &r->vertices);
    kn_model_def_extent(def, r->extent_m);
    kn_reach_look(r, view);
    return r->top != NULL;
}

void kn_reach_look(kn_reach *r, const kn_camera_view *view)
{
    // The camera looks at the box of the undeformed object, which stands centred on z = 0.
    float low[3] = {0}, high[3];
    for (int i = 0; i < 3; i++) high[i] = (float)(r->extent_m[i] * (i == 2 ? 1.0 : 0.5));
    for (int i = 0; i < 2; i++) low[i] = -high[i];
    kn_camera_look(&r->camera, low, high, view);
}

void kn_reach_close(kn_reach *r)
{
    free(r->top);
    memset(r, 0, sizeof *r);
}

bool kn_reach_fits(const kn_reach *r, const kn_mesh *mesh)
{
    return mesh->whole && r->top && mesh->vertex_count == r->vertices;
}

void kn_reach_hover(const kn_reach *r, const kn_mesh *mesh, kn_pointer_wish *wish)
{
    double highest_m = 0;
    for (int v = 0; v < mesh->vertex_count; v++) highest_m = fmax(highest_m, mesh->positions_m[3 * v + 2]);
    wish->hover_z_m = highest_m + kn_foot_m(r->tool) + hover_m;
}

void kn_reach_aim(const kn_reach *r, double u, double v, kn_pointer_wish *wish)
{
    double at_m[2];
    // Find the point under the pointer in the plane of the top, and keep it near the object.
    if (!kn_camera_pick(&r->camera, u, v, r->extent_m[2], at_m)) return;
    for (int i = 0; i < 2; i++) {
        double most_m = 0.5 * r->extent_m[i] + beside_m;
        wish->at_m[i] = fmin(fmax(at_m[i], -most_m), most_m);
    }
}

bool kn_reach_touch(const kn_reach *r, const kn_mesh *mesh, kn_pointer_wish *wish)
{
    if (!kn_dent_touch(mesh, r->top, r->def->spacing_m, r->tool, wish->at_m[0], wish->at_m[1], &wish->touch_z_m,
                       &wish->flush_z_m))
        return false;
    wish->flush_z_m = fmax(wish->flush_z_m, wish->touch_z_m - uneven_m);
    return true;
}

double kn_reach_deepest(const kn_reach *r, const kn_pointer_wish *wish)
{
    double from_m = wish->pressed ? wish->touch_z_m - kn_foot_m(r->tool) : r->extent_m[2];
    // A round tool may not sink deeper than its radius.
    double most_m = fmax(0, from_m - thinnest * r->extent_m[2]);
    return kn_foot_flat(r->tool->shape) ? most_m : fmin(most_m, kn_foot_m(r->tool));
}
