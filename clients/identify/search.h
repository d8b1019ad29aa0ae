#ifndef KN_CLIENTS_IDENTIFY_SEARCH_H
#define KN_CLIENTS_IDENTIFY_SEARCH_H
// Least squares for a model whose evaluation takes seconds. The search has one or two unknowns and needs about ten
// evaluations of the model. Each evaluation is called a look.
//
// All looks are kept. Around the best look the model is taken to be linear in the logarithms of the unknowns. The
// slopes come from the nearest looks in different directions (secants). kn_fit minimises this linear model within a
// trust region, and the next look is taken there. The region grows or shrinks with the ratio of the actual to the
// predicted decrease of the sum of squares. The search ends when the next step is below half a percent, or when the
// predicted decrease is below a thousandth of the sum of squares (a hundredth if the model is far from the data). The
// search continues while the secants are too long to be trusted.
//
// The slopes come from secants over 20 % of an unknown, not from kn_fit's own step of 1e-5 of a logarithm. The reason
// is that a press is computed in single precision with a solver tolerance of 0.001, so its residuals are not smooth in
// the last digits.
#include "clients/identify/least_squares.h"

#define KN_SEARCH_UNKNOWNS 2
#define KN_SEARCH_LOOKS 16

typedef struct kn_look {
    double at[KN_SEARCH_UNKNOWNS]; // logarithms of the unknowns
    double *residual, sum; // residuals (owned), and their sum of squares; sum INFINITY: the model has no solution
} kn_look;

typedef struct kn_search {
    int unknowns; // number of unknowns; 0: the model is evaluated once, without a search
    const char *name[KN_SEARCH_UNKNOWNS];
    double low[KN_SEARCH_UNKNOWNS], high[KN_SEARCH_UNKNOWNS];
    int starts; // number of starts; the model is evaluated at each, and the search continues from the best start
    double start[6][KN_SEARCH_UNKNOWNS];
    int readings;
    bool (*look)(void *of, const double value[KN_SEARCH_UNKNOWNS], double *residual);
    void *of;
    // The following fields are results.
    int looks, best; // number of looks; index of the best look in at[]
    kn_look at[KN_SEARCH_LOOKS];
    double value[KN_SEARCH_UNKNOWNS];
    bool at_low[KN_SEARCH_UNKNOWNS], at_high[KN_SEARCH_UNKNOWNS];
    bool settled; // the search converged; false: it used up all looks
    // the search ended far from the data, while the predicted decrease was still above a thousandth of the sum of
    // squares
    bool early;
    // derivatives of the residuals by the logarithms of the unknowns, best look; owned
    double *slope[KN_SEARCH_UNKNOWNS];
} kn_search;

// Run the search. Return false if no start has a solution, or if memory runs out.
bool kn_search_run(kn_search *search);
void kn_search_free(kn_search *search);

// Return the 95 % interval of an unknown by the method "curvature" of least_squares.h. `worth` is the number of independent
// readings (kn_evidence_worth).
kn_fit_interval kn_search_interval(const kn_search *search, int unknown, double worth);

#endif
