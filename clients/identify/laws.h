#ifndef KN_CLIENTS_IDENTIFY_LAWS_H
#define KN_CLIENTS_IDENTIFY_LAWS_H
// The laws: models of a material that are compared (models.h), and their prediction of a relaxation or creep curve.
//
//     held      springs, dampers   k_inf + sum of k_i exp(-t/tau_i): a class of one-ports, except for the stress in its
//                                  dashpot while the strain still rises; classes that differ only there are one law
//               the papers' damper hold.h, from a separate stress at time 0 for each curve
//               logarithm          a - b ln t
//               fractional Maxwell fractional.h
//     creep     springs, dampers   chain.h, the class's Voigt form
//               the papers' damper chain.h
//               logarithm          J = b ln(1 + t/tau), by memory.h
//               fractional Maxwell J = t^a/(V Gamma(1+a)) + t^b/(G Gamma(1+b)), by memory.h
//
// If the strain rises at a constant rate within `ramp_s` before the hold, every linear law predicts its modulus
// averaged over the rise.
#include "clients/identify/curve.h"
#include "clients/identify/fit.h"
#include "clients/identify/memory.h"

#define KN_FIT_LAWS_MAX 16

typedef enum kn_fit_law_kind {
    KN_FIT_LAW_UNITS,
    KN_FIT_LAW_DOUGH,
    KN_FIT_LAW_LOGARITHM,
    KN_FIT_LAW_FRACTIONAL
} kn_fit_law_kind;

typedef struct kn_fit_law {
    kn_fit_law_kind kind;
    char name[48];
    char letters[16]; // letters in the first paper's figure 2, "b d f"; "": none
    bool yardstick;   // a law that is not a chain of springs and dampers, for comparison only
    bool relax;       // else creep
    // UNITS
    bool spring, damper; // relax: spring: with k_inf; creep: the chain has a spring, a damper
    int units;           // relax: Maxwell elements; creep: Voigt elements
    // DOUGH: which parameters the law has beside k1, alpha and beta
    bool c1, p0, p1;
} kn_fit_law;

// Readings of one curve in the order of time: the early part, which is fitted, or the late part, which is predicted.
typedef struct kn_fit_law_part {
    int count;
    double *time_s; // relax: since the strain was reached
    double *value;  // relax: stress, Pa, or modulus; creep: strain
} kn_fit_law_part;

typedef struct kn_fit_law_curve {
    const kn_curve *curve;
    double strain, ramp_s;   // relax; strain is 1 if the values are moduli
    kn_memory memory;        // creep
    kn_fit_law_part part[2]; // early, late
} kn_fit_law_curve;

// List all laws of an experiment and return their number. First come the one-ports of springs and dampers in the
// catalogue, one for each class.
int kn_fit_laws(kn_fit_law law[KN_FIT_LAWS_MAX], bool relax);

// List the unknowns of a law with their bounds, and return their number. For the papers' damper in a hold, the stress
// at time 0 of each curve is an unknown, too.
int kn_fit_law_unknowns(const kn_fit_law *law, int curves, const kn_fit_law_curve *curve,
                        kn_fit_unknown out[KN_FIT_UNKNOWNS]);
const char *kn_fit_law_unit(const kn_fit_law *law, int unknown); // unit of an unknown: "Pa", "Pa*s", ...

// List up to KN_FIT_LAW_STARTS starts for the search, and return their number. `found` holds the `count` fitted values
// of the papers' damper with fewer parameters, from which a creep fit continues; `count` 0: there is no such fit yet.
#define KN_FIT_LAW_STARTS 12
int kn_fit_law_starts(const kn_fit_law *law, int curves, const kn_fit_law_curve *curve, int count,
                      const kn_fit_unknown *found, double start[][KN_FIT_UNKNOWNS]);

// Predict curve number `c` at `count` rising times, for the values of the unknowns. Return false if the law has no
// solution.
bool kn_fit_law_predict(const kn_fit_law *law, const double *value, kn_fit_law_curve *curve, int c, int count,
                        const double *time_s, double *out);

#endif
