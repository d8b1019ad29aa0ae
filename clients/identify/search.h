#ifndef KN_CLIENTS_IDENTIFY_SEARCH_H
#define KN_CLIENTS_IDENTIFY_SEARCH_H
// Least squares where every look at the model takes seconds: one or two unknowns, about ten looks.
//
// Looks are kept. Around the best of them the model is taken to be straight in the logarithms, by the nearest looks
// that lie in different directions (secants); kn_fit finds the best of that straight model within a trust region, there
// the next look is taken, and the region grows or shrinks by whether it kept what it promised. It ends where the next
// step would be below half a percent, or promises less than a thousandth of the sum (a hundredth, far off), and the
// secants are short enough to be believed.
//
// Differences over 20 % instead of kn_fit's own 1e-5 of a logarithm: a press in f32 with a tolerance of 0.001 is not
// smooth in the last digits.
#include "clients/identify/fit.h"

#define KN_SEARCH_UNKNOWNS 2
#define KN_SEARCH_LOOKS 16

typedef struct kn_look {
    double at[KN_SEARCH_UNKNOWNS]; // logarithms
    double *residual, sum;         // owned; sum INFINITY: no answer there
} kn_look;

typedef struct kn_search {
    int unknowns; // 0: one look
    const char *name[KN_SEARCH_UNKNOWNS];
    double low[KN_SEARCH_UNKNOWNS], high[KN_SEARCH_UNKNOWNS];
    int starts; // the best of them is gone on from
    double start[6][KN_SEARCH_UNKNOWNS];
    int readings;
    bool (*look)(void *of, const double value[KN_SEARCH_UNKNOWNS], double *residual);
    void *of;
    // out
    int looks, best;
    kn_look at[KN_SEARCH_LOOKS];
    double value[KN_SEARCH_UNKNOWNS];
    bool at_low[KN_SEARCH_UNKNOWNS], at_high[KN_SEARCH_UNKNOWNS];
    bool settled;                      // it ended as above, not for want of looks
    bool early;                        // and far off, where a thousandth of the sum was still promised
    double *slope[KN_SEARCH_UNKNOWNS]; // of the residuals by each logarithm, at the best; owned
} kn_search;

// False: no start has an answer, or memory is short.
bool kn_search_run(kn_search *search);
void kn_search_free(kn_search *search);

// 95 % interval by curvature, were the residuals worth so many independent readings.
kn_fit_interval kn_search_interval(const kn_search *search, int unknown, double worth);

#endif
