#ifndef KN_CLIENTS_PLAN_H
#define KN_CLIENTS_PLAN_H
// What a sweep has to replay: points of speed against accuracy, and for each lattice the references that they are
// measured against (all f64):
//
//     SAME   at the point's step: secant, 5 linearisations, CG to 1e-8      a point against it: error of the solver
//     FINE   at 1/16 of the scene's step, CG to 1e-4                         SAME against it: error of the step
//     FINE of the finest lattice of the sweep                                FINE against it: error of the lattice
//
// FINE linearises once per step, a sixteenth as late: on dough 0.06 % of force from one that does it until nothing
// moves, for a seventh of its time.
//
// A run is the scene with a few keys set, and without its `quality`, which is checked against them and is no part of
// what is played; its id is a hash of its canonical text.
#include "core/scene/scene.h"
#include "server/replay.h"

#define KN_RUNS_MAX 1024
#define KN_RUN_SETS 9
#define KN_AXIS_MAX 32

typedef enum kn_method { KN_METHOD_BLEND, KN_METHOD_SECANT, KN_METHOD_TANGENT, KN_METHOD_RK4 } kn_method;
typedef enum kn_role { KN_ROLE_POINT, KN_ROLE_SAME, KN_ROLE_FINE } kn_role;

typedef struct kn_run {
    kn_role role;
    bool own;         // what the scene itself says
    double spacing_m; // 0: a mesh
    double dt_s;
    kn_method method;
    kn_precision precision;
    int iterations, iterations_max, passes;
    double tolerance;
    int same, fine; // numbers of the references, -1: none
    int nodes;
    char id[17];
} kn_run;

typedef struct kn_axes_def { // 0 values of an axis: the scene's own
    int methods, precisions, counts, tolerances, passes, steps, spacings;
    kn_method method[4];
    kn_precision precision[2];
    int count[KN_AXIS_MAX]; // CG iterations that every step gets
    double
        tolerance[KN_AXIS_MAX]; // 0: and no more; else up to three times as many, or 24, while the residual is above it
    int pass[KN_AXIS_MAX];
    double dt_s[KN_AXIS_MAX], spacing_m[KN_AXIS_MAX];
} kn_axes_def;

typedef struct kn_plan {
    const char *scene_path, *log_path;
    const char *const *sets; // of --set: over the scene in every run
    int set_count;
    kn_scene *scene; // with them
    char *text;      // its canonical text without quality: what the runs are made of
    bool fine;       // FINE references are wanted
    int count;
    kn_run run[KN_RUNS_MAX];
    int notes;
    char note[4][300]; // what cannot run, and why
} kn_plan;

// Loads the scene. False and one line in error.
bool kn_plan_open(kn_plan *plan, char *error, size_t error_size);
void kn_plan_close(kn_plan *plan);

// Adds the product of the axes, without points that are there already. A lattice or a method that the scene cannot have
// gives a note: lattices that were named by the user (strict) an error.
bool kn_plan_add(kn_plan *plan, const kn_axes_def *axes, bool strict, char *error, size_t error_size);
bool kn_plan_add_own(kn_plan *plan, char *error, size_t error_size);
bool kn_plan_references(kn_plan *plan, char *error, size_t error_size); // once all points are there

typedef struct kn_run_sets { // over plan->text, for a replay
    char made[KN_RUN_SETS][48];
    const char *set[KN_RUN_SETS]; // made
    int count;
} kn_run_sets;
void kn_run_sets_make(kn_run_sets *sets, const kn_run *run);

// "5 mm, 1 ms, blend f32, 8": for people.
const char *kn_run_name(const kn_run *run, char text[96]);
const char *kn_method_name(kn_method method);
const char *kn_run_effort(const kn_run *run,
                          char text[64]); // "8", "to 0.001", "8..24 to 0.001", with " x2" linearisations

#endif
