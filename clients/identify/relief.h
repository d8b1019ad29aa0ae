#ifndef KN_CLIENTS_IDENTIFY_RELIEF_H
#define KN_CLIENTS_IDENTIFY_RELIEF_H
// A measured surface, and how far a model's is from it: what a fit of shape is made of.
//
// Of a range image, which is seen straight from above:
//
//     outline   how far the object reaches from its middle, along rays 2 degrees apart, each a mean of eight: to a part
//               of a pixel on both sides, of the model exactly, from the edges of its triangles     r = (R' - R)/sigma
//     patches   squares of about a 32nd of the object, in each the mean of the height where both are seen, away from
//               the outline, where a side that falls steeply would only tell the outline once more  r = (z' - z)/sigma
//
// Left out is what the tool hides: the box around its plan at that moment. Sigma is the noise of the image, found from
// second differences of neighbouring pixels, over the root of what was averaged, and a thousandth of the height, which
// the solver itself may be off by; of the outline besides a pixel over the root of 12.
//
// Of points anywhere on the surface (a 3-D scan): their distance from the model's triangles, outside positive, over a
// hundredth of the height.
//
// What none of it sees: from above, the sides below their widest place, and so whether a barrel is closed at the top or
// at its foot; what happens inside.
#include "clients/viewer/range.h"
#include "core/shape.h"
#include <stdbool.h>
#include <stddef.h>

#define KN_RELIEF_RAYS 180

typedef struct kn_relief {
    kn_range frame;                            // of the image; of points width 0
    uint16_t *level;                           // as measured, owned
    uint8_t *counts;                           // [height][width] 1: its height is compared
    double noise_m;                            // of a pixel's height
    double tall_m;                             // the object's height at rest
    double centre_m[2];                        // where the rays begin
    double ray_m[KN_RELIEF_RAYS], ray_sigma_m; // measured
    bool ray_counts[KN_RELIEF_RAYS];           // false: hidden by the tool, or cut off by the picture
    int rays;                                  // that count
    int side, across, down, patches;           // pixels of a patch; of the grid of patches; that count
    double *patch_m, *patch_sigma_m;           // [down * across] mean height measured; NAN: too little of it counts
    int points;
    double (*point_m)[3]; // owned
    double point_sigma_m;
    int readings; // residuals
} kn_relief;

typedef struct kn_relief_box { // hidden: x, y; low >= high: nothing
    double low_m[2], high_m[2];
} kn_relief_box;

// Takes the level over. rest_m, vertices: the surface of the object at rest, to see whether it can be this object.
// False and one sentence in error, without a file's name; level is freed then, too.
bool kn_relief_image(kn_relief *relief, const kn_range *frame, uint16_t *level, int vertices, const float (*rest_m)[3],
                     const kn_relief_box *hidden, char *error, size_t error_size);

// Takes over the points; at most KN_RELIEF_POINTS of them, evenly, are kept.
#define KN_RELIEF_POINTS 2000
bool kn_relief_points(kn_relief *relief, int count, double (*point_m)[3], int vertices, const float (*rest_m)[3],
                      const kn_relief_box *hidden, char *error, size_t error_size);
void kn_relief_free(kn_relief *relief); // zeroed is fine

typedef struct kn_relief_misfit {
    double height_m, outline_m; // rms; of points the distance, and NAN
    double bulge_m[2][2];       // beyond the object at rest: measured, model; along x, y; NAN: hidden, or points
} kn_relief_misfit;

// residual[readings]: rays, then patches; or points. The picture is taken to lie shift_m to the right and up of where
// it says. misfit may be NULL. False: memory is short.
bool kn_relief_compare(const kn_relief *relief, const double shift_m[2], const float (*now_m)[3],
                       const float (*rest_m)[3], int vertices, int triangles, const int (*triangle)[3],
                       double *residual, kn_relief_misfit *misfit);

#endif
