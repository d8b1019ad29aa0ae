#ifndef KN_CLIENTS_IDENTIFY_CANDIDATE_H
#define KN_CLIENTS_IDENTIFY_CANDIDATE_H
// A structure that may explain what was measured, and the fit of it: the inside pressure P0 where it has gas, and the
// factor on gamma, the stress area of an edge, where its material's damper depends on the stress.
//
// clang-format off
//     diagonals            sides, face and body diagonals               (a) of the first paper's figure 12
//     pressure             sides, diagonals of 0.02, gas in every cell  (b), with what keeps it from shearing
//     both                 diagonals and gas                            (c)
//     mesh, mesh-pressure  the edges of a mesh of tetrahedra or triangles, without and with gas in its elements
// clang-format on
//
// gamma is what the stress that a damper feels is worked out with, |f|/(gamma kappa L0) (core/grid.h); springs and
// dashpots do not see it. So gamma times s is the damper's law stretched: p0 s, p1 s, beta/s, c2 at p0 and p1 as it was
// (core/law.h: T(b) becomes s T(b/s)). A scene can say that of its material, and needs no key of its own for it.
#include "clients/identify/evidence.h"
#include "clients/identify/identified.h"
#include "clients/identify/search.h"

#define KN_CANDIDATES 5
#define KN_CANDIDATE_SETS 6
#define KN_LEAST_PA 100.0 // of P0: what a scene takes
#define KN_MOST_PA 1e7

typedef struct kn_candidate {
    const char *name, *words; // "both", "diagonals and gas in every cell"
    kn_scene *scene;          // owned
    kn_model *first;          // with the numbers of the scene, for its surface; owned
    kn_exhibit best;          // its surface is owned
    float (*rest_m)[3];
    bool gas, area; // what is sought
    bool one_skin;  // the scene asks for gas in one skin around all cells, which no structure has
    // of kn_candidate_fit
    bool found;    // else it has no answer anywhere
    char why[200]; // then why
    double pressure_pa, area_factor, shift_m[2];
    double gamma;           // of the model with area_factor 1
    kn_identified known[2]; // of P0 and of the factor; those sought come first
    int sought, unknowns;   // with the shifts
    bool no_gas_left;       // P0 went to its lower bound
    double sum, worth;      // S; independent readings
    double *residual;       // [readings]
    kn_relief_misfit misfit[KN_PRESS_MOMENTS];
    double pull_share; // rms of force over the largest
    int presses;
    bool settled, early; // as kn_search has them
    double seconds;
} kn_candidate;

// A scene, or NULL and one line in error: path with the user's sets, then the structure's.
typedef struct kn_candidate_def {
    const char *scene_path;
    const char *const *sets;
    int set_count;
    const char *mesh, *mesh_unit; // for the mesh structures; NULL: the scene's own
} kn_candidate_def;

// What structures there are for that scene, by their names; all of them where only is NULL, else those between its
// commas. Returns their number; 0 and one line in error: none, or a scene cannot be made.
int kn_candidates_open(kn_candidate candidate[KN_CANDIDATES], const kn_candidate_def *def, const char *only,
                       char *error, size_t error_size);
void kn_candidate_free(kn_candidate *candidate);

// The scene's definition with other numbers.
kn_model_def kn_candidate_model(const kn_candidate *candidate, double pressure_pa, double area_factor);

// told: as kn_press_play has it. Several candidates may be fitted at a time. False: memory is short.
bool kn_candidate_fit(kn_candidate *candidate, const kn_evidence *evidence, void (*told)(void *of, int64_t ticks),
                      void *of);

// Ticks that the fit will play, about.
double kn_candidate_work(const kn_candidate *candidate, const kn_evidence *evidence);

// A scene with what was found, that kneadd loads: its canonical text under a comment. NULL and one line in error.
char *kn_candidate_scene(const kn_candidate *candidate, const kn_candidate_def *def, char *error, size_t error_size);

// The same block with the same numbers in cells half as wide, with nothing left to be sought: what of a misfit is the
// lattice's. False and one line in error; finer is freed then.
bool kn_candidate_finer(kn_candidate *finer, const kn_candidate *candidate, const kn_candidate_def *def, char *error,
                        size_t error_size);

#endif
