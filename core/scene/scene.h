#ifndef KN_CORE_SCENE_H
#define KN_CORE_SCENE_H
// A scene is YAML text in which values have units. Loading parses and validates the text, and turns it into the
// definitions from which the model and the servo loop are built. Every error is one line, `file:line:col: what is
// wrong, what was expected`. Loading and parsing allocate memory and read files: not for a real-time loop.
#include "core/device.h"
#include "core/model.h"
#include "core/safety.h"
#include <stdint.h>

// Quality points: named compromises between speed and accuracy, from the fastest to the most accurate. OWN stands for
// the values under the keys solver and object of the scene, without a quality point.
typedef enum kn_quality { KN_QUALITY_FAST, KN_QUALITY_BALANCED, KN_QUALITY_ACCURATE, KN_QUALITY_OWN } kn_quality;
#define KN_QUALITIES 4

typedef struct kn_point {
    bool defined; // the scene defines this quality point; OWN is always defined
    // A running server may switch to this point: the solver is implicit, and spacing and precision are equal to the
    // spacing and precision of the chosen point.
    bool live;
    kn_effort effort; // iterations, tolerance and linearisations of a step at this quality point
} kn_point;

// Bits of kn_scene.mesh_measures. The words none, stress, residual, both of the key mesh.measures mean 0, 1, 2, 3.
#define KN_MESH_STRESS 1
#define KN_MESH_RESIDUAL 2

typedef struct kn_scene {
    char name[64];    // name of the scene's file without folder
    char label[1024]; // what the object stands for and how well; "": the scene does not say
    int version;      // version of the scene format, 1
    kn_model_def model;
    kn_simplices *mesh;                   // mesh to which model.mesh points; owned by the scene; NULL: a block
    struct kn_shape *tool[KN_PROBES_MAX]; // shapes to which model.probe[].parts point; owned by the scene; NULL: none
    kn_point point[KN_QUALITIES];
    kn_quality quality; // chosen quality point; its values are in `model`
    double budget_s;    // time budget of a tick, from reading poses to publishing forces: see servo.h
    int threads;        // number of threads of a step, 1 or 2; 0: not given, 1
    double accuracy;    // relative error of the force that coarse cells away from the tools may cause; 0: no such cells
    kn_device_def device; // haptic device: profile touch, falcon, omega, unknown, or bench for the virtual hand
    kn_safety_limits limits;
    double mesh_hz;    // rate of mesh messages, 30..60
    double rate_hz;    // poses per second that the device sends; 0: 1000
    int mesh_measures; // values that a mesh message holds besides positions: sum of KN_MESH_STRESS, KN_MESH_RESIDUAL
    // Line and column of the last of the keys solver.kind, dt, isa and mass_scale in the file; 1, 1 if the file has
    // none of these keys. An error of building or stepping the model points at this place.
    int solver_line, solver_col;
    // Canonical YAML text of the whole scene in SI units, with every default and every --set written out. Parsing this
    // text gives the same scene. Owned by the scene.
    char *text;
    // Hash (kn_hash_bytes) of `text` without the lines that hold the paths of mesh files. `text` also holds the hashes
    // of the mesh files. So a scene keeps its hash if a mesh file moves, but not if the contents of a mesh file change.
    uint64_t text_hash;
} kn_scene;

// Load a scene from a file, or parse the text of a scene of `size` bytes; `name` is then the file's name for messages.
// Each of the set_count texts in `sets` is "key=value" as given to --set. They replace values of the file, one after
// the other. Return a scene, which the caller destroys. If anything is wrong, return NULL and write one line into
// `error`, a buffer of error_size bytes.
kn_scene *kn_scene_load(const char *path, const char *const *sets, int set_count, char *error, size_t error_size);
kn_scene *kn_scene_parse(const char *name, const char *text, size_t size, const char *const *sets, int set_count,
                         char *error, size_t error_size);
// Parse the text of a scene that the file with the path `beside`, e.g. a log, contains. If a mesh file is not found at
// its path in the text, look for a file of that name in the folder of `beside`. (kn_scene_parse looks in the folder of
// `name`.)
kn_scene *kn_scene_parse_beside(const char *beside, const char *name, const char *text, size_t size,
                                const char *const *sets, int set_count, char *error, size_t error_size);
void kn_scene_destroy(kn_scene *scene); // does nothing if `scene` is NULL
void kn_scene_clear(kn_scene *scene);   // free text, mesh and tools of a scene, but not the scene itself

const char *kn_quality_name(kn_quality quality); // "fast", "balanced", "accurate", "own"
// Return the text "quality=NAME". `--set quality=NAME` is the long form of `--quality NAME`. Return NULL if the name is
// not one of kn_quality_names.
const char *kn_quality_set(const char *name);
extern const char kn_quality_names[]; // all names in one text: "fast, balanced, accurate or own"

// Return the table of all keys for `knead check --keys`: a heading, then one line per key with path, unit, range,
// default and meaning. The list ends with NULL. The memory is static.
const char *const *kn_scene_keys(void);

// --- library --------------------------------------------------------------------------------------------------------

// Named materials: the files of core/scenes/materials are compiled in. So `material: dough` means the same material in
// every scene, and no file needs to be installed. Each file holds a material and its density, with the source of every
// number. Device profiles, the files of core/devices, are compiled in the same way. The key material.variant chooses a
// variant of a material (draft.h). In a scene, the name of a material may have the variant as a suffix: dough-plastic.
typedef struct kn_library_entry {
    const char *name; // name of the material or device, e.g. "dough"
    const char *text; // text of the file
} kn_library_entry;

extern const kn_library_entry kn_library[]; // in alphabetical order; the last entry has the name NULL
extern const kn_library_entry kn_devices[]; // the files of core/devices: one for each word of device.profile

// Return the named material, or NULL if there is none with this name. The name may have the suffix of a variant:
// *variant becomes the index of the variant in the words of material.variant, or -1 without a suffix.
const kn_library_entry *kn_library_find(const char *name, int *variant);

// Print the names of all materials into `text`, a buffer of 256 bytes, and return it: "clay, dough, ...".
const char *kn_library_names(char text[256]);

#endif
