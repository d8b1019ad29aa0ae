#ifndef KN_CLIENTS_IDENTIFY_CONSTITUTIVE_MODELS_H
#define KN_CLIENTS_IDENTIFY_CONSTITUTIVE_MODELS_H
// The models of a material that are compared (model_comparison.h). Each model predicts a relaxation or creep curve:
//
//     relaxation  springs, dampers   G = k_inf + sum of k_i exp(-t/tau_i), for a class of one-ports that no measurement
//                                    can tell apart. The stress of a dashpot while the strain still rises is left out,
//                                    so classes that differ only in such a dashpot are one model
//                 the papers' damper as a held element, with a separate stress at time 0 for each curve
//                 logarithm          G = a - b ln t
//                 fractional Maxwell by kn_fractional_maxwell_relax
//     creep       springs, dampers   as a Voigt chain, from the Voigt form of the class of one-ports
//                 the papers' damper as a Voigt chain
//                 logarithm          J = b ln(1 + t/tau), by superposition
//                 fractional Maxwell J = t^a/(V Gamma(1+a)) + t^b/(G Gamma(1+b)), by superposition
//
// G is the relaxation modulus, J the creep compliance, t the time. Logarithm and fractional Maxwell are no springs and
// dampers. They are yardsticks: they show how near a model of springs and dampers could come to the data.
//
// If the strain rises at a constant rate during the time `ramp_s` before the hold, every linear model predicts its
// modulus averaged over that rise.
#include "clients/identify/measured_curve.h"
#include "clients/identify/least_squares.h"
#include "core/oneport.h"

#define KN_CONSTITUTIVE_MAX 16    // largest number of models of an experiment
#define KN_CONSTITUTIVE_STARTS 12 // largest number of starts of a search
#define KN_SUPERPOSITION_STEPS 8  // largest number of changes of load; the number of node pairs grows as its square

// ---- yardstick models (yardstick_models.c)

// The fractional Maxwell model: two springpots in series. A springpot lies between a spring (order 0) and a damper
// (order 1).
//
//     o--[ V, a ]--[ G, b ]--o    stress V d^a x/dt^a and G d^b x/dt^b,  0 <= b < a <= 1
//
//     Z(p) = 1/(1/(V p^a) + 1/(G p^b)),   J(t) = t^a/(V Gamma(1+a)) + t^b/(G Gamma(1+b))                        (1)
//     G(t) = G t^-b E_{a-b,1-b}(-(G/V) t^(a-b))                                                                 (2)
//
// E is Mittag-Leffler's function (Jaishankar and McKinley, Proc. R. Soc. A 469 (2013) 20120284). (2) is computed from
// Z(p)/p by the fixed Talbot inversion of Laplace transforms (Abate and Valko, Int. J. Numer. Meth. Engng 60 (2004)
// 979), to a relative error of 1e-10. The powers of p at time t are powers of t times the powers of p at the fixed
// nodes of the inversion. The powers at the fixed nodes are therefore computed only once.
typedef struct kn_fractional_maxwell {
    double v_pa_s, v_order; // coefficient V of the first springpot [Pa s^a], and its order a
    double g_pa_s, g_order; // coefficient G of the second springpot [Pa s^b], and its order b
} kn_fractional_maxwell;

// Compute the relaxation modulus at `count` times [Pa]. The strain is reached at time 0. If `ramp_s` is 0, the strain
// is a step. Otherwise the strain rises at a constant rate from -ramp_s to 0, and the result is equation (2) averaged
// over this ramp. The times must be > 0 after a step, or >= 0 after a ramp.
void kn_fractional_maxwell_relax(const kn_fractional_maxwell *f, double ramp_s, int count, const double *time_s,
                                 double *modulus_pa);

// Creep of any linear material under steps of load, from its creep compliance J(t) alone. The strain x follows from
// Boltzmann's superposition:
//
//     x(t) = integral of J(t - s) dP(s),   P = W/S0 (1 - x), or W/S0 where the area is taken as constant           (3)
//
// The method is product integration: P is linear between nodes (points in time), and J is integrated exactly. Nodes are
// densest just after a change of load. A lag is the time between two nodes. The lags and their logarithms are computed
// once per curve.
typedef struct kn_superposition {
    const kn_curve *curve; // the loads of this curve act on the model
    int nodes;             // number of nodes; 0: the struct has not been prepared
    double *time_s;        // [nodes] times of the nodes; each change of load is a node
    // Private to yardstick_models.c. Each pair of nodes (n, j) with j < n has one entry, at the index n(n-1)/2 + j.
    // lag_s: time between the two nodes; ln_lag: its logarithm; j: compliance; k: integral of the compliance
    double *lag_s, *ln_lag, *j, *k;
    double *strain, *slope;
} kn_superposition;

// Callback: compute the compliance j[], and the integral k[] of the compliance from lag 0 on, at `count` lags > 0.
// ln_lag[] holds the logarithms of the lags. The compliance must be 0 at lag 0.
typedef void kn_superposition_compliance(const void *of, int count, const double *lag_s, const double *ln_lag,
                                         double *j, double *k);

// Prepare the nodes for the loads of a curve, up to the curve's last reading. Return false if there are more than
// KN_SUPERPOSITION_STEPS changes of load or if memory runs out.
bool kn_superposition_open(kn_superposition *m, const kn_curve *curve);
void kn_superposition_close(kn_superposition *m); // the struct may be all zeros

// Compute the strain at `count` rising times, up to the curve's last reading. Return false if a strain is not finite.
bool kn_superposition_creep(kn_superposition *m, kn_superposition_compliance *compliance, const void *of, int count,
                            const double *time_s, double *strain);

// ---- all models of a material

// One class: elements of the catalogue that an experiment cannot tell apart.
typedef struct kn_element_class {
    // name of the class: the Voigt form, or if kn_element_classes was called with `relax`, a name such as "two Maxwell
    // units"
    char name[KN_ELEMENT_TEXT];
    char letters[16]; // letters of its elements in the first paper's figure 2, such as "b d f"
    kn_oneport oneport;
} kn_element_class;

// List the classes of the catalogue in the order of their first elements, and return the number of classes. If `relax`
// is true, elements that differ only in a dashpot in parallel form one class, since a held strain does not show this
// dashpot.
int kn_element_classes(kn_element_class class[KN_CATALOGUE], bool relax);

typedef enum kn_constitutive_kind {
    KN_CONSTITUTIVE_UNITS,  // springs and dampers
    KN_CONSTITUTIVE_PAPERS, // the papers' damper
    KN_CONSTITUTIVE_LOGARITHM,
    KN_CONSTITUTIVE_FRACTIONAL
} kn_constitutive_kind;

typedef struct kn_constitutive_model {
    kn_constitutive_kind kind;
    char name[48];
    char letters[16]; // letters of the elements in the first paper's figure 2, such as "b d f"; "": not in figure 2
    bool yardstick;   // the model is no chain of springs and dampers, and serves for comparison only
    bool relax;       // true: the model predicts relaxation; false: creep
    // The next fields are for the kind KN_CONSTITUTIVE_UNITS. spring: whether k_inf is above 0 (relaxation), or whether
    // the chain has a single spring (creep). damper: whether the chain has a single damper (creep only).
    bool spring, damper;
    int units; // relaxation: number of Maxwell elements; creep: number of Voigt elements
    // The next fields are for the kind KN_CONSTITUTIVE_PAPERS: whether the model has the parameters c1, P0 and P1
    // beside k1, alpha and beta.
    bool c1, p0, p1;
} kn_constitutive_model;

// Readings of one part of a curve, in the order of time. The early part of a curve is fitted, the late part is
// predicted.
typedef struct kn_compared_part {
    int count;      // number of readings
    double *time_s; // [count] relaxation: time since the strain was reached; creep: time since the first load
    double *value;  // [count] relaxation: stress or modulus [Pa]; creep: strain
    double least;   // least value
} kn_compared_part;

typedef struct kn_compared_curve {
    const kn_curve *curve;
    // relaxation only. strain: held strain, or 1 if the values are moduli; ramp_s: duration of the rise of the strain
    double strain, ramp_s;
    double largest;                 // largest magnitude of all values of the curve
    kn_superposition superposition; // creep only
    kn_compared_part part[2];       // [0]: early part; [1]: late part
} kn_compared_curve;

// List all models of an experiment and return the number of models. The first models are the classes of the catalogue.
int kn_constitutive_models(kn_constitutive_model model[KN_CONSTITUTIVE_MAX], bool relax);

// List the unknowns of a model with their units and bounds, and return the number of unknowns. In relaxation with the
// papers' damper, the stress at time 0 of each curve is also an unknown, for at most 6 curves.
int kn_constitutive_unknowns(const kn_constitutive_model *model, int curves, const kn_compared_curve *curve,
                             kn_fit_unknown out[KN_FIT_UNKNOWNS]);

// List up to KN_CONSTITUTIVE_STARTS starts for the search, and return the number of starts. A creep fit of the papers'
// damper continues from a fit of the papers' damper with fewer parameters. `found` holds the `count` fitted values of
// that smaller fit. `count` is 0 if there is no smaller fit.
int kn_constitutive_starts(const kn_constitutive_model *model, int curves, const kn_compared_curve *curve, int count,
                           const kn_fit_unknown *found, double start[][KN_FIT_UNKNOWNS]);

// Predict the curve curve[c] at `count` rising times, for the values value[] of the unknowns. Return false if the model
// has no solution. kn_yardstick_predict is the same function for the yardsticks alone.
bool kn_constitutive_predict(const kn_constitutive_model *model, const double *value, kn_compared_curve *curve, int c,
                             int count, const double *time_s, double *out);
bool kn_yardstick_predict(const kn_constitutive_model *model, const double *value, kn_compared_curve *curve, int count,
                          const double *time_s, double *out);

#endif
