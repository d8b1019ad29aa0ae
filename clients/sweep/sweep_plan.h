#ifndef KN_CLIENTS_SWEEP_PLAN_H
#define KN_CLIENTS_SWEEP_PLAN_H
// Plan of a sweep. A sweep replays one log with many solver settings to compare their speed and accuracy. One replay is
// a run. A run is either a point (one combination of settings to judge) or a reference that points are measured
// against. All references are computed in f64 by conjugate gradients (CG):
//
//     SAME   time step of the point; secant, 5 linearisations, CG to 1e-8    point minus SAME: error of the solver
//     FINE   1/16 of the scene's time step; CG to 1e-4                       SAME minus FINE: error of the time step
//     FINE of the finest lattice of the sweep                                FINE minus this FINE: error of the lattice
//
// FINE linearises once per time step. On dough the force of FINE differs by 0.06 % from the force of a solution that
// relinearises in every step until the result no longer changes. FINE takes a seventh of that solution's time.
//
// A run is the scene with a few keys set. The `quality` block of the scene is left out, because the scene reader would
// check `quality` against these keys. The replay does not use `quality`. The id of a run is a hash of its canonical
// text, of the log and of this program, so a folder of traces may serve several sweeps.
#include "clients/cli/jobs.h"
#include "core/scene/scene.h"
#include "server/log_replay.h"

#define KN_SWEEP_RUNS_MAX 1024
#define KN_SWEEP_RUN_SETS 9
#define KN_AXIS_MAX 32

// Method: a linearisation of the implicit solver (blend, secant, tangent), or the explicit solver rk4.
typedef enum kn_method { KN_METHOD_BLEND, KN_METHOD_SECANT, KN_METHOD_TANGENT, KN_METHOD_RK4 } kn_method;
typedef enum kn_role { KN_ROLE_POINT, KN_ROLE_SAME, KN_ROLE_FINE } kn_role;

// Run: one replay of the log with given solver settings.
typedef struct kn_sweep_run {
    kn_role role;
    bool own;            // true: the run uses the solver settings that the scene itself contains
    double spacing_m;    // spacing of the lattice's nodes; 0: the object is a mesh
    double force_factor; // object.force_factor; 1 at a spacing that is not the scene's own
    double dt_s;
    kn_method method;
    kn_precision precision;
    int iterations, iterations_max, passes;
    double tolerance;
    int same, fine; // indices in plan->run of the references SAME and FINE of this point; -1: none
    int nodes;
    char id[17]; // hash of the run's canonical scene text, the log and this program, 16 hex digits
} kn_sweep_run;

// Axes of a sweep. An axis is a list of values of one setting. An axis without values uses the scene's own value.
typedef struct kn_axes_def {
    int methods, precisions, counts, tolerances, passes, steps, spacings;
    kn_method method[4];
    kn_precision precision[2];
    int count[KN_AXIS_MAX]; // number of CG iterations in every time step
    // Relative residual at which CG may stop once it has made `count` iterations. CG ends at the latest after
    // max(3 * count, 24) iterations. 0: CG makes exactly `count` iterations.
    double tolerance[KN_AXIS_MAX];
    int pass[KN_AXIS_MAX];
    double dt_s[KN_AXIS_MAX], spacing_m[KN_AXIS_MAX];
} kn_axes_def;

typedef struct kn_sweep_plan {
    const char *scene_path, *log_path;
    const char *const *sets; // texts `key=value` of the option --set; every run applies them to the scene
    int set_count;
    kn_scene *scene; // the scene at scene_path with the texts in `sets` applied
    char *text;      // canonical text of the scene without its block `quality`; all runs start from this text
    uint64_t origin; // hash of this program and the log
    bool fine;       // true: the plan contains the references FINE, see the top of this file
    int count;
    kn_sweep_run run[KN_SWEEP_RUNS_MAX];
    int notes;
    char note[4][300]; // notes to print for the user, such as the reason why a lattice is impossible
} kn_sweep_plan;

// Load the scene of the plan. Return false and one line in error on failure.
bool kn_sweep_plan_open(kn_sweep_plan *plan, char *error, size_t error_size);
void kn_sweep_plan_close(kn_sweep_plan *plan);

// Add one point (run to judge) for each combination of values of the axes. Points that are in the plan already are not
// added again. If the scene does not allow a lattice or a method, add a note instead. strict: the user named the
// lattices, so an impossible lattice is an error.
bool kn_sweep_plan_add(kn_sweep_plan *plan, const kn_axes_def *axes, bool strict, char *error, size_t error_size);
// Add the solver settings that the scene itself contains as a point (run to judge).
bool kn_sweep_plan_add_own(kn_sweep_plan *plan, char *error, size_t error_size);
// Add the reference runs of all points. Call this function when all points are in the plan.
bool kn_sweep_plan_references(kn_sweep_plan *plan, char *error, size_t error_size);

typedef struct kn_sweep_run_sets { // settings of one run, which override the scene text plan->text in a replay
    char made[KN_SWEEP_RUN_SETS][48];
    const char *set[KN_SWEEP_RUN_SETS]; // pointers to the texts in `made`
    int count;
} kn_sweep_run_sets;
// Write the settings of a run as `key=value` texts.
void kn_sweep_run_sets_make(kn_sweep_run_sets *sets, const kn_sweep_run *run);

// Describe the settings of a run in words, such as "5 mm, 1 ms, blend f32, 8" (spacing, time step, method, precision,
// CG iterations). Return `text`.
const char *kn_sweep_run_name(const kn_sweep_run *run, char text[96]);
const char *kn_method_name(kn_method method);
// Describe the number of CG iterations of a run, such as "8", or "8..24 to 0.001" with a tolerance. " x2" is appended
// for two linearisations. For rk4 the text is "-". Return `text`.
const char *kn_sweep_run_effort(const kn_sweep_run *run, char text[64]);

// Command line of `knead tradeoff`.

#define KN_TRADEOFF_SETS 64

typedef struct kn_tradeoff_options {
    // Names of files and folders (scene, log, csv, png, resume), and trace of a worker process; NULL: the option was not
    // given.
    const char *scene, *log, *csv, *png, *resume, *job;
    const char *sets[KN_TRADEOFF_SETS];
    int set_count;
    kn_jobs_engine engine;
    bool quick, write;
    // Upper limit [us] of the chosen point's tick times (90th percentile); 0: --budget was not given.
    double budget_us;
    // True: the user gave a list for an axis, so the sweep has one point for each combination of listed values.
    bool listed;
    kn_axes_def axes; // values of each varied solver setting
} kn_tradeoff_options;

// Parse the command line. Return KN_OPTIONS_READ, or an exit code: 0 after --help, KN_EXIT_USAGE after a mistake.
int kn_tradeoff_options_parse(kn_tradeoff_options *opt, int argc, char **argv);

#endif
