#ifndef KN_TESTS_OWNED_H
#define KN_TESTS_OWNED_H
// Destroy an object of a test at the end of its block. The object made last is destroyed first:
//
//     OWN(kn_scene) *scene = load("dough.yaml");    then kn_scene_destroy(scene)
//     AT_END(rig_free) rig r = rig_make();          then rig_free(&r)
//
// OWNS(type, its destroy function) makes OWN usable for a type. It stands once in a file.
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
OWNS(kn_scratch, kn_scratch_destroy)
OWNS(kn_simplices, kn_simplices_destroy)
OWNS(kn_surface, kn_surface_destroy)

#endif
