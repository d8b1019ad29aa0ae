#ifndef KN_CLIENTS_VIEWER_IMAGE_H
#define KN_CLIENTS_VIEWER_IMAGE_H
// A picture as a file.
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// Writes rgba [height][width][4], top row first, as PNG: to a new file beside path, then renamed, so that whoever looks
// at path sees the old picture or the whole new one. A path that is there and no regular file is refused: renaming
// would put a file in the place of a device or a link. False and one sentence in error.
bool kn_image_write_png(const char *path, int width, int height, const uint8_t *rgba, char *error, size_t error_size);

// Words in a PNG, that its readers show or look up.
typedef struct kn_image_text {
    const char *key, *text; // Latin-1; key of 1..79 letters
} kn_image_text;

// The same of 16-bit grey, with pixel_m for whoever wants to measure in it (0: not told).
bool kn_image_write_gray16(const char *path, int width, int height, const uint16_t *level, double pixel_m,
                           int text_count, const kn_image_text *text, char *error, size_t error_size);

// Reads such a PNG, of at most `most` pixels on a side. The texts that it has of those keys are copied, "" stays where
// it has none. level [height][width] is the caller's to free, pixel_m 0 where the file does not say it. False and one
// sentence in error: not there, no PNG, damaged, other than 16-bit grey.
typedef struct kn_image_found {
    const char *key;
    char text[64];
} kn_image_found;

bool kn_image_read_gray16(const char *path, int most, int *width, int *height, uint16_t **level, double *pixel_m,
                          int text_count, kn_image_found *text, char *error, size_t error_size);

#endif
