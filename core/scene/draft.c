#include "core/scene/draft.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Largest number of nodes of a block: 100 times more than any processor can step in a millisecond. The memory of these
// nodes (below 4 GiB in f64) still fits a workstation. A larger number is probably a typing error.
enum { NODES_MAX = 1 << 22 };
#define BUDGET_S 0.8e-3 // default of solver.budget: leaves 0.2 ms of the 1 ms tick to the operating system
#define LETTERS "abcdefghijklmnopqrstuvwxyz"
// Largest difference between the extent of a block and a whole number of spacings, in spacings. So an extent of 5 cm
// fits a spacing of 3.3333333333333333 mm, but not a spacing of 3.333 mm.
#define SPACING_TOLERANCE 1e-6

_Static_assert(sizeof(kn_damper) == sizeof(int) && sizeof(kn_solver) == sizeof(int), "a CHOICE is stored as an int");

// The key table. Each list of keys in keys.h belongs to a different struct, so each list needs a row macro of its own
// for offsetof.
#define ROW(parent, id, when_, path_, type_, count_, unit_, least_, most_, fallback_, member, meaning_)                \
    [KN_KEY_##id] = {KN_WHEN_##when_, path_,     KN_TYPE_##type_,          count_,  unit_, least_,                     \
                     most_,           fallback_, offsetof(parent, member), meaning_},
#define SCENE_ROW(...) ROW(kn_draft, __VA_ARGS__)
#define PROBE_ROW(...) ROW(kn_probe_def, __VA_ARGS__)
#define SURFACE_ROW(...) ROW(kn_draft_surface, __VA_ARGS__)
#define PART_ROW(...) ROW(kn_draft_part, __VA_ARGS__)
const kn_key kn_keys[KN_KEY_COUNT] = {KN_SCENE_KEYS(SCENE_ROW) KN_PROBE_KEYS(PROBE_ROW) KN_SURFACE_KEYS(SURFACE_ROW)
                                          KN_PART_KEYS(PART_ROW)};

void *kn_draft_field(kn_draft *draft, int slot, kn_key_id id)
{
    char *base = (char *)draft;
    if (slot > KN_PROBES_MAX) base = (char *)&draft->part[slot - 1 - KN_PROBES_MAX];
    else if (slot > 0 && id >= KN_KEY_SURFACE) base = (char *)&draft->surface[slot - 1];
    else if (slot > 0) base = (char *)&draft->scene.model.probe[slot - 1];
    return base + kn_keys[id].offset;
}

// Return true if the owner of a slot (scene, probe or part) can have key `id`.
static bool of_slot(int slot, kn_key_id id)
{
    if (slot == 0) return id < KN_KEY_PROBE_NAME;
    return (id >= KN_KEY_PROBE_NAME) && (id >= KN_KEY_PART_SHAPE) == (slot > KN_PROBES_MAX);
}

const char *kn_draft_path(kn_draft *draft, int slot, kn_key_id id, char path[KN_LINE_MAX])
{
    const int part = slot - 1 - KN_PROBES_MAX, of = part < 0 ? slot : 1 + part / KN_PARTS_MAX;
    const char *name = slot > 0 ? draft->scene.model.probe[of - 1].name : "";
    if (part >= 0)
        snprintf(path, KN_LINE_MAX, "probes.%s.parts.%d%s", *name ? name : "NAME", 1 + part % KN_PARTS_MAX,
                 strrchr(kn_keys[id].path, '.'));
    else if (slot == 0) snprintf(path, KN_LINE_MAX, "%s", kn_keys[id].path);
    else if (*name) snprintf(path, KN_LINE_MAX, "probes.%s%s", name, strrchr(kn_keys[id].path, '.'));
    else snprintf(path, KN_LINE_MAX, "probes[%d]%s", slot - 1, strrchr(kn_keys[id].path, '.'));
    return path;
}

bool kn_draft_complain(kn_draft *draft, kn_mark mark, const char *format, ...)
{
    char what[512];
    // print the message, preceded by the name of the quality point if a point is being checked
    int used = draft->point ? snprintf(what, sizeof what, "quality.%s: ", draft->point) : 0;
    va_list args;
    va_start(args, format);
    vsnprintf(what + used, sizeof what - (size_t)used, format, args);
    va_end(args);
    // print the place of the error: a line of the file, or the key of a --set
    if (mark.source < 0) {
        snprintf(draft->error, draft->error_size, "%s:%d:%d: %s", draft->file, mark.line, mark.col, what);
    } else {
        const char *set = draft->sets[mark.source];
        int size = 0;
        bool point = strncmp(set, "quality=", 8) == 0 && set[8] && set[8 + strspn(set + 8, LETTERS)] == '\0';
        if (point) { // name the option --quality NAME as the user wrote it
            snprintf(draft->error, draft->error_size, "--quality %.24s: %s", set + 8, what);
            return false;
        }
        bool keyless = *set == '=';
        while (set[size] > ' ' && set[size] <= '~' && (set[size] != '=' || keyless) && size < 128) size++;
        // if the message begins with the key of the --set, print the key only once
        bool twice = size > 0 && strncmp(what, set, (size_t)size) == 0 && what[size] == ':';
        snprintf(draft->error, draft->error_size, "--set %.*s%s", size, set, twice ? what + size : ": ");
        if (!twice) strncat(draft->error, what, draft->error_size - strlen(draft->error) - 1);
    }
    return false;
}

void kn_draft_init(kn_draft *draft, const char *file, const char *const *sets, char *error, size_t error_size)
{
    *draft = (kn_draft){.file = file, .sets = sets, .error = error, .error_size = error_size};
    for (int slot = 0; slot < KN_SLOTS; slot++)
        for (kn_key_id id = 0; id < KN_KEY_COUNT; id++) {
            const char *fallback = kn_keys[id].fallback;
            char problem[KN_LINE_MAX];
            // until a value is written, an error about the key points at the start of the file
            draft->at[slot][id] = (kn_mark){.source = KN_SOURCE_DEFAULT, .line = 1, .col = 1};
            draft->group[slot][id] = (kn_mark){.source = KN_SOURCE_FILE, .line = 1, .col = 1};
            // read the default text, unless the key is required, optional or computed later
            if (!of_slot(slot, id) || !fallback || *fallback == '\0' || *fallback == '(') continue;
            kn_key_read(&kn_keys[id], kn_draft_field(draft, slot, id), &fallback, 1, NULL, problem);
        }
}

// Return the mark of the value that was written last. An error about two values that do not fit together points at this
// mark. Every --set is later than the file, and the second --set is later than the first.
static kn_mark later_of(kn_mark x, kn_mark y)
{
    if (x.source != y.source) return x.source > y.source ? x : y;
    return x.line > y.line || (x.line == y.line && x.col > y.col) ? x : y;
}

static kn_mark later(const kn_draft *draft, kn_key_id a, kn_key_id b)
{
    return later_of(draft->at[0][a], draft->at[0][b]);
}

// Return the key whose value decides whether key `id` is relevant.
static kn_key_id chooser(const kn_draft *draft, kn_key_id id)
{
    if (kn_keys[id].when >= KN_WHEN_PLATE) return id < KN_KEY_PART_SHAPE ? KN_KEY_PROBE_SHAPE : KN_KEY_PART_SHAPE;
    switch (kn_keys[id].when) {
    case KN_WHEN_BLOCK:
    case KN_WHEN_MESH: return KN_KEY_MESH;
    case KN_WHEN_DIAGONALS: return *draft->mesh_path ? KN_KEY_MESH : KN_KEY_STRUCTURE;
    case KN_WHEN_PRESSURE: return KN_KEY_PRESSURE;
    case KN_WHEN_TABLE: return KN_KEY_SUPPORT;
    default: return KN_KEY_DAMPER;
    }
}

kn_probe_shape kn_draft_shape(const kn_draft *draft, int slot)
{
    if (slot <= KN_PROBES_MAX) return draft->scene.model.probe[slot - 1].shape;
    return (kn_probe_shape)(draft->part[slot - 1 - KN_PROBES_MAX].kind + KN_PROBE_SPHERE);
}

// Return true if a tool of this shape meets the condition `when`.
static bool of_shape(kn_key_when when, kn_probe_shape shape)
{
    const bool edged = shape == KN_PROBE_BOX || shape == KN_PROBE_CROSS, cylinder = shape == KN_PROBE_CYLINDER;
    const bool capsule = shape == KN_PROBE_CAPSULE;
    switch (when) {
    case KN_WHEN_PLATE: return shape == KN_PROBE_PLATE;
    case KN_WHEN_SURFACE: return shape == KN_PROBE_MESH;
    case KN_WHEN_ROUND: return shape == KN_PROBE_SPHERE || capsule || cylinder;
    case KN_WHEN_LONG: return capsule || cylinder;
    case KN_WHEN_BOX: return edged;
    case KN_WHEN_EDGED: return edged || cylinder;
    default: return shape != KN_PROBE_PLATE;
    }
}

// Return true if the values in the draft meet the condition under which the key is relevant.
static bool relevant(kn_draft *draft, int slot, kn_key_id id)
{
    const kn_model_def *def = &draft->scene.model;
    const bool mesh = *draft->mesh_path != '\0';
    // conditions from KN_WHEN_PLATE on concern the shape of a probe or part, all others concern the scene
    if (kn_keys[id].when >= KN_WHEN_PLATE) return slot > 0 && of_shape(kn_keys[id].when, kn_draft_shape(draft, slot));
    switch (kn_keys[id].when) {
    case KN_WHEN_BLOCK: return !mesh;
    case KN_WHEN_MESH: return mesh;
    case KN_WHEN_DIAGONALS: return !mesh && def->structure == KN_STRUCTURE_DIAGONALS;
    case KN_WHEN_PRESSURE: return def->pressure != KN_PRESSURE_NONE;
    case KN_WHEN_CONSTANT: return def->material.damper == KN_DAMPER_CONSTANT;
    case KN_WHEN_RAMP: return def->material.damper == KN_DAMPER_RAMP;
    case KN_WHEN_FORCE: return def->material.damper == KN_DAMPER_EXPONENTIAL || def->material.damper == KN_DAMPER_RAMP;
    case KN_WHEN_EXPONENTIAL: return def->material.damper == KN_DAMPER_EXPONENTIAL;
    case KN_WHEN_TABLE: return def->support == KN_SUPPORT_FRICTION;
    default: return true;
    }
}

// Check that a relevant key is written if the key is required.
static bool require(kn_draft *draft, int slot, kn_key_id id)
{
    char path[KN_LINE_MAX], expects[KN_LINE_MAX];
    if (kn_keys[id].fallback || kn_draft_given(draft, slot, id)) return true;
    // if a --set made the key necessary, report that --set; else report the mapping in which the key is missing
    bool chosen = kn_keys[id].when != KN_WHEN_ALWAYS && draft->at[slot][chooser(draft, id)].source >= 0;
    return kn_draft_complain(draft, chosen ? draft->at[slot][chooser(draft, id)] : draft->group[slot][id],
                             "%s is missing, expected %s", kn_draft_path(draft, slot, id, path),
                             kn_key_expects(&kn_keys[id], expects));
}

// Clear the value of an irrelevant key. If a later --set made the key irrelevant, this is no error. If the key was
// irrelevant as written, report an error. An object.accuracy other than 0 is always an error, because the user relies
// on that accuracy.
static bool drop(kn_draft *draft, int slot, kn_key_id id)
{
    char path[KN_LINE_MAX], choice[KN_LINE_MAX];
    kn_key_id by = chooser(draft, id);
    size_t size = (size_t)kn_keys[id].count * (kn_keys[id].type == KN_TYPE_CHOICE ? sizeof(int) : sizeof(double));
    bool dropped = draft->at[slot][by].source > draft->at[slot][id].source;
    if (id == KN_KEY_ACCURACY) dropped = draft->scene.accuracy == 0;
    // clear the member; but plate and box share the member size_m, which must keep the value of the relevant key
    bool either = id == KN_KEY_PROBE_SIZE || id == KN_KEY_PROBE_EXTENT;
    kn_probe_shape shape = slot > 0 ? kn_draft_shape(draft, slot) : KN_PROBE_PLATE;
    if (!either || !(of_shape(KN_WHEN_PLATE, shape) || of_shape(KN_WHEN_BOX, shape)))
        memset(kn_draft_field(draft, slot, id), 0, size);
    if (!kn_draft_given(draft, slot, id) || dropped) return true;
    if (by == KN_KEY_MESH)
        return kn_draft_complain(draft, draft->at[slot][id],
                                 "%s means nothing with%s object.mesh, expected it left out", kn_keys[id].path,
                                 *draft->mesh_path ? "" : "out");
    const char *dot = strrchr(kn_keys[by].path, '.');
    return kn_draft_complain(draft, draft->at[slot][id], "%s means nothing with '%s: %s', expected it left out",
                             kn_draft_path(draft, slot, id, path), dot ? dot + 1 : kn_keys[by].path,
                             kn_key_print(&kn_keys[by], kn_draft_field(draft, slot, by), choice));
}

// Check every key of a slot: a relevant key must be written if it is required, an irrelevant key must not be written.
static bool check_slot(kn_draft *draft, int slot)
{
    for (kn_key_id id = 0; id < KN_KEY_COUNT; id++)
        if (of_slot(slot, id) && !(relevant(draft, slot, id) ? require : drop)(draft, slot, id)) return false;
    return true;
}

// Check that a union has parts and that a tool of any other shape has no parts. If a --set changed the shape, drop the
// parts without an error.
static bool check_parts(kn_draft *draft, int slot)
{
    const kn_probe_def *probe = &draft->scene.model.probe[slot - 1];
    kn_mark shape = draft->at[slot][KN_KEY_PROBE_SHAPE], parts = draft->parts_at[slot - 1];
    int *count = &draft->part_count[slot - 1];
    char choice[KN_LINE_MAX];
    if (probe->shape == KN_PROBE_UNION && *count == 0)
        return kn_draft_complain(draft, shape.source >= 0 ? shape : draft->group[slot][KN_KEY_PROBE_SHAPE],
                                 "probes.%s.parts is missing, expected a list of 1 to %d mappings with shape",
                                 probe->name, KN_PARTS_MAX);
    for (int i = 0; probe->shape == KN_PROBE_UNION && i < *count; i++)
        if (!check_slot(draft, kn_slot_of_part(slot, i))) return false;
    if (probe->shape == KN_PROBE_UNION || *count == 0) return true;
    *count = 0;
    return shape.source > parts.source ||
           kn_draft_complain(draft, parts, "probes.%s.parts means nothing with 'shape: %s', expected it left out",
                             probe->name, kn_key_print(&kn_keys[KN_KEY_PROBE_SHAPE], &probe->shape, choice));
}

static bool check_presence(kn_draft *draft)
{
    for (int slot = 0; slot <= draft->scene.model.probe_count; slot++)
        if (!check_slot(draft, slot) || (slot > 0 && !check_parts(draft, slot))) return false;
    return true;
}

// If a modulus is given per height of a specimen, multiply the modulus by that height. Then check the range.
static bool finish_modulus(kn_draft *draft, kn_key_id id)
{
    char expects[KN_LINE_MAX];
    const kn_key *key = &kn_keys[id];
    double *value = kn_draft_field(draft, 0, id);
    kn_mark at = draft->at[0][id];
    if (at.per_height && !kn_draft_given(draft, 0, KN_KEY_SPECIMEN_HEIGHT))
        return kn_draft_complain(draft, at, "%s is given per height of a specimen (%s/m), expected %s, too, e.g. 1 cm",
                                 key->path, key->unit, kn_keys[KN_KEY_SPECIMEN_HEIGHT].path);
    if (at.per_height) *value *= draft->specimen_height_m;
    if (*value >= key->least && *value <= key->most) return true;
    return kn_draft_complain(draft, at, "%s is %g %s, out of range, expected %s", key->path, *value, key->unit,
                             kn_key_expects(key, expects));
}

// Compute alpha and beta of an exponential damper from c_max and c_min, if the scene gives c_max and c_min instead.
// Call before the check for missing keys, because this function marks alpha and beta as given.
static bool take_ends(kn_draft *draft)
{
    static const kn_key_id ends[2] = {KN_KEY_C_MAX, KN_KEY_C_MIN}, curve[2] = {KN_KEY_ALPHA, KN_KEY_BETA};
    kn_material *mat = &draft->scene.model.material;
    kn_mark at = later(draft, KN_KEY_C_MAX, KN_KEY_C_MIN);
    if (mat->damper != KN_DAMPER_EXPONENTIAL ||
        !(kn_draft_given(draft, 0, ends[0]) || kn_draft_given(draft, 0, ends[1])))
        return true;
    // c_max and c_min need p0 and p1
    if (!kn_draft_given(draft, 0, KN_KEY_P0) || !kn_draft_given(draft, 0, KN_KEY_P1))
        return require(draft, 0, kn_draft_given(draft, 0, KN_KEY_P0) ? KN_KEY_P1 : KN_KEY_P0);
    // c_max and c_min must both be given. It is an error if the same or a later source also gives alpha or beta. The
    // place of c_max and c_min becomes the place of alpha and beta.
    for (int i = 0; i < 2; i++) {
        if (!kn_draft_given(draft, 0, ends[i]))
            return kn_draft_complain(draft, at, "%s is missing, expected it beside %s", kn_keys[ends[i]].path,
                                     kn_keys[ends[!i]].path);
        if (kn_draft_given(draft, 0, curve[i]) && draft->at[0][curve[i]].source >= at.source)
            return kn_draft_complain(draft, draft->at[0][curve[i]],
                                     "%s is given beside c_max and c_min, expected only one of the pairs",
                                     kn_keys[curve[i]].path);
        if (!finish_modulus(draft, ends[i])) return false;
        draft->at[0][curve[i]] = at;
        draft->at[0][curve[i]].per_height = false;
        draft->at[0][ends[i]].source = KN_SOURCE_DEFAULT;
    }
    // solve c_max = alpha exp(-beta p0), c_min = alpha exp(-beta p1)
    bool rising = mat->p0_pa < mat->p1_pa; // if false, finish_material reports that p0 must be less than p1
    mat->beta_per_pa = rising ? log(mat->c_max_pa_s / mat->c_min_pa_s) / (mat->p1_pa - mat->p0_pa) : 0;
    mat->alpha_pa_s = mat->c_max_pa_s * exp(mat->beta_per_pa * mat->p0_pa);
    if (mat->c_min_pa_s <= mat->c_max_pa_s) return true;
    return kn_draft_complain(draft, at, "material.c_min is %g Pa s, expected at most c_max, %g Pa s", mat->c_min_pa_s,
                             mat->c_max_pa_s);
}

// Check the stroke and set the default of the ratio. If a_min = a_max, the damper cannot move, and the ratio is a_max,
// so that the object keeps its shape as made. Otherwise the ratio is 0.2 if the material has a spring k1 or a rigid
// damper. Without a spring, the ratio is c2/(c1 + c2): the share of c1 in the deformation when c1 and c2 are pressed in
// series.
static bool finish_stroke(kn_draft *draft)
{
    kn_material *mat = &draft->scene.model.material;
    kn_mark at = later(draft, KN_KEY_STROKE, KN_KEY_RATIO);
    bool stroke = kn_draft_given(draft, 0, KN_KEY_STROKE), ratio = kn_draft_given(draft, 0, KN_KEY_RATIO);
    if (ratio && !stroke)
        return kn_draft_complain(draft, at, "material.ratio means nothing without a stroke, expected it left out");
    if (stroke && mat->stroke[1] == 0)
        return kn_draft_complain(draft, at, "material.stroke ends at 0, expected [a_min, a_max] with a_max above 0");
    if (stroke && !ratio) {
        double c2 = kn_material_c2(mat, 0), share = mat->k1_pa > 0 || isinf(c2) ? 0.2 : c2 / (mat->c1_pa_s + c2);
        mat->ratio = mat->stroke[0] == mat->stroke[1] ? mat->stroke[1] : share;
        draft->at[0][KN_KEY_RATIO] = at;
    }
    const char *problem = kn_material_check(mat);
    return !problem || kn_draft_complain(draft, at, "material: %s", problem);
}

// Check the values of the material against each other, then convert them to the chosen variant.
static bool finish_material(kn_draft *draft)
{
    const kn_material *mat = &draft->scene.model.material;
    // convert the moduli to SI
    for (kn_key_id id = 0; id < KN_KEY_COUNT; id++)
        if (kn_keys[id].type == KN_TYPE_MODULUS && relevant(draft, 0, id) && !finish_modulus(draft, id)) return false;
    if (relevant(draft, 0, KN_KEY_P0) && mat->p0_pa >= mat->p1_pa)
        return kn_draft_complain(draft, later(draft, KN_KEY_P0, KN_KEY_P1),
                                 "material.p0 is %g Pa, expected less than p1, %g Pa", mat->p0_pa, mat->p1_pa);
    if (mat->damper == KN_DAMPER_RAMP && mat->c_min_pa_s > mat->c_max_pa_s)
        return kn_draft_complain(draft, later(draft, KN_KEY_C_MAX, KN_KEY_C_MIN),
                                 "material.c_min is %g Pa s, expected at most c_max, %g Pa s", mat->c_min_pa_s,
                                 mat->c_max_pa_s);
    if (!kn_draft_vary_material(draft)) return false;
    // first check the material without its stroke: an error then points at k1 or c1, not at the stroke
    kn_material bare = *mat;
    bare.stroke[0] = bare.stroke[1] = 0;
    const char *problem = kn_material_check(&bare);
    if (problem) return kn_draft_complain(draft, later(draft, KN_KEY_K1, KN_KEY_C1), "material: %s", problem);
    return finish_stroke(draft);
}

// Check that a flat object (a block with two extents, or a mesh of triangles) has a thickness, and that a solid object
// has no thickness.
static bool finish_thickness(kn_draft *draft, bool flat)
{
    char expects[KN_LINE_MAX];
    const kn_key_id by = *draft->mesh_path ? KN_KEY_MESH : KN_KEY_SIZE;
    const kn_mark at = draft->at[0][KN_KEY_THICKNESS], what = draft->at[0][by];
    if (kn_draft_given(draft, 0, KN_KEY_THICKNESS) == flat) return true;
    if (flat)
        return kn_draft_complain(draft, later_of(draft->group[0][KN_KEY_THICKNESS], what),
                                 "object.thickness is missing, expected %s because %s",
                                 kn_key_expects(&kn_keys[KN_KEY_THICKNESS], expects),
                                 by == KN_KEY_MESH ? "object.mesh is flat" : "object.size has two values");
    draft->scene.model.thickness_m = 0;
    draft->at[0][KN_KEY_THICKNESS].source = KN_SOURCE_DEFAULT;
    if (what.source > at.source) return true; // a --set made the object solid, so the thickness is ignored
    return kn_draft_complain(draft, at, "object.thickness means nothing with %s, expected it left out",
                             by == KN_KEY_MESH ? "a mesh of tetrahedra" : "an object.size of three values");
}

// Read the mesh, or compute the numbers of nodes of a block.
static bool finish_object(kn_draft *draft)
{
    static const char axis[3] = {'x', 'y', 'z'};
    kn_model_def *def = &draft->scene.model;
    kn_mark at = later(draft, KN_KEY_SIZE, KN_KEY_SPACING);
    double nodes = 1;
    if (*draft->mesh_path) return kn_draft_mesh(draft) && finish_thickness(draft, def->mesh->dimension == 2);
    if (!finish_thickness(draft, draft->size_m[1] == 0)) return false;
    for (int k = 0; k < 3; k++) {
        if (draft->size_m[k] == 0) {
            def->nodes[k] = 1; // a flat object has one layer of nodes along y
            continue;
        }
        // the extent must be a whole number of spacings
        double cells = draft->size_m[k] / def->spacing_m, whole = round(cells);
        if (whole < 1 || !(fabs(cells - whole) <= SPACING_TOLERANCE))
            return kn_draft_complain(draft, at,
                                     "object.size along %c, %g m, is %.8g spacings of %g m, "
                                     "expected a whole number, e.g. with a spacing of %.10g m",
                                     axis[k], draft->size_m[k], cells, def->spacing_m,
                                     draft->size_m[k] / fmax(whole, 1));
        def->nodes[k] = whole > NODES_MAX ? NODES_MAX + 1 : (int)whole + 1;
        nodes *= def->nodes[k];
    }
    if (nodes > NODES_MAX)
        return kn_draft_complain(draft, at, "object: size and spacing make %.4g nodes, expected at most %d", nodes,
                                 NODES_MAX);
    return true;
}

// Check the name and size of a probe.
static bool finish_probe(kn_draft *draft, int slot)
{
    const kn_model_def *def = &draft->scene.model;
    const kn_probe_def *probe = &def->probe[slot - 1];
    const kn_mark *at = draft->at[slot];
    for (int other = 1; other < slot; other++)
        if (strcmp(def->probe[other - 1].name, probe->name) == 0)
            return kn_draft_complain(draft, later_of(at[KN_KEY_PROBE_NAME], draft->at[other][KN_KEY_PROBE_NAME]),
                                     "probe '%s' exists already, expected another name", probe->name);
    // a ball smaller than a spacing would slip through between the sample points of the surface
    if (of_shape(KN_WHEN_ROUND, probe->shape) && probe->radius_m < def->spacing_m)
        return kn_draft_complain(draft, later_of(at[KN_KEY_PROBE_RADIUS], draft->at[0][KN_KEY_SPACING]),
                                 "probes.%s.radius is %g m, expected at least %s, %g m", probe->name, probe->radius_m,
                                 def->mesh ? "the mesh's mean edge" : "object.spacing", def->spacing_m);
    return kn_draft_tool_fits(draft, slot);
}

// Check the values of the solver. Set the defaults that the solvers rk4 and fixed do not take from the key table.
static bool finish_solver(kn_draft *draft)
{
    kn_solver_def *solver = &draft->scene.model.solver;
    if (solver->iterations_max < solver->iterations)
        return kn_draft_complain(draft, later(draft, KN_KEY_ITERATIONS, KN_KEY_ITERATIONS_MAX),
                                 "solver.iterations_max is %d, expected at least solver.iterations, %d",
                                 solver->iterations_max, solver->iterations);
    if (solver->kind == KN_SOLVER_IMPLICIT) return true;
    if (kn_draft_given(draft, 0, KN_KEY_PRECISION) && solver->precision != KN_PRECISION_F64)
        return kn_draft_complain(draft, later(draft, KN_KEY_PRECISION, KN_KEY_KIND),
                                 "solver.precision is f32, expected f64 with 'kind: %s'",
                                 solver->kind == KN_SOLVER_RK4 ? "rk4" : "fixed");
    if (solver->kind == KN_SOLVER_FIXED && !kn_draft_given(draft, 0, KN_KEY_ITERATIONS)) solver->iterations = 8;
    if (solver->kind == KN_SOLVER_FIXED && !kn_draft_given(draft, 0, KN_KEY_PASSES)) solver->passes = 2;
    solver->precision = KN_PRECISION_F64;
    return true;
}

bool kn_draft_finish_point(kn_draft *draft)
{
    // a quality point can change the spacing of a block; a mesh stays as it is and needs no second check
    if (!*draft->mesh_path && !finish_object(draft)) return false;
    for (int slot = 1; slot <= draft->scene.model.probe_count; slot++)
        if (!finish_probe(draft, slot)) return false;
    return finish_solver(draft) && kn_draft_fine(draft);
}

// Set the default coupling of a probe. A tool that a hand moves through a device needs a coupling. A tool that a
// virtual hand or a script moves (profile bench) follows its pose rigidly, as in the papers.
static void couple(kn_draft *draft, int slot)
{
    const kn_device_def *device = &draft->scene.device;
    kn_probe_def *probe = &draft->scene.model.probe[slot - 1];
    kn_mark *at = draft->at[slot], profile = draft->at[0][KN_KEY_PROFILE];
    if (probe->shape == KN_PROBE_PLATE || draft->scene.model.solver.kind != KN_SOLVER_IMPLICIT) return;
    if (!kn_draft_given(draft, slot, KN_KEY_PROBE_COUPLING) && strcmp(device->name, "bench") != 0) {
        probe->coupling_n_m = device->coupling_n_m;
        at[KN_KEY_PROBE_COUPLING] = profile;
    }
    if (!kn_draft_given(draft, slot, KN_KEY_PROBE_COUPLING_DAMPING) && probe->coupling_n_m > 0) {
        probe->coupling_n_s_m = device->coupling_n_s_m;
        at[KN_KEY_PROBE_COUPLING_DAMPING] = profile;
    }
}

// Store the place at which an error of building or stepping the model points: the last of the solver's keys kind, isa,
// dt and mass_scale in the file.
static void mark_solver(kn_draft *draft)
{
    static const kn_key_id said[] = {KN_KEY_KIND, KN_KEY_ISA, KN_KEY_DT, KN_KEY_MASS_SCALE};
    kn_mark at = draft->group[0][KN_KEY_VERSION];
    for (size_t i = 0; i < sizeof said / sizeof *said; i++)
        if (draft->at[0][said[i]].source == KN_SOURCE_FILE) at = later_of(at, draft->at[0][said[i]]);
    draft->scene.solver_line = at.line, draft->scene.solver_col = at.col;
}

// The factor on the forces of a file is that of its spacing: if a --set changes the spacing, the factor becomes 1.
static void drop_factor(kn_draft *draft)
{
    kn_mark *factor = &draft->at[0][KN_KEY_FORCE_FACTOR];
    const bool other = draft->at[0][KN_KEY_SPACING].source > factor->source;
    if (factor->source == KN_SOURCE_FILE && other) factor->source = KN_SOURCE_DEFAULT;
    if (factor->source == KN_SOURCE_DEFAULT) draft->scene.model.force_factor = 1;
}

bool kn_draft_finish(kn_draft *draft)
{
    kn_model_def *def = &draft->scene.model;
    // clear the probes that the scene does not define, because they still hold default values
    memset(&def->probe[def->probe_count], 0, sizeof def->probe[0] * (size_t)(KN_PROBES_MAX - def->probe_count));
    // material and object come first, because tools are checked against the spacing
    if (!take_ends(draft) || !check_presence(draft) || !finish_material(draft) || !finish_object(draft)) return false;
    if (!kn_draft_tools(draft)) return false;
    for (int slot = 1; slot <= def->probe_count; slot++)
        if (!finish_probe(draft, slot)) return false;
    // the device's coupling is the default of the probes' couplings
    if (!kn_draft_device(draft)) return false;
    for (int slot = 1; slot <= def->probe_count; slot++) couple(draft, slot);
    if (!kn_draft_given(draft, 0, KN_KEY_BUDGET)) draft->scene.budget_s = BUDGET_S;
    mark_solver(draft);
    kn_draft_drop_label(draft);
    drop_factor(draft);
    // compute the size from the nodes, so that equal lattices have equal canonical texts even if two files round the
    // size differently
    for (int k = 0; k < 3; k++) draft->size_m[k] = (def->nodes[k] - 1) * def->spacing_m;
    return finish_solver(draft) && kn_draft_fine(draft) && kn_draft_quality(draft);
}

// Buffer of the canonical text. The text takes about 2 kB, or 10 kB with four unions; long paths add up to 12 kB. So 32
// kB are enough.
typedef struct page {
    char text[32768];
    size_t used;
    char group[KN_LINE_MAX]; // path of the mapping to which the last line belongs, with a dot: "quality.fast."
} page;

static void put(page *out, const char *format, ...) __attribute__((format(printf, 2, 3)));
static void put(page *out, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    int n = vsnprintf(out->text + out->used, sizeof out->text - out->used, format, args);
    va_end(args);
    out->used += (size_t)n;
}

// Print a text between single quotes. Double every quote within the text, as YAML asks.
static void put_quoted(page *out, const char *text)
{
    put(out, "'");
    for (; *text; text++) put(out, *text == '\'' ? "''" : "%c", *text);
    put(out, "'\n");
}

// Print a line for each mapping of a key's path that is not open yet. Return the number of mappings above the key.
static int open_groups(page *out, const char *path)
{
    int depth = 0;
    size_t at = 0;
    for (const char *dot; (dot = strchr(path + at, '.')); depth++) {
        size_t end = (size_t)(dot + 1 - path);
        if (strncmp(out->group, path, end) != 0) {
            snprintf(out->group, sizeof out->group, "%.*s", (int)end, path);
            put(out, "%*s%.*s:\n", 2 * depth, "", (int)(end - 1 - at), path + at);
        }
        at = end;
    }
    return depth;
}

// Print a key with its value, unless the key is irrelevant, absent or not part of the canonical text.
static void put_key(page *out, kn_draft *draft, int slot, kn_key_id id)
{
    const kn_key *key = &kn_keys[id];
    char value[KN_LINE_MAX];
    const char *dot = strrchr(key->path, '.');
    bool optional = key->fallback && *key->fallback == '\0';
    if (!relevant(draft, slot, id) || (optional && !kn_draft_given(draft, slot, id))) return;
    // leave out the variant: the material's numbers are already converted to it
    if (slot == 0 && id == KN_KEY_VARIANT) return;
    if (kn_draft_of_device(id) && !draft->device_whole) return;
    // print the indentation, and "- " before the first key of a list item
    if (slot == 0) put(out, "%*s", 2 * open_groups(out, key->path), "");
    else if (slot <= KN_PROBES_MAX) put(out, id == KN_KEY_PROBE_NAME ? "  - " : "    ");
    else put(out, id == KN_KEY_PART_SHAPE ? "      - " : "        ");
    put(out, "%s: ", dot ? dot + 1 : key->path);
    if (kn_key_long(key)) put_quoted(out, kn_draft_field(draft, slot, id));
    else put(out, "%s\n", kn_key_print(key, kn_draft_field(draft, slot, id), value));
}

char *kn_draft_format(kn_draft *draft)
{
    page out = {.used = 0};
    for (kn_key_id id = 0; id < KN_KEY_PROBE_NAME; id++) put_key(&out, draft, 0, id);
    if (draft->scene.model.probe_count > 0) put(&out, "probes:\n");
    for (int slot = 1; slot <= draft->scene.model.probe_count; slot++) {
        for (kn_key_id id = KN_KEY_PROBE_NAME; id < KN_KEY_PART_SHAPE; id++) put_key(&out, draft, slot, id);
        if (draft->part_count[slot - 1] > 0) put(&out, "    parts:\n");
        for (int i = 0; i < draft->part_count[slot - 1]; i++)
            for (kn_key_id id = KN_KEY_PART_SHAPE; id < KN_KEY_COUNT; id++)
                put_key(&out, draft, kn_slot_of_part(slot, i), id);
    }
    return strdup(out.text);
}
