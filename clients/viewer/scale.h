#ifndef KN_CLIENTS_VIEWER_SCALE_H
#define KN_CLIENTS_VIEWER_SCALE_H
// Colour scale and its legend. The colours are viridis: equal steps look equal, also in grey and to colour-blind
// viewers.
#include <stddef.h>

#define KN_SCALE_COLORS 9
extern const float kn_scale_color[KN_SCALE_COLORS][3]; // sRGB at 0, 1/8 .. 1

typedef struct kn_scale { // a colour scale from 0 to `top`
    const char *words;    // "von Mises stress"
    const char *unit;     // "Pa", "m"; "": the value is a share, shown in %
    double top;           // > 0
} kn_scale;

// Return the smallest 1, 2 or 5 times a power of ten that is at least `most`, or 1e-9 if `most` is not positive.
double kn_scale_round(double most);
// Do the same, but allow 1.5, 3 and 7.5 times a power of ten as well, so that values fill at least three fifths of a
// legend.
double kn_scale_top(double most);
void kn_scale_at(double share, float srgb[3]); // colour at 0..1; values beyond get the end colours

// Write the title of a legend into `text`, for example "von Mises stress, kPa".
void kn_scale_title(const kn_scale *scale, char *text, size_t size);

// Write the number at tick i (0, 1, ...) into `text` and return the position of the tick on the scale, 0..1. A negative
// position means that there are no more ticks.
double kn_scale_tick(const kn_scale *scale, int i, char *text, size_t size);

#endif
