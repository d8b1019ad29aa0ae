#ifndef KN_TESTS_OWNED_H
#define KN_TESTS_OWNED_H
// An object of a test is destroyed at the end of its block, the last made first:
//
//     OWN(kn_scene) *scene = load("dough.yaml");    then kn_scene_destroy(scene)
//     AT_END(rig_free) rig r = rig_make();          then rig_free(&r)
//
// OWNS(type, its destroy), once in a file, lets OWN be used for that type.
#include "core/model.h"
#include "core/scene/scene.h"
#include "core/simplices.h"
#include "core/state.h"
#include "core/surface.h"

#define AT_END(end) __attribute__((unused, cleanup(end)))
#define OWN(type) AT_END(type##_at_end) type
#define OWNS(type, end)                                                                                                \
    static inline void type##_at_end(type **owned) { end(*owned); }

OWNS(kn_scene, kn_scene_destroy)
OWNS(kn_model, kn_model_destroy)
OWNS(kn_state, kn_state_destroy)
OWNS(kn_simplices, kn_simplices_destroy)
OWNS(kn_surface, kn_surface_destroy)

#endif
