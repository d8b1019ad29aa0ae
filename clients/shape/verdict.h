#ifndef KN_CLIENTS_SHAPE_VERDICT_H
#define KN_CLIENTS_SHAPE_VERDICT_H
// Verdict: which of the fitted structures (candidates) explains the measurements, and how certain the choice is, in
// words. S is the sum of squared residuals, n the number of residuals.
//
//     off     sqrt(S/n), the size of the residuals in units of the noise. A candidate with a larger `off` than
//             KN_VERDICT_OFF does not explain the data
//     dAICc   difference between the candidate's and the best candidate's AICc (Akaike's criterion for small samples).
//             The AICc is computed for the number of independent readings (kn_evidence_worth) of the candidate with the
//             least S. An S below n is raised to n, since a misfit below the noise supports no candidate
//
// If no candidate explains the data, the residuals come from errors of the models, not from noise. In that case the
// best candidate is the one with the least `off`, whatever its number of unknowns. All candidates whose `off` is at
// most KN_VERDICT_NEAR times the least `off` count as equally likely.
//
// A structure whose fitted gas pressure is near 0 is not counted: it equals the structure without gas.
#include "clients/shape/candidate.h"

#define KN_VERDICT_OFF 3.0
#define KN_VERDICT_NEAR 1.3
#define KN_VERDICT_APART 10.0 // dAICc above which a candidate has hardly any support

typedef struct kn_verdict {
    int best;                    // index of the best candidate; -1: no candidate has a solution
    double delta[KN_CANDIDATES]; // dAICc of each candidate; INFINITY: the candidate has no solution
    double off[KN_CANDIDATES];   // `off` of each candidate: size of the residuals in units of the noise
    bool explained;              // whether `off` of the best candidate is at most KN_VERDICT_OFF
    int rival;                   // index of a candidate that is as well supported as the best; -1: there is none
    char words[600];             // the verdict in sentences
} kn_verdict;

void kn_verdict_make(kn_verdict *verdict, int count, const kn_candidate *candidate, const kn_evidence *evidence);

#endif
