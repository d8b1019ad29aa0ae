#ifndef KN_CLIENTS_VIEWER_RANGE_FILE_H
#define KN_CLIENTS_VIEWER_RANGE_FILE_H
// Range image as a file: a PNG of 16-bit grey with texts for step_mm, pixel_mm, left_mm and top_mm. `knead view
// --depth` writes such files. An image of another instrument can be read if these four numbers are given separately.
#include "clients/viewer/range.h"
#include <stdbool.h>
#include <stddef.h>

#define KN_RANGE_MOST 8192 // largest width or height of an image that can be read, pixels

// Write a range image. `title`: text that says which object is shown. On failure return false and put one sentence in
// error.
bool kn_range_save(const char *path, const kn_range *range, const char *title, const uint16_t *level, char *error,
                   size_t error_size);

typedef struct kn_range_given { // numbers that replace those in the file's texts; NAN: use the number in the file
    double step_m, pixel_m, left_m, top_m;
} kn_range_given;

// Read a range image. table_m becomes 0, because heights are in the scene's frame. The caller frees *level. Return
// false and put one sentence in error if kn_image_read_gray16 fails, if a number is missing or malformed, or if no
// surface is visible in the image.
bool kn_range_load(const char *path, const kn_range_given *given, kn_range *range, uint16_t **level, char *error,
                   size_t error_size);

#endif
