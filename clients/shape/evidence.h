#ifndef KN_CLIENTS_SHAPE_EVIDENCE_H
#define KN_CLIENTS_SHAPE_EVIDENCE_H
// Evidence: all measurements of one press. The measurements are surfaces at given times, and the contact force. The
// residuals of a model form one vector: first the residuals of each surface, then the residuals of the force.
#include "clients/shape/pull.h"
#include "clients/shape/relief.h"

typedef struct kn_evidence {
    kn_press press;
    int reliefs;                        // number of measured surfaces
    kn_relief relief[KN_PRESS_MOMENTS]; // [reliefs]
    double moment_s[KN_PRESS_MOMENTS];  // [reliefs] time at which each surface was measured
    bool pulled;                        // whether the force was measured
    kn_pull pull;                       // measured force, if `pulled`
    bool align;                         // fit one horizontal shift, common to all images, of their place in the scene
    int readings;                       // number of residuals
    double until_s;                     // time of the last measurement
} kn_evidence;

void kn_evidence_close(kn_evidence *evidence); // compute the fields readings and until_s
void kn_evidence_free(kn_evidence *evidence);

// An exhibit: a model's simulated press, for comparison with the evidence.
typedef struct kn_exhibit {
    const kn_surface *surface;
    const float (*rest_m)[3]; // positions of the surface's vertices at rest
    kn_pressed pressed;
} kn_exhibit;

// Compute residual[evidence->readings]. If evidence->align is true, fit the shift of the images: `shift_m` holds the
// start of the search and receives the result. `misfit` receives one entry for each measured surface, or is NULL.
// Return false if memory runs out.
bool kn_evidence_compare(const kn_evidence *evidence, const kn_exhibit *exhibit, double shift_m[2], double *residual,
                         kn_relief_misfit misfit[KN_PRESS_MOMENTS]);

// Return the number of independent readings that contain as much information as the residuals. The outline of an image,
// the patches of an image and the force are one series of residuals each. A series of n residuals counts as
// n (1 - c)/(1 + c) readings, where c is the correlation of successive residuals. The result is the sum over all
// series.
double kn_evidence_worth(const kn_evidence *evidence, const double *residual);

#endif
