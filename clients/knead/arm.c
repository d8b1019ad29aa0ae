#include "clients/knead/arm.h"
#include <math.h>
#include <string.h>

// Integration steps per period. With a period of 1 ms a step is 50 us. That is 1/90 of sqrt(m / k), where m is the mass
// of the lightest device and k the stiffness of the firmest grip.
#define SUBSTEPS 20
#define TAU 6.283185307179586

// Parameters of a person: grip spring and damper, hand mass, arm spring and damper. See the table in arm.h.
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

kn_arm_def kn_arm_of(const kn_device_def *device)
{
    return (kn_arm_def){.mass_kg = device->mass_kg,
                        .damping_n_s_m = device->damping_n_s_m,
                        .coulomb_n = device->friction_n,
                        .encoder_m = device->encoder_m,
                        .force_limit_n = device->force_limit_n};
}

// Return the position rounded to the encoder step. A step of 0 means an exact encoder.
static double read_encoder(const kn_arm_def *def, double x_m)
{
    return def->encoder_m > 0.0 ? def->encoder_m * round(x_m / def->encoder_m) : x_m;
}

void kn_arm_init(kn_arm *arm, const kn_arm_def *def, const double at_m[3])
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

static double norm(const double v[3]) { return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

// Scale the commanded force down to the force limit. The direction is kept.
static void saturate(kn_arm *arm, const double force_n[3])
{
    double size = norm(force_n), limit = arm->def.force_limit_n;
    double share = limit > 0.0 && size > limit ? limit / size : 1.0;
    for (int k = 0; k < 3; k++) arm->force_n[k] = share * force_n[k];
}

// Compute the velocities at the end of a sub-step from the forces at its beginning. Coulomb friction acts last and
// implicitly: a slow device stops instead of moving back and forth.
static void push(kn_arm *arm, const double path_m[3], const double path_m_s[3], double dt)
{
    const kn_arm_def *d = &arm->def;
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
    // Coulomb friction reduces the speed by a fixed amount per sub-step, at most to zero, so it never reverses the
    // motion.
    double speed = norm(arm->v_m_s), lost = dt * d->coulomb_n / d->mass_kg;
    for (int k = 0; k < 3 && lost > 0.0; k++) arm->v_m_s[k] *= speed > lost ? 1.0 - lost / speed : 0.0;
}

// Set x and y of the device to the intended path if the device moves freely along z only.
static void guide(kn_arm *arm, const double path_m[3], const double path_m_s[3])
{
    for (int k = 0; k < 2 && arm->def.axes == 1; k++) {
        arm->x_m[k] = arm->hand_m[k] = path_m[k];
        arm->v_m_s[k] = arm->hand_m_s[k] = path_m_s[k];
    }
}

void kn_arm_tick(kn_arm *arm, const double force_n[3], const double path_m[3], const double path_m_s[3])
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
    // Sample the encoder and update the measured velocity. `share` is the weight of the newest difference in the
    // first-order low-pass.
    double share = -expm1(-TAU * arm->def.velocity_hz * period);
    for (int k = 0; k < 3; k++) {
        double next_m = read_encoder(&arm->def, arm->x_m[k]);
        arm->velocity_m_s[k] += share * ((next_m - arm->position_m[k]) / period - arm->velocity_m_s[k]);
        arm->position_m[k] = next_m;
    }
}
