#ifndef KN_CLIENTS_VIEWER_SCALE_H
#define KN_CLIENTS_VIEWER_SCALE_H
// Colour scale and its legend. The colours are viridis: equal steps look equal, also in grey and to colour-blind
// viewers.
#include <stddef.h>

#define KN_SCALE_COLORS 9
extern const float kn_scale_color[KN_SCALE_COLORS][3]; // colours of the scale at 0, 1/8 .. 1, sRGB

typedef struct kn_scale { // a colour scale from 0 to `top`
    const char *words;    // name of the value, for example "von Mises stress"
    const char *unit;     // unit of the value, for example "Pa"; "": the value is a fraction, shown in %
    double top;           // value at the upper end of the scale, > 0
} kn_scale;

// Return the smallest 1, 2 or 5 times a power of ten that is at least `most`, or 1e-9 if `most` is not positive.
double kn_scale_round(double most);
// Return such a number as kn_scale_round does, but allow 1.5, 3 and 7.5 times a power of ten as well. The values then
// fill at least three fifths of a legend.
double kn_scale_top(double most);
// Compute the colour at `share` (0..1) of the scale; values outside 0..1 get the end colours.
void kn_scale_at(double share, float srgb[3]);

// Write the title of a legend into `text`, for example "von Mises stress, kPa".
void kn_scale_title(const kn_scale *scale, char *text, size_t size);

// Write the number beside tick mark i (0, 1, ...) of the legend into `text`, and return the position of the mark on the
// scale, 0..1. A negative position means that there are no more tick marks.
double kn_scale_tick(const kn_scale *scale, int i, char *text, size_t size);

#endif
