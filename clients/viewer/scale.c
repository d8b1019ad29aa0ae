#include "clients/viewer/scale.h"
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

// Colours of the viridis scale at nine equal steps.
#define HEX(rgb)                                                                                                       \
    {                                                                                                                  \
        (float)((rgb) >> 16) / 255.0f, (float)((rgb) >> 8 & 255) / 255.0f, (float)((rgb)&255) / 255.0f                 \
    }
const float kn_scale_color[KN_SCALE_COLORS][3] = {HEX(0x440154), HEX(0x472d7b), HEX(0x3b528b),
                                                  HEX(0x2c728e), HEX(0x21918c), HEX(0x28ae80),
                                                  HEX(0x5ec962), HEX(0xaddc30), HEX(0xfde725)};

// Return the smallest value step * 10^n that is at least `most`.
static double step_above(double most, int count, const double *steps)
{
    if (!(most > 1e-9)) return 1e-9;
    double ten = pow(10, floor(log10(most))), top = 0;
    // The small margin allows for rounding errors, because 3 * 0.1 is slightly more than 0.3.
    for (int i = 0; i < count && top < most; i++) top = steps[i] * ten * (1 + 1e-12);
    return top;
}

double kn_scale_round(double most) { return step_above(most, 4, (const double[]){1, 2, 5, 10}); }

double kn_scale_top(double most) { return step_above(most, 7, (const double[]){1, 1.5, 2, 3, 5, 7.5, 10}); }

// Interpolate linearly between the two nearest colours.
void kn_scale_at(double share, float srgb[3])
{
    double x = fmin(fmax(share, 0), 1) * (KN_SCALE_COLORS - 1);
    int i = (int)fmin(x, KN_SCALE_COLORS - 2);
    for (int k = 0; k < 3; k++)
        srgb[k] = kn_scale_color[i][k] + (float)(x - i) * (kn_scale_color[i + 1][k] - kn_scale_color[i][k]);
}

// Write the unit with the SI prefix that suits the scale's top into `text`. Return the factor by which values are
// multiplied.
static double prefix(const kn_scale *s, char text[16])
{
    static const char *const name[] = {"n", "\u00b5", "m", "", "k", "M", "G"};
    if (!*s->unit) return strcpy(text, "%"), 100;
    // The factor slightly above 1 makes 1e-3 m read as 1 mm in spite of rounding errors.
    int third = (int)fmin(fmax(floor(log10(s->top * 1.000001) / 3), -3), 3);
    snprintf(text, 16, "%s%s", name[third + 3], s->unit);
    return pow(10, -3 * third);
}

void kn_scale_title(const kn_scale *scale, char *text, size_t size)
{
    char unit[16];
    prefix(scale, unit);
    snprintf(text, size, "%s, %s", scale->words, unit);
}

double kn_scale_tick(const kn_scale *scale, int i, char *text, size_t size)
{
    char unit[16];
    // Choose the number of intervals by the first digits of the scale's top, so that the tick marks are round numbers.
    double by = prefix(scale, unit), first = scale->top / pow(10, floor(log10(scale->top * 1.000001)));
    const bool thirds = fabs(first - 1.5) < 1e-6 || fabs(first - 3) < 1e-6 || fabs(first - 6) < 1e-6;
    // number of intervals; a scale whose top begins with 1, 5 or 7.5 has five
    const int ticks = thirds ? 3 : first < 1.5 || first > 4.5 ? 5 : 4;
    if (i > ticks) return -1;
    snprintf(text, size, "%.3g", by * scale->top * i / ticks);
    return (double)i / ticks;
}
