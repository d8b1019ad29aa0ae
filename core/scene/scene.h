#ifndef KN_CORE_SCENE_H
#define KN_CORE_SCENE_H
// A scene: YAML text with units in its values -> definitions the model and the servo are built from.
// Parse, then validate; every complaint is one line, `file:line:col: what is wrong, what was expected`.
#include "core/device.h"
#include "core/model.h"
#include "core/safety.h"
#include <stdint.h>

// Named points of speed against accuracy, the cheaper first. OWN: what the scene's solver says, without any of them.
typedef enum kn_quality { KN_QUALITY_FAST, KN_QUALITY_BALANCED, KN_QUALITY_ACCURATE, KN_QUALITY_OWN } kn_quality;
#define KN_QUALITIES 4

typedef struct kn_point {
    bool defined;     // the scene names it; OWN always is
    bool live;        // same lattice and precision as the chosen point: a server may take it while it runs
    kn_effort effort; // what a step is then given
} kn_point;

// Bits of mesh_measures; mesh.measures' words are these numbers.
#define KN_MESH_STRESS 1
#define KN_MESH_RESIDUAL 2

typedef struct kn_scene {
    char name[64]; // file name without folder
    int version;   // the format's, 1
    kn_model_def model;
    kn_simplices *mesh;                   // what model.mesh points at, owned; NULL: a block
    struct kn_shape *tool[KN_PROBES_MAX]; // what a probe's parts point at, owned; NULL: it has none
    kn_point point[KN_QUALITIES];
    kn_quality quality;   // the chosen one, which model is built with
    double budget_s;      // of a tick, read to publish: see servo.h
    double accuracy;      // of the force, that coarse cells away from the tools may cost; 0: there are none
    kn_device_def device; // the hand's: profile touch, falcon, omega, unknown, or bench, the virtual hand
    kn_safety_limits limits;
    double mesh_hz;    // 30..60
    int mesh_measures; // KN_MESH_STRESS, KN_MESH_RESIDUAL: what meshes tell beside places (gauge.h)
    int solver_line,
        solver_col;     // in the file, of what it says of solver's kind, dt, isa, mass_scale, the last of them;
                        // 1, 1: nothing. That is what to point at when a model cannot be built or stepped
    char *text;         // canonical YAML of the whole scene in SI, every default and override written out:
                        // parsing it gives the same scene. Owned.
    uint64_t text_hash; // kn_hash_bytes of text but for the line that says where the mesh lies: text has its hash
} kn_scene;

// Loads a file, or parses text that a log or a test holds. sets[] are "key=value" as given to --set, applied over the
// file in their order. NULL and one line in error when anything is wrong.
kn_scene *kn_scene_load(const char *path, const char *const *sets, int set_count, char *error, size_t error_size);
kn_scene *kn_scene_parse(const char *name, const char *text, size_t size, const char *const *sets, int set_count,
                         char *error, size_t error_size);
// The same of a text that the file `beside` holds: a mesh that is not (or no longer is) where the text says is looked for
// by its base name in that file's folder too. kn_scene_parse looks beside name.
kn_scene *kn_scene_parse_beside(const char *beside, const char *name, const char *text, size_t size,
                                const char *const *sets, int set_count, char *error, size_t error_size);
void kn_scene_destroy(kn_scene *scene); // NULL is fine

const char *kn_quality_name(kn_quality quality); // "fast", "balanced", "accurate", "own"
// What --quality NAME is among the sets: "quality=NAME". NULL: there is no such name; kn_quality_names are expected.
const char *kn_quality_set(const char *name);
extern const char kn_quality_names[]; // "fast, balanced, accurate or own"

// The table of every key: path, unit, range, default, meaning; NULL-terminated lines for `knead check --keys`.
const char *const *kn_scene_keys(void);

#endif
