#ifndef KN_CLIENTS_VIEWER_IMAGE_H
#define KN_CLIENTS_VIEWER_IMAGE_H
// A picture as a file.
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// Writes rgba [height][width][4], top row first, as PNG: to a new file beside path, then renamed, so that whoever looks at
// path sees the old picture or the whole new one. A path that is there and no regular file is refused: renaming would put a
// file in the place of a device or a link. False and one sentence in error.
bool kn_image_write_png(const char *path, int width, int height, const uint8_t *rgba, char *error, size_t error_size);

#endif
