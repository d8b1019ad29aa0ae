#include "clients/knead/buzz.h"
#include <math.h>

void kn_buzz_init(kn_buzz *buzz, double period_s, double first)
{
    // Second-order Butterworth high-pass by the bilinear transform. The variable w is the prewarped cut-off frequency.
    double w = tan(3.141592653589793 * KN_BUZZ_HZ * period_s), root2 = sqrt(2.0);
    double a0 = 1.0 + root2 * w + w * w;
    // Both past inputs of the filter equal the first value, so a constant signal gives zero output from the beginning.
    *buzz = (kn_buzz){
        .b = 1.0 / a0, .a1 = 2.0 * (w * w - 1.0) / a0, .a2 = (1.0 - root2 * w + w * w) / a0, .x1 = first, .x2 = first};
}

void kn_buzz_add(kn_buzz *buzz, double value)
{
    double y = buzz->b * (value - 2.0 * buzz->x1 + buzz->x2) - buzz->a1 * buzz->y1 - buzz->a2 * buzz->y2;
    buzz->x2 = buzz->x1;
    buzz->x1 = value;
    buzz->y2 = buzz->y1;
    buzz->y1 = y;
    buzz->sum += y * y;
    buzz->count++;
}

void kn_buzz_reset(kn_buzz *buzz)
{
    buzz->sum = 0.0;
    buzz->count = 0;
}

double kn_buzz_rms(const kn_buzz *buzz) { return buzz->count ? sqrt(buzz->sum / (double)buzz->count) : 0.0; }

void kn_turns_add(kn_turns *t, double value)
{
    // `gone` is the distance of the signal from its extreme value since the last turn. If the signal moves on in the
    // same direction, the extreme value is updated.
    double gone = value - t->extreme;
    if (t->up * gone > 0.0 || (t->up == 0 && t->hysteresis > fabs(gone))) {
        if (t->up) t->extreme = value;
        // If the signal moves back from the extreme value by more than the hysteresis, this is a turn. The first motion
        // only sets the direction and is not counted.
    } else if (fabs(gone) > t->hysteresis) {
        t->count += t->up != 0;
        t->up = gone > 0.0 ? 1 : -1;
        t->extreme = value;
    }
}
