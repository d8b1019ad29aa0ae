#include "core/scene/library.h"

#include <stdio.h>
#include <string.h>

enum { RHEOLOGICAL, VISCOELASTIC, PLASTIC }; // values of the key material.variant, in the order of its words

static const char *const suffixes[] = {"-rheological", "-viscoelastic", "-plastic"};

const kn_library_entry *kn_library_find(const char *name, int *variant)
{
    // cut off the suffix of a variant
    size_t size = strlen(name);
    *variant = -1;
    for (int i = 0; i < 3; i++) {
        size_t end = strlen(suffixes[i]);
        if (size <= end || strcmp(name + size - end, suffixes[i]) != 0) continue;
        *variant = i;
        size -= end;
        break;
    }
    for (const kn_library_entry *e = kn_library; e->name; e++)
        if (strlen(e->name) == size && memcmp(e->name, name, size) == 0) return e;
    return NULL;
}

const char *kn_library_names(char text[KN_LINE_MAX])
{
    size_t used = 0;
    *text = '\0';
    for (const kn_library_entry *e = kn_library; e->name && used < KN_LINE_MAX; e++)
        used += (size_t)snprintf(text + used, KN_LINE_MAX - used, "%s%s", used ? ", " : "", e->name);
    return text;
}

static bool of_material(kn_key_id id) { return strncmp(kn_keys[id].path, "material.", strlen("material.")) == 0; }

static bool given(const kn_draft *draft, kn_key_id id) { return draft->at[0][id].source != KN_SOURCE_DEFAULT; }

// Copy the value of a key, and whether it was given, with the mark of the material's name.
static void take_key(kn_draft *draft, const kn_draft *from, kn_key_id id, kn_mark mark)
{
    const kn_key *key = &kn_keys[id];
    size_t size = (size_t)key->count * (key->type == KN_TYPE_CHOICE ? sizeof(int) : sizeof(double));
    memcpy((char *)draft + key->offset, (const char *)from + key->offset, size);
    mark.per_height = from->at[0][id].per_height;
    mark.library = true;
    draft->at[0][id] = mark;
    if (!given(from, id)) draft->at[0][id].source = KN_SOURCE_DEFAULT;
    draft->group[0][id] = mark; // a missing key is reported at the material's name
}

bool kn_library_take(kn_draft *draft, const kn_draft *from, int variant, kn_mark mark)
{
    // refuse anything but material and density
    for (kn_key_id id = 0; id < KN_KEY_PROBE_NAME; id++)
        if (given(from, id) && !of_material(id) && id != KN_KEY_DENSITY)
            return kn_draft_complain(draft, mark, "%s is in %s, expected only a material and its density there",
                                     kn_keys[id].path, from->file);
    if (from->scene.model.probe_count > 0)
        return kn_draft_complain(draft, mark, "probes are in %s, expected only a material and its density there",
                                 from->file);
    for (kn_key_id id = 0; id < KN_KEY_PROBE_NAME; id++)
        if (of_material(id)) take_key(draft, from, id, mark);
    // the scene's own density takes precedence
    bool own = given(draft, KN_KEY_DENSITY) && !draft->at[0][KN_KEY_DENSITY].library;
    if (!own && given(from, KN_KEY_DENSITY)) take_key(draft, from, KN_KEY_DENSITY, mark);
    if (variant < 0) return true;
    draft->variant = variant;
    draft->at[0][KN_KEY_VARIANT] = mark;
    return true;
}

// Make a pair of dampers that acts as one. Constant dampers are equal, each twice c2. If c2 depends on force, c1 is so
// stiff that it hardly counts.
static void make_plastic(kn_material *mat)
{
    mat->k1_pa = 0;
    mat->c1_pa_s = mat->damper == KN_DAMPER_CONSTANT ? mat->c2_pa_s *= 2 : 25 * kn_material_c2(mat, 0);
}

bool kn_library_vary(kn_draft *draft)
{
    kn_material *mat = &draft->scene.model.material;
    kn_mark at = draft->at[0][KN_KEY_VARIANT];
    bool rigid = mat->damper == KN_DAMPER_NONE || (mat->stroke[1] > 0 && mat->stroke[0] == mat->stroke[1]);
    if (draft->variant == PLASTIC && rigid)
        return kn_draft_complain(draft, at, "material.variant is plastic, expected a damper that can move");
    if (draft->variant == PLASTIC) make_plastic(mat);
    if (draft->variant != VISCOELASTIC) return true;
    // put both stops at one place, so the damper cannot move
    mat->ratio = mat->stroke[0] = mat->stroke[1] = 1;
    draft->at[0][KN_KEY_STROKE] = draft->at[0][KN_KEY_RATIO] = at;
    return true;
}
