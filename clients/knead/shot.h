#ifndef KN_CLIENTS_SHOT_H
#define KN_CLIENTS_SHOT_H
// Shot: maker of pictures of stills (still.h). It renders the object and writes caption, scale bar and legend on the
// picture.
#include "clients/knead/still.h"
#include "clients/viewer/label.h"

typedef struct kn_shot kn_shot;

// Open a shot (a maker of pictures). width, height: size of the pictures, pixels. samples: as for kn_renderer_open.
// Return NULL and one sentence in `error` on failure.
kn_shot *kn_shot_open(int width, int height, int samples, char *error, size_t error_size);

// Text on the picture. PLAIN: none. NAMED: name of the object and length of the scale bar. LEGEND: as NAMED, and the
// legend of the colours.
typedef enum kn_shot_words { KN_SHOT_PLAIN, KN_SHOT_NAMED, KN_SHOT_LEGEND } kn_shot_words;

// Draw a still into rgba[height][width][4]. scale: colour scale of still->value; NULL: the object has its own colour.
// The function replaces the still's values by places on the colour scale. Return false and one sentence in `error` on
// failure.
bool kn_shot_take(kn_shot *shot, kn_still *still, const kn_scale *scale, kn_shot_words words, uint8_t *rgba,
                  char *error, size_t error_size);
// Free a shot (a maker of pictures). NULL is allowed.
void kn_shot_close(kn_shot *shot);

#endif
