// rules LOG PROBE CLAMP GUARD: whether the forces of a log keep the rules of core/safety.h, in numbers:
//
//     forces N fresh N cycles N, over_clamp N over_guard N over_slope N late_zero N: ticks that break a rule
//     largest F steepest_contact F steepest_transition F                             N; N per ms
//
// fresh: with a new pose; cycles: those that were missed, too. In contact a tick may differ from the one before by
// guard per ms since the last pose, 3 ms at most, and the rise of the gain; every other one, fading, stale, braking, by
// max(0.5 N, clamp/17) per ms. late_zero: 20 ms after the last pose or later, and yet a force.
#include "proto/knead_contact_force_t.h"
#include <inttypes.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define TRANSITION                                                                                                     \
    (KNEAD_CONTACT_FORCE_T_FLAG_LATCHED | KNEAD_CONTACT_FORCE_T_FLAG_STALE | KNEAD_CONTACT_FORCE_T_FLAG_BRAKE |        \
     KNEAD_CONTACT_FORCE_T_FLAG_STOPPING)

static double clamp_n, guard_n, largest_n, contact_n, transition_n;
static int64_t forces, fresh, over_clamp, over_guard, over_slope, late_zero, tick = -1, cycles;
static double last_n[3];
static int silent;

static double larger(double a, double b) { return a > b ? a : b; }

static void take(const knead_contact_force_t *f)
{
    double size = 0, step = 0, slope = larger(0.5, clamp_n / 17.0), ramp = clamp_n / 200.0 + 1e-9;
    int ms = tick < 0 ? 1 : (int)(f->tick - tick), gap = silent + ms, deadline = 20;
    bool stale = f->flags & KNEAD_CONTACT_FORCE_T_FLAG_STALE;
    for (int i = 0; i < 3; i++) {
        size += f->force_n[i] * f->force_n[i];
        step += (f->force_n[i] - last_n[i]) * (f->force_n[i] - last_n[i]);
        last_n[i] = f->force_n[i];
    }
    size = sqrt(size);
    step = sqrt(step);
    silent = stale ? gap : 0;
    forces++;
    fresh += !stale;
    cycles += ms;
    tick = f->tick;
    largest_n = larger(largest_n, size);
    over_clamp += !(size <= clamp_n + 1e-9);
    late_zero += silent >= deadline && size > 0;
    if (gap >= deadline) return; // the deadline wins over every slope
    if (f->flags & TRANSITION) {
        transition_n = larger(transition_n, step / ms);
        over_slope += !(step <= slope * ms + ramp);
        return;
    }
    double span = gap < 3 ? gap : 3;
    contact_n = larger(contact_n, step / span);
    over_guard += !(step <= guard_n * span + ramp);
}

int main(int argc, char **argv)
{
    lcm_eventlog_t *log = argc == 5 ? lcm_eventlog_create(argv[1], "r") : NULL;
    char channel[80];
    if (!log) return fprintf(stderr, "usage: rules LOG PROBE CLAMP GUARD\n"), 2;
    snprintf(channel, sizeof channel, "KNEAD_FORCE_%.60s", argv[2]);
    clamp_n = atof(argv[3]);
    guard_n = atof(argv[4]);
    for (lcm_eventlog_event_t *e; (e = lcm_eventlog_read_next_event(log)); lcm_eventlog_free_event(e)) {
        knead_contact_force_t f;
        if (!strcmp(e->channel, channel) && knead_contact_force_t_decode(e->data, 0, e->datalen, &f) >= 0) take(&f);
    }
    lcm_eventlog_destroy(log);
    printf("forces %" PRId64 " fresh %" PRId64 " cycles %" PRId64 " over_clamp %" PRId64 " over_guard %" PRId64
           " over_slope %" PRId64 " late_zero %" PRId64 "\n",
           forces, fresh, cycles, over_clamp, over_guard, over_slope, late_zero);
    printf("largest %.3f steepest_contact %.3f steepest_transition %.3f\n", largest_n, contact_n, transition_n);
    return 0;
}
