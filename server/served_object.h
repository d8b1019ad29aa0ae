#ifndef KN_SERVER_SERVED_OBJECT_H
#define KN_SERVER_SERVED_OBJECT_H
// The served object: a scene, its model, and the backend that steps the model. All three are built from a scene file
// and from the settings in force when the object was last saved. An operator makes these settings at run time. An
// object that does not fit into memory is refused. Not real-time.
#include "core/lattice/measure.h"
#include "server/servo.h"

typedef struct kn_served_object_def {
    const char *scene_path;
    const char *const *sets; // "key=value" settings that override those of the scene file
    int set_count;
    // Name of the scene, and its checked text with all options applied; NULL: read the file scene_path.
    const char *name, *text;
    const char *state_dir; // directory of snapshots; NULL: nothing is saved or restored
    const char *device;    // URI of a circuit that steps the object; NULL: this processor steps the object
    bool local_model;      // true: identify local contact models and publish them as KNEAD_CONTACT
} kn_served_object_def;

typedef struct kn_served_object {
    kn_scene *base;  // scene of the file with the options applied
    kn_scene *scene; // `base` with the restored settings; the same pointer as `base` if there are no restored settings
    kn_settings settings; // settings restored from the newest snapshot
    kn_model *model;      // model of `scene`
    kn_backend backend;
    kn_state *settled; // the object at rest (kn_scene_settle)
    kn_audit *audit;   // energy audit; NULL: the solver has no audit
    kn_helper *helper; // second thread of a step; NULL: none
    char alone[64];    // reason why there is no second thread although the scene asks for one; "": none
} kn_served_object;

// Load the object that `def` describes. Return 0 on success. Otherwise put one line in error (`path: why`, or with the
// scene's line number) and return an exit code: 2 if the scene is bad or does not fit into memory, 3 if the circuit
// cannot be used. After a failure there is nothing to free.
int kn_served_object_load(kn_served_object *served, const kn_served_object_def *def, char *error, size_t error_size);
// Create the second thread of a step if the scene asks for it.
void kn_served_object_help(kn_served_object *served);
// Measure the time of one tick with one thread on this machine, ns. If `pressed` is NULL, nothing touches the object.
// Otherwise `pressed` must be the model that the backend steps, and all tools press the object. A step on this
// processor is measured in processor time, which other processes do not lengthen. A step on a circuit is measured until
// the answer arrives. The object is reset afterwards.
int64_t kn_served_object_measure(kn_backend *backend, const kn_model *pressed);
// Return the deadline of a step, in units of work (core/solve/step_effort.h), such that a step ends within
// KN_STEP_SHARE of `budget_s` on this machine. The time of a unit is measured while all tools of `model` hit the object
// at 5 cm/s. `helper`: second thread of a step; NULL: none. `model` must be the model that the backend steps. The
// deadline is never below the units of the shortest step. Return 0 if the solver has no deadline. The object is reset
// afterwards.
int64_t kn_served_object_deadline(kn_backend *backend, kn_helper *helper, const kn_model *model, double budget_s);
// Return the duration of the longest tick while all tools of `model` hit the object at 5 cm/s, ns. `deadline`: largest
// number of units of work per step; 0: no deadline. `helper`: second thread of a step; NULL: none.
int64_t kn_served_object_worst(kn_backend *backend, kn_helper *helper, const kn_model *model, int64_t deadline);
void kn_served_object_free(kn_served_object *served); // a zeroed object is allowed

#endif
