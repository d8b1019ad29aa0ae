#ifndef KN_CLIENTS_STABILITY_TRIAL_H
#define KN_CLIENTS_STABILITY_TRIAL_H
// Trial: one small scene, one action on it, and a comparison of a solver's result with a reference. `knead stability`
// runs some thousands of trials.
//
// Reference R(dt): the same scene, path and time step dt, computed in f64. In each time step the law of the edges is
// relinearised, and the equations are solved by conjugate gradients, until the residual is 1e-7 of the residual at the
// start of the step. If the residual at the start is small, the bound is 1e-10 of the largest residual of the last
// second. So R(dt) is the exact solution of the time step's equations, free of solver errors. R(dt/2) is the same with
// half the time step and is solved to 1e-4.
//
//     solver error        |x - R(dt)| / |R(dt)|           error by iterations, linearisation and f32; judged
//     time-step error     |R(dt) - R(dt/2)| / |R(dt/2)|   error by the time step, for any solver; reported separately
//
// x is the result of the solver under test. |.| is the Euclidean norm. Each error is computed for forces and for
// shapes. Force error: norm over the forces of all steps, or, without a probe, over the displacements of the top.
// Shape error: norm over the displacements of all nodes, at the end of the pressing and at the end of the trial. The
// larger difference of the two times is divided by the larger norm of the two times.
//
// Judgements:
//     right        the force error and the shape error are below 5 %, because a hand notices differences of 7 % or more
//                  (Pang, Tan, Durlach 1991). If the time-step error is above 5 %, the bound is the time-step error,
//                  but 7 % at most, because no solver is to blame if a node bounces off the plate once more or less
//     chattering   total variation / peak of the forces is more than 1.5 times that of R(dt) or R(dt/2), whichever is
//                  smaller
//     wrong        finite and not chattering, but an error is above its bound
//     diverged     a number is not finite, or a force is above a hundred times the reference's peak
//     refused      the model cannot be built; `reason` tells why
// An explicit method does not share the time-step error of R(dt), so its bound is larger by that error, which is about
// twice the time-step error above. If the time step is shorter than a millisecond, forces are averaged over a
// millisecond, because a device receives one force per millisecond. No path is symmetric, because on a symmetric path
// rounding alone would decide to which side a soft block buckles.
#include "core/step.h"

// Action of the hand or load on the object.
// PRESS: the tool goes from the undeformed top down to depth_m, stays, and goes up again, at most at 3 cm/s.
// JUMP: as PRESS, but during three time steps on the way down the tool's pose is displaced by jump_m.
// LOAD: a constant force presses on the top of the object during the first half of the trial.
// NONE: nothing acts on the object.
typedef enum kn_stability_trial_hand {
    KN_STABILITY_TRIAL_HAND_PRESS,
    KN_STABILITY_TRIAL_HAND_JUMP,
    KN_STABILITY_TRIAL_HAND_LOAD,
    KN_STABILITY_TRIAL_HAND_NONE
} kn_stability_trial_hand;

typedef struct kn_stability_trial {
    kn_model_def def;
    kn_stability_trial_hand hand;
    int steps;        // number of time steps of def.solver.dt_s
    double depth_m;   // PRESS, JUMP: depth of the tool; reduced if its speed would exceed 3 cm/s
    double jump_m[3]; // JUMP: displacement of the tool's pose
    // LOAD: strain that the material, from rest, reaches under the load in half the trial's time; this sets the load.
    double strain;
    // Volume ratio V/V0 of the object's topmost cells at the start; 1: at rest; negative: the cells are inside out.
    double squeezed;
    kn_simplices *mesh; // mesh of the object, owned by the trial; def.mesh points to it
} kn_stability_trial;

typedef enum kn_judgement {
    KN_STABILITY_TRIAL_RIGHT,
    KN_STABILITY_TRIAL_REFUSED,
    KN_STABILITY_TRIAL_CHATTERING,
    KN_STABILITY_TRIAL_WRONG,
    KN_STABILITY_TRIAL_DIVERGED,
    KN_STABILITY_TRIAL_DIED, // the process of the trial ended before the result was judged, or could not be started
    KN_JUDGEMENTS
} kn_judgement;

// Ways of solving a trial. KN_WAY_DEFAULT uses the solver settings of the trial. Each other way changes one setting.
typedef enum kn_way { KN_WAY_DEFAULT, KN_WAY_SECANT, KN_WAY_TANGENT, KN_WAY_F64, KN_WAY_RK4, KN_WAYS } kn_way;

// Judgement of one way of solving a trial.
typedef struct kn_score {
    kn_judgement verdict;
    // force, shape: force error and shape error as defined at the top of this file. variation: (total variation / peak)
    // of the forces, divided by the same ratio of the reference.
    double force, shape, variation;
    char reason[120]; // reason of the verdict REFUSED or DIED
} kn_score;

// Results of all ways of solving one trial.
typedef struct kn_outcome {
    kn_score score[KN_WAYS];
    double step_error; // time-step error of the reference, the larger of its force and shape errors
    bool loose;        // true: the reference missed its tolerance of 1e-7 in at least one time step
} kn_outcome;

extern const char *const kn_way_name[KN_WAYS];
extern const char *const kn_judgement_name[KN_JUDGEMENTS];

// Solve a trial in several ways and judge each result. ways: bit mask of the ways, bit w for the kn_way w. Until a way
// is judged, its verdict in *outcome is DIED. Return false when memory is short.
bool kn_stability_trial_run(const kn_stability_trial *trial, unsigned ways, kn_outcome *outcome);

// Free the mesh of a trial.
void kn_stability_trial_free(kn_stability_trial *trial);

// Trials of the solvers with extreme parameters, for `knead stability`. The trials are arranged in maps, one
// trial per cell, and the maps are grouped in families. The scenes are small: some fifty nodes of dough with common
// parameters, so that thousands of trials take minutes. Only the family "size" has larger scenes.

#define KN_STABILITY_MAP_SIDE 16
#define KN_STABILITY_MAPS_MAX 96

typedef struct kn_stability_map {
    int family; // index into kn_stability_families
    char title[80];
    // across: name of the parameter that changes from column to column. down: name of the parameter that changes from
    // row to row.
    const char *across, *down;
    int columns, rows;
    double x[KN_STABILITY_MAP_SIDE], y[KN_STABILITY_MAP_SIDE];
    const char *y_text
        [KN_STABILITY_MAP_SIDE]; // labels of the rows, if the rows are choices (e.g. materials) instead of numbers
    int variant;
} kn_stability_map;

// Names of the families of maps, in the order of the maps.
extern const char *const kn_stability_families[];

// Fill `maps` with all maps and return their number. If `quick` is true, each map has fewer cells.
int kn_stability_maps(kn_stability_map maps[KN_STABILITY_MAPS_MAX], bool quick);

// Create the trial that belongs to one cell of a map. Free it with kn_stability_trial_free. Return false if out of
// memory.
bool kn_stability_map_trial(const kn_stability_map *map, int column, int row, kn_stability_trial *trial);

// Atlas: all maps with the outcome of every cell. The trial of each cell runs in a process of its own. Afterwards the
// maps are printed, written to a file and drawn.

typedef struct kn_stability_atlas {
    kn_stability_map map[KN_STABILITY_MAPS_MAX];
    int maps;
    // Index of the first cell of each map, followed by the total number of cells. The cells of a map are numbered row
    // by row, from left to right.
    int first[KN_STABILITY_MAPS_MAX + 1];
    kn_outcome *cell; // outcome of each cell, in memory that the processes of the trials share
    double seconds;   // wall-clock duration of the survey of all cells, s
} kn_stability_atlas;

// The kn_stability_atlas functions that return int return an exit code. On failure they print one line on stderr.

// Run the trials of all cells, one after the other. If `quick` is true, each map has fewer cells. Only maps of the
// family with the index `family` are included, or all maps if it is negative.
int kn_stability_atlas_survey(kn_stability_atlas *atlas, bool quick, int family);
void kn_stability_atlas_free(kn_stability_atlas *atlas);

// Print the table of the outcomes, the maps and remarks on single cells. Return true if, in every cell, the default
// solver gives a right result or refuses the scene.
bool kn_stability_atlas_print(const kn_stability_atlas *atlas);

// Write the outcome of every cell as CSV.
int kn_stability_atlas_write(const kn_stability_atlas *atlas, const char *path);
// Draw the maps as PNG.
int kn_stability_atlas_draw(const kn_stability_atlas *atlas, const char *path);

#endif
