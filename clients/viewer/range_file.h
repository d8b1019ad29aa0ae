#ifndef KN_CLIENTS_VIEWER_RANGE_FILE_H
#define KN_CLIENTS_VIEWER_RANGE_FILE_H
// A range image as a file: a PNG of 16-bit grey whose texts say step_mm, pixel_mm, left_mm and top_mm. `knead view
// --depth` writes them; what another instrument wrote is read with these four numbers told beside it.
#include "clients/viewer/range.h"
#include <stdbool.h>
#include <stddef.h>

#define KN_RANGE_MOST 8192 // pixels on a side of one that is read

// title: what it is of. False and one sentence in error.
bool kn_range_save(const char *path, const kn_range *range, const char *title, const uint16_t *level, char *error,
                   size_t error_size);

typedef struct kn_range_given { // what is told beside the file, over its texts; NAN: not told
    double step_m, pixel_m, left_m, top_m;
} kn_range_given;

// table_m becomes 0: of the scene's frame. level is the caller's to free. False and one sentence in error: as
// kn_image_read_gray16, a number that is missing or none, nothing seen at all.
bool kn_range_load(const char *path, const kn_range_given *given, kn_range *range, uint16_t **level, char *error,
                   size_t error_size);

#endif
