#ifndef KN_TESTS_RULES_H
#define KN_TESTS_RULES_H
// The rules of core/safety.h and clients/tactile/device_session.h, checked from one millisecond to the next. They apply
// to the forces that kneadd publishes, or to the force of a device's motors by the device's own clock.
//
//     contact      |change| <= guard per ms since the last news, for 3 ms at most: so long a force may be held
//     transition   |change| <= max(0.5 N, clamp/17) per ms: the force fades, or news are missing
//     deadline     0 N from 20 ms after the last news on, of the local model from 300
//
// Either change may be larger by clamp/200, the ramp of a hand that engages or hears again. News are poses for
// kneadd, and forces for a device.
#include "core/safety.h"
#include "proto/knead_contact_force_t.h"
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

typedef enum kn_judged { KN_JUDGED_SERVER, KN_JUDGED_FORCES, KN_JUDGED_LOCAL } kn_judged;

typedef struct kn_given { // the force of one tick
    int ms;               // ms since the tick before
    double force_n[3];
    int64_t heard; // news until this tick
    int64_t came;  // news until the next tick; by then the motors give the newest of them
    int32_t flags; // flags of the newest force
} kn_given;

typedef struct kn_rules {
    kn_judged of;
    double clamp_n, guard_n_per_ms;
    int64_t ticks, fresh, heard, pressed;                       // ms; ms with news; number of news; ms above 0.1 N
    int64_t over_clamp, over_guard, over_slope, after_deadline; // ticks that break a rule
    double largest_n, contact_n, transition_n;                  // largest force, N; steepest changes, N per ms
    int64_t outages, felt; // silences that lasted until the deadline; those that began with more than 0.1 N
    int zero_at;           // longest time of those silences until 0 N, ms
    // private
    double last_n[3], at_last_n;
    int silent, missing, at;
    int64_t tick; // tick of kneadd's last force
} kn_rules;

static inline double kn_rules_between(const double a[3], const double b[3])
{
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2]));
}

static inline void kn_rules_outage(kn_rules *r, const kn_given *g, double size_n, int deadline)
{
    if (g->heard) r->at_last_n = size_n, r->at = -1;
    else if (r->at < 0 && size_n == 0) r->at = r->silent;
    if (r->silent < deadline || r->silent - g->ms >= deadline) return;
    r->outages++;
    r->felt += r->at_last_n > 0.1;
    if (r->at < 0) r->zero_at = r->silent;
    else if (r->at_last_n > 0.1 && r->at > r->zero_at) r->zero_at = r->at;
}

static inline void kn_rules_take(kn_rules *r, const kn_given *g)
{
    bool server = r->of == KN_JUDGED_SERVER, local = r->of == KN_JUDGED_LOCAL;
    int deadline = local ? 300 : 20, gap = r->missing + g->ms; // gap: time since the last force that answers news
    double slope = fmax(0.5, r->clamp_n / 17), ramp = r->clamp_n / 200 + 1e-9;
    double size_n = kn_rules_between(g->force_n, (double[3]){0}), step_n = kn_rules_between(g->force_n, r->last_n);
    int32_t fades =
        KN_FLAG_LATCHED | KN_FLAG_BRAKE | KNEAD_CONTACT_FORCE_T_FLAG_STOPPING | (server ? KN_FLAG_STALE : 0);
    memcpy(r->last_n, g->force_n, sizeof r->last_n);
    r->silent = g->heard ? 0 : r->silent + g->ms;
    r->missing = g->came ? 0 : gap;
    r->ticks += g->ms;
    r->fresh += g->heard > 0;
    r->heard += g->heard;
    r->pressed += size_n > 0.1;
    r->largest_n = fmax(r->largest_n, size_n);
    r->over_clamp += !(size_n <= r->clamp_n + 1e-9);
    r->after_deadline += r->silent >= deadline && r->missing > 0 && size_n > 0;
    kn_rules_outage(r, g, size_n, deadline);
    if (local ? r->silent > 100 : (!server && r->missing > 3) || g->flags & fades) {
        int span = server || r->missing > 0 ? g->ms : gap;
        if (r->silent >= deadline) return; // the deadline has priority over the slopes
        r->over_slope += !(step_n <= slope * span + ramp);
        r->transition_n = fmax(r->transition_n, step_n / span);
    } else {
        int span = gap < 3 ? gap : 3;
        r->over_guard += !(step_n <= r->guard_n_per_ms * span + ramp);
        r->contact_n = fmax(r->contact_n, step_n / span);
    }
}

// Judge a KNEAD_FORCE message. Messages come in the order of their ticks.
static inline void kn_rules_force(kn_rules *r, const knead_contact_force_t *f)
{
    bool fresh = !(f->flags & KN_FLAG_STALE);
    bool goes_on = r->ticks > 0 && f->tick > r->tick; // otherwise this is the first force of a kneadd's life
    kn_given g = {.ms = goes_on ? (int)(f->tick - r->tick) : 1, .heard = fresh, .came = fresh, .flags = f->flags};
    memcpy(g.force_n, f->force_n, sizeof g.force_n);
    r->tick = f->tick;
    kn_rules_take(r, &g);
}

static inline int64_t kn_rules_broken(const kn_rules *r)
{
    return r->over_clamp + r->over_guard + r->over_slope + r->after_deadline;
}

static inline void kn_rules_print(const kn_rules *r)
{
    printf("ticks %lld fresh %lld heard %lld pressed %lld broken %lld: over_clamp %lld over_guard %lld over_slope %lld "
           "after_deadline %lld\nlargest %.3f steepest_contact %.3f steepest_transition %.3f outages %lld felt %lld "
           "zero_at %d\n",
           (long long)r->ticks, (long long)r->fresh, (long long)r->heard, (long long)r->pressed,
           (long long)kn_rules_broken(r), (long long)r->over_clamp, (long long)r->over_guard, (long long)r->over_slope,
           (long long)r->after_deadline, r->largest_n, r->contact_n, r->transition_n, (long long)r->outages,
           (long long)r->felt, r->zero_at);
}

#endif
