#ifndef KN_SERVER_SERVED_H
#define KN_SERVER_SERVED_H
// What is served: a scene, the lattice that it means, and where that is stepped; from a file, and from what an operator had
// set over it when it was saved last. Nothing is served that does not fit into memory. Not real-time.
#include "core/energy.h"
#include "server/servo.h"

typedef struct kn_served_def {
    const char *scene_path;
    const char *const *sets; // "key=value" over the scene
    int set_count;
    const char *name, *text; // of what was in that file, options and all, when it was checked; NULL: it is read
    const char *state_dir;   // where snapshots are kept and restored from, NULL: nowhere
    const char *device;      // URI of a circuit that steps the object, NULL: this processor does
    bool local_model;        // identify and publish KNEAD_CONTACT
} kn_served_def;

typedef struct kn_served {
    kn_scene *base;  // as its file and the options say
    kn_scene *scene; // and what was set over it before; the same one, where nothing was
    kn_sets sets;
    kn_model *model; // of scene
    kn_backend backend;
    kn_audit *audit; // NULL: a solver without one
} kn_served;

// Not 0, and one line in error, `path: why` or the scene's own; then there is nothing to free. 2: the scene, 3: the device.
int kn_served_load(kn_served *served, const kn_served_def *def, char *error, size_t error_size);
// ns that a tick takes here, while nothing touches the object or, of that model, while its tools press it; as new then.
// Of this processor: its own time, whatever else runs; of a circuit: until it has answered.
int64_t kn_served_measure(kn_backend *backend, const kn_model *pressed);
// Units that a step may take here (core/deadline.h), to be done with it in KN_SERVED_SHARE of budget_s: by the time that
// units of strokes of all tools of `model`, which the backend steps, take this processor, on one thread. Never below
// the shortest step's. 0: a solver without a deadline. As new then.
int64_t kn_served_deadline(kn_backend *backend, const kn_model *model, double budget_s);
#define KN_SERVED_SHARE 0.7 // the rest is for what no step counts, and for a core whose other thread is busy
// ns that the longest of those strokes takes here, by a deadline; 0: none.
int64_t kn_served_worst(kn_backend *backend, const kn_model *model, int64_t deadline);
void kn_served_free(kn_served *served); // one that is all 0 is fine

#endif
