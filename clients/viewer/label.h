#ifndef KN_CLIENTS_VIEWER_LABEL_H
#define KN_CLIENTS_VIEWER_LABEL_H
// What is written on a picture: what it is of, how long the bar on the table is, what the colours mean. Cairo's text,
// in whatever sans-serif face fontconfig has.
#include "clients/viewer/scale.h"
#include <stdbool.h>
#include <stdint.h>

typedef struct kn_label {
    const char *caption;   // upper left; NULL: none
    const kn_scale *scale; // its legend, at the right; NULL: none
    const char *bar;       // "1 cm"; NULL: none
    float bar_at[2];       // where: middle of the text's upper edge, pixels from the upper left corner
} kn_label;

// Says how long the bar is whose text belongs at bar_at, where that is in the picture. words: the caller's, as long
// as the label is used.
void kn_label_bar(kn_label *label, char words[32], double bar_m, int width, int height);

// On rgba [height][width][4], top row first. False and one sentence in error: libcairo is not there, out of memory.
bool kn_label_draw(const kn_label *label, int width, int height, uint8_t *rgba, char *error, size_t error_size);

#endif
