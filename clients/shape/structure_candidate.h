#ifndef KN_CLIENTS_SHAPE_STRUCTURE_CANDIDATE_H
#define KN_CLIENTS_SHAPE_STRUCTURE_CANDIDATE_H
// A candidate: a structure of the object that may explain the measurements, and its fit to them. If the structure has
// gas in its cells, the inside pressure P0 is an unknown. If the material's damper depends on the stress, a factor on
// gamma, the stress area of an edge, is an unknown.
//
// clang-format off
//     diagonals            sides, face and body diagonals               (a) of the first paper's figure 12
//     pressure             sides, diagonals of 0.02, gas in every cell  (b), with enough diagonals to prevent shearing
//     both                 diagonals and gas                            (c)
//     mesh, mesh-pressure  the edges of a mesh of tetrahedra or triangles, without and with gas in its elements
// clang-format on
//
// gamma turns the force f of an edge into the stress that drives its damper, |f|/(gamma kappa L0) (core/grid.h).
// Springs and dashpots do not use gamma. A factor s on gamma thus stretches the law of the damper: p0, p1 and 1/beta
// become s times as large, and the damping c2 at p0 and at p1 stays (core/law.h: T(b) becomes s T(b/s)). A scene
// expresses the factor by these material parameters and needs no key of its own for it.
//
// The verdict states which of the fitted structures explains the measurements, and how certain the choice is. S is the
// sum of squared residuals, n the number of residuals.
//
//     off     sqrt(S/n), the size of the residuals in units of the noise. A candidate with a larger `off` than
//             KN_STRUCTURE_VERDICT_OFF does not explain the data
//     dAICc   difference between the candidate's and the best candidate's AICc (Akaike's criterion for small samples).
//             The AICc is computed for the number of independent readings of the candidate with the least S. An S below
//             n is raised to n, since a misfit below the noise supports no candidate
//
// If no candidate explains the data, the residuals come from errors of the models, not from noise. In that case the
// best candidate is the one with the least `off`, whatever its number of unknowns. All candidates whose `off` is at
// most KN_STRUCTURE_VERDICT_NEAR times the least `off` count as equally likely.
//
// A structure whose fitted gas pressure is near 0 is not counted: it equals the structure without gas.
#include "clients/identify/parameter_estimate.h"
#include "clients/shape/measurement.h"

#define KN_CANDIDATES 5

typedef struct kn_candidate {
    const char *name, *words; // for example name "both" and words "diagonals and gas in every cell"
    kn_scene *scene;          // owned
    kn_model *first;          // model with the scene's own parameters; it defines the surface; owned
    kn_model_surface surface; // owned
    kn_pressed pressed;       // results of the press with the best parameters so far; owned
    bool gas, area; // gas: the inside pressure P0 is an unknown of the fit; area: the factor on gamma is an unknown
    bool one_skin;  // the scene requests gas in one skin around all cells, which no candidate structure offers
    // The next fields are set by kn_candidate_fit.
    bool found;    // false: the model of this structure has no solution at any start of the search
    char why[200]; // reason why the model has no solution; set if `found` is false
    double pressure_pa, area_factor, shift_m[2];
    double gamma;                   // gamma of the model whose area_factor is 1
    kn_parameter_estimate known[2]; // P0, if P0 is an unknown; then gamma, if the factor on gamma is an unknown
    int unknowns; // number of unknowns: P0, the factor on gamma, and the shift of the images along x and y
    // the fit removed the gas: the fitted P0 is below 0.05 atm, and the data give P0 no lower limit
    bool no_gas_left;
    // sum: sum S of the squared residuals; independent: number of independent readings in the residuals
    double sum, independent;
    double *residual; // [readings] residuals of the best press
    kn_surface_misfit misfit[KN_PRESS_MOMENTS];
    double force_share; // rms difference of measured and computed force, as a share of the largest measured force
    int presses;
    // settled: the search converged; early: the search ended early, far from the data (kn_trust_region)
    bool settled, early;
    double seconds;
} kn_candidate;

// Sources of a candidate's scene: a scene file and the changes to it. The user's --set options are applied first, then
// the settings of the candidate's structure.
typedef struct kn_candidate_def {
    const char *scene_path;
    const char *const *sets;
    int set_count;
    const char *mesh, *mesh_unit; // mesh for the two mesh structures; NULL: the scene's own mesh
} kn_candidate_def;

// List the structures that are possible for the scene. `only` limits them to names separated by commas; NULL: all.
// Return the number of structures. Return 0 with one line in `error` if there are none or if a scene cannot be built.
int kn_candidates_open(kn_candidate candidate[KN_CANDIDATES], const kn_candidate_def *def, const char *only,
                       char *error, size_t error_size);
void kn_candidate_free(kn_candidate *candidate);

// Return the model definition of the candidate's scene with the given inside pressure P0 and the given factor on gamma.
kn_model_def kn_candidate_model(const kn_candidate *candidate, double pressure_pa, double area_factor);

// Fit one candidate to the measurement. Several threads may fit different candidates at once. To report progress, the
// fit calls `told` with `of` and the number of ticks that were simulated since the last call. Return false if memory
// runs out.
bool kn_candidate_fit(kn_candidate *candidate, const kn_measurement *measurement, void (*told)(void *of, int64_t ticks),
                      void *of);

// Estimate the number of ticks that all presses of the fit will simulate.
double kn_candidate_work(const kn_candidate *candidate, const kn_measurement *measurement);

// Return a scene with the fitted parameters, as canonical text that kneadd loads. The caller frees the text. On failure
// return NULL with one line in `error`.
char *kn_candidate_scene(const kn_candidate *candidate, const kn_candidate_def *def, char *error, size_t error_size);

// Store in `finer` the block of `candidate` with the fitted parameters, but with cells of half the width and without
// unknowns. The misfit of `finer` shows how much of the error comes from the lattice. On failure free `finer` and
// return false with one line in `error`.
bool kn_candidate_finer(kn_candidate *finer, const kn_candidate *candidate, const kn_candidate_def *def, char *error,
                        size_t error_size);

#define KN_STRUCTURE_VERDICT_OFF 3.0
#define KN_STRUCTURE_VERDICT_NEAR 1.3
#define KN_STRUCTURE_VERDICT_APART 10.0 // dAICc above which a candidate has hardly any support

typedef struct kn_structure_verdict {
    int best;                    // index of the best candidate; -1: no candidate has a solution
    double delta[KN_CANDIDATES]; // dAICc of each candidate; INFINITY: the candidate has no solution
    double off[KN_CANDIDATES];   // `off` of each candidate: size of the residuals in units of the noise
    bool explained;              // whether `off` of the best candidate is at most KN_STRUCTURE_VERDICT_OFF
    int rival;                   // index of a candidate that is as well supported as the best; -1: there is none
    char words[600];             // the verdict in sentences
} kn_structure_verdict;

void kn_structure_verdict_make(kn_structure_verdict *verdict, int count, const kn_candidate *candidate,
                               const kn_measurement *measurement);

#endif
