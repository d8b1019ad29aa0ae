#include "core/scene/draft.h"

#include <assert.h>
#include <stdio.h>
#include <string.h>

// The keys that a quality point (kn_quality) may override, in the order of KN_QUALITY_KEYS.
static const kn_key_id overridden[] = {KN_KEY_ITERATIONS,    KN_KEY_ITERATIONS_MAX, KN_KEY_TOLERANCE, KN_KEY_PASSES,
                                       KN_KEY_LINEARIZATION, KN_KEY_PRECISION,      KN_KEY_SPACING};
enum { KEYS = sizeof overridden / sizeof *overridden };
static_assert(KN_KEY_BALANCED_ITERATIONS == KN_KEY_FAST_ITERATIONS + KEYS, "points stand in the table one by one");
static_assert(KN_KEY_ACCURATE_ITERATIONS == KN_KEY_FAST_ITERATIONS + 2 * KEYS, "in the order of kn_quality");

static const char *const names[KN_QUALITIES] = {"fast", "balanced", "accurate", "own"};
static const char *const sets[KN_QUALITIES] = {"quality=fast", "quality=balanced", "quality=accurate", "quality=own"};
const char kn_quality_names[] = "fast, balanced, accurate or own";

const char *kn_quality_name(kn_quality quality) { return names[quality]; }

const char *kn_quality_set(const char *name)
{
    for (int q = 0; q < KN_QUALITIES; q++)
        if (strcmp(names[q], name) == 0) return sets[q];
    return NULL;
}

// Return key number `i` of a quality point.
static kn_key_id key_of(kn_quality quality, int i)
{
    return (kn_key_id)(KN_KEY_FAST_ITERATIONS + (int)quality * KEYS + i);
}

static bool given(const kn_draft *draft, kn_key_id id) { return draft->at[0][id].source != KN_SOURCE_DEFAULT; }

// Return true if a quality point overrides key number `i`. A spacing does not apply to a mesh.
static bool says(const kn_draft *draft, kn_quality quality, int i)
{
    return given(draft, key_of(quality, i)) && !(overridden[i] == KN_KEY_SPACING && *draft->mesh_path);
}

// Return true if the scene defines the point, i.e. overrides at least one key. OWN is always defined.
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

// Let a --set of a solver key override the chosen point, too. Otherwise the --set would have no effect.
static void take_sets(kn_draft *draft, kn_quality chosen)
{
    for (int i = 0; i < KEYS; i++)
        if (says(draft, chosen, i) && draft->at[0][overridden[i]].source > draft->at[0][key_of(chosen, i)].source)
            copy_value(draft, key_of(chosen, i), overridden[i]);
}

// Compute the model of a point: copy the draft, override its keys, and check the rules again.
static bool try_point(const kn_draft *draft, kn_quality quality, kn_model_def *made)
{
    kn_draft copy = *draft;
    copy.point = names[quality];
    for (int i = 0; i < KEYS; i++)
        if (says(draft, quality, i)) copy_value(&copy, overridden[i], key_of(quality, i));
    if (!kn_draft_finish_point(&copy)) return false;
    *made = copy.scene.model;
    return true;
}

static bool complain_undefined(kn_draft *draft)
{
    char list[64] = "";
    for (kn_quality q = 0; q < KN_QUALITY_OWN; q++)
        if (defined(draft, q)) snprintf(list + strlen(list), sizeof list - strlen(list), "%s, ", names[q]);
    kn_mark at = draft->at[0][KN_KEY_CHOSEN];
    if (!*list) return kn_draft_complain(draft, at, "the scene has no quality points, expected this left out");
    return kn_draft_complain(draft, at, "the scene has no quality.%s, expected %sor own", names[draft->chosen], list);
}

bool kn_draft_quality(kn_draft *draft)
{
    kn_model_def made[KN_QUALITIES];
    if (!given(draft, KN_KEY_CHOSEN)) draft->chosen = KN_QUALITY_OWN;
    // OWN is the default and does not appear in the canonical text
    if (draft->chosen == KN_QUALITY_OWN) draft->at[0][KN_KEY_CHOSEN].source = KN_SOURCE_DEFAULT;
    else if (!defined(draft, (kn_quality)draft->chosen)) return complain_undefined(draft);
    else take_sets(draft, (kn_quality)draft->chosen);

    // every defined point must be valid, not only the chosen one
    made[KN_QUALITY_OWN] = draft->scene.model;
    for (kn_quality q = 0; q < KN_QUALITY_OWN; q++)
        if (defined(draft, q) && !try_point(draft, q, &made[q])) return false;
    draft->scene.quality = (kn_quality)draft->chosen;
    draft->built = made[draft->chosen];
    // a running server can switch to a point only if lattice and precision stay the same
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
