#include "clients/hand/haptic_render.h"
#include "core/algebra/algebra.h"
#include <math.h>
#include <string.h>

// The energy reservoir of the passivity controller is computed from the stiffness of the coupling. If the stiffness is
// lower than this value, this value is used instead, N/m.
static const double lightest_n_m = 100.0;
static const double fade_s = 0.017; // time in which the force fades to 0 after a stop of the rendering
// Time without a new force after which a watchdog fades the force, s. The watchdogs hold a force for 3 ticks of 1 ms.
static const double hold_s = 3.5e-3;
// Largest change of the force per ms while a watchdog fades the force. If the force limit is high, the fade may be
// steeper; see core/safety.h.
static const double slope_n_per_ms = 0.5;
static const double smoothing = 0.01; // weight of the newest round trip in the smoothed round trip
// Upper limit of the time between two calls, s. If more time has passed, the computation uses this limit. The error
// does not matter, because the force of the local model has faded by then.
static const double longest_s = 0.05;
static const double step_s = 0.01; // longest time step of the local model
// Force limit of the local model, N. The limit is too high to matter, so that the impulse guard sees a wild force and
// trips.
static const double any_n = 1e3;

static double norm(const double v[3]) { return sqrt(kn_dot(v, v)); }

// Return the stiffness of the coupling as felt by the hand, N/m.
static double coupling(const kn_haptic_render_def *d)
{
    bool own = d->coupling_n_m > 0.0;
    return own ? d->coupling_n_m * d->device.force_scale * d->device.scale : d->device.hand.stiffness_n_m;
}

void kn_haptic_render_init(kn_haptic_render *r, const kn_haptic_render_def *def)
{
    const kn_device_def *d = &def->device;
    memset(r, 0, sizeof *r);
    r->def = *def;
    // The passivity controller needs the mass of the device, so a device of unknown mass has no controller.
    if (d->mass_kg > 0.0)
        kn_passivity_init(&r->passivity, &(kn_passivity_def){.mass_kg = d->mass_kg,
                                                             .round_trip_s = d->round_trip_s,
                                                             .velocity_hz = def->velocity_hz,
                                                             .encoder_m = d->encoder_m,
                                                             .coupling_n_m = fmax(coupling(def), lightest_n_m),
                                                             .force_limit_n = d->force_limit_n});
    kn_haptic_render_begin(r, 0);
}

void kn_haptic_render_begin(kn_haptic_render *r, int64_t session)
{
    const kn_haptic_render_def *d = &r->def;
    bool own = d->coupling_n_m > 0.0;
    r->session = session;
    r->stop = KN_HAPTIC_RENDER_RUNS;
    r->gain = 1.0;
    r->news = false;
    r->gap_s = 0.0;
    memset(r->heard_n, 0, sizeof r->heard_n);
    memset(r->guarded_n, 0, sizeof r->guarded_n);
    kn_guard_init(&r->guard, d->guard_n_per_ms);
    r->allowed_n = r->guard.most_n_per_ms;
    if (!d->local) return;
    kn_contact_model_init(&r->model,
                          &(kn_contact_model_def){.session = session,
                                                  .radius_m = d->radius_m,
                                                  .force_scale = d->device.force_scale,
                                                  .force_limit_n = any_n,
                                                  .stiffness_n_m = own ? d->coupling_n_m : d->device.coupling_n_m,
                                                  .damping_n_s_m = own ? d->coupling_n_s_m : d->device.coupling_n_s_m});
}

static void to_scene(const kn_haptic_render *r, const double x[3], const double v[3], double scene_m[3],
                     double scene_m_s[3])
{
    kn_device_position(&r->def.device, x, scene_m);
    kn_device_velocity(&r->def.device, v, scene_m_s);
}

void kn_haptic_render_turn(kn_haptic_render *r, const double orientation_wxyz[4])
{
    if (r->def.local && !r->def.level) kn_contact_model_turn(&r->model, orientation_wxyz);
}

void kn_haptic_render_pose(kn_haptic_render *r, int64_t seq, const double position_m[3], const double velocity_m_s[3])
{
    double x[3], v[3];
    if (!r->def.local) return;
    to_scene(r, position_m, velocity_m_s, x, v);
    kn_contact_model_pose(&r->model, seq, x, v);
}

// Stop giving force. Keep the reason of the first stop.
static void stop(kn_haptic_render *r, kn_haptic_render_stop why)
{
    if (r->stop) return;
    r->stop = why;
    r->reflexes += why == KN_HAPTIC_RENDER_REFLEX;
    r->refusals += why == KN_HAPTIC_RENDER_FAR;
}

bool kn_haptic_render_force(kn_haptic_render *r, const double scene_n[3], double age_s)
{
    if (!isfinite(kn_dot(scene_n, scene_n))) return false;
    // If this force is the first answer to its pose, update the smoothed round trip with the time since that pose was
    // sent.
    if (age_s >= 0.0) r->round_trip_s += smoothing * (fmin(age_s, 1.0) - r->round_trip_s);
    // If the round trip is too long, stop rendering kneadd's forces. Do not stop if the local model is used or def.held
    // is set.
    if (r->round_trip_s > KN_HAPTIC_RENDER_FAR_S && !r->def.local && !r->def.held) stop(r, KN_HAPTIC_RENDER_FAR);
    kn_device_force(&r->def.device, scene_n, r->heard_n);
    r->news = true;
    return true;
}

kn_contact_take kn_haptic_render_contact(kn_haptic_render *r, const kn_contact_unit *unit)
{
    return r->def.local ? kn_contact_model_take(&r->model, unit) : KN_CONTACT_FOREIGN;
}

// Step the local contact model to the present pose and write its force in device axes. Return the energy stored in the
// model's springs as felt at the hand, J.
static double replay(kn_haptic_render *r, double dt_s, const double position_m[3], const double velocity_m_s[3],
                     double force_n[3])
{
    double x[3], v[3], scene_n[3], left_s = fmin(dt_s, longest_s);
    to_scene(r, position_m, velocity_m_s, x, v);
    // Divide a long interval into steps of at most step_s.
    do {
        kn_contact_model_render(&r->model, fmin(left_s, step_s), x, v, scene_n);
        left_s -= step_s;
    } while (left_s > 0.0);
    kn_device_force(&r->def.device, scene_n, force_n);
    return r->def.device.force_scale / r->def.device.scale * kn_contact_model_energy(&r->model, x);
}

// Move guarded_n towards wanted_n while a watchdog fades the force. wanted_n can change during the fade, because the
// passivity controller acts. The total slope of the force must not exceed slope_n_per_ms. So limit the change towards
// wanted_n to the difference between slope_n_per_ms and the slope of the fade.
static void fade(kn_haptic_render *r, double dt_s, const double wanted_n[3])
{
    double faded_n = r->def.device.force_limit_n / (1e3 * fade_s), step_n[3];
    for (int i = 0; i < 3; i++) step_n[i] = wanted_n[i] - r->guarded_n[i];
    double left_n = 1e3 * dt_s * fmax(0.0, slope_n_per_ms - faded_n);
    double share = fmin(1.0, left_n / fmax(norm(step_n), 1e-9));
    for (int i = 0; i < 3; i++) r->guarded_n[i] += share * step_n[i];
}

// Pass wanted_n through the impulse guard. The function may be called at any rate, because the allowed change of the
// force grows with the time since the last call, up to the change that is allowed in 1 ms. A force may be held for 3
// ms. So if a new force comes after 2 or 3 ms, it may change by as much as is allowed in 2 or 3 ms.
static void guard(kn_haptic_render *r, double dt_s, const double wanted_n[3], bool news)
{
    r->gap_s = fmin(r->gap_s + dt_s, longest_s);
    r->tick_s = fmin(r->tick_s + dt_s, longest_s);
    // kn_guard_age takes whole milliseconds, so keep the rest of the time in tick_s.
    kn_guard_age(&r->guard, (int)(r->tick_s * 1e3));
    r->tick_s = fmod(r->tick_s, 1e-3);
    // Compute the change of the force that is allowed in this call.
    double ms = fmin(fmax(round(1e3 * r->gap_s), 1.0), 3.0), most_n = r->guard.most_n_per_ms * ms;
    r->allowed_n = fmin(r->allowed_n + 1e3 * dt_s * r->guard.most_n_per_ms, most_n);
    if (r->stop) return; // the last good force is kept and fades
    // If no new force has come for more than hold_s, a watchdog fades the force.
    if (!news && r->gap_s > hold_s) {
        fade(r, dt_s, wanted_n);
        return;
    }
    double before_n[3], changed_n[3];
    memcpy(before_n, r->guarded_n, sizeof before_n);
    // Let the impulse guard judge the change of the force, and subtract this change from the allowed change.
    kn_guard_result result = kn_guard_pass(&r->guard, wanted_n, r->allowed_n, r->guarded_n);
    for (int i = 0; i < 3; i++) changed_n[i] = r->guarded_n[i] - before_n[i];
    r->allowed_n = fmax(0.0, r->allowed_n - norm(changed_n));
    if (news) r->gap_s = 0.0;
    r->guards += result == KN_GUARD_LIMITED || result == KN_GUARD_TRIPPED;
    if (result == KN_GUARD_TRIPPED) stop(r, KN_HAPTIC_RENDER_REFLEX);
}

void kn_haptic_render_give(kn_haptic_render *r, double dt_s, const double position_m[3], const double velocity_m_s[3],
                           double share)
{
    const double limit_n = r->def.device.force_limit_n;
    // observed: true if the passivity controller runs, which needs the mass of the device. news: true if there is a new
    // force; the local model gives a new force at every call.
    bool observed = r->passivity.def.mass_kg > 0.0, news = r->news || r->def.local;
    // kneadd does not send the energy stored in its object. The value -1 tells the controller that this energy is not
    // known.
    double wanted_n[3], stored_j = -1.0;
    dt_s = fmax(dt_s, 0.0);
    if (r->def.local) stored_j = replay(r, dt_s, position_m, velocity_m_s, wanted_n);
    else memcpy(wanted_n, r->heard_n, sizeof wanted_n);
    // The output stage: passivity, impulse guard, clamp, gain.
    if (observed) kn_passivity_filter(&r->passivity, position_m, velocity_m_s, stored_j, wanted_n, wanted_n);
    guard(r, dt_s, wanted_n, news);
    // After a stop the force fades.
    if (r->stop) r->gain = fmax(0.0, r->gain - dt_s / fade_s);
    double size = norm(r->guarded_n);
    // The clamp scales the force to the limit and keeps its direction.
    share *= size > limit_n ? r->gain * limit_n / size : r->gain;
    r->clamped += size > limit_n && news;
    r->news = false;
    for (int i = 0; i < 3; i++) r->given_n[i] = share * r->guarded_n[i];
    if (observed) kn_passivity_sent(&r->passivity, r->given_n);
    r->largest_n = fmax(r->largest_n, norm(r->given_n));
}

const char *kn_haptic_render_why(kn_haptic_render_stop why)
{
    static const char *const told[] = {
        [KN_HAPTIC_RENDER_REFLEX] = "the device's own impulse guard tripped, because the requested force jumped",
        [KN_HAPTIC_RENDER_FAR] =
            "a round trip above 5 ms: forces that come so late are not used; with kneadd --local-model, the option "
            "--local renders the contact instead",
    };
    return told[why];
}
