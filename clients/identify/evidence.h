#ifndef KN_CLIENTS_IDENTIFY_EVIDENCE_H
#define KN_CLIENTS_IDENTIFY_EVIDENCE_H
// Evidence: all measurements of one press, which are surfaces at given times and the contact force. It also defines the
// vector of a model's residuals: first those of each surface, then those of the force.
#include "clients/identify/pull.h"
#include "clients/identify/relief.h"

typedef struct kn_evidence {
    kn_press press;
    int reliefs;
    kn_relief relief[KN_PRESS_MOMENTS];
    double moment_s[KN_PRESS_MOMENTS];
    bool pulled; // whether the force was measured
    kn_pull pull;
    bool align; // fit one shift, common to all images, of their place in the scene
    int readings;
    double until_s; // time of the last measurement
} kn_evidence;

void kn_evidence_close(kn_evidence *evidence); // computes readings and until_s
void kn_evidence_free(kn_evidence *evidence);

typedef struct kn_exhibit { // An exhibit: a model's simulated press, for comparison with the evidence
    const kn_surface *surface;
    const float (*rest_m)[3];
    kn_pressed pressed;
} kn_exhibit;

// Compute residual[readings]. If `align`, the shift is fitted: `shift_m` holds the start of the search and receives the
// result. `misfit` has one entry for each relief, or is NULL. Return false if memory runs out.
bool kn_evidence_compare(const kn_evidence *evidence, const kn_exhibit *exhibit, double shift_m[2], double *residual,
                         kn_relief_misfit misfit[KN_PRESS_MOMENTS]);

// Return the number of independent readings that contain as much information as the residuals. The outline of an image,
// the patches of an image and the force are one series each. A series of n residuals counts as n (1 - c)/(1 + c)
// readings, where c is the correlation of successive residuals.
double kn_evidence_worth(const kn_evidence *evidence, const double *residual);

#endif
