#ifndef KN_SERVER_SCENE_CHANGE_H
#define KN_SERVER_SCENE_CHANGE_H
// Changes of the scene while it is served. An operator overrides keys of the scene by settings. The settings lead to a
// new scene, which has the same lattice and tools but another material, other forces or another solver effort.
// Everything is built on a worker thread. Then one tick of the servo adopts the change (kn_tick_in.change) and carries
// the object's state over to the new model (core/snapshot.h). The force on the hand fades to zero and comes back.
//
//     worker thread   parse . build . fit ----+                   energy before and after . free the old one
//     servo thread    ..tick....tick....tick..v carry, step ..tick....tick....tick..
//     gain            --------------------------.                                 .  '  ------
//                                                '._____________________ .  '
#include "core/lattice/measure.h"
#include "core/scene/scene.h"
#include "server/backend/backend.h"

#define KN_SETTINGS_BYTES 1024 // size of the text with its NUL, bytes
#define KN_SETTINGS_MAX 32     // largest number of settings

// Settings with which an operator overrides those of a scene: lines of KEY=VALUE, each key once. Plain text without
// pointers, so that a snapshot can hold the settings.
typedef struct kn_settings {
    char text[KN_SETTINGS_BYTES]; // one setting per line, for example "material.c1=3 kPa*s\ndevice.clamp=2 N\n"
} kn_settings;

// Add the setting `set`, or replace an earlier one with the same key. If `set` is not KEY=VALUE, holds control
// characters or does not fit, return false, put one line in error, and leave the settings as they were.
bool kn_settings_add(kn_settings *settings, const char *set, char *error, int error_size);

// List the settings as --set takes them. The strings point into `room`, which gets a copy of the text. Return the
// number of settings.
int kn_settings_list(const kn_settings *settings, char room[KN_SETTINGS_BYTES], const char *list[KN_SETTINGS_MAX]);

// Parse the text of `base` again, overridden by the settings. `path`: scene file, in whose folder the scene's other
// files are found. On failure return NULL and put one line in error.
kn_scene *kn_settings_parse(const kn_settings *settings, const kn_scene *base, const char *path, char *error,
                            size_t error_size);

typedef struct kn_scene_change {
    kn_scene *scene;
    kn_model *model;
    kn_backend backend;
    kn_audit *audit; // energy audit; NULL: the solver has no audit
    // Number of units of work that a step may take in the new model (kn_served_object_deadline); 0: unchanged.
    int64_t deadline;
    kn_state *settled;    // the object at rest in the new model (kn_scene_settle)
    kn_settings settings; // settings made at run time: with them, the scene of the server's start becomes `scene`
    // The object's state in the new model, as of the tick that adopted the change.
    kn_state *carried;
} kn_scene_change;

// Number of ticks in which an object under gravity settles before its first tick.
#define KN_SETTLE_TICKS 1000
// Return the settled state of a model, KN_SETTLE_TICKS ticks of its own weight after the undeformed state. The caller
// destroys it. Return NULL if there is no gravity, nothing holds the object, or memory is short. Not real-time.
kn_state *kn_scene_settle(const kn_model *model);
// Return a line of warning if the settled object has not come to rest on its support, or NULL.
const char *kn_scene_sinks(const kn_model *model, const kn_state *settled);

// Build a change to `scene`, and take ownership of `scene`, also on failure. `now` and `model` are the scene and the
// model being served. If `identify` is true, the new backend identifies local contact models (core/contact_model.h)
// with the virtual coupling of the new scene's device. If the scene cannot be built, or the object cannot continue in
// it, return NULL and put one line in error.
kn_scene_change *kn_scene_change_create(kn_scene *scene, const kn_scene *now, const kn_model *model, bool identify,
                                        char *error, size_t error_size);
void kn_scene_change_destroy(kn_scene_change *change); // `change` may be NULL

#endif
