#include "clients/identify/hold.h"
#include "clients/identify/special.h"
#include <math.h>

#define SMALL 1e-12 // if beta P is below this limit, exp(-beta P) counts as 1
enum { NEWTON_MAX = 60 };

// Return exp(-beta clamp(P)): the damper as a share of alpha.
static double share(const kn_held_element *h, double p)
{
    return exp(-h->beta_per_pa * fmin(fmax(p, h->p0_pa), h->p1_pa));
}

double kn_held_element_time(const kn_held_element *h, double p)
{
    const double thins = p > h->p0_pa && p < h->p1_pa ? h->beta_per_pa * p : 0;
    return h->alpha_s * share(h, p) + h->c1_s * (1 + thins);
}

// Return the floor: the stress below which the damper is constant, so that the stress falls exponentially. Above p1 the
// stress falls exponentially, too.
static double floor_of(const kn_held_element *h)
{
    return h->beta_per_pa > 0 ? fmax(h->p0_pa, SMALL / h->beta_per_pa) : INFINITY;
}

// Integrate exp(-u)/u between two values of u by the Gauss-Legendre rule with 2 * pairs points over ln u.
static double by_gauss(double middle, double half, int pairs, const double *place, const double *weight)
{
    double sum = 0;
    for (int i = 0; i < pairs; i++) {
        const double apart = exp(half * place[i]);
        sum += weight[i] * (exp(-middle * apart) + exp(-middle / apart));
    }
    return half * sum;
}

// Return E1(x) - E1(y), y > x. If both are close, four or six points suffice: this costs a tenth, avoids cancellation
// and has a relative error of 1e-13.
static double e1_between(double x, double y)
{
    static const double place4[2] = {0.3399810435848563, 0.8611363115940526};
    static const double weight4[2] = {0.6521451548625461, 0.3478548451374538};
    static const double place6[3] = {0.2386191860831969, 0.6612093864662645, 0.9324695142031521};
    static const double weight6[3] = {0.4679139345726910, 0.3607615730481386, 0.1713244923791704};
    const double half = log(y / x) / 2, wide = half * (1 + y);
    if (wide > 0.5) return kn_exponential_integral(x) - kn_exponential_integral(y);
    return wide > 0.05 ? by_gauss(sqrt(x * y), half, 3, place6, weight6)
                       : by_gauss(sqrt(x * y), half, 2, place4, weight4);
}

// Return the time by equation (1) in which the stress falls from `from` to `to`. Both stresses are between the floor
// and p1.
static double between(const kn_held_element *h, double from, double to)
{
    const double b = h->beta_per_pa;
    return h->alpha_s * e1_between(b * to, b * from) + h->c1_s * (log(from / to) + b * (from - to));
}

// Return the time constant outside P0 to P1, where the damper is constant.
static double outside(const kn_held_element *h, double clamped) { return h->alpha_s * share(h, clamped) + h->c1_s; }

double kn_held_element_until(const kn_held_element *h, double to)
{
    const double low = floor_of(h);
    double from = h->begin_pa, t = 0;
    // Add the times above p1, between p1 and the floor, and below the floor.
    if (from > h->p1_pa && low < h->p1_pa) {
        const double end = fmax(to, h->p1_pa);
        t += outside(h, h->p1_pa) * log(from / end);
        from = end;
    }
    if (from > low && from > to) {
        const double end = fmax(to, low);
        t += between(h, from, end);
        from = end;
    }
    return from > to ? t + outside(h, fmin(from, low)) * log(from / to) : t;
}

// Return ln P at the time `wait` after the stress was `from`, by equation (1). P is at least `least`. The method is
// Newton's in ln P, within an interval that encloses the root. Far below the root, Newton's method solves for the
// logarithm of the time, which is closer to linear.
static double after(const kn_held_element *h, double from, double wait, double least)
{
    double high = log(from), low = log(least), half = wait / kn_held_element_time(h, from) / 2;
    double u = high - wait / kn_held_element_time(h, exp(high - half)); // start by the midpoint rule, of second order
    if (!(wait > 0)) return high;
    for (int i = 0; i < NEWTON_MAX && low < high; i++) {
        if (!(u > low && u < high)) u = (low + high) / 2;
        const double p = exp(u), t = between(h, from, p), tau = kn_held_element_time(h, p);
        if (t > wait) low = u;
        else high = u;
        const double step = t > 2 * wait ? t / tau * log(t / wait) : (t - wait) / tau;
        u += step;
        if (fabs(step) < 3e-7) return u; // Newton's method squares the error, so u is exact enough after this step
    }
    return u;
}

// A point of the curve from which the search for the next stress starts: a stress and its time.
typedef struct stretch {
    double from_pa, from_s;
} stretch;

void kn_held_element_stress(const kn_held_element *h, int count, const double *time_s, double *stress_pa)
{
    const double low = floor_of(h);
    const double at_p1 = h->begin_pa > h->p1_pa && low < h->p1_pa ? kn_held_element_until(h, h->p1_pa) : 0;
    const double at_low = h->begin_pa > low ? kn_held_element_until(h, low) : 0;
    stretch s = {h->begin_pa, 0}; // stress and time that were found last
    for (int i = 0; i < count; i++) {
        const double t = time_s[i];
        // Above p1 the fall is exponential.
        if (t < at_p1) {
            stress_pa[i] = h->begin_pa * exp(-t / outside(h, h->p1_pa));
            continue;
        }
        if (s.from_s < at_p1) s = (stretch){h->p1_pa, at_p1};
        // Between p1 and the floor, invert equation (1) from the last stress found. Below the floor the fall is
        // exponential again.
        if (t < at_low) s = (stretch){exp(after(h, s.from_pa, t - s.from_s, low)), t};
        stress_pa[i] = s.from_pa;
        if (t < at_low) continue;
        const double begin = fmin(h->begin_pa, low);
        stress_pa[i] = begin * exp(-(t - at_low) / outside(h, begin));
    }
}
