#ifndef KN_CLIENTS_IDENTIFY_LAWS_H
#define KN_CLIENTS_IDENTIFY_LAWS_H
// What the models that are compared (models.h) say of a relaxation or a creep curve.
//
//     held      springs, dampers   k_inf + sum of k_i exp(-t/tau_i): a class of one-ports but for what its dashpot
//                                  carries while the strain still grows, so classes that differ in that alone are one
//               the papers' damper hold.h, from a stress of its own for each curve at time 0
//               logarithm          a - b ln t
//               fractional Maxwell fractional.h
//     creep     springs, dampers   chain.h, the class's Voigt form
//               the papers' damper chain.h
//               logarithm          J = b ln(1 + t/tau), by memory.h
//               fractional Maxwell J = t^a/(V Gamma(1+a)) + t^b/(G Gamma(1+b)), by memory.h
//
// A hold after a steady rise of the strain within ramp_s is the modulus averaged over that, for all that is linear.
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
    char letters[16]; // of the first paper's figure 2, "b d f"; "": none
    bool yardstick;   // no row of springs and dampers
    bool relax;       // else creep
    // UNITS
    bool spring, damper; // relax: spring is k_inf. creep: in the row
    int units;           // relax: Maxwell units. creep: Voigt units
    // DOUGH: what it has beside k1, alpha, beta
    bool c1, p0, p1;
} kn_fit_law;

// One curve's readings, those that are fitted and those that are predicted, in the order of time.
typedef struct kn_fit_law_part {
    int count;
    double *time_s; // relax: since the strain was reached
    double *value;  // relax: stress, Pa, or modulus. creep: strain
} kn_fit_law_part;

typedef struct kn_fit_law_curve {
    const kn_curve *curve;
    double strain, ramp_s;   // relax; strain 1 where the values are moduli
    kn_memory memory;        // creep
    kn_fit_law_part part[2]; // early, late
} kn_fit_law_curve;

// All laws of an experiment; the springs and dampers of the catalogue first, one for each class. Returns how many.
int kn_fit_laws(kn_fit_law law[KN_FIT_LAWS_MAX], bool relax);

// The unknowns of a law with their bounds. Behind them, for the papers' damper in a hold, a stress for each curve.
int kn_fit_law_unknowns(const kn_fit_law *law, int curves, const kn_fit_law_curve *curve,
                        kn_fit_unknown out[KN_FIT_UNKNOWNS]);
const char *kn_fit_law_unit(const kn_fit_law *law, int unknown); // "Pa", "Pa*s", ..., of the unknown of that number

// Where a search may begin: up to KN_FIT_LAW_STARTS places. found: what was found for the papers' damper with fewer
// numbers, from which a creep goes on; count 0: nothing yet.
#define KN_FIT_LAW_STARTS 12
int kn_fit_law_starts(const kn_fit_law *law, int curves, const kn_fit_law_curve *curve, int count,
                      const kn_fit_unknown *found, double start[][KN_FIT_UNKNOWNS]);

// What the law says of curve number c at count times that rise. False: no answer.
bool kn_fit_law_predict(const kn_fit_law *law, const double *value, kn_fit_law_curve *curve, int c, int count,
                        const double *time_s, double *out);

#endif
