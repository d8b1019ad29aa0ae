#ifndef KN_TESTS_PRESSER_H
#define KN_TESTS_PRESSER_H
// A simulated device in a rigid hand, on the bridge of `knead hand`. It presses a block of 3 cm again and again, with
// a ball of 15 mm as probe, and lifts the tool when it is not let in. rules.h judges the force of its motors in each
// millisecond of its own clock.
#include "clients/tactile/bridge.h"
#include "tests/tactile/rules.h"

static const double kn_presser_top_m = 0.053;

typedef struct kn_presser {
    kn_tactile base;
    kn_bridge *bridge;
    kn_tactile_pose pose;
    kn_given now; // the current tick's force and news
    bool live;    // the motors are on
    int64_t heard;
    kn_rules rules;
    int engaged_ms, away_ms;
} kn_presser;

static inline bool kn_presser_open(kn_tactile *device, kn_bridge *bridge, char *error, size_t error_size)
{
    (void)error, (void)error_size;
    ((kn_presser *)device)->bridge = bridge;
    return true;
}

static inline void kn_presser_close(kn_tactile *device) { (void)device; }

static inline double kn_presser_wanted_m(const kn_presser *p) // press for 1.5 s of every 2 s
{
    int ms = p->engaged_ms % 2000;
    if (p->engaged_ms == 0 || ms >= 1500) return kn_presser_top_m;
    return 0.0385 + 1.5e-3 * sin(6.283185307179586 * 2e-3 * ms);
}

static inline double kn_presser_clamp(double x, double limit) { return fmax(-limit, fmin(limit, x)); }

static inline void kn_presser_tick(kn_tactile *device, int elapsed_ms)
{
    kn_presser *p = (kn_presser *)device;
    const kn_device_session *t = &p->bridge->now.session;
    p->now.came = t->heard - p->heard;
    if (p->now.ms > 0) kn_rules_take(&p->rules, &p->now);
    p->now.ms = elapsed_ms;
    p->now.heard = p->now.came;
    p->now.flags = t->flags;
    p->heard = t->heard;

    bool in =
        t->mode == KN_SESSION_HELD && (t->flags & (KN_FLAG_ENGAGED | KN_FLAG_RAMPING)) && !(t->flags & KN_FLAG_LATCHED);
    p->away_ms = in ? 0 : p->away_ms + 1;
    if (in) p->engaged_ms++;
    if (p->away_ms > 50) p->engaged_ms = 0; // lift and wait to be let in again
    double *z_m = &p->pose.position_m[2], *v_m_s = &p->pose.velocity_m_s[2];
    // follow the wanted height at 30 rad/s
    double a_m_s2 = 30.0 * (30.0 * (kn_presser_wanted_m(p) - *z_m) - 2.0 * *v_m_s);
    *v_m_s = kn_presser_clamp(*v_m_s + 1e-3 * kn_presser_clamp(a_m_s2, 3.0), 0.15); // clamped to 3 m/s^2 and 0.15 m/s
    *z_m += 1e-3 * *v_m_s;
    kn_bridge_moved(p->bridge, &p->pose);
}

static inline void kn_presser_give(kn_tactile *device, const double force_n[3], bool live)
{
    kn_presser *p = (kn_presser *)device;
    for (int i = 0; i < 3; i++) p->now.force_n[i] = live ? force_n[i] : 0.0;
    p->live = live;
}

// Start at x_m. render: the definition used by the bridge.
static inline void kn_presser_init(kn_presser *p, double x_m, const kn_haptic_render_def *render)
{
    *p = (kn_presser){.base = {.name = "presser",
                               .open = kn_presser_open,
                               .close = kn_presser_close,
                               .tick = kn_presser_tick,
                               .give = kn_presser_give},
                      .pose = {.position_m = {x_m, 0, kn_presser_top_m}, .orientation_wxyz = {1}}};
    p->rules = (kn_rules){.of = render->local ? KN_JUDGED_LOCAL : KN_JUDGED_FORCES,
                          .clamp_n = render->device.force_limit_n,
                          .guard_n_per_ms = 4};
}

#endif
