#ifndef KN_SERVER_CHANGE_H
#define KN_SERVER_CHANGE_H
// A change: the replacement of the scene that is being served. The new scene has the same lattice and tools but another
// material, other forces or another solver effort. Everything is built on a worker thread. Then one tick of the servo
// adopts the change (kn_tick_in.change) and carries the object's state over to the new model (core/snapshot.h). The
// force on the hand fades to zero and comes back.
//
//     worker thread   parse . build . fit ----+                   energy before and after . free the old one
//     servo thread    ..tick....tick....tick..v carry, step ..tick....tick....tick..
//     gain            --------------------------.                                 .  '  ------
//                                                '._____________________ .  '
#include "core/measure.h"
#include "server/servo.h"

typedef struct kn_change {
    kn_scene *scene;
    kn_model *model;
    kn_backend backend;
    kn_audit *audit; // energy audit; NULL: the solver has no audit
    // Number of units of work that a step may take in the new model (kn_served_deadline); 0: unchanged.
    int64_t deadline;
    kn_sets sets;      // run-time settings that turn the scene of the server's start into `scene`
    kn_state *carried; // the object's state in the new model, as of the tick that adopted the change; no solver scratch
} kn_change;

// Build a change to `scene`, and take ownership of `scene`, also on failure. `now` and `model` are the scene and the
// model being served. If `identify` is true, the new backend identifies local contact models (core/contact_model.h)
// with the virtual coupling of the new scene's device. If the scene cannot be built, or the object cannot continue in
// it, return NULL and put one line in error.
kn_change *kn_change_create(kn_scene *scene, const kn_scene *now, const kn_model *model, bool identify, char *error,
                            size_t error_size);
void kn_change_destroy(kn_change *change); // `change` may be NULL

#endif
