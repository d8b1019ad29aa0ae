#ifndef KN_CLIENTS_IDENTIFY_VERDICT_H
#define KN_CLIENTS_IDENTIFY_VERDICT_H
// Verdict: which of the fitted structures (candidates) explains the measurements, and how certain that is, in words. S
// is the sum of squared residuals, n their number.
//
//     off     sqrt(S/n): the size of the residuals in units of the noise; nothing explains the data above
//             KN_VERDICT_OFF
//     dAICc   difference of Akaike's criterion from the best, for the number of independent readings that the residuals
//             of the candidate with the least S are worth. S is at least n, since a misfit below the noise supports no
//             candidate
//
// If no candidate explains the data, the errors of the models decide instead of the noise. The best candidate is then
// the one with the least `off`, whatever its number of unknowns. All candidates whose `off` is at most KN_VERDICT_NEAR
// times as large count as equally likely.
//
// A structure whose fitted gas pressure is near 0 is not counted: it equals the structure without gas.
#include "clients/identify/candidate.h"

#define KN_VERDICT_OFF 3.0
#define KN_VERDICT_NEAR 1.3
#define KN_VERDICT_APART 10.0 // dAICc above which a candidate has hardly any support

typedef struct kn_verdict {
    int best;                    // index of the best candidate; -1: none has a solution
    double delta[KN_CANDIDATES]; // dAICc; INFINITY: no solution
    double off[KN_CANDIDATES];
    bool explained; // whether `off` of the best candidate is at most KN_VERDICT_OFF
    int rival;      // index of a candidate that is as well supported as the best; -1: none
    char words[600];
} kn_verdict;

void kn_verdict_make(kn_verdict *verdict, int count, const kn_candidate *candidate, const kn_evidence *evidence);

#endif
