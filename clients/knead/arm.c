#include "clients/knead/arm.h"
#include <math.h>
#include <string.h>

#define SUBSTEPS 20 // of 1 ms: 50 us, a 90th of sqrt(m / k) of the lightest device in the firmest grip
#define TAU 6.283185307179586

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

static double read_encoder(const kn_arm_def *def, double x_m)
{
    return def->encoder_m > 0.0 ? def->encoder_m * round(x_m / def->encoder_m) : x_m;
}

void kn_arm_init(kn_arm *arm, const kn_arm_def *def, const double at_m[3])
{
    memset(arm, 0, sizeof *arm);
    arm->def = *def;
    if (!(arm->def.period_s > 0.0)) arm->def.period_s = 1e-3;
    if (!(arm->def.velocity_hz > 0.0)) arm->def.velocity_hz = 100.0;
    if (arm->def.axes != 1) arm->def.axes = 3;
    for (int k = 0; k < 3; k++) {
        arm->x_m[k] = arm->hand_m[k] = at_m[k];
        arm->position_m[k] = read_encoder(def, at_m[k]);
    }
}

static double norm(const double v[3]) { return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

static void saturate(kn_arm *arm, const double force_n[3])
{
    double size = norm(force_n), limit = arm->def.force_limit_n;
    double share = limit > 0.0 && size > limit ? limit / size : 1.0;
    for (int k = 0; k < 3; k++) arm->force_n[k] = share * force_n[k];
}

// Velocities at the end of a sub-step from the forces at its beginning; friction last and implicit, so that what is
// slow stops instead of turning back and forth.
static void push(kn_arm *arm, const double path_m[3], const double path_m_s[3], double dt)
{
    const kn_arm_def *d = &arm->def;
    const hand *h = &hands[d->grip];
    for (int k = 0; k < 3; k++) {
        double grip = h->grip_n_m * (arm->hand_m[k] - arm->x_m[k]) + h->grip_n_s_m * (arm->hand_m_s[k] - arm->v_m_s[k]);
        double pull = h->arm_n_m * (path_m[k] - arm->hand_m[k]) + h->arm_n_s_m * (path_m_s[k] - arm->hand_m_s[k]);
        double free = arm->v_m_s[k] + dt / d->mass_kg * (arm->force_n[k] + d->bias_n[k] + grip);
        arm->v_m_s[k] = free / (1.0 + dt * d->damping_n_s_m / d->mass_kg);
        if (h->mass_kg > 0.0) arm->hand_m_s[k] += dt / h->mass_kg * (pull - grip);
    }
    double speed = norm(arm->v_m_s), lost = dt * d->coulomb_n / d->mass_kg;
    for (int k = 0; k < 3 && lost > 0.0; k++) arm->v_m_s[k] *= speed > lost ? 1.0 - lost / speed : 0.0;
}

// x, y of a device that moves along z alone.
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
    for (int step = 1; step <= SUBSTEPS; step++) {
        for (int k = 0; k < 3; k++) target_m[k] = path_m[k] + step * dt * path_m_s[k];
        push(arm, target_m, path_m_s, dt);
        for (int k = 0; k < 3; k++) {
            arm->x_m[k] += dt * arm->v_m_s[k];
            arm->hand_m[k] += dt * arm->hand_m_s[k];
        }
        guide(arm, target_m, path_m_s);
    }
    double share = -expm1(-TAU * arm->def.velocity_hz * period); // of the newest difference
    for (int k = 0; k < 3; k++) {
        double next_m = read_encoder(&arm->def, arm->x_m[k]);
        arm->velocity_m_s[k] += share * ((next_m - arm->position_m[k]) / period - arm->velocity_m_s[k]);
        arm->position_m[k] = next_m;
    }
}
