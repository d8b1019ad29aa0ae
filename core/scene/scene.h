#ifndef KN_CORE_SCENE_H
#define KN_CORE_SCENE_H
// A scene: YAML text with units in its values becomes the definitions from which model and servo loop are built.
// The text is parsed, then validated. Every error is one line, `file:line:col: what is wrong, what was expected`.
#include "core/device.h"
#include "core/model.h"
#include "core/safety.h"
#include <stdint.h>

// Quality points: named settings between speed and accuracy, the fastest first. OWN stands for the values of the
// scene's solver without a quality point.
typedef enum kn_quality { KN_QUALITY_FAST, KN_QUALITY_BALANCED, KN_QUALITY_ACCURATE, KN_QUALITY_OWN } kn_quality;
#define KN_QUALITIES 4

typedef struct kn_point {
    bool defined; // the scene defines this quality point; OWN is always defined
    // The point has the lattice and precision of the chosen point, so a server may switch to it while running.
    bool live;
    kn_effort effort; // effort of a step at this quality point
} kn_point;

// Bits of kn_scene.mesh_measures. The words of the key mesh.measures have these numbers.
#define KN_MESH_STRESS 1
#define KN_MESH_RESIDUAL 2

typedef struct kn_scene {
    char name[64]; // name of the scene's file without folder
    int version;   // version of the scene format, 1
    kn_model_def model;
    kn_simplices *mesh;                   // target of model.mesh, owned; NULL: a block
    struct kn_shape *tool[KN_PROBES_MAX]; // target of a probe's parts, owned; NULL: the probe has none
    kn_point point[KN_QUALITIES];
    kn_quality quality;   // chosen quality point; `model` has its values
    double budget_s;      // time budget of a tick, from reading poses to publishing forces: see servo.h
    double accuracy;      // relative force error that coarse cells away from the tools may cause; 0: no coarse cells
    kn_device_def device; // haptic device: profile touch, falcon, omega, unknown, or bench for the virtual hand
    kn_safety_limits limits;
    double mesh_hz;    // rate of mesh messages, 30..60
    int mesh_measures; // KN_MESH_STRESS, KN_MESH_RESIDUAL: values that meshes carry beside positions (measure.h)
    // Place in the file of the last of the keys kind, dt, isa and mass_scale of solver; 1, 1 if it has none of them. An
    // error of building or stepping the model points there.
    int solver_line, solver_col;
    // Canonical YAML of the whole scene in SI, with every default and override written out. Parsing it gives the same
    // scene. Owned.
    char *text;
    // kn_hash_bytes of text without the lines that tell where meshes are; text contains the hashes of the meshes.
    uint64_t text_hash;
} kn_scene;

// Load a file, or parse text that a log or a test holds. sets[] are "key=value" as given to --set; they replace the
// file's values, in their order. Return NULL with one line in error if anything is wrong.
kn_scene *kn_scene_load(const char *path, const char *const *sets, int set_count, char *error, size_t error_size);
kn_scene *kn_scene_parse(const char *name, const char *text, size_t size, const char *const *sets, int set_count,
                         char *error, size_t error_size);
// Parse the text of the scene file whose path is `beside`. If a mesh is not found at the path given in the text, look
// for its base name in the folder of `beside`. (kn_scene_parse does so in the folder of `name`.)
kn_scene *kn_scene_parse_beside(const char *beside, const char *name, const char *text, size_t size,
                                const char *const *sets, int set_count, char *error, size_t error_size);
void kn_scene_destroy(kn_scene *scene); // does nothing if `scene` is NULL
void kn_scene_clear(kn_scene *scene);   // free what a scene owns, but not the scene itself

const char *kn_quality_name(kn_quality quality); // "fast", "balanced", "accurate", "own"
// Return the setting that --quality NAME stands for, "quality=NAME", or NULL if the name is not one of
// kn_quality_names.
const char *kn_quality_set(const char *name);
extern const char kn_quality_names[]; // all names in one text: "fast, balanced, accurate or own"

// Return the table of all keys for `knead check --keys` as NULL-terminated lines: path, unit, range, default, meaning.
const char *const *kn_scene_keys(void);

// --- library --------------------------------------------------------------------------------------------------------

// Named materials: the files of core/scenes/materials, compiled in. So `material: dough` means the same material in
// every scene, wherever the scene is and whatever is installed. Each file holds a material and its density, with the
// source of every number. Device profiles, the files of core/devices, are compiled in the same way. material.variant
// chooses a variant of a material (draft.h). In a scene, the name of a material may have the variant as a suffix:
// dough-plastic.
typedef struct kn_library_entry {
    const char *name; // name of the material or device, e.g. "dough"
    const char *text; // text of the file
} kn_library_entry;

extern const kn_library_entry kn_library[]; // in alphabetical order; the last entry has the name NULL
extern const kn_library_entry kn_devices[]; // the files of core/devices: one for each word of device.profile

// Return the entry of a name without its suffix, or NULL if there is none. *variant becomes the number of the suffix in
// the words of material.variant, or -1.
const kn_library_entry *kn_library_find(const char *name, int *variant);

// Print the names of all materials into `text`, a buffer of 256 bytes, and return it: "clay, dough, ...".
const char *kn_library_names(char text[256]);

#endif
