// The parts of a scene that may come from another file: the numbers of a named material, and the numbers of a haptic
// device.
#include "core/scene/draft.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

// --- material -------------------------------------------------------------------------------------------------------

enum { RHEOLOGICAL, VISCOELASTIC, PLASTIC }; // values of the key material.variant, in the order of its words

static bool of_material(kn_key_id id) { return strncmp(kn_keys[id].path, "material.", strlen("material.")) == 0; }

// Copy the value of a key from the draft of a material's file. Also copy whether this file gives the key. `mark`: place
// where the scene names the material; an error about the value points there.
static void take_key(kn_draft *draft, const kn_draft *from, kn_key_id id, kn_mark mark)
{
    const kn_key *key = &kn_keys[id];
    size_t size = kn_key_long(key) ? KN_PATH_MAX
                                   : (size_t)key->count * (key->type == KN_TYPE_CHOICE ? sizeof(int) : sizeof(double));
    memcpy((char *)draft + key->offset, (const char *)from + key->offset, size);
    mark.per_height = from->at[0][id].per_height;
    mark.library = true;
    draft->at[0][id] = mark;
    if (!kn_draft_given(from, 0, id)) draft->at[0][id].source = KN_SOURCE_DEFAULT;
    draft->group[0][id] = mark; // if the key is missing, the error points at the material's name
}

bool kn_draft_take_material(kn_draft *draft, const kn_draft *from, int variant, kn_mark mark)
{
    // refuse any key that belongs neither to the material nor to its density and label
    for (kn_key_id id = 0; id < KN_KEY_PROBE_NAME; id++)
        if (kn_draft_given(from, 0, id) && !of_material(id) && id != KN_KEY_DENSITY && id != KN_KEY_LABEL)
            return kn_draft_complain(draft, mark, "%s is in %s, expected only a material, its density and label there",
                                     kn_keys[id].path, from->file);
    if (from->scene.model.probe_count > 0)
        return kn_draft_complain(draft, mark, "probes are in %s, expected only a material, its density and label there",
                                 from->file);
    for (kn_key_id id = 0; id < KN_KEY_PROBE_NAME; id++)
        if (of_material(id)) take_key(draft, from, id, mark);
    // a density or a label that the scene itself gives takes precedence over that in the file
    static const kn_key_id beside[] = {KN_KEY_DENSITY, KN_KEY_LABEL};
    for (int i = 0; i < 2; i++) {
        bool own = kn_draft_given(draft, 0, beside[i]) && !draft->at[0][beside[i]].library;
        if (!own && kn_draft_given(from, 0, beside[i])) take_key(draft, from, beside[i], mark);
    }
    if (variant < 0) return true;
    draft->variant = variant;
    draft->at[0][KN_KEY_VARIANT] = mark;
    return true;
}

void kn_draft_drop_label(kn_draft *draft)
{
    kn_mark *label = &draft->at[0][KN_KEY_LABEL];
    if (label->source == KN_SOURCE_DEFAULT) return;
    for (kn_key_id id = 0; id < KN_KEY_PROBE_NAME; id++) {
        const kn_mark *key = &draft->at[0][id];
        if (!of_material(id) || key->source == KN_SOURCE_DEFAULT) continue;
        const bool set_later = key->source >= 0 && label->source < 0, own = label->library && !key->library;
        if (!set_later && !own) continue;
        label->source = KN_SOURCE_DEFAULT;
        *draft->scene.label = '\0';
        return;
    }
}

// Remove the spring, so that the dampers c1 and c2 in series act like the given damper c2 alone. If c2 is constant, c1
// and c2 both become twice the given c2. If c2 depends on the stress, c1 becomes 25 times c2(0): so viscous that it
// hardly deforms.
static void make_plastic(kn_material *mat)
{
    mat->k1_pa = 0;
    mat->c1_pa_s = mat->damper == KN_DAMPER_CONSTANT ? mat->c2_pa_s *= 2 : 25 * kn_material_c2(mat, 0);
}

bool kn_draft_vary_material(kn_draft *draft)
{
    kn_material *mat = &draft->scene.model.material;
    kn_mark at = draft->at[0][KN_KEY_VARIANT];
    bool rigid = mat->damper == KN_DAMPER_NONE || (mat->stroke[1] > 0 && mat->stroke[0] == mat->stroke[1]);
    if (draft->variant == PLASTIC && rigid)
        return kn_draft_complain(draft, at, "material.variant is plastic, expected a damper that can move");
    if (draft->variant == PLASTIC) make_plastic(mat);
    if (draft->variant != VISCOELASTIC) return true;
    // stroke [1, 1]: both end stops at one place, so the damper cannot move
    mat->ratio = mat->stroke[0] = mat->stroke[1] = 1;
    draft->at[0][KN_KEY_STROKE] = draft->at[0][KN_KEY_RATIO] = at;
    return true;
}

// --- device ---------------------------------------------------------------------------------------------------------

// Return the period of the loop of device and servo.
static double period_s(const kn_draft *draft)
{
    return draft->scene.rate_hz > 0 ? fmax(1 / draft->scene.rate_hz, 1e-3) : 1e-3;
}

// Return true if the scene's file or a --set gives the key, false if only the device profile gives the key.
static bool said(const kn_draft *draft, kn_key_id id)
{
    return kn_draft_given(draft, 0, id) && !draft->at[0][id].library;
}

bool kn_draft_of_device(kn_key_id id) { return id >= KN_KEY_DEVICE_MASS && id <= KN_KEY_DEVICE_SCALE; }

bool kn_draft_take_device(kn_draft *draft, const kn_draft *from, kn_mark mark)
{
    const size_t prefix = strlen("device.");
    if (from->scene.model.probe_count > 0)
        return kn_draft_complain(draft, mark, "probes are in %s, expected only device: there", from->file);
    for (kn_key_id id = 0; id < KN_KEY_PROBE_NAME; id++) {
        const kn_key *key = &kn_keys[id];
        bool whole = key->type == KN_TYPE_CHOICE || key->type == KN_TYPE_INTEGER;
        if (!kn_draft_given(from, 0, id)) continue;
        // a device's file may hold only keys that begin with "device."
        if (strncmp(key->path, "device.", prefix) != 0)
            return kn_draft_complain(draft, mark, "%s is in %s, expected only device: there", key->path, from->file);
        // a value that the scene itself gives takes precedence over the value of a profile
        if (mark.library && kn_draft_given(draft, 0, id)) continue;
        memcpy((char *)draft + key->offset, (const char *)from + key->offset,
               (size_t)key->count * (whole ? sizeof(int) : sizeof(double)));
        draft->at[0][id] = mark;
    }
    return true;
}

// Return true if the canonical text must hold all keys of the device. With all keys in the text, a log can be replayed
// even after the profile has changed. For the device bench, the text needs these keys only if the scene itself gives
// one.
static bool says_all(const kn_draft *draft)
{
    bool all = strcmp(draft->scene.device.name, "bench") != 0;
    for (kn_key_id id = 0; id < KN_KEY_PROBE_NAME; id++) all |= kn_draft_of_device(id) && said(draft, id);
    return all;
}

// Compute the virtual coupling of the device. A stiffness or damping from the profile is an upper limit for the
// computed value. A stiffness or damping that the scene itself gives is used unchanged.
static void couple(kn_draft *draft)
{
    kn_device_def *d = &draft->scene.device;
    bool own_damping = said(draft, KN_KEY_DEVICE_COUPLING_DAMPING);
    kn_coupling c = kn_coupling_default(own_damping ? INFINITY : d->mass_kg, d->damping_n_s_m, period_s(draft),
                                        d->round_trip_s, d->hand);
    if (!said(draft, KN_KEY_DEVICE_COUPLING)) d->hand.stiffness_n_m = c.stiffness_n_m;
    d->hand.damping_n_s_m = c.damping_n_s_m;
    // convert stiffness and damping from the hand's frame to the scene, see core/device.h
    double at_hand = d->force_scale * d->scale;
    d->coupling_n_m = d->hand.stiffness_n_m / at_hand;
    d->coupling_n_s_m = d->hand.damping_n_s_m / at_hand;
}

// Set the hold from the device's rate: two periods, one of them for jitter. A scene may only shorten it.
static bool hold(kn_draft *draft)
{
    kn_safety_limits *limits = &draft->scene.limits;
    const int most_ms = (int)fmin(fmax(ceil(2e3 * period_s(draft) - 1e-6), 3), 15);
    if (!kn_draft_given(draft, 0, KN_KEY_HOLD)) limits->hold_ms = most_ms;
    if (limits->hold_ms < 1e3 * period_s(draft) - 1e-6)
        return kn_draft_complain(
            draft, draft->at[0][KN_KEY_HOLD],
            "device.hold: %d ms is shorter than the %.3g ms between poses at %g Hz, so every force "
            "would fade: expected %d to %d ms",
            limits->hold_ms, 1e3 * period_s(draft), 1 / period_s(draft), (int)ceil(1e3 * period_s(draft) - 1e-6),
            most_ms);
    if (limits->hold_ms > most_ms)
        return kn_draft_complain(draft, draft->at[0][KN_KEY_HOLD],
                                 "device.hold: %d ms is longer than poses at %g Hz need, expected at most %d ms, or "
                                 "device.rate",
                                 limits->hold_ms, 1 / period_s(draft), most_ms);
    return limits->zero_ms > limits->hold_ms ||
           kn_draft_complain(draft, draft->at[0][KN_KEY_ZERO],
                             "device.zero: %d ms, expected more than device.hold, %d ms", limits->zero_ms,
                             limits->hold_ms);
}

void kn_draft_lower_clamp(kn_scene *scene)
{
    kn_safety_limits *l = &scene->limits;
    // the force may fall by clamp / 17 in a ms, or 0.5 N, and fades in the time from hold to zero
    const double fade_ms = l->zero_ms - l->hold_ms, most_n = fade_ms * fmax(0.5, l->clamp_n / 17);
    if (fade_ms >= 17 || l->clamp_n <= most_n) return;
    l->torque_clamp_n_m *= most_n / l->clamp_n;
    scene->device.force_limit_n = l->clamp_n = most_n;
}

bool kn_draft_device(kn_draft *draft)
{
    kn_device_def *d = &draft->scene.device;
    kn_safety_limits *limits = &draft->scene.limits;
    char name[KN_LINE_MAX];
    snprintf(d->name, sizeof d->name, "%.15s", kn_key_print(&kn_keys[KN_KEY_PROFILE], &draft->profile, name));
    // set the defaults that depend on other keys
    if (!kn_draft_given(draft, 0, KN_KEY_TORQUE_CLAMP)) limits->torque_clamp_n_m = 0.05 * limits->clamp_n;
    for (int k = 0; k < 3 && !kn_draft_given(draft, 0, KN_KEY_DEVICE_BASIS); k++) d->basis[k] = k + 1;
    if (!kn_draft_given(draft, 0, KN_KEY_DEVICE_ROTATION)) d->rotation_wxyz[0] = 1.0;
    d->force_limit_n = limits->clamp_n;
    d->force_scale = limits->force_scale;
    if (!hold(draft)) return false;
    draft->device_whole = says_all(draft);
    // report a problem at the key device.basis if its text contains the word `basis`, else at device.rotation
    const char *problem = kn_device_check(d);
    kn_key_id key = problem && strstr(problem, "basis") ? KN_KEY_DEVICE_BASIS : KN_KEY_DEVICE_ROTATION;
    if (problem) return kn_draft_complain(draft, draft->at[0][key], "%s: %s", kn_keys[key].path, problem);
    couple(draft);
    return true;
}
