#ifndef KN_CLIENTS_VIEWER_RANGE_H
#define KN_CLIENTS_VIEWER_RANGE_H
// Range image: the height of the surface above the table at every pixel, as a range finder above the table measures it.
// The lines of sight are parallel and point straight down. x points to the right and y up in the picture; pixels are
// square. Heights are computed from the triangles in float precision, not read from a depth buffer.
//
// Range image as a file: a PNG of 16-bit grey with texts for step_mm, pixel_mm, left_mm and top_mm. `knead view
// --depth` writes such files. An image of another instrument can be read if these four numbers are given separately.
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct kn_range {
    int width, height;
    double pixel_m;       // side of a pixel: 1, 2 or 5 times a power of ten
    double left_m, top_m; // left_m: x of the middle of the left column; top_m: y of the middle of the top row
    double step_m;        // height of one grey level: 1, 2 or 5 times a power of ten, at least 1 um
    double table_m;       // z of the table
    // Heights of the lowest and the highest visible point above the table; 0 if nothing is visible.
    double lowest_m, highest_m;
} kn_range;

// Choose the frame of the image: a rectangle around both the surface at rest and the present surface, with some margin.
// Because of the margin, the image of a pressed object usually has the same frame as the image of the object at rest.
kn_range kn_range_frame(int width, int height, int vertex_count, const float (*rest)[3], const float (*now)[3]);

// Fill in `level` [height][width], top row first. Where there is no surface, a level is 0. Elsewhere it is 1 +
// height/step_m, rounded. A surface below the table has level 1. Triangles with a position that is not finite are left
// out.
void kn_range_draw(kn_range *range, const float (*now)[3], int triangle_count, const int (*triangle)[3],
                   uint16_t *level);

#define KN_RANGE_MOST 8192 // largest width or height of an image that can be read, pixels

// Write a range image. `title`: text that says which object is shown. On failure return false and put one sentence in
// error.
bool kn_range_save(const char *path, const kn_range *range, const char *title, const uint16_t *level, char *error,
                   size_t error_size);

// Numbers that replace the numbers in the texts of the file. NAN: use the number in the file.
typedef struct kn_range_given {
    double step_m, pixel_m, left_m, top_m;
} kn_range_given;

// Read a range image. table_m becomes 0, because the table of a scene is at z = 0. The caller frees *level. Return
// false and put one sentence in error if kn_image_read_gray16 fails, if a number is missing or malformed, or if no
// surface is visible in the image.
bool kn_range_load(const char *path, const kn_range_given *given, kn_range *range, uint16_t **level, char *error,
                   size_t error_size);

#endif
