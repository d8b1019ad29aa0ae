#ifndef KN_CLIENTS_IDENTIFY_EVIDENCE_H
#define KN_CLIENTS_IDENTIFY_EVIDENCE_H
// All that was measured of one press, and one vector of residuals of what a model makes of it: surfaces first, each at
// its moment, then the force.
#include "clients/identify/pull.h"
#include "clients/identify/relief.h"

typedef struct kn_evidence {
    kn_press press;
    int reliefs;
    kn_relief relief[KN_PRESS_MOMENTS];
    double moment_s[KN_PRESS_MOMENTS];
    bool pulled; // there is a force
    kn_pull pull;
    bool align; // the pictures may lie a little elsewhere in the scene than they say, all of them the same
    int readings;
    double until_s; // what is after it nothing was measured of
} kn_evidence;

void kn_evidence_close(kn_evidence *evidence); // readings and until_s of what is there
void kn_evidence_free(kn_evidence *evidence);

typedef struct kn_exhibit { // a model's side of it
    const kn_surface *surface;
    const float (*rest_m)[3];
    kn_pressed pressed;
} kn_exhibit;

// residual[readings]. shift_m: in, where the search for it begins; out, as found, with align. misfit: of each relief,
// or NULL. False: memory is short.
bool kn_evidence_compare(const kn_evidence *evidence, const kn_exhibit *exhibit, double shift_m[2], double *residual,
                         kn_relief_misfit misfit[KN_PRESS_MOMENTS]);

// How many independent readings residuals are worth: those of one picture's outline, of its patches, and of the force
// are series, n (1 - c)/(1 + c) of each, c their correlation from one to the next.
double kn_evidence_worth(const kn_evidence *evidence, const double *residual);

#endif
