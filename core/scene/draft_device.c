#include "core/scene/draft.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define PERIOD_S 1e-3 // of a device's loop, the servo's

static bool given(const kn_draft *draft, kn_key_id id) { return draft->at[0][id].source != KN_SOURCE_DEFAULT; }

static bool said(const kn_draft *draft, kn_key_id id) // by the scene or a --set, not by the profile
{
    return given(draft, id) && !draft->at[0][id].library;
}

bool kn_draft_of_device(kn_key_id id) { return id >= KN_KEY_DEVICE_MASS && id <= KN_KEY_DEVICE_SCALE; }

bool kn_draft_take_device(kn_draft *draft, const kn_draft *from, kn_mark mark)
{
    const size_t prefix = strlen("device.");
    if (from->scene.model.probe_count > 0)
        return kn_draft_complain(draft, mark, "probes stand in %s, expected device: alone", from->file);
    for (kn_key_id id = 0; id < KN_KEY_PROBE_NAME; id++) {
        const kn_key *key = &kn_keys[id];
        bool whole = key->type == KN_TYPE_CHOICE || key->type == KN_TYPE_INTEGER;
        if (!given(from, id)) continue;
        if (strncmp(key->path, "device.", prefix) != 0)
            return kn_draft_complain(draft, mark, "%s stands in %s, expected device: alone", key->path, from->file);
        if (mark.library && given(draft, id)) continue;
        memcpy((char *)draft + key->offset, (const char *)from + key->offset,
               (size_t)key->count * (whole ? sizeof(int) : sizeof(double)));
        draft->at[0][id] = mark;
    }
    return true;
}

// The canonical text holds all that a profile says of a device: a log replays by it when the profile is another. Of a
// bench there is nothing to say.
static bool says_all(const kn_draft *draft)
{
    bool all = strcmp(draft->scene.device.name, "bench") != 0;
    for (kn_key_id id = 0; id < KN_KEY_PROBE_NAME; id++) all |= kn_draft_of_device(id) && said(draft, id);
    return all;
}

// What a profile says of the coupling is a ceiling; what the scene says is so.
static void couple(kn_draft *draft)
{
    kn_device_def *d = &draft->scene.device;
    bool own_damping = said(draft, KN_KEY_DEVICE_COUPLING_DAMPING);
    kn_coupling c =
        kn_coupling_default(own_damping ? INFINITY : d->mass_kg, d->damping_n_s_m, PERIOD_S, d->round_trip_s, d->hand);
    if (!said(draft, KN_KEY_DEVICE_COUPLING)) d->hand.stiffness_n_m = c.stiffness_n_m;
    d->hand.damping_n_s_m = c.damping_n_s_m;
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
    if (!given(draft, KN_KEY_TORQUE_CLAMP)) limits->torque_clamp_n_m = 0.05 * limits->clamp_n;
    for (int k = 0; k < 3 && !given(draft, KN_KEY_DEVICE_BASIS); k++) d->basis[k] = k + 1;
    if (!given(draft, KN_KEY_DEVICE_ROTATION)) d->rotation_wxyz[0] = 1.0;
    d->force_limit_n = limits->clamp_n;
    d->force_scale = limits->force_scale;
    draft->device_whole = says_all(draft);
    const char *problem = kn_device_check(d);
    kn_key_id key = problem && strstr(problem, "basis") ? KN_KEY_DEVICE_BASIS : KN_KEY_DEVICE_ROTATION;
    if (problem) return kn_draft_complain(draft, draft->at[0][key], "%s: %s", kn_keys[key].path, problem);
    couple(draft);
    return true;
}
