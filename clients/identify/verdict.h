#ifndef KN_CLIENTS_IDENTIFY_VERDICT_H
#define KN_CLIENTS_IDENTIFY_VERDICT_H
// Which of the fitted structures explains what was measured, and in words how sure that is.
//
//     off     sqrt(S/n): how many times the noise the residuals are; above KN_VERDICT_OFF nothing explains them
//     dAICc   of Akaike's criterion against the best, by as many independent readings as the best one's residuals are
//             worth; S no less than n: what is below the noise supports nobody
//
// Where nothing explains it the model's error decides, not the noise: then the best is the one that is least off,
// whatever its numbers cost, and all that are off by up to KN_VERDICT_NEAR times as much are as likely.
//
// Gas whose pressure the fit has taken away is no structure of its own: it is the same without gas.
#include "clients/identify/candidate.h"

#define KN_VERDICT_OFF 3.0
#define KN_VERDICT_NEAR 1.3
#define KN_VERDICT_APART 10.0 // of dAICc: hardly any support is left

typedef struct kn_verdict {
    int best;                    // candidate; -1: none has an answer
    double delta[KN_CANDIDATES]; // INFINITY: no answer
    double off[KN_CANDIDATES];
    bool explained; // best's off is small enough
    int rival;      // as well supported; -1: none
    char words[600];
} kn_verdict;

void kn_verdict_make(kn_verdict *verdict, int count, const kn_candidate *candidate, const kn_evidence *evidence);

#endif
