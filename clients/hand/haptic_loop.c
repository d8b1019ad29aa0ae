#include "clients/hand/haptic_loop.h"
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "core/algebra/algebra.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Number of integration steps per period. With a period of 1 ms, a step takes 50 us. This step is 1/90 of sqrt(m / k),
// where m is the mass of the lightest device and k is the stiffness of the firmest grip.
#define SUBSTEPS 20
#define TAU 6.283185307179586

// Parameters of a person: grip spring and damper, hand mass, arm spring and damper. See the table in haptic_loop.h.
typedef struct hand {
    const char *name;
    double grip_n_m, grip_n_s_m, mass_kg, arm_n_m, arm_n_s_m;
} hand;

static const hand hands[KN_GRIPS] = {
    [KN_GRIP_NONE] = {.name = "none"},
    [KN_GRIP_LIGHT] = {"light", 300.0, 1.0, 0.05, 100.0, 1.0},
    [KN_GRIP_NORMAL] = {"normal", 800.0, 3.0, 0.1, 300.0, 4.0},
    [KN_GRIP_FIRM] = {"firm", 2500.0, 8.0, 0.2, 800.0, 10.0},
};

const char kn_grip_names[] = "none, light, normal or firm";

const char *kn_grip_name(kn_grip grip) { return hands[grip].name; }

bool kn_grip_find(const char *name, kn_grip *grip)
{
    for (int i = 0; i < KN_GRIPS; i++)
        if (strcmp(hands[i].name, name) == 0) {
            *grip = (kn_grip)i;
            return true;
        }
    return false;
}

kn_held_device_def kn_held_device_of(const kn_device_def *device)
{
    return (kn_held_device_def){.mass_kg = device->mass_kg,
                                .damping_n_s_m = device->damping_n_s_m,
                                .coulomb_n = device->friction_n,
                                .encoder_m = device->encoder_m,
                                .force_limit_n = device->force_limit_n};
}

// Return the position rounded to the encoder step. A step of 0 means an exact encoder.
static double read_encoder(const kn_held_device_def *def, double x_m)
{
    return def->encoder_m > 0.0 ? def->encoder_m * round(x_m / def->encoder_m) : x_m;
}

void kn_held_device_init(kn_held_device *arm, const kn_held_device_def *def, const double at_m[3])
{
    memset(arm, 0, sizeof *arm);
    arm->def = *def;
    // Replace fields that are zero or invalid with their defaults.
    if (!(arm->def.period_s > 0.0)) arm->def.period_s = 1e-3;
    if (!(arm->def.velocity_hz > 0.0)) arm->def.velocity_hz = 100.0;
    if (arm->def.axes != 1) arm->def.axes = 3;
    // The device and the hand start at rest at the same place, so the grip spring between them carries no force.
    for (int k = 0; k < 3; k++) {
        arm->x_m[k] = arm->hand_m[k] = at_m[k];
        arm->position_m[k] = read_encoder(def, at_m[k]);
    }
}

// Scale the commanded force down to the force limit. The direction is kept.
static void saturate(kn_held_device *arm, const double force_n[3])
{
    double size = sqrt(kn_dot(force_n, force_n)), limit = arm->def.force_limit_n;
    double share = limit > 0.0 && size > limit ? limit / size : 1.0;
    for (int k = 0; k < 3; k++) arm->force_n[k] = share * force_n[k];
}

// Compute the velocities at the end of a sub-step from the forces at its beginning. Coulomb friction acts last and
// implicitly: a slow device stops instead of moving back and forth.
static void push(kn_held_device *arm, const double path_m[3], const double path_m_s[3], double dt)
{
    const kn_held_device_def *d = &arm->def;
    const hand *h = &hands[d->grip];
    for (int k = 0; k < 3; k++) {
        // `grip` is the force of the hand on the device. `pull` is the force of the arm on the hand.
        double grip = h->grip_n_m * (arm->hand_m[k] - arm->x_m[k]) + h->grip_n_s_m * (arm->hand_m_s[k] - arm->v_m_s[k]);
        double pull = h->arm_n_m * (path_m[k] - arm->hand_m[k]) + h->arm_n_s_m * (path_m_s[k] - arm->hand_m_s[k]);
        // Integrate all forces explicitly except viscous friction, which is implicit.
        double free = arm->v_m_s[k] + dt / d->mass_kg * (arm->force_n[k] + d->bias_n[k] + grip);
        arm->v_m_s[k] = free / (1.0 + dt * d->damping_n_s_m / d->mass_kg);
        if (h->mass_kg > 0.0) arm->hand_m_s[k] += dt / h->mass_kg * (pull - grip);
    }
    // Coulomb friction reduces the speed by a fixed amount per sub-step, but not below zero, so friction never reverses
    // the motion.
    double speed = sqrt(kn_dot(arm->v_m_s, arm->v_m_s)), lost = dt * d->coulomb_n / d->mass_kg;
    for (int k = 0; k < 3 && lost > 0.0; k++) arm->v_m_s[k] *= speed > lost ? 1.0 - lost / speed : 0.0;
}

// Set x and y of the device to the intended path if the device moves freely along z only.
static void guide(kn_held_device *arm, const double path_m[3], const double path_m_s[3])
{
    for (int k = 0; k < 2 && arm->def.axes == 1; k++) {
        arm->x_m[k] = arm->hand_m[k] = path_m[k];
        arm->v_m_s[k] = arm->hand_m_s[k] = path_m_s[k];
    }
}

// Weight of the newest difference in the first-order low-pass that measures the velocity.
static double newest_share(const kn_held_device_def *def) { return -expm1(-TAU * def->velocity_hz * def->period_s); }

double kn_held_device_resolution_n(const kn_held_device *arm, const kn_coupling *coupling)
{
    const kn_held_device_def *d = &arm->def;
    return d->encoder_m * (coupling->stiffness_n_m + coupling->damping_n_s_m * newest_share(d) / d->period_s);
}

void kn_held_device_tick(kn_held_device *arm, const double force_n[3], const double path_m[3], const double path_m_s[3])
{
    double period = arm->def.period_s, dt = period / SUBSTEPS, target_m[3];
    saturate(arm, force_n);
    // Integrate device and hand. The force is constant over the period, and the intended path continues at constant
    // velocity.
    for (int step = 1; step <= SUBSTEPS; step++) {
        for (int k = 0; k < 3; k++) target_m[k] = path_m[k] + step * dt * path_m_s[k];
        push(arm, target_m, path_m_s, dt);
        // Advance positions with the new velocities (semi-implicit Euler).
        for (int k = 0; k < 3; k++) {
            arm->x_m[k] += dt * arm->v_m_s[k];
            arm->hand_m[k] += dt * arm->hand_m_s[k];
        }
        guide(arm, target_m, path_m_s);
    }
    // Sample the encoder and update the measured velocity.
    double share = newest_share(&arm->def);
    for (int k = 0; k < 3; k++) {
        double next_m = read_encoder(&arm->def, arm->x_m[k]);
        arm->velocity_m_s[k] += share * ((next_m - arm->position_m[k]) / period - arm->velocity_m_s[k]);
        arm->position_m[k] = next_m;
    }
}

void kn_buzz_init(kn_buzz *buzz, double period_s, double first)
{
    // Second-order Butterworth high-pass by the bilinear transform. The variable w is the prewarped cut-off frequency.
    double w = tan(3.141592653589793 * KN_BUZZ_HZ * period_s), root2 = sqrt(2.0);
    double a0 = 1.0 + root2 * w + w * w;
    // Both past inputs of the filter start at `first`, so a constant signal gives zero output from the beginning.
    *buzz = (kn_buzz){
        .b = 1.0 / a0, .a1 = 2.0 * (w * w - 1.0) / a0, .a2 = (1.0 - root2 * w + w * w) / a0, .x1 = first, .x2 = first};
}

void kn_buzz_add(kn_buzz *buzz, double value)
{
    double y = buzz->b * (value - 2.0 * buzz->x1 + buzz->x2) - buzz->a1 * buzz->y1 - buzz->a2 * buzz->y2;
    buzz->x2 = buzz->x1;
    buzz->x1 = value;
    buzz->y2 = buzz->y1;
    buzz->y1 = y;
    buzz->sum += y * y;
    buzz->count++;
}

void kn_buzz_reset(kn_buzz *buzz)
{
    buzz->sum = 0.0;
    buzz->count = 0;
}

double kn_buzz_rms(const kn_buzz *buzz) { return buzz->count ? sqrt(buzz->sum / (double)buzz->count) : 0.0; }

double kn_turns_hysteresis_n(double resolution_n) { return 2.0 * (1.5 * resolution_n + KN_BUZZ_UNHEARD_N); }

void kn_turns_add(kn_turns *t, double value)
{
    // Let `gone` be the difference between the signal and its extreme value since the last reversal. If the signal
    // moves on in its direction, update the extreme value.
    double gone = value - t->extreme;
    if (t->up * gone > 0.0 || (t->up == 0 && t->hysteresis > fabs(gone))) {
        if (t->up) t->extreme = value;
        // If the signal has moved back from the extreme value by more than the hysteresis, count a reversal. The first
        // motion only sets the direction.
    } else if (fabs(gone) > t->hysteresis) {
        t->count += t->up != 0;
        t->up = gone > 0.0 ? 1 : -1;
        t->extreme = value;
    }
}

// The values of dough are those of a lattice edge in the project's first paper, for an area of 1 cm^2. The values of
// clay and jelly are chosen relative to dough.
// Columns: name, k1, c1, c2 at the force from_n, c2 at the force to_n, from_n, to_n.
const kn_lumped_object_def kn_lumped_objects[KN_LUMPED_OBJECTS] = {
    {"wall", 0, 0, 0, 0, 0, 0},
    {"dough", 188.0, 1000.0, 15700.0, 48.0, 0.044, 0.39},
    {"clay", 3000.0, 300.0, 2e5, 150.0, 0.5, 2.0},
    {"jelly", 50.0, 0.5, 0, 0, 0, 0},
    {"stiff-jelly", 1000.0, 2.0, 0, 0, 0, 0},
};

void kn_lumped_object_init(kn_lumped_object *pad, const kn_lumped_object_def *def)
{
    *pad = (kn_lumped_object){.def = *def};
}

// Return the damping c2 at this force. c2 falls exponentially from c2_n_s_m at from_n to c2_least_n_s_m at to_n.
static double c2_of(const kn_lumped_object_def *d, double force_n)
{
    if (d->c2_n_s_m == 0.0) return INFINITY;
    double share = fmin(fmax((force_n - d->from_n) / (d->to_n - d->from_n), 0.0), 1.0);
    return d->c2_n_s_m * pow(d->c2_least_n_s_m / d->c2_n_s_m, share);
}

// Solve F (1 + G/A + G/c2(F)) = Q + G H/A for the contact force F (symbols: see haptic_loop.h). The left side grows
// with F, so bisection finds the root. 50 halvings reach the precision of a double.
static double meet(const kn_lumped_object_def *d, double q, double g, double h, double a)
{
    double target = q + g * h / a;
    // Without c2, and for F <= 0, the equation is linear.
    if (d->c2_n_s_m == 0.0 || target <= 0.0) return target / (1.0 + g / a);
    double low = 0.0, high = target;
    for (int i = 0; i < 50; i++) {
        double mid = 0.5 * (low + high);
        if (mid * (1.0 + g / a + g / c2_of(d, mid)) < target) low = mid;
        else high = mid;
    }
    return 0.5 * (low + high);
}

double kn_lumped_object_tick(kn_lumped_object *pad, const kn_coupling *coupling, double dt_s, double depth_m,
                             double speed_m_s)
{
    const kn_lumped_object_def *d = &pad->def;
    bool wall = d->k1_n_m == 0.0 && d->c1_n_s_m == 0.0;
    // A wall has an infinite A (symbol of haptic_loop.h), so the Voigt element of a wall never moves.
    double a = wall ? INFINITY : d->c1_n_s_m + dt_s * d->k1_n_m, h = d->k1_n_m * pad->voigt_m;
    // Compute the depth of the device below the deformed surface, and the terms Q and G of the force law F = Q - G w in
    // haptic_loop.h.
    double out_m = depth_m - pad->voigt_m - pad->flow_m;
    double q = coupling->stiffness_n_m * out_m + coupling->damping_n_s_m * speed_m_s;
    double g = coupling->damping_n_s_m + dt_s * coupling->stiffness_n_m;
    // Contact begins when the device is below the surface. Contact then lasts until the force is zero, even if the
    // device is above the surface, because the coupling's damper can still press.
    double force = out_m > 0.0 || pad->touching ? meet(d, q, g, h, a) : 0.0;
    // A negative contact force would pull the tool into the pad, so contact ends instead.
    pad->force_n = fmax(force, 0.0);
    pad->touching = pad->force_n > 0.0;
    // Implicit Euler step: the Voigt element and the damper c2 move with the force at the end of the step.
    pad->voigt_m += dt_s * (pad->force_n - h) / a;
    pad->flow_m += dt_s * pad->force_n / c2_of(d, pad->force_n);
    return pad->force_n;
}

double kn_lumped_object_stored_j(const kn_lumped_object *pad)
{
    return 0.5 * pad->def.k1_n_m * pad->voigt_m * pad->voigt_m;
}

double kn_lumped_object_touch(void *contact, const double position_m[3], const double velocity_m_s[3],
                              double force_n[3])
{
    kn_lumped_object_contact *c = contact;
    force_n[0] = force_n[1] = 0.0;
    force_n[2] = kn_lumped_object_tick(&c->pad, &c->coupling, 1e-3, -position_m[2], -velocity_m_s[2]);
    return kn_lumped_object_stored_j(&c->pad);
}

// Return the first tool that can be coupled to a device, or the tool `name` if a name is given. A plate cannot be
// coupled. Return NULL if no tool fits.
static const kn_probe_def *find_tool(const kn_model_def *def, const char *name)
{
    for (int i = 0; i < def->probe_count; i++) {
        bool coupled = def->probe[i].shape != KN_PROBE_PLATE;
        if (coupled && (!name || !strcmp(name, def->probe[i].name))) return &def->probe[i];
    }
    return NULL;
}

// Find the height at which the tool first touches the object, by bisection between a point far above the object and the
// object's middle.
static double touch_height(const kn_lattice_object *slab, const kn_model_def *def)
{
    double extent_m[3], at_m[3] = {0.0};
    const double level[4] = {1.0, 0.0, 0.0, 0.0};
    kn_model_def_extent(def, extent_m);
    double inside_m = 0.5 * extent_m[2], clear_m = extent_m[2] + 1.0;
    for (int i = 0; i < 40; i++) {
        at_m[2] = 0.5 * (inside_m + clear_m);
        if (kn_clearance(slab->model, slab->state, 0, at_m, level) > 0.0) clear_m = at_m[2];
        else inside_m = at_m[2];
    }
    return clear_m;
}

bool kn_lattice_object_open(kn_lattice_object *slab, const kn_scene *scene, const char *tool,
                            const kn_coupling *coupling, char *error, size_t error_size)
{
    kn_model_def def = scene->model;
    const kn_probe_def *probe = find_tool(&scene->model, tool);
    memset(slab, 0, sizeof *slab);
    if (!probe) {
        snprintf(error, error_size, "%s has no tool%s%s that can be coupled to a device", scene->name, tool ? " " : "",
                 tool ? tool : "");
        return false;
    }
    // The model gets only this tool, with the coupling that the caller tests.
    def.probe[0] = *probe;
    def.probe[0].coupling_n_m = coupling->stiffness_n_m;
    def.probe[0].coupling_n_s_m = coupling->damping_n_s_m;
    def.probe_count = 1;
    slab->model = kn_model_build(&def, error, error_size);
    slab->state = slab->model ? kn_state_create(slab->model) : NULL;
    slab->scratch = slab->model ? kn_scratch_create(slab->model) : NULL;
    if (!slab->state || !slab->scratch) {
        if (slab->model) snprintf(error, error_size, "out of memory");
        kn_lattice_object_close(slab);
        return false;
    }
    slab->touch_m = touch_height(slab, &def);
    slab->input.probe[0].attached = true;
    slab->input.probe[0].orientation_wxyz[0] = 1.0;
    return true;
}

void kn_lattice_object_close(kn_lattice_object *slab)
{
    kn_state_destroy(slab->state);
    kn_scratch_destroy(slab->scratch);
    kn_model_destroy(slab->model);
    slab->state = NULL;
    slab->scratch = NULL;
    slab->model = NULL;
}

double kn_lattice_object_touch(void *self, const double position_m[3], const double velocity_m_s[3], double force_n[3])
{
    kn_lattice_object *slab = self;
    kn_probe_input *in = &slab->input.probe[0];
    memcpy(in->position_m, position_m, sizeof in->position_m);
    memcpy(in->velocity_m_s, velocity_m_s, sizeof in->velocity_m_s);
    // Convert the height: the tool first touches the object at z = 0 in the simulated loop, but at z = touch_m in the
    // scene.
    in->position_m[2] += slab->touch_m;
    slab->diverged |= kn_step(slab->model, slab->state, slab->scratch, &slab->input, &slab->output) != KN_OK;
    memcpy(force_n, slab->output.probe[0].force_n, sizeof slab->output.probe[0].force_n);
    return -1.0;
}

// The smallest valid scene. Only the device of this scene is used; its model is never built.
static const char scene_text[] = "version: 1\nobject: {size: [1 cm, 1 cm, 1 cm], spacing: 1 cm}\nmaterial: jelly\n"
                                 "support: bonded\n";

int kn_device_profile_load(kn_device_def *device, const char *subcommand, const char *name, const char *const *sets,
                           int set_count)
{
    char profile[128], error[512] = "out of memory";
    const char **all = calloc((size_t)set_count + 1, sizeof *all);
    kn_scene *scene = NULL;
    // The name of the profile becomes the first --set of the small scene, and the user's texts of --set follow.
    snprintf(profile, sizeof profile, "device=%s", name);
    if (all) {
        all[0] = profile;
        for (int i = 0; i < set_count; i++) all[i + 1] = sets[i];
        scene = kn_scene_parse("device", scene_text, sizeof scene_text - 1, all, set_count + 1, error, sizeof error);
    }
    free(all);
    // The user did not write the first --set, so remove its text from the beginning of the error message.
    const char *own = "--set device: ";
    bool ours = strncmp(error, own, strlen(own)) == 0;
    if (!scene) return kn_complain(subcommand, KN_EXIT_USAGE, "%s", error + (ours ? strlen(own) : 0));
    *device = scene->device;
    kn_scene_destroy(scene);
    return KN_EXIT_OK;
}

#define PI 3.141592653589793
static const double period_s = 1e-3;
static const double lean_n = 1.0, press_n = 2.0, clear_m = 2e-3, tap_m = 0.01, tap_hz = 2.0;
static const double slide_m = 0.02, slide_m_s = 0.01, slide_from_s = 2.0, ramp_s = 0.05;
// A resting device buzzes if its vibration exceeds this value plus 1.5 encoder steps, m. The vibration is the root mean
// square of the part of the position above 10 Hz.
static const double unseen_m = 2e-6;

// Stiffness of the springs of arm and grip in series, N/m. To press with the force F against a wall, the intended path
// must lie below the surface of the wall by F / stiffness.
static const double give_n_m[KN_GRIPS] = {[KN_GRIP_LIGHT] = 75.0, [KN_GRIP_NORMAL] = 218.2, [KN_GRIP_FIRM] = 606.1};

// State of one simulated motion. way_n: forces on their way to the device, a ring of the last trip_ms + 1 periods.
typedef struct loop {
    const kn_haptic_loop_def *def;
    kn_held_device arm;
    kn_passivity passivity;
    double way_n[KN_HAPTIC_LOOP_TRIP_MAX_MS + 1][3];
    kn_buzz force, side, position;
    kn_turns turns, side_turns; // reversals of the force along z (turns) and along x (side_turns)
    double stroke_j;            // energy given to the hand until the present stroke began
    bool air;
    kn_haptic_loop_result result;
} loop;

// Compute the position along x of a slide: at rest until slide_from_s, then accelerated to slide_m_s within ramp_s.
static void slide_along(double t_s, double *x_m, double *speed_m_s)
{
    double since_s = fmax(0.0, t_s - slide_from_s), early_s = fmin(since_s, ramp_s);
    *speed_m_s = slide_m_s * early_s / ramp_s;
    *x_m = -0.5 * slide_m + 0.5 * *speed_m_s * early_s + slide_m_s * (since_s - early_s);
}

// Compute position and velocity at a time on the path that the hand intends.
static void path_at(const kn_haptic_loop_def *def, double t_s, double path_m[3], double path_m_s[3])
{
    double depth_m = def->arm.grip == KN_GRIP_NONE ? 0.0 : press_n / give_n_m[def->arm.grip];
    double w = def->motion == KN_HAPTIC_LOOP_TAP ? 2.0 * PI * tap_hz : PI, swing_m = 0.5 * (clear_m + depth_m);
    memset(path_m, 0, 3 * sizeof *path_m);
    memset(path_m_s, 0, 3 * sizeof *path_m_s);
    if (def->motion == KN_HAPTIC_LOOP_SLIDE) slide_along(t_s, &path_m[0], &path_m_s[0]);
    if (def->motion == KN_HAPTIC_LOOP_LEAN) return;
    if (def->motion == KN_HAPTIC_LOOP_TAP) {
        path_m[2] = tap_m * cos(w * t_s);
        path_m_s[2] = -tap_m * w * sin(w * t_s);
        // In a press, the hand moves down along half a cosine period within 1 s, then stays down.
    } else if (t_s >= 1.0) {
        path_m[2] = -depth_m;
    } else {
        path_m[2] = clear_m - swing_m * (1.0 - cos(w * t_s));
        path_m_s[2] = -swing_m * w * sin(w * t_s);
    }
}

// Set up device, hand and link, at rest at the beginning of the motion.
static void start(loop *l, const kn_haptic_loop_def *def)
{
    kn_held_device_def arm = def->arm;
    double speed_m_s[3], at_m[3];
    path_at(def, 0.0, at_m, speed_m_s);
    memset(l, 0, sizeof *l);
    l->def = def;
    if (def->motion == KN_HAPTIC_LOOP_LEAN) arm.bias_n[2] = -lean_n;
    kn_held_device_init(&l->arm, &arm, at_m);
    l->result.resolution_n = kn_held_device_resolution_n(&l->arm, &def->coupling);
    l->side_turns.hysteresis = l->turns.hysteresis = kn_turns_hysteresis_n(l->result.resolution_n);
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

// Update the results after one period. A stroke lasts from one period in the air (without force) to the next. The
// energy given in a stroke is the increase of the total energy given to the hand.
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
static bool tick(loop *l, int n, kn_haptic_loop_object *object, void *self)
{
    const kn_haptic_loop_def *def = l->def;
    double path_m[3], path_m_s[3], out_n[3];
    // The object writes its force into the ring buffer, and the oldest force in the buffer arrives at the device.
    double *slot = l->way_n[n % (def->trip_ms + 1)], *wanted_n = l->way_n[(n + 1) % (def->trip_ms + 1)];
    double stored_j = object(self, l->arm.position_m, l->arm.velocity_m_s, slot);
    // The passivity controller always computes its force, which is used only if def->passivity is set.
    kn_passivity_filter(&l->passivity, l->arm.position_m, l->arm.velocity_m_s, stored_j, wanted_n, out_n);
    path_at(def, n * period_s, path_m, path_m_s);
    kn_held_device_tick(&l->arm, def->passivity ? out_n : wanted_n, path_m, path_m_s);
    kn_passivity_sent(&l->passivity, l->arm.force_n);
    account(l);
    return isfinite(l->arm.x_m[2]) && fabs(l->arm.x_m[2]) < 1.0;
}

// Reset the filters and counters, so that only the motion from now on is judged.
static void judge_from_here(loop *l)
{
    kn_buzz_reset(&l->force);
    kn_buzz_reset(&l->side);
    kn_buzz_reset(&l->position);
    l->turns.count = l->side_turns.count = 0;
}

kn_haptic_loop_result kn_haptic_loop_run(const kn_haptic_loop_def *def, kn_haptic_loop_object *object, void *self)
{
    loop l;
    start(&l, def);
    kn_haptic_loop_result *r = &l.result;
    bool tap = def->motion == KN_HAPTIC_LOOP_TAP;
    int ticks = tap ? 5000 : 4000;
    r->finite = true;
    for (int n = 0; n < ticks && r->finite; n++) {
        if (n == ticks - 1000 && !tap) judge_from_here(&l);
        r->finite = tick(&l, n, object, self);
    }
    r->force_rms_n = kn_buzz_rms(&l.force);
    if (def->motion == KN_HAPTIC_LOOP_SLIDE) r->force_rms_n = fmax(r->force_rms_n, kn_buzz_rms(&l.side));
    r->position_rms_m = kn_buzz_rms(&l.position);
    r->turns = r->strokes ? (double)l.turns.count / r->strokes : 0.0;
    r->acted = l.passivity.acted;
    // Decide whether the loop buzzes, by the bounds in haptic_loop.h.
    bool rough = r->force_rms_n > 1.5 * r->resolution_n + KN_BUZZ_UNHEARD_N ||
                 r->position_rms_m > 1.5 * l.arm.def.encoder_m + unseen_m;
    bool slide = def->motion == KN_HAPTIC_LOOP_SLIDE;
    if (slide) r->turns = fmax(l.turns.count, l.side_turns.count);
    r->buzzes = !r->finite || (tap ? r->turns > KN_HAPTIC_LOOP_TURNS : slide ? r->turns > 2.0 * KN_BUZZ_HZ : rough);
    return *r;
}
