#include "core/field.h"
#include "core/hash.h"
#include "core/solve/tool.h"
#include "core/scene/draft.h"
#include "core/scene/mesh_file.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// Compute the rotation matrix Rz Ry Rx of three angles: a rotation about the fixed axis x, then about y, then about z,
// like roll, pitch and yaw in robot descriptions.
static void turn_of(const double rad[3], double turn[3][3])
{
    const double c[3] = {cos(rad[0]), cos(rad[1]), cos(rad[2])}, s[3] = {sin(rad[0]), sin(rad[1]), sin(rad[2])};
    const double of[3][3] = {{c[2] * c[1], c[2] * s[1] * s[0] - s[2] * c[0], c[2] * s[1] * c[0] + s[2] * s[0]},
                             {s[2] * c[1], s[2] * s[1] * s[0] + c[2] * c[0], s[2] * s[1] * c[0] - c[2] * s[0]},
                             {-s[1], c[1] * s[0], c[1] * c[0]}};
    memcpy(turn, of, sizeof of);
}

// Add a part of a union to the tool, with the part's position and rotation. A cross consists of two solids, so it adds
// two. Return false if the tool would have too many solids.
static bool add_part(kn_shape *tool, const kn_draft_part *part)
{
    kn_shape own = {0};
    bool fits = kn_tool_shape(&part->as, &own);
    for (int i = 0; fits && i < own.part_count; i++) {
        kn_solid *p = &own.part[i];
        memcpy(p->at_m, part->at_m, sizeof p->at_m);
        p->turned = part->turn_rad[0] != 0 || part->turn_rad[1] != 0 || part->turn_rad[2] != 0;
        if (p->turned) turn_of(part->turn_rad, p->turn);
        fits = kn_shape_add(tool, p);
    }
    return fits;
}

// Make the tool of a probe whose shape is a union: add up its parts.
static bool make_union(kn_draft *draft, int slot)
{
    kn_probe_def *probe = &draft->scene.model.probe[slot - 1];
    kn_shape *tool = draft->scene.tool[slot - 1];
    for (int i = 0; i < draft->part_count[slot - 1]; i++) {
        const int part = kn_slot_of_part(slot, i);
        kn_draft_part *of = &draft->part[part - 1 - KN_PROBES_MAX];
        of->as.shape = kn_draft_shape(draft, part);
        if (!add_part(tool, of))
            return kn_draft_complain(draft, draft->at[part][KN_KEY_PART_SHAPE],
                                     "probes.%s.parts has more than %d parts (a cross counts as two), expected fewer",
                                     probe->name, KN_PARTS_MAX);
    }
    probe->parts = tool;
    return true;
}

// Number of cells of a tool's grid of distances per lattice spacing: the default, and the least that is allowed. With 8
// cells per spacing, the error of the grid of a curved tool is less than the depth by which the tool presses in the
// contact's foundation.
#define CELLS_FINE 8
#define CELLS_COARSE 3
#define FARTHEST_M 10.0 // largest coordinate of a corner in the tool frame; the key `at` of a part has the same limit

// Choose the cell side of the grid of distances to a surface: the side that the scene gives, else the default, or a
// wider one if the grid would have too many points.
static bool choose_cell(kn_draft *draft, int slot, const kn_shell *shell, double *cell_m)
{
    const kn_draft_surface *surface = &draft->surface[slot - 1];
    const double spacing_m = draft->scene.model.spacing_m, coarse_m = spacing_m / CELLS_COARSE;
    // compute the extent of the surface along x, y, z
    double extent_m[3] = {0};
    for (int k = 0; k < 3; k++) {
        double low = INFINITY, high = -INFINITY;
        for (int i = 0; i < shell->vertex_count; i++)
            low = fmin(low, shell->x[i][k]), high = fmax(high, shell->x[i][k]);
        extent_m[k] = high - low;
    }
    if (surface->cell_m > coarse_m * (1 + 1e-9))
        return kn_draft_complain(draft, draft->at[slot][KN_KEY_SURFACE_CELL],
                                 "probes.%s.mesh_cell is %g m, expected at most a third of the spacing, %.3g m",
                                 draft->scene.model.probe[slot - 1].name, surface->cell_m, coarse_m);
    // if the scene gives no cell side, start with the default and widen the cells until the grid fits
    *cell_m = surface->cell_m > 0 ? surface->cell_m : spacing_m / CELLS_FINE;
    while (surface->cell_m == 0 && *cell_m < coarse_m && kn_field_points(extent_m, *cell_m) > KN_FIELD_POINTS_MAX)
        *cell_m = fmin(1.05 * *cell_m, coarse_m);
    double points = kn_field_points(extent_m, *cell_m);
    if (points <= KN_FIELD_POINTS_MAX) return true;
    kn_mark at = draft->at[slot][surface->cell_m > 0 ? KN_KEY_SURFACE_CELL : KN_KEY_SURFACE_UNIT];
    return kn_draft_complain(draft, at,
                             "probes.%s.mesh is %.3g x %.3g x %.3g m: with cells of %.3g m it needs %.3g "
                             "MB, expected at most %.3g MB: use wider cells, up to a third of the spacing, or a "
                             "smaller tool",
                             draft->scene.model.probe[slot - 1].name, extent_m[0], extent_m[1], extent_m[2], *cell_m,
                             4e-6 * points, 4e-6 * KN_FIELD_POINTS_MAX);
}

// Convert the surface to metres and make it the tool of a slot.
static bool make_field(kn_draft *draft, int slot, kn_shell *shell)
{
    const double units_per_m = kn_draft_units_per_m[draft->surface[slot - 1].unit];
    const char *name = draft->scene.model.probe[slot - 1].name;
    const kn_mark at = draft->at[slot][KN_KEY_SURFACE];
    kn_shape *tool = draft->scene.tool[slot - 1];
    double cell_m = 0, far_m = 0;
    if (shell->triangle_count > KN_FIELD_TRIANGLES_MAX)
        return kn_draft_complain(draft, at, "probes.%s.mesh has %d triangles, expected at most %d", name,
                                 shell->triangle_count, KN_FIELD_TRIANGLES_MAX);
    for (int i = 0; i < shell->vertex_count; i++)
        for (int k = 0; k < 3; k++) {
            shell->x[i][k] /= units_per_m;
            far_m = fmax(far_m, fabs(shell->x[i][k]));
        }
    if (!choose_cell(draft, slot, shell, &cell_m)) return false;
    if (far_m > FARTHEST_M)
        return kn_draft_complain(draft, at,
                                 "probes.%s.mesh has a corner %.3g m from its origin, expected at most %g m: "
                                 "are its origin and mesh_unit right?",
                                 name, far_m, FARTHEST_M);
    kn_field *field = kn_field_build(shell->vertex_count, (const double(*)[3])shell->x, shell->triangle_count,
                                     (const int(*)[3])shell->triangle, cell_m);
    if (!field)
        return kn_draft_complain(draft, at,
                                 "probes.%s.mesh: not enough memory for its grid, or rounding leaves its "
                                 "surface open",
                                 name);
    kn_shape_drop(tool); // a first call may have loaded another file; drop its shape
    *tool = (kn_shape){0};
    const kn_solid solid = kn_solid_field(field);
    return kn_shape_add(tool, &solid);
}

// Load the surface file of a tool into the scene. A callback kn_draft_file.load.
static bool load_surface(kn_draft *draft, int slot, const char *path, uint64_t *hash)
{
    size_t size;
    unsigned char *bytes = kn_words_load(path, &size, draft->error, draft->error_size);
    kn_shell *shell = bytes ? kn_shell_read(path, bytes, size, draft->error, draft->error_size) : NULL;
    if (shell) *hash = kn_hash_bytes(KN_HASH_SEED, bytes, size);
    bool ok = shell && make_field(draft, slot, shell);
    kn_shell_destroy(shell);
    free(bytes);
    return ok;
}

static bool make_mesh(kn_draft *draft, int slot)
{
    const kn_draft_file file = {slot, KN_KEY_SURFACE, KN_KEY_SURFACE_HASH, "a closed surface", load_surface};
    draft->scene.model.probe[slot - 1].parts = draft->scene.tool[slot - 1];
    return kn_draft_read(draft, &file);
}

bool kn_draft_tools(kn_draft *draft)
{
    for (int slot = 1; slot <= draft->scene.model.probe_count; slot++) {
        const kn_probe_shape shape = draft->scene.model.probe[slot - 1].shape;
        if (shape != KN_PROBE_UNION && shape != KN_PROBE_MESH) continue;
        if (!(draft->scene.tool[slot - 1] = calloc(1, sizeof(kn_shape))))
            return kn_draft_complain(draft, draft->at[slot][KN_KEY_PROBE_SHAPE], "not enough memory for a tool");
        if (!(shape == KN_PROBE_UNION ? make_union : make_mesh)(draft, slot)) return false;
    }
    return true;
}

// Check that a tool of one of the simple shapes is wide enough for the spacing of the lattice.
static bool solid_fits(kn_draft *draft, int slot)
{
    static const kn_key_id sizes[] = {KN_KEY_PROBE_EXTENT, KN_KEY_PROBE_RADIUS, KN_KEY_PROBE_LENGTH, KN_KEY_PROBE_EDGE};
    const kn_model_def *def = &draft->scene.model;
    const kn_probe_def *probe = &def->probe[slot - 1];
    if (probe->shape == KN_PROBE_UNION || probe->shape == KN_PROBE_MESH) return true;
    const char *unfit = kn_tool_unfit(probe, def->spacing_m);
    kn_mark at = draft->at[slot][KN_KEY_PROBE_SHAPE], spacing = draft->at[0][KN_KEY_SPACING];
    // an error points at the size that was written last
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        kn_mark size = draft->at[slot][sizes[i]];
        if (size.source > at.source || (size.source == at.source && size.line >= at.line)) at = size;
    }
    return !unfit || kn_draft_complain(draft, spacing.source > at.source ? spacing : at, "probes.%s: %s (spacing %g m)",
                                       probe->name, unfit, def->spacing_m);
}

bool kn_draft_tool_fits(kn_draft *draft, int slot)
{
    const kn_model_def *def = &draft->scene.model;
    const kn_probe_def *probe = &def->probe[slot - 1];
    if (!solid_fits(draft, slot)) return false;
    // if a surface is too narrow, its unit is usually wrong, so the error points at the unit
    const char *wide = probe->shape == KN_PROBE_MESH ? kn_tool_unfit(probe, def->spacing_m) : NULL;
    if (wide)
        return kn_draft_complain(draft, draft->at[slot][KN_KEY_SURFACE_UNIT],
                                 "probes.%s.mesh: %s (spacing %g m, half width %.3g m): is its unit right?",
                                 probe->name, wide, def->spacing_m, probe->parts->fine_m);
    // each part of a union must itself be wide enough
    for (int i = 0; i < draft->part_count[slot - 1]; i++) {
        const int part = kn_slot_of_part(slot, i);
        const char *unfit = kn_tool_unfit(&draft->part[part - 1 - KN_PROBES_MAX].as, def->spacing_m);
        kn_mark at = draft->at[part][KN_KEY_PART_SHAPE], spacing = draft->at[0][KN_KEY_SPACING];
        if (unfit)
            return kn_draft_complain(draft, spacing.source > at.source ? spacing : at,
                                     "probes.%s.parts.%d: %s (spacing %g m)", def->probe[slot - 1].name, i + 1, unfit,
                                     def->spacing_m);
    }
    return true;
}
