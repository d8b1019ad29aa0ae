#ifndef KN_CLIENTS_VIEWER_RANGE_H
#define KN_CLIENTS_VIEWER_RANGE_H
// A range image, as a range finder above the table would make it: for every pixel how high the surface there stands
// above the table. Parallel lines of sight straight down, x to the right, y up the picture, square pixels. Pure;
// heights are those of the triangles to a float's precision, no depth buffer's.
#include <stdbool.h>
#include <stdint.h>

typedef struct kn_range {
    int width, height;
    double pixel_m;             // side of a pixel: 1, 2 or 5 times a power of ten
    double left_m, top_m;       // x of the middle of the first column, y of the middle of the first row
    double step_m;              // height of a grey level: 1, 2 or 5 times a power of ten, 1 um at least
    double table_m;             // z of the table
    double lowest_m, highest_m; // of what was seen, above the table; 0 when nothing was
} kn_range;

// Frames the surface with some air around it, at rest and as it is, so that the image of a press is that of the rest.
kn_range kn_range_frame(int width, int height, int vertex_count, const float (*rest)[3], const float (*now)[3]);

// level [height][width], top row first: 0 where nothing is, else 1 + height/step_m, rounded; what has sunk below the
// table is level 1. Triangles with a place that is not finite are left out.
void kn_range_draw(kn_range *range, const float (*now)[3], int triangle_count, const int (*triangle)[3],
                   uint16_t *level);

// Fills lowest_m and highest_m from the levels. False: nothing is seen.
bool kn_range_look(kn_range *range, const uint16_t *level);

#endif
