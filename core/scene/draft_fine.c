#include "core/composite.h"
#include "core/scene/draft.h"

#include <math.h>
#include <string.h>

// Margin of fine cells around the tools' reach, in tool widths. Measured on dough at 16 000 nodes with a spacing of a
// sixth of the tool's width: the force is within 0.3 to 0.7 % of that of a uniform lattice. Half the margin costs 2.5
// %.
#define MARGIN_WIDTHS 0.7
#define BELOW 1.5 // depth of the box of fine cells, in margins: below a tool pressed in by its width, a width remains

static bool given(const kn_draft *draft, int slot, kn_key_id id)
{
    return draft->at[slot][id].source != KN_SOURCE_DEFAULT;
}

// Return the width of the contact that strains the object. It is the narrow side of a strip; the contact of a ball is
// narrower than the ball.
static double width_of(const kn_probe_def *probe)
{
    if (probe->shape == KN_PROBE_PLATE) return fmin(probe->size_m[0], probe->size_m[1]);
    if (probe->shape == KN_PROBE_BOX) return fmin(fmin(probe->size_m[0], probe->size_m[1]), probe->size_m[2]);
    if (probe->shape == KN_PROBE_CROSS) return fmin(probe->size_m[1], probe->size_m[2]);
    return 1.5 * (probe->parts ? probe->parts->fine_m : probe->radius_m);
}

// Return how far a tool reaches from its centre along an axis, whether the tool is level or turned.
static double half_of(const kn_probe_def *probe, int k)
{
    const double *size = probe->size_m;
    switch (probe->shape) {
    case KN_PROBE_PLATE: return 0.5 * size[k];
    case KN_PROBE_BOX: return hypot(0.5 * hypot(size[0], size[1]), size[2]);
    case KN_PROBE_CROSS: return hypot(0.5 * hypot(size[0], size[1]), size[2]);
    default: return probe->parts ? probe->parts->bound_m : probe->radius_m + probe->length_m;
    }
}

// Check that a probe has a reach with its ends in order.
static bool check_reach(kn_draft *draft, int slot)
{
    const kn_probe_def *probe = &draft->scene.model.probe[slot - 1];
    if (!given(draft, slot, KN_KEY_PROBE_REACH))
        return kn_draft_complain(draft, draft->at[0][KN_KEY_ACCURACY],
                                 "probes.%s.reach is missing, expected [x, x, y, y] with object.accuracy", probe->name);
    for (int k = 0; k < 2; k++)
        if (probe->reach_m[k][0] > probe->reach_m[k][1])
            return kn_draft_complain(draft, draft->at[slot][KN_KEY_PROBE_REACH],
                                     "probes.%s.reach ends at %g m along %c, expected %g m or more", probe->name,
                                     probe->reach_m[k][1], "xy"[k], probe -> reach_m[k][0]);
    return true;
}

// Extend the range low..high by the reach of a probe.
static void add_reach(const kn_probe_def *probe, double low_m[3], double high_m[3])
{
    for (int k = 0; k < 2; k++) {
        double half = half_of(probe, k);
        low_m[k] = fmin(low_m[k], probe->reach_m[k][0] - half);
        high_m[k] = fmax(high_m[k], probe->reach_m[k][1] + half);
    }
}

// Return true if the tools can never be above the block.
static bool is_off(const kn_model_def *def, const double low_m[3], const double high_m[3])
{
    bool off = false;
    for (int k = 0; k < 2; k++) {
        double half = 0.5 * (def->nodes[k] - 1) * def->spacing_m;
        off = off || low_m[k] >= half || high_m[k] <= -half;
    }
    return off;
}

bool kn_draft_fine(kn_draft *draft)
{
    kn_model_def *def = &draft->scene.model;
    double low_m[3] = {INFINITY, INFINITY}, high_m[3] = {-INFINITY, -INFINITY}, width = 0;
    memset(def->fine, 0, sizeof def->fine);
    if (!given(draft, 0, KN_KEY_ACCURACY) || draft->scene.accuracy == 0) return true;
    // refuse an unfit object even if the tools' reach would leave no coarse cell, because the scene asks for this
    // accuracy
    const char *unfit = kn_composite_unfit(def);
    if (unfit) return kn_draft_complain(draft, draft->at[0][KN_KEY_ACCURACY], "object.accuracy: %s", unfit);
    // range of all tools, and width of the widest tool
    for (int slot = 1; slot <= def->probe_count; slot++) {
        if (!check_reach(draft, slot)) return false;
        add_reach(&def->probe[slot - 1], low_m, high_m);
        width = fmax(width, width_of(&def->probe[slot - 1]));
    }
    // coarse cells are two spacings wide, so every axis needs an even number of spacings
    for (int k = 0; k < 3; k++)
        if (def->nodes[k] % 2 == 0)
            return kn_draft_complain(draft, draft->at[0][KN_KEY_ACCURACY],
                                     "object.size along %c is %d spacings, "
                                     "expected an even number with object.accuracy",
                                     "xyz"[k], def -> nodes[k] - 1);
    if (def->probe_count > 0 && is_off(def, low_m, high_m))
        return kn_draft_complain(draft, draft->at[1][KN_KEY_PROBE_REACH],
                                 "probes.%s.reach and all others lie outside the object, expected a reach on it",
                                 def->probe[0].name);
    // the box of fine cells reaches from the top down by BELOW margins; kn_composite_box adds one of these margins
    double margin = given(draft, 0, KN_KEY_MARGIN) ? draft->margin_m : MARGIN_WIDTHS * width;
    high_m[2] = (def->nodes[2] - 1) * def->spacing_m;
    low_m[2] = high_m[2] - (BELOW - 1) * margin;
    // without probes or without coarse cells the whole block stays uniform
    if (def->probe_count == 0 || !kn_composite_box(def, low_m, high_m, margin, def->fine))
        memset(def->fine, 0, sizeof def->fine);
    const char *wrong = kn_composite_check(def);
    return !wrong || kn_draft_complain(draft, draft->at[0][KN_KEY_ACCURACY], "object.accuracy: %s", wrong);
}
