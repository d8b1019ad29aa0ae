#ifndef KN_CLIENTS_VIEWER_LABEL_H
#define KN_CLIENTS_VIEWER_LABEL_H
// Text on a picture: the caption, the length of the bar on the table, and the legend of the colours. Drawn by Cairo in
// the sans-serif face that fontconfig finds.
#include "clients/viewer/scale.h"
#include <stdbool.h>
#include <stdint.h>

typedef struct kn_label {
    const char *caption;   // text at the upper left; NULL: none
    const kn_scale *scale; // scale of the legend at the right; NULL: none
    const char *bar;       // text of the bar on the table, for example "1 cm"; NULL: no bar
    float bar_at[2];       // middle of the upper edge of the bar's text, pixels from the picture's upper left corner
} kn_label;

// Set the text of the bar on the table, if bar_at is in the picture. The text is written to `words`, which must outlive
// the label.
void kn_label_bar(kn_label *label, char words[32], double bar_m, int width, int height);

// Draw the label on rgba [height][width][4], top row first. Return false with one sentence in error if libcairo is
// missing or memory is short.
bool kn_label_draw(const kn_label *label, int width, int height, uint8_t *rgba, char *error, size_t error_size);

#endif
