#ifndef KN_SERVER_CHANGE_H
#define KN_SERVER_CHANGE_H
// Another scene for the object that is being served: the same lattice and tools of another material, other forces,
// other effort. All of it is built aside; then one tick of the servo goes over to it (kn_tick_in.change), and keeps
// what the object is (core/carry.h). What the hand feels goes through zero.
//
//     worker thread   parse . build . fit ----+                   energy before and after . free the one before
//     servo thread    ..tick....tick....tick..v carry, step ..tick....tick....tick..
//     gain            --------------------------.                                 .  '  ------
//                                                '._____________________ .  '
#include "core/energy.h"
#include "server/servo.h"

typedef struct kn_change {
    kn_scene *scene;
    kn_model *model;
    kn_backend backend;
    kn_audit *audit;   // NULL: a solver without one
    int64_t deadline;  // units of a step in it, as kn_served_deadline says; 0: as before
    kn_sets sets;      // that made scene of the one of the start
    kn_state *carried; // kept: what the tick found, in the new model
} kn_change;

// Takes scene over. now, model: what is served; identify: local models, with the coupling of scene's device. NULL and
// one line in error: it cannot be built, or the object cannot go on in it.
kn_change *kn_change_create(kn_scene *scene, const kn_scene *now, const kn_model *model, bool identify, char *error,
                            size_t error_size);
void kn_change_destroy(kn_change *change); // NULL is fine

#endif
