#include "core/passivity.h"
#include "core/algebra/algebra.h"
#include <math.h>
#include <string.h>

// largest default of the damping a_max: stronger damping feels sticky, and oscillates over a simulated 10 ms link
static const double damping_ceiling_n_s_m = 10.0;
static const double forgiving_s = 0.1;
// least limit of the credit if the stored energy is unknown, J; jelly returns 3 to 6 mJ, which must not be damped
static const double unknown_cap_j = 5e-3;
#define TAU 6.283185307179586

void kn_passivity_init(kn_passivity *p, const kn_passivity_def *def)
{
    memset(p, 0, sizeof *p);
    p->def = *def;
    kn_passivity_def *d = &p->def;
    if (!(d->period_s > 0.0)) d->period_s = 1e-3;
    if (!(d->velocity_hz > 0.0)) d->velocity_hz = 100.0;
    if (!(d->reserve_j > 0.0)) d->reserve_j = 1e-3;
    // a damper stronger than mass / (2 late_s) would give energy to the hand, because the velocity is late
    double late_s = d->period_s + d->round_trip_s + 1.0 / (TAU * d->velocity_hz);
    if (!(d->damping_max_n_s_m > 0.0)) d->damping_max_n_s_m = fmin(damping_ceiling_n_s_m, d->mass_kg / (2.0 * late_s));
}

// Return the largest credit, J: the energy that coupling and object store, plus the reserve.
static double cap(const kn_passivity *p, double stored_j, const double wanted_n[3])
{
    const kn_passivity_def *d = &p->def;
    if (!(stored_j >= 0.0)) return fmax(unknown_cap_j, d->force_limit_n * d->force_limit_n / d->coupling_n_m);
    double force2 = fmin(kn_dot(wanted_n, wanted_n), d->force_limit_n * d->force_limit_n);
    return force2 / (2.0 * d->coupling_n_m) + stored_j + d->reserve_j;
}

// Return the largest error that the encoder's step may cause in the work of the last period, J.
static double unseen(const kn_passivity *p)
{
    double change = 0.0;
    for (int k = 0; k < 3; k++) change += fabs(p->force_n[k] - p->before_n[k]);
    return p->running ? 0.5 * p->def.encoder_m * change : 0.0;
}

// Add the work of the last period to the account. The force was held while the position moved.
static void observe(kn_passivity *p, const double position_m[3])
{
    if (!isfinite(kn_dot(position_m, position_m))) return;
    double moved[3];
    for (int k = 0; k < 3; k++) moved[k] = position_m[k] - p->position_m[k];
    double given = p->running ? kn_dot(p->force_n, moved) : 0.0;
    p->given_j += given;
    p->credit_j -= given - unseen(p);
    memcpy(p->position_m, position_m, sizeof p->position_m);
    p->running = true;
}

// Let a debt fade for one period. Debts fade only while the wanted force is 0.
static void forgive(kn_passivity *p)
{
    double paid = p->credit_j * -expm1(-p->def.period_s / forgiving_s);
    p->credit_j -= paid;
    p->forgiven_j -= paid;
}

bool kn_passivity_filter(kn_passivity *p, const double position_m[3], const double velocity_m_s[3], double stored_j,
                         const double wanted_n[3], double out_n[3])
{
    const kn_passivity_def *d = &p->def;
    // observe: add the work and limit the credit
    observe(p, position_m);
    p->credit_j = fmin(p->credit_j, cap(p, stored_j, wanted_n));
    bool air = kn_dot(wanted_n, wanted_n) == 0.0;
    if (air && p->credit_j < 0.0) forgive(p);

    // damp: choose the damping that repays a debt within this period, but at most damping_max_n_s_m
    double speed2 = kn_dot(velocity_m_s, velocity_m_s), a = 0.0;
    if (!air && p->credit_j < 0.0 && speed2 > 0.0)
        a = fmin(d->damping_max_n_s_m, -p->credit_j / (d->period_s * speed2));
    p->damping_n_s_m = a;
    p->acted += a > 0.0;
    for (int k = 0; k < 3; k++) out_n[k] = wanted_n[k] - (a > 0.0 ? a * velocity_m_s[k] : 0.0);
    return a > 0.0;
}

void kn_passivity_sent(kn_passivity *p, const double force_n[3])
{
    memcpy(p->before_n, p->force_n, sizeof p->before_n);
    memcpy(p->force_n, force_n, sizeof p->force_n);
}
