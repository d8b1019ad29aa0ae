#ifndef KN_CLIENTS_IDENTIFY_RELIEF_H
#define KN_CLIENTS_IDENTIFY_RELIEF_H
// A relief: a measured surface of the object, and the residuals of a model's surface against it.
//
// A range image is seen from straight above. It is compared by:
//
//     outline   distance R from the middle to the edge along rays 2 degrees apart. A ray is a mean of eight subrays.
//               The edge is found to a fraction of a pixel in the image, and exactly in the model, by its triangle
//               edges                                                                               r = (R' - R)/sigma
//     patches   squares with sides of about a 32nd of the object: the mean height z of their visible pixels. Pixels
//               near the outline do not count, since a steep side would only repeat the outline     r = (z' - z)/sigma
//
// R' and z' are the model's values.
//
// The area that the tool hides is left out: the box around the tool, as seen from above, at that moment. sigma combines
// two errors. The first is the noise of the image, from second differences of neighbouring pixels, over the root of the
// number of pixels averaged. The second is a thousandth of the height, the possible error of the solver. For the
// outline, a pixel over the root of 12 replaces the noise.
//
// Points anywhere on the surface (a 3-D scan) are compared by their distance from the model's triangles, positive
// outside, divided by a hundredth of the height.
//
// Neither measurement is complete. An image from above does not show the sides below their widest place. It cannot tell
// a barrel that is closed at the top from one that is closed at the foot. Neither measurement shows the inside of the
// object.
#include "clients/viewer/range.h"
#include "core/shape.h"
#include <stdbool.h>
#include <stddef.h>

#define KN_RELIEF_RAYS 180

typedef struct kn_relief {
    kn_range frame;                            // frame of the image; width 0: the relief holds points
    uint16_t *level;                           // pixels of the image as measured; owned
    uint8_t *counts;                           // [height][width] 1: the pixel's height is compared
    double noise_m;                            // noise of a pixel's height
    double tall_m;                             // the object's height at rest
    double centre_m[2];                        // middle of the object, where the rays begin
    double ray_m[KN_RELIEF_RAYS], ray_sigma_m; // measured distance along each ray, and its sigma
    bool ray_counts[KN_RELIEF_RAYS];           // false: hidden by the tool, or cut off by the image
    int rays;                                  // number of rays that are compared
    // pixels along a patch; columns and rows of the grid of patches; number of patches that are compared
    int side, across, down, patches;
    double *patch_m, *patch_sigma_m; // [down * across] measured mean height; NAN: too few pixels count
    int points;
    double (*point_m)[3]; // owned
    double point_sigma_m;
    int readings; // number of residuals
} kn_relief;

typedef struct kn_relief_box { // area that the tool hides, in x and y; low >= high: none
    double low_m[2], high_m[2];
} kn_relief_box;

// Take over the level image. `rest_m` holds the `vertices` of the object's surface at rest, to check that the image can
// show this object. Return false with one sentence in error, without a file name; level is then freed, too.
bool kn_relief_image(kn_relief *relief, const kn_range *frame, uint16_t *level, int vertices, const float (*rest_m)[3],
                     const kn_relief_box *hidden, char *error, size_t error_size);

// Take over the points. If there are more than KN_RELIEF_POINTS, an even selection is kept.
#define KN_RELIEF_POINTS 2000
bool kn_relief_points(kn_relief *relief, int count, double (*point_m)[3], int vertices, const float (*rest_m)[3],
                      const kn_relief_box *hidden, char *error, size_t error_size);
void kn_relief_free(kn_relief *relief); // a zeroed struct is fine

typedef struct kn_relief_misfit {
    double height_m, outline_m; // rms differences; for points height_m is the rms distance and outline_m is NAN
    // growth of the outline beyond the object at rest: [0] measured, [1] model; along x, y; NAN: hidden, or points
    double bulge_m[2][2];
} kn_relief_misfit;

// Compute residual[readings] of a model's surface: of the rays, then of the patches; or of the points. The image is
// assumed to lie `shift_m` to the right of and above its stated place. misfit may be NULL. Return false if memory runs
// out.
bool kn_relief_compare(const kn_relief *relief, const double shift_m[2], const float (*now_m)[3],
                       const float (*rest_m)[3], int vertices, int triangles, const int (*triangle)[3],
                       double *residual, kn_relief_misfit *misfit);

#endif
