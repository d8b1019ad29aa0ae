#include "clients/identify/special.h"
#include <math.h>

#define EULER_GAMMA 0.57721566490153286061

// Return E1(x) by the power series -gamma - ln x - sum of (-x)^k/(k k!), where gamma is Euler's constant.
static double by_series(double x)
{
    double sum = 0, term = 1; // (-x)^k/k!
    for (int k = 1; k < 30; k++) {
        term *= -x / k;
        sum += term / k;
        if (fabs(term) < 1e-17) break;
    }
    return -EULER_GAMMA - log(x) - sum;
}

// Return E1(x) by the continued fraction exp(-x) (1/(x+1- 1/(x+3- 4/(x+5- ...)))), evaluated from the front by Lentz's
// method. About 80/x terms are needed.
static double by_fraction(double x)
{
    double b = x + 1, c = INFINITY, d = 1 / b, h = d;
    for (int i = 1; i < 200; i++) {
        const double a = -(double)i * i;
        b += 2;
        d = 1 / (a * d + b);
        c = b + a / c;
        const double factor = c * d;
        h *= factor;
        if (fabs(factor - 1) < 1e-16) break;
    }
    return h * exp(-x);
}

double kn_exponential_integral(double x)
{
    if (!(x > 0)) return x == 0 ? INFINITY : NAN;
    return x <= 1 ? by_series(x) : by_fraction(x);
}
