#ifndef KN_CLIENTS_SHOT_H
#define KN_CLIENTS_SHOT_H
// The picture of a still: renderer, caption, bar and legend.
#include "clients/knead/still.h"
#include "clients/viewer/scale.h"

typedef struct kn_shot kn_shot;

// samples: as kn_renderer_open. NULL and one sentence in error.
kn_shot *kn_shot_open(int width, int height, int samples, char *error, size_t error_size);

typedef enum kn_shot_words { KN_SHOT_PLAIN, KN_SHOT_NAMED, KN_SHOT_LEGEND } kn_shot_words; // each more than the last

// scale: what still->value stands for; NULL: no colours. words: nothing is written on it, its name and the bar's
// length, or the legend, too. rgba [height][width][4]. The still's numbers are places on the scale from then on. False
// and one sentence in error.
bool kn_shot_take(kn_shot *shot, kn_still *still, const kn_scale *scale, kn_shot_words words, uint8_t *rgba,
                  char *error, size_t error_size);
void kn_shot_close(kn_shot *shot); // NULL is fine

#endif
