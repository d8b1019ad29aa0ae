#ifndef KN_TESTS_MADE_H
#define KN_TESTS_MADE_H
// Curves that a test makes: the response of a network to drives that follow each other, or reading by reading.
#include "clients/identify/measured_curve.h"
#include "core/network.h"
#include "tests/check.h"
#include "tests/dice.h"
#include "tests/dough.h"

// Data sets on which the night judges the intervals of a fit. These statistics are arithmetic: release judges them, and
// the checked build only looks at the memory of a few fits.
#if defined(KN_SANITIZED)
enum { NIGHT_SETS = 10 };
#else
enum { NIGHT_SETS = 200 };
#endif

static uint64_t seed = 1; // of all noise

// Compute the response at `count` times to drives, each of which begins at its start_s. A reading at the time of a new
// drive belongs before it. stress_pa or strain may be NULL.
static inline void respond(const kn_network *net, int drives, const kn_drive *drive, double tolerance, int count,
                           const double *time_s, double *stress_pa, double *strain)
{
    kn_network_state at = {0};
    for (int i = 0, next = 0; i < count; i++) {
        for (; next < drives && drive[next].start_s < time_s[i] - 1e-9; next++) {
            if (next > 0) CHECK(kn_network_advance(net, &at, &drive[next - 1], drive[next].start_s, tolerance));
            CHECK(kn_network_jump(net, &at, &drive[next]));
        }
        if (next > 0) CHECK(kn_network_advance(net, &at, &drive[next - 1], time_s[i], tolerance));
        if (stress_pa) stress_pa[i] = at.stress_pa;
        if (strain) strain[i] = at.strain;
    }
}

// Return a curve with room for its readings; kn_curve_free releases it.
static inline kn_curve curve_make(kn_curve_kind kind, int count)
{
    kn_curve c = {.kind = kind, .name = "made", .file = "made.csv", .count = count, .noise = 1};
    c.time_s = calloc((size_t)count, sizeof *c.time_s);
    c.value = calloc((size_t)count, sizeof *c.value);
    c.weight = calloc((size_t)count, sizeof *c.weight);
    c.line = calloc((size_t)count, sizeof *c.line);
    for (int i = 0; i < count; i++) c.weight[i] = 1, c.line[i] = i + 2;
    return c;
}

static inline double curve_largest(const kn_curve *c)
{
    double most = 0;
    for (int i = 0; i < c->count; i++) most = fmax(most, c->value[i]);
    return most;
}

// Return a creep under a load, taken off after loaded_s, with `count` readings.
static inline kn_curve curve_creep(const kn_network *net, double load_pa, double loaded_s, int count, double every_s)
{
    const kn_drive drive[] = {{.kind = KN_DRIVE_LOAD, .value = load_pa}, {.kind = KN_DRIVE_LOAD, .start_s = loaded_s}};
    kn_curve c = curve_make(KN_CURVE_CREEP, count);
    c.steps = every_s * count > loaded_s ? 2 : 1;
    c.step[0].stress_pa = load_pa;
    c.step[1] = (kn_curve_step){.time_s = loaded_s, .early_s = loaded_s, .late_s = loaded_s};
    for (int i = 0; i < count; i++) c.time_s[i] = every_s * (i + 1);
    respond(net, c.steps, drive, 1e-10, count, c.time_s, NULL, c.value);
    return c;
}

// Return a relaxation after a rise to this strain in rise_s; 0: a step. Readings: count, from first_s after the rise
// on, so many in each decade of time.
static inline kn_curve curve_hold(const kn_network *net, double strain, double rise_s, int count, double first_s,
                                  double each_decade)
{
    const kn_drive drive[] = {{.kind = KN_DRIVE_STRAIN, .rate_per_s = strain / rise_s},
                              {.kind = KN_DRIVE_STRAIN, .value = strain, .start_s = rise_s}};
    const int step = rise_s == 0;
    kn_curve c = curve_make(KN_CURVE_RELAX, count);
    c.strain = strain;
    for (int i = 0; i < count; i++) c.time_s[i] = rise_s + first_s * pow(10, i / each_decade);
    respond(net, 2 - step, drive + step, 1e-10, count, c.time_s, c.value, NULL);
    for (int i = 0; i < count; i++) c.time_s[i] -= rise_s;
    return c;
}

// Set the values of `to` to those of `from` with noise: a share of the largest value, and a share of each value.
static inline void curve_noise(kn_curve *to, const kn_curve *from, double of_largest, double of_each)
{
    const double size = of_largest * curve_largest(from);
    for (int i = 0; i < from->count; i++)
        to->value[i] = from->value[i] + (size + of_each * from->value[i]) * kn_dice_normal(&seed);
}

#endif
