#ifndef KN_CLIENTS_VIEWER_LABEL_H
#define KN_CLIENTS_VIEWER_LABEL_H
// Colour scale and its legend. The colours are viridis: equal steps look equal, also in grey and to colour-blind
// viewers.
//
// Text on a picture: the caption, the length of the bar on the table, and the legend of the colours. Drawn by Cairo in
// the sans-serif face that fontconfig finds.
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define KN_SCALE_COLORS 9
extern const float kn_scale_color[KN_SCALE_COLORS][3]; // colours of the scale at 0, 1/8 .. 1, sRGB

typedef struct kn_scale { // a colour scale from 0 to `top`
    const char *words;    // name of the value, for example "von Mises stress"
    const char *unit;     // unit of the value, for example "Pa"; "": the value is a fraction, shown in %
    double top;           // value at the upper end of the scale, > 0
} kn_scale;

// Return the smallest number that is 1, 2 or 5 times a power of ten and at least `most`. Return 1e-9 if `most` is below
// 1e-9.
double kn_scale_round(double most);
// Return the smallest number that is 1, 1.5, 2, 3, 5 or 7.5 times a power of ten and at least `most`. On a scale that
// ends at this number, the value `most` is at three fifths or higher. Return 1e-9 if `most` is below 1e-9.
double kn_scale_top(double most);
// Compute the colour at `share` (0..1) of the scale; values outside 0..1 get the end colours.
void kn_scale_at(double share, float srgb[3]);

// Write the title of a legend into `text`, for example "von Mises stress, kPa".
void kn_scale_title(const kn_scale *scale, char *text, size_t size);

// Write the number beside tick mark i (0, 1, ...) of the legend into `text`, and return the position of the mark on the
// scale, 0..1. A negative position means that there are no more tick marks.
double kn_scale_tick(const kn_scale *scale, int i, char *text, size_t size);

typedef struct kn_label {
    const char *caption;   // text at the upper left; NULL: none
    const kn_scale *scale; // scale of the legend at the right; NULL: none
    const char *bar;       // text of the bar on the table, for example "1 cm"; NULL: no bar
    float bar_at[2]; // middle of the upper edge of the bar's text, pixels from the upper left corner of the picture
} kn_label;

// Set the text of the bar on the table, if bar_at is in the picture. The text is written to `words`, which must outlive
// the label.
void kn_label_bar(kn_label *label, char words[32], double bar_m, int width, int height);

// Draw the label on rgba [height][width][4], top row first. Return false with one sentence in error if libcairo is
// missing or memory is short.
bool kn_label_draw(const kn_label *label, int width, int height, uint8_t *rgba, char *error, size_t error_size);

#endif
