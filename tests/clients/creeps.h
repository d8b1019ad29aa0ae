#ifndef KN_TESTS_CREEPS_H
#define KN_TESTS_CREEPS_H
// Creep curves of the first paper's dough, computed by core/network.h, with noise: 60 s under a load, then 70 s
// without.
#include "clients/identify/measured_curve.h"
#include "core/network.h"
#include "tests/dice.h"
#include "tests/dough.h"
#include <stdlib.h>
#include <string.h>

static uint64_t creeps_seed = 20261123;

// Return a curve without noise. every_s: time between readings. Release the curve with creeps_free.
static kn_curve creeps_of(const kn_material *material, double load_gf, double loaded_s, double rest_s, double every_s)
{
    kn_network net = kn_network_of(material);
    kn_network_state s = {0};
    kn_drive d = {.kind = KN_DRIVE_LOAD, .value = load_gf * GF_CM2};
    kn_curve c = {
        .kind = KN_CURVE_CREEP,
        .file = "creep.csv",
        .steps = rest_s > 0 ? 2 : 1,
        .step = {{.stress_pa = load_gf * GF_CM2}, {.time_s = loaded_s, .early_s = loaded_s, .late_s = loaded_s}},
        .height_m = 0.01,
        .area_m2 = 1e-4};
    size_t count = (size_t)((loaded_s + rest_s) / every_s + 0.5);
    snprintf(c.name, sizeof c.name, "%g gf", load_gf);
    c.count = (int)count;
    c.time_s = calloc(3 * count, sizeof *c.time_s);
    c.value = c.time_s + count;
    c.weight = c.value + count;
    c.line = calloc(count, sizeof *c.line);
    kn_network_jump(&net, &s, &d);
    for (int i = 0; i < c.count; i++) {
        double t = every_s * (i + 1);
        if (d.value > 0 && t > loaded_s + 1e-9) {
            kn_network_advance(&net, &s, &d, loaded_s, 1e-10);
            d.value = 0;
            kn_network_jump(&net, &s, &d);
        }
        kn_network_advance(&net, &s, &d, t, 1e-10);
        c.time_s[i] = t;
        c.value[i] = s.strain;
        c.weight[i] = 1;
        c.line[i] = i + 2;
    }
    c.noise = kn_curve_noise(c.count, c.time_s, c.value);
    return c;
}

static void creeps_free(kn_curve *c)
{
    free(c->time_s);
    free(c->line);
}

// Copy `from` to `to` and add noise of the given share of the largest strain. Both curves have the same count.
static void creeps_noise(kn_curve *to, const kn_curve *from, double share)
{
    double most = 0;
    for (int i = 0; i < from->count; i++) most = fmax(most, from->value[i]);
    for (int i = 0; i < from->count; i++) to->value[i] = from->value[i] + share * most * kn_dice_normal(&creeps_seed);
    to->noise = kn_curve_noise(to->count, to->time_s, to->value);
}

#endif
