#ifndef KN_CORE_SCENE_DRAFT_H
#define KN_CORE_SCENE_DRAFT_H
// A scene while it is read: the values as written, and where each was written, so that a rule between two keys can
// still point at a line. Reading fills it (scene.c), then kn_draft_finish checks the rules and works out what follows.
#include "core/scene/keys.h"
#include "core/scene/scene.h"
#include "core/shape.h"

enum { KN_SOURCE_DEFAULT = -2, KN_SOURCE_FILE = -1 }; // 0, 1, ...: number of the --set

typedef struct kn_mark {
    int source;
    int line, col;   // in the file, from 1
    bool per_height; // the value is per metre of specimen height
    bool library;    // it came with a named material
} kn_mark;

// 0: the scene's keys; 1 + p: those of probe p; behind them those of the parts of probe 0, 1, ...
#define KN_SLOTS (1 + KN_PROBES_MAX * (1 + KN_PARTS_MAX))

static inline int kn_slot_of_part(int slot, int part) // part from 0, of the probe in that slot
{
    return 1 + KN_PROBES_MAX + (slot - 1) * KN_PARTS_MAX + part;
}

typedef struct kn_draft_surface { // of a tool that is a mesh
    char path[KN_PATH_MAX];       // as written; absolute once it has been read
    int unit;                     // number of the word in the key's table
    uint64_t hash;
    double cell_m;
} kn_draft_surface;

typedef struct kn_draft_part { // of a union
    int kind;                  // number of the word in the key's table: kn_probe_shape without the plate
    kn_probe_def as;           // its size
    double at_m[3], turn_rad[3];
} kn_draft_part;

typedef struct kn_draft_point { // what quality.NAME says
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
    int variant;       // 0 rheological, 1 viscoelastic, 2 plastic
    bool is_part;      // it is the file of a material or a device that is read, not a scene
    int profile;       // of the device: number of the word in the key's table
    bool device_whole; // the canonical text says all of the device, not its name and limits alone
    int chosen;        // kn_quality
    kn_draft_point fast, balanced, accurate;
    kn_model_def built;          // scene.model with the chosen point in its place
    const char *point;           // NULL, or name of the point that stands in scene.model
    char mesh_path[KN_PATH_MAX]; // as written; absolute once it has been read. "": a block
    int mesh_unit;               // number of the word in the key's table
    uint64_t mesh_hash;
    kn_draft_part part[KN_PROBES_MAX * KN_PARTS_MAX]; // in the order of their slots
    int part_count[KN_PROBES_MAX];
    kn_draft_surface surface[KN_PROBES_MAX];
    kn_mark parts_at[KN_PROBES_MAX];       // where a probe's list of parts was written
    kn_mark at[KN_SLOTS][KN_KEY_COUNT];    // where each key's value was written
    kn_mark group[KN_SLOTS][KN_KEY_COUNT]; // where the mapping stands that holds or should hold the key
    const char *file;                      // for complaints; its folder is where a mesh is looked for
    const char *beside;                    // another file in whose folder it may be, NULL: none
    const char *const *sets;
    char *error;
    size_t error_size;
} kn_draft;

// Everything at its default, nothing written.
void kn_draft_init(kn_draft *draft, const char *file, const char *const *sets, char *error, size_t error_size);

void *kn_draft_field(kn_draft *draft, int slot, kn_key_id id);
// "probes.plate.size", or "probes[0].size" before the name is known.
const char *kn_draft_path(kn_draft *draft, int slot, kn_key_id id, char path[KN_LINE_MAX]);

// Writes "file:line:col: ..." or "--set key: ..." into error. Always false.
bool kn_draft_complain(kn_draft *draft, kn_mark mark, const char *format, ...) __attribute__((format(printf, 3, 4)));

// The rules between keys, then everything that follows from the values. False after a complaint. scene.model is then
// what object and solver say, which the canonical text holds; built is what the chosen point of quality makes of it.
bool kn_draft_finish(kn_draft *draft);

// The rules of those keys that a point of quality may change. False after a complaint.
bool kn_draft_finish_point(kn_draft *draft);

// The points of quality, and built (draft_quality.c). False after a complaint.
bool kn_draft_quality(kn_draft *draft);

// The box of fine cells, from accuracy, margin and the probes' reach (draft_fine.c). False after a complaint.
bool kn_draft_fine(kn_draft *draft);

// Takes the device keys of `from`: all of a device's file, of a profile (mark.library) those that the draft has not
// (draft_device.c). False after a complaint about anything else in it.
bool kn_draft_take_device(kn_draft *draft, const kn_draft *from, kn_mark mark);
bool kn_draft_of_device(kn_key_id id); // what a device has beyond the limits

// What follows from the device's keys. False after a complaint.
bool kn_draft_device(kn_draft *draft);

// Shape of the probe, or of the part, in that slot.
kn_probe_shape kn_draft_shape(const kn_draft *draft, int slot);

// Makes the tools that are more than the numbers of a probe, which the scene then owns (draft_tool.c). False after a
// complaint.
bool kn_draft_tools(kn_draft *draft);

// Whether such a tool's parts are wide enough for the lattice as it is. False after a complaint.
bool kn_draft_tool_fits(kn_draft *draft, int slot);

// Reads the mesh that the draft names (draft_mesh.c). False after a complaint.
bool kn_draft_mesh(kn_draft *draft);

// A file that a key names and that may have moved: read by `load` into the scene, its hash compared with what the text
// says, its path made absolute (draft_mesh.c). load: false with one line in draft->error; what it replaces it frees.
typedef struct kn_draft_file {
    int slot;
    kn_key_id path, hash;
    const char *kind; // "a Gmsh mesh"
    bool (*load)(kn_draft *draft, int slot, const char *path, uint64_t *hash);
} kn_draft_file;
bool kn_draft_read(kn_draft *draft, const kn_draft_file *file);
extern const double kn_draft_units_per_m[4]; // of the words of a mesh's unit

// The canonical text of a finished draft; NULL when memory is short.
char *kn_draft_format(kn_draft *draft);

#endif
