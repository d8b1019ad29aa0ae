#ifndef KN_CLIENTS_IDENTIFY_CONSTITUTIVE_MODELS_H
#define KN_CLIENTS_IDENTIFY_CONSTITUTIVE_MODELS_H
// The laws: the models of a material that are compared (models.h). Each law predicts a relaxation or creep curve:
//
//     relaxation  springs, dampers   G = k_inf + sum of k_i exp(-t/tau_i), for a class of one-ports that no measurement
//                                    can tell apart. The stress of a dashpot while the strain still rises is left out,
//                                    so classes that differ only in such a dashpot are one law
//                 the papers' damper by hold.h, with a separate stress at time 0 for each curve
//                 logarithm          G = a - b ln t
//                 fractional Maxwell by fractional.h
//     creep       springs, dampers   by chain.h, from the Voigt form of the class of one-ports
//                 the papers' damper by chain.h
//                 logarithm          J = b ln(1 + t/tau), by memory.h
//                 fractional Maxwell J = t^a/(V Gamma(1+a)) + t^b/(G Gamma(1+b)), by memory.h
//
// G is the relaxation modulus, J the creep compliance, t the time.
//
// If the strain rises at a constant rate during the time `ramp_s` before the hold, every linear law predicts its
// modulus averaged over that rise.
#include "clients/identify/curve.h"
#include "clients/identify/least_squares.h"
#include "clients/identify/memory.h"

#define KN_CONSTITUTIVE_MAX 16

typedef enum kn_constitutive_kind {
    KN_CONSTITUTIVE_UNITS,
    KN_CONSTITUTIVE_DOUGH,
    KN_CONSTITUTIVE_LOGARITHM,
    KN_CONSTITUTIVE_FRACTIONAL
} kn_constitutive_kind;

typedef struct kn_constitutive_model {
    kn_constitutive_kind kind;
    char name[48];
    char letters[16]; // letters of the elements in the first paper's figure 2, such as "b d f"; "": not in figure 2
    bool yardstick;   // the law is no chain of springs and dampers, and serves for comparison only
    bool relax;       // true: the law predicts relaxation; false: creep
    // The next fields are for the kind KN_CONSTITUTIVE_UNITS (springs and dampers).
    // spring: in relaxation, k_inf is not 0; in creep, the chain has a single spring. damper: the chain has a single
    // damper (creep only)
    bool spring, damper;
    int units; // number of Maxwell elements in relaxation, of Voigt elements in creep
    // The next fields are for the kind KN_CONSTITUTIVE_DOUGH (the papers' damper): which parameters the law has beside k1,
    // alpha and beta.
    bool c1, p0, p1;
} kn_constitutive_model;

// Readings of one part of a curve, in the order of time. The early part of a curve is fitted, the late part is
// predicted.
typedef struct kn_compared_part {
    int count;      // number of readings
    double *time_s; // [count] relaxation: time since the strain was reached; creep: time since the first load
    double *value;  // [count] relaxation: stress or modulus [Pa]; creep: strain
} kn_compared_part;

typedef struct kn_compared_curve {
    const kn_curve *curve;
    // relaxation only: the held strain, or 1 if the values are moduli; duration of the rise of the strain
    double strain, ramp_s;
    kn_superposition memory;  // creep only: nodes for the superposition of memory.h
    kn_compared_part part[2]; // early part, late part
} kn_compared_curve;

// List all laws of an experiment and return the number of laws. The first laws are the one-ports of springs and dampers
// in the catalogue, one law for each class of one-ports.
int kn_constitutive_models(kn_constitutive_model law[KN_CONSTITUTIVE_MAX], bool relax);

// List the unknowns of a law with their bounds, and return the number of unknowns. In relaxation with the papers'
// damper, the stress at time 0 of each curve is also an unknown.
int kn_constitutive_model_unknowns(const kn_constitutive_model *law, int curves, const kn_compared_curve *curve,
                                   kn_fit_unknown out[KN_FIT_UNKNOWNS]);
const char *kn_constitutive_model_unit(const kn_constitutive_model *law,
                                       int unknown); // return the unit of an unknown: "Pa", "Pa*s", ...

// List up to KN_CONSTITUTIVE_STARTS starts for the search, and return the number of starts. A creep fit of the papers'
// damper continues from a fit of the papers' damper with fewer parameters. `found` holds the `count` fitted values of
// that smaller fit. `count` is 0 if there is no smaller fit.
#define KN_CONSTITUTIVE_STARTS 12
int kn_constitutive_model_starts(const kn_constitutive_model *law, int curves, const kn_compared_curve *curve,
                                 int count, const kn_fit_unknown *found, double start[][KN_FIT_UNKNOWNS]);

// Predict the curve curve[c] at `count` rising times, for the values value[] of the unknowns. Return false if the law
// has no solution.
bool kn_constitutive_model_predict(const kn_constitutive_model *law, const double *value, kn_compared_curve *curve,
                                   int c, int count, const double *time_s, double *out);

#endif
