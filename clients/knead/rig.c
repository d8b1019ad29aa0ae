#include "clients/knead/rig.h"
#include "clients/knead/buzz.h"
#include <math.h>
#include <string.h>

#define PI 3.141592653589793
static const double period_s = 1e-3;
static const double lean_n = 1.0, press_n = 2.0, clear_m = 2e-3, tap_m = 0.01, tap_hz = 2.0;
static const double slide_m = 0.02, slide_m_s = 0.01, slide_from_s = 2.0, ramp_s = 0.05;
// Constants added in the bounds of rig.h: 2 mN for the force, 2 um for the position.
static const double unheard_n = 2e-3, unseen_m = 2e-6;

// Stiffness of the springs of arm and grip in series, N/m. To press with a force against a wall, the intended path must
// go force / stiffness deeper than the wall.
static const double give_n_m[KN_GRIPS] = {[KN_GRIP_LIGHT] = 75.0, [KN_GRIP_NORMAL] = 218.2, [KN_GRIP_FIRM] = 606.1};

// State of one simulated motion. way_n: forces on their way to the device, a ring of the last trip_ms + 1 periods.
typedef struct loop {
    const kn_rig_def *def;
    kn_arm arm;
    kn_passivity passivity;
    double way_n[KN_RIG_TRIP_MAX_MS + 1][3];
    kn_buzz force, side, position;
    kn_turns turns, side_turns; // reversals of the force along z (turns) and along x (side_turns)
    double stroke_j;            // energy given to the hand until the present stroke began
    bool air;
    kn_rig_result result;
} loop;

// Compute the position along x of a slide: at rest until slide_from_s, then accelerated to slide_m_s within ramp_s.
static void slide_along(double t_s, double *x_m, double *speed_m_s)
{
    double since_s = fmax(0.0, t_s - slide_from_s), early_s = fmin(since_s, ramp_s);
    *speed_m_s = slide_m_s * early_s / ramp_s;
    *x_m = -0.5 * slide_m + 0.5 * *speed_m_s * early_s + slide_m_s * (since_s - early_s);
}

// Compute position and velocity at a time on the path that the hand intends.
static void path_at(const kn_rig_def *def, double t_s, double path_m[3], double path_m_s[3])
{
    double depth_m = def->arm.grip == KN_GRIP_NONE ? 0.0 : press_n / give_n_m[def->arm.grip];
    double w = def->motion == KN_RIG_TAP ? 2.0 * PI * tap_hz : PI, swing_m = 0.5 * (clear_m + depth_m);
    memset(path_m, 0, 3 * sizeof *path_m);
    memset(path_m_s, 0, 3 * sizeof *path_m_s);
    if (def->motion == KN_RIG_SLIDE) slide_along(t_s, &path_m[0], &path_m_s[0]);
    if (def->motion == KN_RIG_LEAN) return;
    if (def->motion == KN_RIG_TAP) {
        path_m[2] = tap_m * cos(w * t_s);
        path_m_s[2] = -tap_m * w * sin(w * t_s);
        // A press goes down on half a cosine within 1 s and stays.
    } else if (t_s >= 1.0) {
        path_m[2] = -depth_m;
    } else {
        path_m[2] = clear_m - swing_m * (1.0 - cos(w * t_s));
        path_m_s[2] = -swing_m * w * sin(w * t_s);
    }
}

// Set up device, hand and link at rest at the begin of the motion.
static void start(loop *l, const kn_rig_def *def)
{
    kn_arm_def arm = def->arm;
    double speed_m_s[3], at_m[3];
    path_at(def, 0.0, at_m, speed_m_s);
    memset(l, 0, sizeof *l);
    l->def = def;
    if (def->motion == KN_RIG_LEAN) arm.bias_n[2] = -lean_n;
    kn_arm_init(&l->arm, &arm, at_m);
    // Resolution: the force changes by this much when a position is read one encoder step further.
    double share = -expm1(-2.0 * PI * l->arm.def.velocity_hz * period_s);
    double per_step_n_m = def->coupling.stiffness_n_m + def->coupling.damping_n_s_m * share / period_s;
    l->result.resolution_n = arm.encoder_m * per_step_n_m;
    l->side_turns.hysteresis = l->turns.hysteresis = 2.0 * (1.5 * l->result.resolution_n + unheard_n);
    kn_passivity_init(&l->passivity,
                      &(kn_passivity_def){.mass_kg = arm.mass_kg,
                                          .period_s = period_s,
                                          .round_trip_s = def->trip_ms * period_s,
                                          .velocity_hz = l->arm.def.velocity_hz,
                                          .encoder_m = arm.encoder_m,
                                          .coupling_n_m = def->coupling.stiffness_n_m,
                                          .force_limit_n = arm.force_limit_n > 0.0 ? arm.force_limit_n : 1e3});
    kn_buzz_init(&l->force, period_s, 0.0);
    kn_buzz_init(&l->side, period_s, 0.0);
    kn_buzz_init(&l->position, period_s, at_m[2]);
    l->air = true;
}

// Update the results after one period. A stroke lasts from one time in the air to the next. The energy that a stroke
// gave to the hand is the increase of the hand's energy during the stroke.
static void account(loop *l)
{
    double size = fabs(l->arm.force_n[2]), given_j = l->passivity.given_j;
    bool air = size == 0.0;
    if (l->air && !air) l->result.strokes++;
    if (air) l->result.returned_j = fmax(l->result.returned_j, given_j - l->stroke_j);
    if (air) l->stroke_j = given_j;
    l->air = air;
    l->result.peak_n = fmax(l->result.peak_n, size);
    kn_buzz_add(&l->force, l->arm.force_n[2]);
    kn_buzz_add(&l->side, l->arm.force_n[0]);
    kn_buzz_add(&l->position, l->arm.x_m[2]);
    kn_turns_add(&l->turns, l->arm.force_n[2]);
    kn_turns_add(&l->side_turns, l->arm.force_n[0]);
}

// Simulate one period of 1 ms. Return false if the simulation gives numbers that are not finite.
static bool tick(loop *l, int n, kn_rig_object *object, void *self)
{
    const kn_rig_def *def = l->def;
    double path_m[3], path_m_s[3], out_n[3];
    // The object writes the newest force; the oldest force of the ring arrives at the device.
    double *slot = l->way_n[n % (def->trip_ms + 1)], *wanted_n = l->way_n[(n + 1) % (def->trip_ms + 1)];
    double stored_j = object(self, l->arm.position_m, l->arm.velocity_m_s, slot);
    // The controller always observes. Its output is used only if def->passivity is set.
    kn_passivity_filter(&l->passivity, l->arm.position_m, l->arm.velocity_m_s, stored_j, wanted_n, out_n);
    path_at(def, n * period_s, path_m, path_m_s);
    kn_arm_tick(&l->arm, def->passivity ? out_n : wanted_n, path_m, path_m_s);
    kn_passivity_sent(&l->passivity, l->arm.force_n);
    account(l);
    return isfinite(l->arm.x_m[2]) && fabs(l->arm.x_m[2]) < 1.0;
}

// Reset all measures, so that only the motion from now on is judged.
static void judge_from_here(loop *l)
{
    kn_buzz_reset(&l->force);
    kn_buzz_reset(&l->side);
    kn_buzz_reset(&l->position);
    l->turns.count = l->side_turns.count = 0;
}

kn_rig_result kn_rig_run(const kn_rig_def *def, kn_rig_object *object, void *self)
{
    loop l;
    start(&l, def);
    kn_rig_result *r = &l.result;
    bool tap = def->motion == KN_RIG_TAP;
    int ticks = tap ? 5000 : 4000;
    r->finite = true;
    for (int n = 0; n < ticks && r->finite; n++) {
        if (n == ticks - 1000 && !tap) judge_from_here(&l);
        r->finite = tick(&l, n, object, self);
    }
    r->force_rms_n = kn_buzz_rms(&l.force);
    if (def->motion == KN_RIG_SLIDE) r->force_rms_n = fmax(r->force_rms_n, kn_buzz_rms(&l.side));
    r->position_rms_m = kn_buzz_rms(&l.position);
    r->turns = r->strokes ? (double)l.turns.count / r->strokes : 0.0;
    r->acted = l.passivity.acted;
    // Decide whether the loop buzzes, by the bounds in rig.h.
    bool rough =
        r->force_rms_n > 1.5 * r->resolution_n + unheard_n || r->position_rms_m > 1.5 * l.arm.def.encoder_m + unseen_m;
    bool slide = def->motion == KN_RIG_SLIDE;
    if (slide) r->turns = fmax(l.turns.count, l.side_turns.count);
    r->buzzes = !r->finite || (tap ? r->turns > KN_RIG_TURNS : slide ? r->turns > 2.0 * KN_BUZZ_HZ : rough);
    return *r;
}
