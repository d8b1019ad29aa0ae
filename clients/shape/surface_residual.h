#ifndef KN_CLIENTS_SHAPE_SURFACE_RESIDUAL_H
#define KN_CLIENTS_SHAPE_SURFACE_RESIDUAL_H
// A measured surface of the object, which is either a range image or a set of points. The functions compute the
// residuals of a model's surface against the measured surface.
//
// A range image is seen from straight above. The model is compared with the image by two kinds of residuals r:
//
//     outline   distance R from the middle of the object to its edge, along rays 2 degrees apart. A ray is a mean of
//               eight subrays. The edge is found to a fraction of a pixel in the image, and exactly in the model, from
//               the edges of its triangles                                                          r = (R' - R)/sigma
//     patches   squares with sides of about a 32nd of the object: the mean height z of their visible pixels. Pixels
//               near the outline do not count, since a steep side would only repeat the outline     r = (z' - z)/sigma
//
// R' and z' are the model's values.
//
// The area that the tool hides at the moment of the image is left out: a box around the tool, as seen from above. sigma
// combines two errors. For a patch, the first error is the noise of a pixel's height (from second differences of
// neighbouring pixels) divided by the square root of the number of averaged pixels. For the outline, the first error is
// the width of a pixel divided by the square root of 12. The second error is a thousandth of the object's height, the
// possible error of the solver.
//
// Points anywhere on the surface (a 3-D scan) are compared by their distance from the model's triangles. The distance
// is positive outside the model. The residual is the distance divided by a hundredth of the object's height.
//
// Neither measurement is complete. An image from above does not show the sides of the object below their widest place.
// So an image does not distinguish a barrel that is closed at the top from one that is closed at the foot. Neither
// measurement shows the inside of the object.
#include "clients/viewer/range.h"
#include "core/surface.h"

#define KN_SURFACE_RAYS 180

typedef struct kn_surface_residual {
    kn_range frame;     // place and size of the image; frame.width 0: points were measured, not an image
    uint16_t *level;    // [height][width] pixels of the image as measured; owned
    uint8_t *counts;    // [height][width] 1: the pixel's height is compared with the model; 0: the pixel is left out
    double noise_m;     // standard deviation of the noise of a pixel's height
    double tall_m;      // the object's height at rest
    double centre_m[2]; // middle of the object (x, y), from which the rays start
    // measured distance from the middle of the object to its edge along each ray; sigma of these distances
    double ray_m[KN_SURFACE_RAYS], ray_sigma_m;
    // false: the tool hides the edge on this ray, or the image's border cuts the ray off
    bool ray_counts[KN_SURFACE_RAYS];
    int rays; // number of rays that are compared with the model
    // side: number of pixels along each side of a patch; across, down: number of columns and of rows of the grid of
    // patches; patches: number of patches that are compared with the model
    int side, across, down, patches;
    // [down * across] measured mean height of each patch, and its sigma; NAN: too few pixels of the patch are compared
    double *patch_m, *patch_sigma_m;
    int points;           // number of points
    double (*point_m)[3]; // [points] measured points; owned
    double point_sigma_m; // sigma of a point's distance from the model
    int readings;         // number of residuals
} kn_surface_residual;

typedef struct kn_hidden_area { // area that the tool hides, in x and y; low_m >= high_m: the tool hides nothing
    double low_m[2], high_m[2];
} kn_hidden_area;

typedef struct kn_model_surface { // a model's surface; the fields are owned
    kn_surface *mesh;
    float (*rest_m)[3]; // [mesh->vertex_count] positions of the vertices at rest
} kn_model_surface;

// Prepare the comparison with a range image and take over `level`. The model's surface at rest serves to check that the
// image can show this object. On failure free `level` and return false with one sentence in `error`, which does not
// name the file.
bool kn_surface_residual_image(kn_surface_residual *measured, const kn_range *frame, uint16_t *level,
                               const kn_model_surface *model, const kn_hidden_area *hidden, char *error,
                               size_t error_size);

// Prepare the comparison with points and take over `point_m`. If there are more than KN_SURFACE_POINTS points, keep
// every n-th point.
#define KN_SURFACE_POINTS 2000
bool kn_surface_residual_points(kn_surface_residual *measured, int count, double (*point_m)[3],
                                const kn_model_surface *model, const kn_hidden_area *hidden, char *error,
                                size_t error_size);
void kn_surface_residual_free(kn_surface_residual *measured); // a zeroed struct is allowed

typedef struct kn_surface_misfit {
    // rms differences between model and image in height and in outline; for points height_m is the rms distance and
    // outline_m is NAN
    double height_m, outline_m;
    // largest distance of the outline beyond the sides of the object at rest; [0] measured, [1] of the model; along x
    // and along y; NAN: the tool hides the outline, or points were measured
    double bulge_m[2][2];
} kn_surface_misfit;

// Compute residual[measured->readings] of a model's surface, whose vertices are at now_m. For an image, the residuals of
// the rays come first, then those of the patches. For points, each point has one residual. The image is assumed to be
// displaced by `shift_m` along x and y from its stated place. `misfit` may be NULL. Return false if memory runs out.
bool kn_surface_residual_compare(const kn_surface_residual *measured, const double shift_m[2],
                                 const kn_model_surface *model, const float (*now_m)[3], double *residual,
                                 kn_surface_misfit *misfit);

// Return the distance of a point from a surface of triangles [m]. The distance is > 0 if the point is outside the
// surface. Seen from outside, the vertices of a triangle are counter-clockwise. The triangle nearest to the point
// determines the sign. If several triangles are equally near, the sign comes from the triangle whose normal points most
// directly towards or away from the point.
double kn_surface_residual_distance(const double point_m[3], const float (*now_m)[3], int triangles,
                                    const int (*triangle)[3]);

#endif
