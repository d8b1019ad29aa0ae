#ifndef KN_CLIENTS_VIEWER_SCALE_H
#define KN_CLIENTS_VIEWER_SCALE_H
// Numbers as colours, and as the legend's words. Colours are viridis: even steps look even, in grey and to colour-blind
// eyes, too.
#include <stddef.h>

#define KN_SCALE_COLORS 9
extern const float kn_scale_color[KN_SCALE_COLORS][3]; // sRGB at 0, 1/8 .. 1

typedef struct kn_scale { // from 0 to top
    const char *words;    // "von Mises stress"
    const char *unit;     // "Pa", "m"; "": a share, told in %
    double top;           // > 0
} kn_scale;

double kn_scale_round(double most); // the smallest of 1, 2 or 5 times a power of ten that holds it; 0 or less: 1e-9
double kn_scale_top(double most);   // of 1.5, 3 or 7.5, too: what it holds fills three fifths of a legend or more
void kn_scale_at(double share, float srgb[3]); // 0..1; beyond: the ends

// "von Mises stress, kPa".
void kn_scale_title(const kn_scale *scale, char *text, size_t size);

// Tick i, 0 and up: its place on the scale, 0..1, and its number. A negative place: there are no more.
double kn_scale_tick(const kn_scale *scale, int i, char *text, size_t size);

#endif
