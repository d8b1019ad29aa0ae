#ifndef KN_CLIENTS_SHAPE_TRUST_REGION_H
#define KN_CLIENTS_SHAPE_TRUST_REGION_H
// Least squares for a model whose evaluation takes seconds. The search has one or two unknowns and needs about ten
// evaluations of the model.
//
// All evaluations are kept. Around the best one the model is taken to be linear in the logarithms of the unknowns. The
// slopes come from the nearest evaluations in different directions (secants). kn_fit minimises this linear model within
// a trust region, and the model is evaluated there next. The region grows or shrinks with the ratio of the actual to
// the predicted decrease of the sum of squares. The search ends when the next step is below half a percent, or when the
// next step is below 20 % and its predicted decrease is below a thousandth of the sum of squares (a hundredth if the
// model is far from the data). The search continues while the secants are too long to be trusted.
//
// The slopes come from secants over 20 % of an unknown, not from kn_fit's own step of 1e-5 of a logarithm. The reason
// is that a press is computed in single precision with a solver tolerance of 0.001, so its residuals are not smooth in
// the last digits.
#include "clients/identify/least_squares.h"

#define KN_TRUST_UNKNOWNS 2
#define KN_TRUST_EVALUATIONS 16

typedef struct kn_evaluation {
    double at[KN_TRUST_UNKNOWNS]; // logarithms of the unknowns at which the model was evaluated
    double *residual, sum; // residuals (owned), and their sum of squares; sum INFINITY: the model has no solution
} kn_evaluation;

typedef struct kn_trust_region {
    int unknowns; // number of unknowns; 0: the model is evaluated once, without a search
    const char *name[KN_TRUST_UNKNOWNS];
    double low[KN_TRUST_UNKNOWNS], high[KN_TRUST_UNKNOWNS];
    int starts; // number of starts; the model is evaluated at each, and the search continues from the best start
    double start[6][KN_TRUST_UNKNOWNS];
    int readings;
    // Callback: compute residual[readings] for the given values of the unknowns. Return false if the model has no
    // solution for these values.
    bool (*misfit)(void *of, const double value[KN_TRUST_UNKNOWNS], double *residual);
    void *of;
    // The next fields are results of the search.
    int evaluations, best; // evaluations: number of evaluations; best: index of the best evaluation
    kn_evaluation evaluation[KN_TRUST_EVALUATIONS];
    double value[KN_TRUST_UNKNOWNS];
    bool settled; // the search converged; false: it used up all evaluations
    // the search ended far from the data, while the predicted decrease was still above a thousandth of the sum of
    // squares
    bool early;
    // derivatives of the residuals by the logarithms of the unknowns, at the best evaluation; owned
    double *slope[KN_TRUST_UNKNOWNS];
} kn_trust_region;

// Run the search. Return false if no start has a solution, or if memory runs out.
bool kn_trust_region_run(kn_trust_region *search);
void kn_trust_region_free(kn_trust_region *search);

// Return the 95 % interval of an unknown by the method "curvature" of least_squares.h. `independent` is the number of
// independent readings (kn_measurement_independent).
kn_fit_interval kn_trust_region_interval(const kn_trust_region *search, int unknown, double independent);

#endif
