#ifndef KN_CLIENTS_SHAPE_MEASUREMENT_H
#define KN_CLIENTS_SHAPE_MEASUREMENT_H
// All measurements of one press: surfaces at given times, and the contact force. The residuals of a
// model form one vector: first the residuals of each surface, then those of the force.
#include "clients/shape/press_protocol.h"
#include "clients/viewer/range.h"
#include "core/surface.h"

// ---- a measured surface (surface_residual.c)
//
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

#define KN_SURFACE_RAYS 180

typedef struct kn_surface_residual {
    kn_range frame;     // place and size of the image; frame.width 0: points were measured, not an image
    uint16_t *level;    // [height][width] pixels of the image as measured; owned
    uint8_t *counts;    // [height][width] 1: the pixel's height is compared with the model; 0: the pixel is left out
    double noise_m;     // standard deviation of the noise of a pixel's height
    double tall_m;      // the object's height at rest
    double centre_m[2]; // middle of the object (x, y), from which the rays start
    // ray_m: measured distance from the middle of the object to its edge, along each ray; ray_sigma_m: sigma of these
    // distances
    double ray_m[KN_SURFACE_RAYS], ray_sigma_m;
    // ray_counts: false if the tool hides the edge on this ray, or if the image's border cuts the ray off
    bool ray_counts[KN_SURFACE_RAYS];
    int rays; // number of rays that are compared with the model
    // side: number of pixels along each side of a patch; across, down: number of columns and of rows of the grid of
    // patches; patches: number of patches that are compared with the model
    int side, across, down, patches;
    // [down * across] patch_m: measured mean height of each patch; patch_sigma_m: its sigma. NAN: too few pixels of the
    // patch are compared
    double *patch_m, *patch_sigma_m;
    int points;           // number of points
    double (*point_m)[3]; // [points] measured points; owned
    double point_sigma_m; // sigma of a point's distance from the model
    int readings;         // number of residuals
} kn_surface_residual;

typedef struct kn_hidden_area { // area that the tool hides, in x and y; low_m >= high_m: the tool hides nothing
    double low_m[2], high_m[2];
} kn_hidden_area;

typedef struct kn_model_surface { // surface of a model; the struct owns both fields
    kn_surface *mesh;
    float (*rest_m)[3]; // [mesh->vertex_count] positions of the vertices at rest
} kn_model_surface;

// Prepare the comparison with a range image and take ownership of `level`. The surface of the model at rest is used to
// check that the image can show this object. On failure free `level`, write one sentence to `error` and return false.
// The sentence does not contain the file's name.
bool kn_surface_residual_image(kn_surface_residual *measured, const kn_range *frame, uint16_t *level,
                               const kn_model_surface *model, const kn_hidden_area *hidden, char *error,
                               size_t error_size);

// Prepare the comparison with points and take ownership of `point_m`. If there are more than KN_SURFACE_POINTS points,
// keep every n-th point.
#define KN_SURFACE_POINTS 2000
bool kn_surface_residual_points(kn_surface_residual *measured, int count, double (*point_m)[3],
                                const kn_model_surface *model, const kn_hidden_area *hidden, char *error,
                                size_t error_size);
void kn_surface_residual_free(kn_surface_residual *measured); // the struct may be all zeros

typedef struct kn_surface_misfit {
    // rms differences between model and image in height (height_m) and in outline (outline_m). For points, height_m is
    // the rms distance and outline_m is NAN.
    double height_m, outline_m;
    // Largest distance by which the outline lies outside the sides of the object at rest. First index: 0 measured, 1
    // model. Second index: 0 along x, 1 along y. NAN: the tool hides the outline, or points were measured.
    double bulge_m[2][2];
} kn_surface_misfit;

// Compute residual[measured->readings] of a model's surface, whose vertices are at now_m. For an image, the residuals
// of the rays come first, then those of the patches. For points, each point has one residual. The image is assumed to
// be displaced by `shift_m` along x and y from its stated place. `misfit` may be NULL. Return false if memory runs out.
bool kn_surface_residual_compare(const kn_surface_residual *measured, const double shift_m[2],
                                 const kn_model_surface *model, const float (*now_m)[3], double *residual,
                                 kn_surface_misfit *misfit);

// Return the distance of a point from a surface of triangles [m]. The distance is > 0 if the point is outside the
// surface. Seen from outside, the vertices of a triangle are counter-clockwise. The triangle nearest to the point
// determines the sign. If several triangles are equally near, the sign comes from the triangle whose normal points most
// directly towards or away from the point.
double kn_surface_residual_distance(const double point_m[3], const float (*now_m)[3], int triangles,
                                    const int (*triangle)[3]);

// ---- a measured force
//
// The force over time is averaged in at most KN_FORCE_SPANS spans of time. The spans have equal widths in the square
// root of the time, since the force changes ever more slowly. The residual of a span is
//
//     r = (F' - F)/sigma      F: mean of the measured forces in the span; F': mean of the model's forces at their times
//
// sigma combines two errors. The first is the noise of one reading divided by the square root of the number of readings
// in the span. The second is the possible error of the solver, half a percent of the largest force. The largest force
// is the largest median of five readings. An outlier (a reading far from its neighbours) is left out. Otherwise one
// wrong reading of 5000 N would make sigma so large that all other readings lose their weight.

#define KN_FORCE_SPANS 300

typedef struct kn_force_residual {
    int count; // number of readings
    // [count] time_s: times of the readings on the clock of the press, rising from reading to reading; force_n: forces,
    // compression positive; owned
    double *time_s, *force_n;
    double noise_n, most_n;      // noise_n: standard deviation of one reading; most_n: largest median of five readings
    int outliers;                // number of outliers that were left out
    double outlier_s, outlier_n; // time and force of the first outlier
    int spans;                   // number of spans that hold readings
    int *span;                   // [count] index of the span that holds each reading
    // [spans] for each span: mean force (span_n), sigma of this mean (span_sigma_n) and mean time (span_s)
    double span_n[KN_FORCE_SPANS], span_sigma_n[KN_FORCE_SPANS], span_s[KN_FORCE_SPANS];
    bool turned; // compression was negative in the file, so the signs of all forces were changed
} kn_force_residual;

// Prepare the comparison of a measured force. The caller has set `count`, `time_s` and `force_n`. Readings outside the
// press are left out. Readings after the hold are left out as well, since the nodes come off the tool one by one while
// the tool withdraws. On failure free the struct and return false with one sentence in `error`.
bool kn_force_residual_make(kn_force_residual *measured, const kn_press *press, char *error, size_t error_size);
void kn_force_residual_free(kn_force_residual *measured); // the struct may be all zeros

// Compute the residual of each span, residual[spans]. If `model_n` is not NULL, model_n[spans] receives the mean of the
// model's force in each span.
void kn_force_residual_compare(const kn_force_residual *measured, const kn_press *press, const kn_pressed *pressed,
                               double *residual, double *model_n);

// ---- all measurements of the press

typedef struct kn_measurement {
    kn_press press;
    int surfaces;                                  // number of measured surfaces
    kn_surface_residual surface[KN_PRESS_MOMENTS]; // [surfaces]
    double moment_s[KN_PRESS_MOMENTS];             // [surfaces] time at which each surface was measured
    bool has_force;                                // whether the force was measured
    kn_force_residual force;                       // measured force, if `has_force`
    bool align;     // whether to fit one horizontal shift of all images from their stated place
    int readings;   // number of residuals
    double until_s; // time of the last measurement
} kn_measurement;

void kn_measurement_close(kn_measurement *measurement); // compute the fields `readings` and `until_s`
void kn_measurement_free(kn_measurement *measurement);

// Compute residual[measurement->readings] of a model that was pressed. If measurement->align is true, fit the shift of
// the images: `shift_m` holds the start of the search and receives the result. `misfit` receives one entry for each
// measured surface, or is NULL. Return false if memory runs out.
bool kn_measurement_compare(const kn_measurement *measurement, const kn_model_surface *model, const kn_pressed *pressed,
                            double shift_m[2], double *residual, kn_surface_misfit misfit[KN_PRESS_MOMENTS]);

// Return the number of independent readings that contain as much information as the residuals. The outline of an image,
// the patches of an image and the force are one series of residuals each. A series of n residuals counts as
// n (1 - c)/(1 + c) readings, where c is the correlation of successive residuals. The result is the sum over all
// series.
double kn_measurement_independent(const kn_measurement *measurement, const double *residual);

#endif
