#include "core/scene/draft.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define PERIOD_S 1e-3 // period of a device's loop and of the servo loop

static bool given(const kn_draft *draft, kn_key_id id) { return draft->at[0][id].source != KN_SOURCE_DEFAULT; }

// Return true if the scene or a --set gives the key, not only the profile.
static bool said(const kn_draft *draft, kn_key_id id) { return given(draft, id) && !draft->at[0][id].library; }

bool kn_draft_of_device(kn_key_id id) { return id >= KN_KEY_DEVICE_MASS && id <= KN_KEY_DEVICE_SCALE; }

bool kn_draft_take_device(kn_draft *draft, const kn_draft *from, kn_mark mark)
{
    const size_t prefix = strlen("device.");
    if (from->scene.model.probe_count > 0)
        return kn_draft_complain(draft, mark, "probes are in %s, expected only device: there", from->file);
    for (kn_key_id id = 0; id < KN_KEY_PROBE_NAME; id++) {
        const kn_key *key = &kn_keys[id];
        bool whole = key->type == KN_TYPE_CHOICE || key->type == KN_TYPE_INTEGER;
        if (!given(from, id)) continue;
        // a device's file may hold nothing else
        if (strncmp(key->path, "device.", prefix) != 0)
            return kn_draft_complain(draft, mark, "%s is in %s, expected only device: there", key->path, from->file);
        // the scene's own value takes precedence over that of a profile
        if (mark.library && given(draft, id)) continue;
        memcpy((char *)draft + key->offset, (const char *)from + key->offset,
               (size_t)key->count * (whole ? sizeof(int) : sizeof(double)));
        draft->at[0][id] = mark;
    }
    return true;
}

// Return true if the canonical text must hold all keys of the device. With all keys in the text, a log can be replayed
// even after the profile has changed. A bench needs none of them, unless the scene itself gives one.
static bool says_all(const kn_draft *draft)
{
    bool all = strcmp(draft->scene.device.name, "bench") != 0;
    for (kn_key_id id = 0; id < KN_KEY_PROBE_NAME; id++) all |= kn_draft_of_device(id) && said(draft, id);
    return all;
}

// Compute the coupling. A value of the profile is a ceiling; a value of the scene is taken as it is.
static void couple(kn_draft *draft)
{
    kn_device_def *d = &draft->scene.device;
    bool own_damping = said(draft, KN_KEY_DEVICE_COUPLING_DAMPING);
    kn_coupling c =
        kn_coupling_default(own_damping ? INFINITY : d->mass_kg, d->damping_n_s_m, PERIOD_S, d->round_trip_s, d->hand);
    if (!said(draft, KN_KEY_DEVICE_COUPLING)) d->hand.stiffness_n_m = c.stiffness_n_m;
    d->hand.damping_n_s_m = c.damping_n_s_m;
    // convert from the hand to the scene, see core/device.h
    double at_hand = d->force_scale * d->scale;
    d->coupling_n_m = d->hand.stiffness_n_m / at_hand;
    d->coupling_n_s_m = d->hand.damping_n_s_m / at_hand;
}

bool kn_draft_device(kn_draft *draft)
{
    kn_device_def *d = &draft->scene.device;
    kn_safety_limits *limits = &draft->scene.limits;
    char name[KN_LINE_MAX];
    snprintf(d->name, sizeof d->name, "%.15s", kn_key_print(&kn_keys[KN_KEY_PROFILE], &draft->profile, name));
    // set the defaults that depend on other keys
    if (!given(draft, KN_KEY_TORQUE_CLAMP)) limits->torque_clamp_n_m = 0.05 * limits->clamp_n;
    for (int k = 0; k < 3 && !given(draft, KN_KEY_DEVICE_BASIS); k++) d->basis[k] = k + 1;
    if (!given(draft, KN_KEY_DEVICE_ROTATION)) d->rotation_wxyz[0] = 1.0;
    d->force_limit_n = limits->clamp_n;
    d->force_scale = limits->force_scale;
    draft->device_whole = says_all(draft);
    // an error points at the key that its text names
    const char *problem = kn_device_check(d);
    kn_key_id key = problem && strstr(problem, "basis") ? KN_KEY_DEVICE_BASIS : KN_KEY_DEVICE_ROTATION;
    if (problem) return kn_draft_complain(draft, draft->at[0][key], "%s: %s", kn_keys[key].path, problem);
    couple(draft);
    return true;
}
