#ifndef KN_CORE_SCENE_DRAFT_H
#define KN_CORE_SCENE_DRAFT_H
// A scene while it is read: the value of each key as written, and the place where the value was written. So an error
// about two keys can still name a line. The reader fills in the draft (reader.c). Then kn_draft_finish checks the rules
// and computes all derived values. The functions allocate memory and read files: not for a real-time loop.
#include "core/scene/keys.h"
#include "core/scene/scene.h"
#include "core/shape.h"

// Source of a value: the default, a file, or a --set option; the options are numbered 0, 1, ... in the order of the
// command line.
enum { KN_SOURCE_DEFAULT = -2, KN_SOURCE_FILE = -1 };

typedef struct kn_mark { // place where a value was written
    int source;          // KN_SOURCE_DEFAULT, KN_SOURCE_FILE or the number of the --set option
    int line, col;       // line and column in the file, from 1
    bool per_height;     // the modulus is written per metre of specimen height, e.g. in Pa/m
    bool library;        // the value comes with a named material or a device profile, not from the text of the scene
} kn_mark;

// Number of slots. Each owner of keys has a slot. Slot 0 belongs to the scene, slot 1 + p to probe p. After the probes
// come the parts of the unions: KN_PARTS_MAX slots for the parts of probe 0, as many for those of probe 1, and so on.
#define KN_SLOTS (1 + KN_PROBES_MAX * (1 + KN_PARTS_MAX))

// Return the slot of part number `part` (from 0) of the probe whose slot is `slot`.
static inline int kn_slot_of_part(int slot, int part) { return 1 + KN_PROBES_MAX + (slot - 1) * KN_PARTS_MAX + part; }

typedef struct kn_draft_surface { // surface file of a tool that is a mesh
    char path[KN_PATH_MAX];       // path of the file: as written in the scene, absolute after the file has been read
    int unit;                     // unit of length in the file: index in kn_draft_units_per_m
    uint64_t hash;                // hash of the file's contents
    double cell_m;                // side of a cell of the grid of distances (core/field.h)
} kn_draft_surface;

typedef struct kn_draft_part {   // part of a union
    int kind;                    // kn_probe_shape of the part minus KN_PROBE_SPHERE, because a part cannot be a plate
    kn_probe_def as;             // shape and sizes of the part; the other members are unused
    double at_m[3], turn_rad[3]; // at_m: position of the part in the tool's frame; turn_rad: its rotation about x, y, z
} kn_draft_part;

typedef struct kn_draft_point { // values of the mapping quality.NAME, one quality point (see kn_quality)
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
    bool is_part;      // the draft is read from a file of a material or a device, not from a scene
    int profile;       // device profile: index of its name in the words of the key device.profile (keys.h)
    bool device_whole; // the canonical text contains all keys of the device, not only its name and limits
    int chosen;        // kn_quality of the chosen quality point
    kn_draft_point fast, balanced, accurate;
    kn_model_def built; // scene.model with the values of the chosen quality point
    const char *point;  // name of the quality point that is being checked, for error messages; NULL: none
    // path of the object's mesh: as written, absolute after the mesh has been read. "": the object is a block
    char mesh_path[KN_PATH_MAX];
    // unit of length in the mesh: index in kn_draft_units_per_m
    int mesh_unit;
    uint64_t mesh_hash;                               // hash of the mesh file's contents
    kn_draft_part part[KN_PROBES_MAX * KN_PARTS_MAX]; // parts of all unions, in the order of their slots
    int part_count[KN_PROBES_MAX];
    kn_draft_surface surface[KN_PROBES_MAX];
    kn_mark parts_at[KN_PROBES_MAX];       // place where each probe's list of parts begins
    kn_mark at[KN_SLOTS][KN_KEY_COUNT];    // place of each key's value
    kn_mark group[KN_SLOTS][KN_KEY_COUNT]; // place of the mapping that holds or should hold the key
    const char *file;                      // name of the scene's file; relative paths start in the folder of this file
    const char *beside;                    // another file whose folder may hold the mesh files; NULL: none
    const char *const *sets;               // options --set, each "key=value"
    char *error;                           // buffer for the error message
    size_t error_size;
} kn_draft;

// Set every key to its default and mark it as not written in any file.
void kn_draft_init(kn_draft *draft, const char *file, const char *const *sets, char *error, size_t error_size);

// Return the member that holds the value of a key in a slot.
void *kn_draft_field(kn_draft *draft, int slot, kn_key_id id);
// Write the path of a key into `path` and return it: "probes.plate.size", or "probes[0].size" if the name of the probe
// is not known yet.
const char *kn_draft_path(kn_draft *draft, int slot, kn_key_id id, char path[KN_LINE_MAX]);

// Return true if the scene's file, a --set option, a named material or a device profile gives the key.
static inline bool kn_draft_given(const kn_draft *draft, int slot, kn_key_id id)
{
    return draft->at[slot][id].source != KN_SOURCE_DEFAULT;
}

// Write one line with a place and the message into draft->error: "file:line:col: MESSAGE" or "--set key: MESSAGE".
// Always return false.
bool kn_draft_complain(kn_draft *draft, kn_mark mark, const char *format, ...) __attribute__((format(printf, 3, 4)));

// Check the rules between keys, then compute all derived values. Return false after an error. After success scene.model
// holds the values of object and solver that the canonical text gives. draft->built is a copy of scene.model in which
// the values of the chosen quality point replace those of the scene.
bool kn_draft_finish(kn_draft *draft);

// Check the rules of the keys that a quality point may change. Return false after an error.
bool kn_draft_finish_point(kn_draft *draft);

// Fill in scene.point, scene.quality and `built` from the quality points of the scene (draft_quality.c). Return false
// after an error.
bool kn_draft_quality(kn_draft *draft);

// Find the box of fine cells from accuracy, margin and the probes' reach (draft_quality.c). Return false after an
// error.
bool kn_draft_fine(kn_draft *draft);

// The numbers of a material are those of a rheological object. The variants of the material follow from the numbers by
// the rules of the second paper:
//     viscoelastic  stroke [1, 1]: the damper cannot move, so all of the deformation is lost
//     plastic       k1 = 0. If c2 is constant, c1 and c2 both become twice the given c2. If c2 depends on the stress,
//                   c1 = 25 c2(0): then c1 and c2 in series equal c2 alone to within 1/26 (equation 8)
// material.variant chooses the variant. The file of a material may set the default variant. In a scene, the name of a
// material may have the variant as a suffix: dough-plastic.
//
// Copy material, density and label from `from`, the draft of a material's file (draft_library.c). Mark every value with
// the place where the scene names the material. A density or label in the scene itself takes precedence.
// `variant`: variant that the suffix of the name chooses, -1 for no suffix. Return false with an error if the file
// holds any other key.
bool kn_draft_take_material(kn_draft *draft, const kn_draft *from, int variant, kn_mark mark);

// Drop the label if it does not speak of the scene's material: if a --set changes the material of a file with a label,
// or if the scene changes a key of a material that brought its label.
void kn_draft_drop_label(kn_draft *draft);

// Change the numbers of the material to those of the variant draft->variant. Before the call, the numbers must be
// complete and in SI. Return false after an error.
bool kn_draft_vary_material(kn_draft *draft);

// Copy the device keys of `from` into the draft (draft_library.c). If `from` is a user's device file, copy all keys. If
// `from` is a profile (mark.library is true), copy only the keys that the draft does not have. Return false with an
// error if `from` has a key that does not begin with "device.".
bool kn_draft_take_device(kn_draft *draft, const kn_draft *from, kn_mark mark);
bool kn_draft_of_device(kn_key_id id); // true if the key describes the device itself, not its name or a safety limit

// Compute the values that follow from the device's keys. Return false after an error.
bool kn_draft_device(kn_draft *draft);

// Return the shape of the probe or part in a slot.
kn_probe_shape kn_draft_shape(const kn_draft *draft, int slot);

// Make the shape of every tool that is a union or a mesh (draft_tool.c). The scene owns these shapes. Return false
// after an error.
bool kn_draft_tools(kn_draft *draft);

// Check that the tool in a slot and its parts are wide enough for the spacing of the lattice. Return false after an
// error.
bool kn_draft_tool_fits(kn_draft *draft, int slot);

// Read the mesh that the draft names (draft_mesh.c). Return false after an error.
bool kn_draft_mesh(kn_draft *draft);

// A mesh file that a key names. The file may have moved since the text of the scene was written. kn_draft_read calls
// `load`, which loads the file into the scene. Then kn_draft_read compares the file's hash with the hash in the text,
// and makes the path absolute (draft_mesh.c). load may be called twice and then frees the data of the first call. load
// returns false after an error, with one line in draft->error.
typedef struct kn_draft_file {
    int slot;             // slot whose keys are `path` and `hash`
    kn_key_id path, hash; // keys of the file's path and of the hash of its contents
    const char *kind;     // what the file must be, for error messages, e.g. "a Gmsh mesh"
    bool (*load)(kn_draft *draft, int slot, const char *path, uint64_t *hash);
} kn_draft_file;
bool kn_draft_read(kn_draft *draft, const kn_draft_file *file);
// units per metre for m, cm, mm, um, in the order of the words of the keys mesh_unit
extern const double kn_draft_units_per_m[4];

// Lower the clamp of a scene whose device holds the force for more than 3 ms, so that the force fades no faster than
// one that is held for 3 ms. To be called when the canonical text is written, which has the clamp that the scene asks
// for.
void kn_draft_lower_clamp(kn_scene *scene);

// Return the canonical text of a finished draft; the caller frees the text. Return NULL if memory is short.
char *kn_draft_format(kn_draft *draft);

#endif
