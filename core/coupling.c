#include "core/coupling.h"
#include <math.h>

// Ratio of the default k_vc to the bound with delay (core/coupling.h). The ratio is below 1 because the bound neglects
// the filter of the velocity and the steps of the encoder.
static const double share = 0.6;
// lag: largest b_vc (t_d + T + filter_s) / m, where filter_s is the delay of the filtered velocity. With a larger lag
// than 0.5 the damper reduces the stable k_vc. With a lag of 1.6 the damper itself oscillates.
static const double lag = 0.5, filter_s = 1.6e-3;

kn_coupling kn_coupling_default(double mass_kg, double damping_n_s_m, double period_s, double round_trip_s,
                                kn_coupling most)
{
    kn_coupling c;
    c.damping_n_s_m = fmin(most.damping_n_s_m, lag * mass_kg / (round_trip_s + period_s + filter_s));
    c.stiffness_n_m =
        fmin(most.stiffness_n_m, share * kn_coupling_delayed(damping_n_s_m, period_s, round_trip_s, c.damping_n_s_m));
    return c;
}

double kn_coupling_colgate(double damping_n_s_m, double period_s, double coupling_n_s_m)
{
    return fmax(0.0, 2.0 * (damping_n_s_m - fabs(coupling_n_s_m)) / period_s);
}

double kn_coupling_delayed(double damping_n_s_m, double period_s, double round_trip_s, double coupling_n_s_m)
{
    return (damping_n_s_m + coupling_n_s_m) / (0.5 * period_s + round_trip_s);
}
