#ifndef KN_CORE_SCENE_DRAFT_H
#define KN_CORE_SCENE_DRAFT_H
// A scene while it is read: the values as written, and the place where each was written. So an error about two keys can
// still name a line. The reader fills in the draft (reader.c). Then kn_draft_finish checks the rules and computes all
// derived values.
#include "core/scene/keys.h"
#include "core/scene/scene.h"
#include "core/shape.h"

// Source of a value: default, file, or 0, 1, ...: number of the --set option that gave the value.
enum { KN_SOURCE_DEFAULT = -2, KN_SOURCE_FILE = -1 };

typedef struct kn_mark { // place where a value was written
    int source;          // KN_SOURCE_DEFAULT, KN_SOURCE_FILE or the number of the --set
    int line, col;       // line and column in the file, from 1
    bool per_height;     // the value as written is per metre of specimen height
    bool library;        // the value was not written, but came with a named material or a device profile
} kn_mark;

// Slots: 0 holds the scene's keys, 1 + p the keys of probe p. Behind them are the keys of the parts of probe 0, 1, ...
#define KN_SLOTS (1 + KN_PROBES_MAX * (1 + KN_PARTS_MAX))

// Return the slot of a part, counted from 0, of the probe in a slot.
static inline int kn_slot_of_part(int slot, int part) { return 1 + KN_PROBES_MAX + (slot - 1) * KN_PARTS_MAX + part; }

typedef struct kn_draft_surface { // surface file of a tool that is a mesh
    char path[KN_PATH_MAX];       // path as written in the scene; absolute after the file has been read
    int unit;                     // unit of length in the file: index in the list of words of the key (keys.h)
    uint64_t hash;                // hash of the file's contents
    double cell_m;                // side of a cell of the grid of distances (core/field.h)
} kn_draft_surface;

typedef struct kn_draft_part {   // part of a union
    int kind;                    // kn_probe_shape of the part, counted without the plate
    kn_probe_def as;             // sizes of the part, in the fields of a probe
    double at_m[3], turn_rad[3]; // position and rotation of the part in the tool
} kn_draft_part;

typedef struct kn_draft_point { // values of quality.NAME: see kn_quality
    int iterations, iterations_max, passes;
    double tolerance, spacing_m;
    kn_linearization linearization;
    kn_precision precision;
} kn_draft_point;

typedef struct kn_draft {
    kn_scene scene;
    double size_m[3];
    double specimen_height_m;
    double margin_m;
    int variant;       // variant of the material: 0 rheological, 1 viscoelastic, 2 plastic
    bool is_part;      // the text is the file of a material or a device, not a scene
    int profile;       // device profile: index in the list of words of the key (keys.h)
    bool device_whole; // the canonical text contains all keys of the device, not only its name and limits
    int chosen;        // kn_quality of the chosen quality point
    kn_draft_point fast, balanced, accurate;
    kn_model_def built; // scene.model with the values of the chosen quality point
    const char *point;  // name of the quality point whose values are in scene.model, or NULL
    // path as written; absolute after the mesh has been read. "": the object is a block
    char mesh_path[KN_PATH_MAX];
    // unit of length in the mesh: index in the list of words of the key (keys.h)
    int mesh_unit;
    uint64_t mesh_hash;                               // hash of the mesh file's contents
    kn_draft_part part[KN_PROBES_MAX * KN_PARTS_MAX]; // parts of all unions, in the order of their slots
    int part_count[KN_PROBES_MAX];
    kn_draft_surface surface[KN_PROBES_MAX];
    kn_mark parts_at[KN_PROBES_MAX];       // place of each probe's list of parts
    kn_mark at[KN_SLOTS][KN_KEY_COUNT];    // place of each key's value
    kn_mark group[KN_SLOTS][KN_KEY_COUNT]; // place of the mapping that holds or should hold the key
    const char *file;                      // name of the scene's file; a mesh is searched in the folder of this file
    const char *beside;                    // another file whose folder may hold the mesh; NULL: none
    const char *const *sets;               // options --set, each "key=value"
    char *error;                           // buffer for the error message
    size_t error_size;
} kn_draft;

// Set every key to its default and mark it as not written in any file.
void kn_draft_init(kn_draft *draft, const char *file, const char *const *sets, char *error, size_t error_size);

// Return the member that holds the value of a key in a slot.
void *kn_draft_field(kn_draft *draft, int slot, kn_key_id id);
// Print the path of a key: "probes.plate.size", or "probes[0].size" before the name is known.
const char *kn_draft_path(kn_draft *draft, int slot, kn_key_id id, char path[KN_LINE_MAX]);

// Return true if the file, a --set, or a named material or profile gives the key.
static inline bool kn_draft_given(const kn_draft *draft, int slot, kn_key_id id)
{
    return draft->at[slot][id].source != KN_SOURCE_DEFAULT;
}

// Write "file:line:col: ..." or "--set key: ..." into error. Always return false.
bool kn_draft_complain(kn_draft *draft, kn_mark mark, const char *format, ...) __attribute__((format(printf, 3, 4)));

// Check the rules between keys, then compute all derived values. Return false after an error. Afterwards scene.model
// holds the values of object and solver as they are in the canonical text. In `built`, the values of the chosen quality
// point replace them.
bool kn_draft_finish(kn_draft *draft);

// Check the rules of the keys that a quality point may change. Return false after an error.
bool kn_draft_finish_point(kn_draft *draft);

// Fill in the quality points and `built` (draft_quality.c). Return false after an error.
bool kn_draft_quality(kn_draft *draft);

// Find the box of fine cells from accuracy, margin and the probes' reach (draft_quality.c). Return false after an
// error.
bool kn_draft_fine(kn_draft *draft);

// The numbers are those of a rheological object. Variants follow from them by the second paper's rules:
//     viscoelastic  stroke [1, 1]: the damper cannot move, so all of the deformation is lost
//     plastic       k1 = 0; c1 = c2 = 2 c2 if c2 is constant; c1 = 25 c2(0) if c2 depends on the stress: then the pair
//                   equals the damper alone to within 1/26 (equation 8)
// material.variant chooses the variant. A material's file may set its default variant. In a scene, the name of a
// material may have the variant as a suffix: dough-plastic.
//
// Copy material and density from the draft of a material's file (draft_library.c). Every value is marked with the place
// where the scene names the material. A density in the scene itself takes precedence. Return false with an error about
// any other key in the file.
bool kn_draft_take_material(kn_draft *draft, const kn_draft *from, int variant, kn_mark mark);

// Replace the complete numbers, in SI, by those of the draft's variant. Return false after an error.
bool kn_draft_vary_material(kn_draft *draft);

// Copy the device keys of `from` into the draft (draft_library.c). From a device's file, copy all keys. From a profile
// (mark.library), copy only the keys that the draft does not have. Return false with an error if `from` has any other
// key.
bool kn_draft_take_device(kn_draft *draft, const kn_draft *from, kn_mark mark);
bool kn_draft_of_device(kn_key_id id); // true if the key describes the device itself, not the safety limits

// Compute the values that follow from the device's keys. Return false after an error.
bool kn_draft_device(kn_draft *draft);

// Return the shape of the probe or part in a slot.
kn_probe_shape kn_draft_shape(const kn_draft *draft, int slot);

// Make the tools that need more than the numbers of a probe: unions and meshes (draft_tool.c). The scene owns the
// tools. Return false after an error.
bool kn_draft_tools(kn_draft *draft);

// Check that a tool and its parts are wide enough for the present lattice. Return false after an error.
bool kn_draft_tool_fits(kn_draft *draft, int slot);

// Read the mesh that the draft names (draft_mesh.c). Return false after an error.
bool kn_draft_mesh(kn_draft *draft);

// A file that a key names and that may have moved since the text was written. kn_draft_read loads it into the scene
// with `load`, compares its hash with the hash in the text, and makes its path absolute (draft_mesh.c). load returns
// false with one line in draft->error. It frees the data that it replaces.
typedef struct kn_draft_file {
    int slot;             // slot of the object that has the keys
    kn_key_id path, hash; // keys of the file's path and of the hash of its contents
    const char *kind;     // description for error messages, e.g. "a Gmsh mesh"
    bool (*load)(kn_draft *draft, int slot, const char *path, uint64_t *hash);
} kn_draft_file;
bool kn_draft_read(kn_draft *draft, const kn_draft_file *file);
extern const double kn_draft_units_per_m[4]; // units per metre, indexed by the unit of a mesh (mesh_unit)

// Return the canonical text of a finished draft, or NULL if memory is short.
char *kn_draft_format(kn_draft *draft);

#endif
