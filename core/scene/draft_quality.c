// The models of the quality points, and the box of fine cells in a block of two resolutions.
#include "core/lattice/lattice.h"
#include "core/scene/draft.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

// --- quality points -------------------------------------------------------------------------------------------------

// The keys that a quality point (kn_quality) may override, in the order of KN_QUALITY_KEYS.
static const kn_key_id overridden[] = {KN_KEY_ITERATIONS,    KN_KEY_ITERATIONS_MAX, KN_KEY_TOLERANCE, KN_KEY_PASSES,
                                       KN_KEY_LINEARIZATION, KN_KEY_PRECISION,      KN_KEY_SPACING};
enum { KEYS = sizeof overridden / sizeof *overridden };
static_assert(KN_KEY_BALANCED_ITERATIONS == KN_KEY_FAST_ITERATIONS + KEYS, "the keys of balanced follow those of fast");
static_assert(KN_KEY_ACCURATE_ITERATIONS == KN_KEY_FAST_ITERATIONS + 2 * KEYS,
              "the keys of accurate follow those of balanced");

// Return key number `i` of a quality point.
static kn_key_id key_of(kn_quality quality, int i)
{
    return (kn_key_id)(KN_KEY_FAST_ITERATIONS + (int)quality * KEYS + i);
}

// Return true if a quality point overrides key number `i`. A quality point cannot override the spacing of a mesh.
static bool says(const kn_draft *draft, kn_quality quality, int i)
{
    return kn_draft_given(draft, 0, key_of(quality, i)) && !(overridden[i] == KN_KEY_SPACING && *draft->mesh_path);
}

// Return true if the scene defines the quality point, i.e. gives at least one of its keys. OWN is always defined.
static bool defined(const kn_draft *draft, kn_quality quality)
{
    bool any = quality == KN_QUALITY_OWN;
    for (int i = 0; quality != KN_QUALITY_OWN && i < KEYS; i++) any |= says(draft, quality, i);
    return any;
}

static void copy_value(kn_draft *draft, kn_key_id to, kn_key_id from)
{
    size_t size = kn_keys[to].type == KN_TYPE_REAL ? sizeof(double) : sizeof(int);
    memcpy(kn_draft_field(draft, 0, to), kn_draft_field(draft, 0, from), size);
    draft->at[0][to] = draft->at[0][from];
}

// If a --set changes a key that the chosen quality point overrides, change the value of the quality point, too.
// Otherwise the --set would have no effect.
static void take_sets(kn_draft *draft, kn_quality chosen)
{
    for (int i = 0; i < KEYS; i++)
        if (says(draft, chosen, i) && draft->at[0][overridden[i]].source > draft->at[0][key_of(chosen, i)].source)
            copy_value(draft, key_of(chosen, i), overridden[i]);
}

// Compute the model of a quality point: copy the draft, override the keys that the point gives, and check the rules
// again.
static bool try_point(const kn_draft *draft, kn_quality quality, kn_model_def *made)
{
    kn_draft copy = *draft;
    copy.point = kn_quality_name(quality);
    for (int i = 0; i < KEYS; i++)
        if (says(draft, quality, i)) copy_value(&copy, overridden[i], key_of(quality, i));
    if (copy.scene.model.spacing_m != draft->scene.model.spacing_m) copy.scene.model.force_factor = 1;
    if (!kn_draft_finish_point(&copy)) return false;
    *made = copy.scene.model;
    return true;
}

static bool complain_undefined(kn_draft *draft)
{
    char list[64] = "";
    for (kn_quality q = 0; q < KN_QUALITY_OWN; q++)
        if (defined(draft, q)) snprintf(list + strlen(list), sizeof list - strlen(list), "%s, ", kn_quality_name(q));
    kn_mark at = draft->at[0][KN_KEY_CHOSEN];
    if (!*list) return kn_draft_complain(draft, at, "the scene has no quality points, expected this left out");
    return kn_draft_complain(draft, at, "the scene has no quality.%s, expected %sor own",
                             kn_quality_name((kn_quality)draft->chosen), list);
}

bool kn_draft_quality(kn_draft *draft)
{
    kn_model_def made[KN_QUALITIES];
    if (!kn_draft_given(draft, 0, KN_KEY_CHOSEN)) draft->chosen = KN_QUALITY_OWN;
    // OWN is the default, so quality.chosen: own does not appear in the canonical text
    if (draft->chosen == KN_QUALITY_OWN) draft->at[0][KN_KEY_CHOSEN].source = KN_SOURCE_DEFAULT;
    else if (!defined(draft, (kn_quality)draft->chosen)) return complain_undefined(draft);
    else take_sets(draft, (kn_quality)draft->chosen);

    // every quality point that the scene defines must be valid, not only the chosen point
    made[KN_QUALITY_OWN] = draft->scene.model;
    for (kn_quality q = 0; q < KN_QUALITY_OWN; q++)
        if (defined(draft, q) && !try_point(draft, q, &made[q])) return false;
    draft->scene.quality = (kn_quality)draft->chosen;
    draft->built = made[draft->chosen];
    // a running server can switch to a quality point only if lattice and precision stay the same
    for (kn_quality q = 0; q < KN_QUALITIES; q++) {
        if (!defined(draft, q)) continue;
        const kn_solver_def *s = &made[q].solver;
        bool live = s->kind == KN_SOLVER_IMPLICIT && s->precision == draft->built.solver.precision &&
                    made[q].spacing_m == draft->built.spacing_m;
        kn_effort effort = {s->iterations, s->iterations_max, s->tolerance, s->passes, s->linearization};
        draft->scene.point[q] = (kn_point){.defined = true, .live = live, .effort = effort};
    }
    return true;
}

// --- box of fine cells ----------------------------------------------------------------------------------------------

// Default margin of fine cells around the reach of the tools, in widths of the widest tool. It was measured on dough at
// 16 000 nodes with a spacing of a sixth of the tool's width. The force differs from that of a uniform lattice by 0.3
// to 0.7 %. With half the margin the force differs by 2.5 %.
#define MARGIN_WIDTHS 0.7
// Depth of the box of fine cells below the top of the block, in margins. With the default margin, it is about as deep
// as the widest tool is wide.
#define BELOW 1.5

// Return the width of a tool's contact, m: for a plate or box the shortest side, for a cross the arm width or the
// height if that is less, for a round tool 1.5 radii.
static double width_of(const kn_probe_def *probe)
{
    if (probe->shape == KN_PROBE_PLATE) return fmin(probe->size_m[0], probe->size_m[1]);
    if (probe->shape == KN_PROBE_BOX) return fmin(fmin(probe->size_m[0], probe->size_m[1]), probe->size_m[2]);
    if (probe->shape == KN_PROBE_CROSS) return fmin(probe->size_m[1], probe->size_m[2]);
    return 1.5 * (probe->parts ? probe->parts->fine_m : probe->radius_m);
}

// Return the distance from a probe's centre to the farthest point of its tool along x (k = 0) or y (k = 1), m: an upper
// limit for every rotation of the tool.
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

// Check that a probe has a reach whose lower limits are not above its upper limits.
static bool check_reach(kn_draft *draft, int slot)
{
    const kn_probe_def *probe = &draft->scene.model.probe[slot - 1];
    if (!kn_draft_given(draft, slot, KN_KEY_PROBE_REACH))
        return kn_draft_complain(
            draft, draft->at[0][KN_KEY_ACCURACY],
            "probes.%s.reach is missing, expected [x_min, x_max, y_min, y_max] with object.accuracy", probe->name);
    for (int k = 0; k < 2; k++)
        if (probe->reach_m[k][0] > probe->reach_m[k][1])
            return kn_draft_complain(draft, draft->at[slot][KN_KEY_PROBE_REACH],
                                     "probes.%s.reach ends at %g m along %c, expected %g m or more", probe->name,
                                     probe->reach_m[k][1], "xy"[k], probe -> reach_m[k][0]);
    return true;
}

// Extend the rectangle from low_m to high_m so that it contains a probe's tool at every position in the probe's reach.
static void add_reach(const kn_probe_def *probe, double low_m[3], double high_m[3])
{
    for (int k = 0; k < 2; k++) {
        double half = half_of(probe, k);
        low_m[k] = fmin(low_m[k], probe->reach_m[k][0] - half);
        high_m[k] = fmax(high_m[k], probe->reach_m[k][1] + half);
    }
}

// Return true if the rectangle from low_m to high_m, within which all tools stay, lies beside the block.
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
    if (!kn_draft_given(draft, 0, KN_KEY_ACCURACY) || draft->scene.accuracy == 0) return true;
    // the scene asks for coarse cells, so first refuse an object that cannot have any, wherever its tools reach
    const char *unfit = kn_composite_unfit(def);
    if (unfit) return kn_draft_complain(draft, draft->at[0][KN_KEY_ACCURACY], "object.accuracy: %s", unfit);
    // find the smallest rectangle within which all tools stay, and the width of the widest tool
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
                                 "probes.%s.reach and the reach of every other probe lie outside the object, "
                                 "expected at least one on the object",
                                 def->probe[0].name);
    // the box reaches from the top down by BELOW margins; kn_composite_box adds one margin below low_m
    double margin = kn_draft_given(draft, 0, KN_KEY_MARGIN) ? draft->margin_m : MARGIN_WIDTHS * width;
    high_m[2] = (def->nodes[2] - 1) * def->spacing_m;
    low_m[2] = high_m[2] - (BELOW - 1) * margin;
    // the block stays uniform if there is no probe, or if the box of fine cells covers the whole block
    if (def->probe_count == 0 || !kn_composite_box(def, low_m, high_m, margin, def->fine))
        memset(def->fine, 0, sizeof def->fine);
    const char *wrong = kn_composite_check(def);
    return !wrong || kn_draft_complain(draft, draft->at[0][KN_KEY_ACCURACY], "object.accuracy: %s", wrong);
}
