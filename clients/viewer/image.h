#ifndef KN_CLIENTS_VIEWER_IMAGE_H
#define KN_CLIENTS_VIEWER_IMAGE_H
// Pictures as PNG files.
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// Write rgba [height][width][4], top row first, as PNG. The data is written to a new file in the same folder, and the
// new file is then renamed to `path`. So a reader of `path` sees the old picture or the whole new one. Refuse a `path`
// that exists and is not a regular file, because the rename would replace a device or a link by a file. On failure
// return false and put one sentence in error.
bool kn_image_write_png(const char *path, int width, int height, const uint8_t *rgba, char *error, size_t error_size);

// Text in a PNG. Other programs can show the text or find it by its key.
typedef struct kn_image_text {
    const char *key, *text; // Latin-1; a key has 1..79 letters
} kn_image_text;

// Write 16-bit grey levels as PNG, in the same way as kn_image_write_png. `pixel_m`: side of a pixel, m, for measuring
// in the picture; 0: unknown.
bool kn_image_write_gray16(const char *path, int width, int height, const uint16_t *level, double pixel_m,
                           int text_count, const kn_image_text *text, char *error, size_t error_size);

// Text to look up in a PNG. `text` becomes "" if the file has no text with this key.
typedef struct kn_image_found {
    const char *key;
    char text[64];
} kn_image_found;

// Read a PNG with 16-bit grey levels and at most `most` pixels on a side. The texts of the given keys are copied. The
// caller frees *level, which is [height][width]. *pixel_m is 0 if the file does not give the size of a pixel. Return
// false and put one sentence in error if the file is missing, is not a PNG, is damaged, or is not 16-bit grey.
bool kn_image_read_gray16(const char *path, int most, int *width, int *height, uint16_t **level, double *pixel_m,
                          int text_count, kn_image_found *text, char *error, size_t error_size);

#endif
