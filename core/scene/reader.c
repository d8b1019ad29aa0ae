// Reader of the YAML text of a scene. No other source of Knead uses libyaml.
#include "core/hash.h"
#include "core/scene/draft.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <yaml.h>

#define PATH_CHARACTERS "abcdefghijklmnopqrstuvwxyz0123456789_." // characters of the key in --set key=value
enum { FILE_MAX_BYTES = 1 << 20, NAME_MAX_BYTES = 32, VALUE_MAX_BYTES = 64 };

// State of the reader, which makes one pass over the events of libyaml. The key table decides which event may follow an
// event. So mappings nest no deeper than the paths in the key table, and an unknown key ends the reading. No input can
// make the reader slow or use much memory.
typedef struct reader {
    kn_draft *draft;
    int source; // source of the text: KN_SOURCE_FILE or the number of the --set option
    int slot;   // slot of the scene, probe or part that is being read
    yaml_parser_t parser;
    yaml_event_t event; // current event of libyaml
    const char *text;
    size_t size;
} reader;

static const char *base_name(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

// Open a regular file. If the file cannot be opened, return NULL and store the reason in *why. A pipe is refused,
// because reading from a pipe might wait forever.
static FILE *open_file(const char *path, const char **why)
{
    struct stat there;
    bool known = stat(path, &there) == 0, regular = known && S_ISREG(there.st_mode);
    FILE *file = regular ? fopen(path, "rb") : NULL;
    if (known && !regular) *why = S_ISDIR(there.st_mode) ? strerror(EISDIR) : "not a regular file";
    else if (!file) *why = strerror(errno);
    return file;
}

// Read a file of at most FILE_MAX_BYTES; the caller frees the text. `kind` tells in the error message what the file
// must be. If the file is larger or cannot be read, return NULL with one line in `error`.
static char *load_file(const char *path, const char *kind, size_t *size, char *error, size_t error_size)
{
    const char *why = NULL;
    FILE *file = open_file(path, &why);
    char *text = file ? malloc(FILE_MAX_BYTES + 1) : NULL;
    *size = text ? fread(text, 1, FILE_MAX_BYTES + 1, file) : 0;
    if (text && *size > FILE_MAX_BYTES) why = "larger than 1 MiB";
    if (!text || why || ferror(file)) {
        snprintf(error, error_size, "%s:1:1: %s, expected a %s file", path, why ? why : strerror(errno), kind);
        free(text);
        text = NULL;
    }
    if (file) fclose(file);
    return text;
}

static kn_mark mark_of(const reader *r, yaml_mark_t m)
{
    return (kn_mark){.source = r->source, .line = (int)m.line + 1, .col = (int)m.column + 1};
}

// Return the place in the text where the current event of libyaml begins.
static kn_mark here(const reader *r) { return mark_of(r, r->event.start_mark); }

// Return the place of the byte at `offset` of the text. If libyaml cannot decode a byte, it reports only this offset.
static kn_mark mark_at(const reader *r, size_t offset)
{
    kn_mark mark = {.source = r->source, .line = 1, .col = 1};
    for (size_t i = 0; i < offset && i < r->size; i++) {
        mark.col++;
        if (r->text[i] == '\n') mark = (kn_mark){.source = r->source, .line = mark.line + 1, .col = 1};
    }
    return mark;
}

// Report an error of libyaml.
static bool complain_yaml(reader *r)
{
    const yaml_parser_t *p = &r->parser;
    if (p->error == YAML_READER_ERROR)
        return kn_draft_complain(r->draft, mark_at(r, p->problem_offset), "not UTF-8 text: %s, expected a scene",
                                 p->problem);
    return kn_draft_complain(r->draft, mark_of(r, p->problem_mark), "not YAML: %s, expected 'key: value'",
                             p->problem ? p->problem : "out of memory");
}

// Return true if an event has no alias, anchor or tag. A scene needs none of these, and aliases could make a short text
// stand for a huge one.
static bool plain(const yaml_event_t *e)
{
    switch (e->type) {
    case YAML_ALIAS_EVENT: return false;
    case YAML_SCALAR_EVENT: return !e->data.scalar.anchor && !e->data.scalar.tag;
    case YAML_SEQUENCE_START_EVENT: return !e->data.sequence_start.anchor && !e->data.sequence_start.tag;
    case YAML_MAPPING_START_EVENT: return !e->data.mapping_start.anchor && !e->data.mapping_start.tag;
    default: return true;
    }
}

// Advance to the next event of libyaml. Return false after an error.
static bool next(reader *r)
{
    yaml_event_delete(&r->event);
    if (!yaml_parser_parse(&r->parser, &r->event)) return complain_yaml(r);
    return plain(&r->event) ||
           kn_draft_complain(r->draft, here(r), "anchors, aliases and tags are not supported, expected a plain value");
}

// Return the kind of the current event for error messages: "a mapping", "a list" or "a value".
static const char *kind_of(const reader *r)
{
    if (r->event.type == YAML_MAPPING_START_EVENT) return "a mapping";
    return r->event.type == YAML_SEQUENCE_START_EVENT ? "a list" : "a value";
}

// Return the text of the current event if it is a scalar of printable ASCII shorter than `most` bytes, else NULL.
static const char *scalar(const reader *r, size_t most)
{
    if (r->event.type != YAML_SCALAR_EVENT || r->event.data.scalar.length >= most) return NULL;
    const char *s = (const char *)r->event.data.scalar.value;
    for (size_t i = 0; i < r->event.data.scalar.length; i++)
        if (s[i] < ' ' || s[i] > '~') return NULL;
    return s;
}

// Report a problem with the value of a key. The message also tells which values the key expects.
static bool complain_key(reader *r, kn_mark mark, const kn_key *key, const char *problem)
{
    char path[KN_LINE_MAX], expects[KN_LINE_MAX];
    return kn_draft_complain(r->draft, mark, "%s: %s, expected %s",
                             kn_draft_path(r->draft, r->slot, (kn_key_id)(key - kn_keys), path), problem,
                             kn_key_expects(key, expects));
}

// Copy the scalar of the current event into `text`. Report an error if the event is no scalar of short ASCII text.
static bool take_value(reader *r, const kn_key *key, char text[VALUE_MAX_BYTES])
{
    const char *s = scalar(r, VALUE_MAX_BYTES);
    if (s) memcpy(text, s, strlen(s) + 1);
    else if (r->event.type == YAML_SCALAR_EVENT) return complain_key(r, here(r), key, "not short ASCII text");
    else return complain_key(r, here(r), key, kind_of(r));
    return true;
}

// Read the value of a key that is a text or a file's path. It may be longer than other values and may have characters
// beyond ASCII.
static bool read_long(reader *r, const kn_key *key)
{
    char whole[KN_PATH_MAX], problem[KN_LINE_MAX];
    const char *text = whole;
    kn_mark mark = here(r);
    if (r->event.type != YAML_SCALAR_EVENT) return complain_key(r, mark, key, kind_of(r));
    size_t size = r->event.data.scalar.length;
    if (size >= sizeof whole) return complain_key(r, mark, key, "too long");
    memcpy(whole, r->event.data.scalar.value, size + 1);
    // a folded or literal text of YAML ends with a newline
    if (key->type == KN_TYPE_TEXT && size > 0 && whole[size - 1] == '\n') whole[--size] = '\0';
    kn_key_id id = (kn_key_id)(key - kn_keys);
    if (strlen(whole) != size) return complain_key(r, mark, key, "not text"); // it contains a NUL
    if (!kn_key_read(key, kn_draft_field(r->draft, r->slot, id), &text, 1, NULL, problem))
        return complain_key(r, mark, key, problem);
    r->draft->at[r->slot][id] = mark;
    return true;
}

// Read the value of a key: one scalar, or a list of scalars.
static bool read_leaf(reader *r, const kn_key *key)
{
    if (kn_key_long(key)) return read_long(r, key);
    enum { LIST_MAX = 4 };
    char text[LIST_MAX][VALUE_MAX_BYTES], problem[KN_LINE_MAX];
    const char *texts[LIST_MAX] = {text[0], text[1], text[2], text[3]};
    kn_mark mark = here(r);
    int count = 0;
    if (r->event.type == YAML_SEQUENCE_START_EVENT) {
        if (key->count == 1) return complain_key(r, mark, key, "a list");
        if (!next(r)) return false;
        while (r->event.type != YAML_SEQUENCE_END_EVENT) {
            if (count == LIST_MAX) return complain_key(r, here(r), key, "too many values");
            if (!take_value(r, key, text[count++]) || !next(r)) return false;
        }
    } else if (!take_value(r, key, text[count++])) {
        return false;
    }
    // store the value, and the place where it is written
    kn_key_id id = (kn_key_id)(key - kn_keys);
    if (!kn_key_read(key, kn_draft_field(r->draft, r->slot, id), texts, count, &mark.per_height, problem))
        return complain_key(r, mark, key, problem);
    r->draft->at[r->slot][id] = mark;
    return true;
}

static bool read_node(reader *r, const char *path);
static bool read_text(kn_draft *draft, int source, int slot, const char *path, const char *text, size_t size);

// Store the place of a mapping for all keys that belong in it. If one of these keys is missing, the error points there.
static void mark_group(reader *r, const char *path)
{
    size_t size = strlen(path);
    for (kn_key_id id = 0; id < KN_KEY_COUNT; id++)
        if (size > 0 && strncmp(kn_keys[id].path, path, size) == 0 && kn_keys[id].path[size] == '.')
            r->draft->group[r->slot][id] = here(r);
}

// Read the mapping at a path. Its keys must exist in the key table, and each key may occur only once.
static bool read_mapping(reader *r, const char *path)
{
    char seen[KN_KEY_COUNT][NAME_MAX_BYTES], below[KN_LINE_MAX], hint[KN_LINE_MAX];
    int lines[KN_KEY_COUNT], count = 0;
    mark_group(r, path);
    for (;;) {
        if (!next(r)) return false;
        if (r->event.type == YAML_MAPPING_END_EVENT) return true;
        kn_mark mark = here(r);
        const char *name = scalar(r, NAME_MAX_BYTES);
        if (!name) return kn_draft_complain(r->draft, mark, "not a key, expected a short name");
        // refuse a key that the mapping already has
        for (int i = 0; i < count; i++)
            if (strcmp(seen[i], name) == 0)
                return kn_draft_complain(r->draft, mark, "'%s' is given already in line %d, expected it once", name,
                                         lines[i]);
        snprintf(below, sizeof below, "%s%s%s", path, *path ? "." : "", name);
        // refuse an unknown key, with a suggestion
        bool is_group;
        if (strchr(name, '.'))
            return kn_draft_complain(r->draft, mark, "'%s' has a dot, expected a mapping (dots are for --set)", name);
        if (!kn_key_find(below, &is_group) && !is_group)
            return kn_draft_complain(r->draft, mark, "unknown key '%s', %s", name, kn_key_suggest(below, hint));
        snprintf(seen[count], NAME_MAX_BYTES, "%s", name); // `seen` is long enough: names are unique and in the table
        lines[count++] = mark.line;
        if (!next(r) || !read_node(r, below)) return false;
    }
}

// Read a list of mappings: the probes of the scene, or the parts of the probe that is being read. `name`: name of the
// list for messages. `keys`: the required keys of a mapping, for messages. `path`: path of each mapping in the key
// table. *count: number of mappings read so far. `most`: largest number of mappings.
static bool read_list(reader *r, const char *name, const char *keys, const char *path, int *count, int most)
{
    // while a mapping is read, r->slot is the slot of this mapping; afterwards, restore the slot of the scene or probe
    const int slot = r->slot;
    if (r->event.type != YAML_SEQUENCE_START_EVENT)
        return kn_draft_complain(r->draft, here(r), "%s: %s, expected a list of mappings", name, kind_of(r));
    for (;;) {
        if (!next(r)) return false;
        if (r->event.type == YAML_SEQUENCE_END_EVENT) return true;
        if (r->event.type != YAML_MAPPING_START_EVENT)
            return kn_draft_complain(r->draft, here(r), "%s: %s, expected a mapping with %s", name, kind_of(r), keys);
        if (*count == most)
            return kn_draft_complain(r->draft, here(r), "%s: one too many, expected at most %d", name, most);
        ++*count;
        r->slot = slot == 0 ? *count : kn_slot_of_part(slot, *count - 1);
        if (!read_mapping(r, path)) return false;
        r->slot = slot;
    }
}

// Read the list of probes. A --set can change only one key of one probe.
static bool read_probes(reader *r)
{
    if (r->source >= 0)
        return kn_draft_complain(r->draft, here(r), "expected one key of one probe, e.g. probes.plate.size");
    return read_list(r, "probes", "name and shape", "probes.NAME", &r->draft->scene.model.probe_count, KN_PROBES_MAX);
}

// Read the list of a union's parts. A --set can change only one key of one part.
static bool read_parts(reader *r)
{
    const int probe = r->slot - 1;
    if (r->source >= 0)
        return kn_draft_complain(r->draft, here(r), "expected one key of one part, e.g. probes.pin.parts.1.radius");
    r->draft->parts_at[probe] = here(r);
    return read_list(r, "parts", "shape", "probes.NAME.parts.N", &r->draft->part_count[probe], KN_PARTS_MAX);
}

// Parse the text of a material's file and copy its values into the draft.
static bool take_material(reader *r, const char *file, const char *text, size_t size, int variant, kn_mark mark)
{
    kn_draft material;
    kn_draft_init(&material, file, NULL, r->draft->error, r->draft->error_size);
    material.is_part = true;
    return read_text(&material, KN_SOURCE_FILE, 0, "", text, size) &&
           kn_draft_take_material(r->draft, &material, variant, mark);
}

// Load a user's file of a material or device. Return its text, which the caller frees, or NULL after an error. `path`
// becomes the path of the file. A name in a scene's file is relative to the folder of the scene. A name in a --set is
// relative to the working directory.
static char *load_part(reader *r, const char *name, const char *kind, kn_mark mark,
                       char path[KN_PATH_MAX + VALUE_MAX_BYTES], size_t *size)
{
    char error[KN_PATH_MAX + 200];
    size_t folder = (size_t)(base_name(r->draft->file) - r->draft->file);
    bool beside = r->source == KN_SOURCE_FILE && *name != '/' && folder < KN_PATH_MAX;
    snprintf(path, KN_PATH_MAX + VALUE_MAX_BYTES, "%.*s%s", beside ? (int)folder : 0, r->draft->file, name);
    char *text = load_file(path, kind, size, error, sizeof error);
    if (!text) kn_draft_complain(r->draft, mark, "%s: %s", kind, error);
    return text;
}

static bool read_material_file(reader *r, const char *name, kn_mark mark)
{
    char path[KN_PATH_MAX + VALUE_MAX_BYTES];
    size_t size;
    char *text = load_part(r, name, "material", mark, path, &size);
    bool ok = text && take_material(r, path, text, size, -1, mark);
    free(text);
    return ok;
}

// Read the profile of the device, and copy those keys into the draft that the scene does not give.
static bool read_profile(kn_draft *draft)
{
    char name[KN_LINE_MAX];
    kn_draft profile;
    kn_mark mark = draft->at[0][KN_KEY_PROFILE];
    if (mark.source == KN_SOURCE_DEFAULT) return true; // kn_draft_finish reports the missing profile
    mark.library = true;
    kn_key_print(&kn_keys[KN_KEY_PROFILE], &draft->profile, name);
    const kn_library_entry *e = kn_devices;
    while (e->name && strcmp(e->name, name) != 0) e++;
    if (!e->name) return kn_draft_complain(draft, mark, "device.profile: no file %s.yaml was compiled in", name);
    kn_draft_init(&profile, e->name, NULL, draft->error, draft->error_size);
    return read_text(&profile, KN_SOURCE_FILE, 0, "", e->text, strlen(e->text)) &&
           kn_draft_take_device(draft, &profile, mark);
}

// Read the short form of the key device, whose value is the name of a profile or of a user's file.
static bool read_device(reader *r)
{
    kn_mark mark = here(r);
    size_t size;
    const char *name = scalar(r, VALUE_MAX_BYTES), *dot = name ? strrchr(name, '.') : NULL;
    if (!dot || strcmp(dot, ".yaml") != 0) return read_leaf(r, &kn_keys[KN_KEY_PROFILE]);
    if (r->draft->is_part)
        return kn_draft_complain(r->draft, mark, "device: a file of a device names another file, expected a mapping");
    char path[KN_PATH_MAX + VALUE_MAX_BYTES];
    char *text = load_part(r, name, "device", mark, path, &size);
    if (!text) return false;
    kn_draft part;
    kn_draft_init(&part, path, NULL, r->draft->error, r->draft->error_size);
    part.is_part = true;
    bool ok = read_text(&part, KN_SOURCE_FILE, 0, "", text, size) && kn_draft_take_device(r->draft, &part, mark);
    free(text);
    // if a key is missing in the device's file, the error points at the name of the file
    for (kn_key_id id = 0; ok && id < KN_KEY_PROBE_NAME; id++)
        if (strncmp(kn_keys[id].path, "device.", 7) == 0) r->draft->group[0][id] = mark;
    return ok;
}

// Read the short form of the key material, whose value is the name of a material or of a user's file.
static bool read_material(reader *r)
{
    int variant;
    char names[KN_LINE_MAX];
    kn_mark mark = here(r);
    const char *name = scalar(r, VALUE_MAX_BYTES), *dot = name ? strrchr(name, '.') : NULL;
    if (dot && strcmp(dot, ".yaml") == 0 && !r->draft->is_part) return read_material_file(r, name, mark);
    const kn_library_entry *entry = name && !r->draft->is_part ? kn_library_find(name, &variant) : NULL;
    if (entry) return take_material(r, entry->name, entry->text, strlen(entry->text), variant, mark);
    return kn_draft_complain(r->draft, mark,
                             "material: '%.40s' is unknown, expected a mapping, a file.yaml, or %s (with -rheological, "
                             "-viscoelastic, -plastic)",
                             name ? name : "", kn_library_names(names));
}

// Read the YAML node at a path that the key table has. The node is a value, a mapping, a list of probes or parts, or a
// short form: one word as the value of device, quality or material.
static bool read_node(reader *r, const char *path)
{
    bool is_group;
    const kn_key *key = kn_key_find(path, &is_group);
    if (key) return read_leaf(r, key);
    if (strcmp(path, "probes") == 0) return read_probes(r);
    if (strcmp(path, "probes.NAME.parts") == 0) return read_parts(r);
    if (strcmp(path, "device") == 0 && r->event.type == YAML_SCALAR_EVENT) return read_device(r);
    if (strcmp(path, "quality") == 0 && r->event.type == YAML_SCALAR_EVENT)
        return read_leaf(r, &kn_keys[KN_KEY_CHOSEN]);
    if (strcmp(path, "material") == 0 && r->event.type == YAML_SCALAR_EVENT) return read_material(r);
    if (r->event.type == YAML_MAPPING_START_EVENT) return read_mapping(r, path);
    return kn_draft_complain(r->draft, here(r), "%s: %s, expected a mapping", path, kind_of(r));
}

// Read a whole text. If `path` is "", the text is a scene or the file of a material or device. Otherwise the text is
// the value of a --set, and `path` is the key.
static bool read_document(reader *r, const char *path)
{
    do // skip the events "stream start" and "document start"
        if (!next(r)) return false;
    while (r->event.type == YAML_STREAM_START_EVENT || r->event.type == YAML_DOCUMENT_START_EVENT);
    if (r->event.type == YAML_STREAM_END_EVENT && *path)
        return kn_draft_complain(r->draft, here(r), "no value, expected key=value");
    const char *expected =
        r->draft->is_part ? "keys of a material or a device" : "a scene that begins with 'version: 1'";
    if (r->event.type == YAML_STREAM_END_EVENT)
        return kn_draft_complain(r->draft, here(r), "empty, expected %s", expected);
    // read the document; nothing may follow it
    bool mapping = r->event.type == YAML_MAPPING_START_EVENT;
    if (*path == '\0' && !mapping) return kn_draft_complain(r->draft, here(r), "%s, expected %s", kind_of(r), expected);
    if (!(*path ? read_node(r, path) : read_mapping(r, path))) return false;
    if (!next(r) || !next(r)) return false; // skip the events "document end" and "stream end"
    return r->event.type == YAML_STREAM_END_EVENT ||
           kn_draft_complain(r->draft, here(r), "a second document, expected one scene per file");
}

// Parse a text and store its values in the draft. `slot`: slot of the scene, probe or part to which the text belongs.
// `path`: "" for a whole file, else the key or mapping that a --set names.
static bool read_text(kn_draft *draft, int source, int slot, const char *path, const char *text, size_t size)
{
    reader r = {.draft = draft, .source = source, .slot = slot, .text = text, .size = size};
    if (!yaml_parser_initialize(&r.parser))
        return kn_draft_complain(draft, (kn_mark){.source = source}, "out of memory");
    yaml_parser_set_encoding(&r.parser, YAML_UTF8_ENCODING);
    yaml_parser_set_input_string(&r.parser, (const unsigned char *)text, size);
    bool ok = read_document(&r, path);
    yaml_event_delete(&r.event);
    yaml_parser_delete(&r.parser);
    return ok;
}

// Copy the end of a --set's key, `rest`, into `generic`. If `rest` names a part of the probe in *slot, such as
// ".parts.2.radius", copy it as ".parts.N.radius" and set *slot to the slot of that part.
static bool find_part(kn_draft *draft, kn_mark mark, const char *rest, char generic[KN_LINE_MAX], int *slot)
{
    const char *number = rest + strlen(".parts."), *end = number;
    snprintf(generic, KN_LINE_MAX, "%s", rest);
    if (strncmp(rest, ".parts.", strlen(".parts.")) != 0) return true;
    end += strcspn(number, ".");
    int count = draft->part_count[*slot - 1], part = end == number + 1 ? *number - '0' : 0;
    if (part < 1 || part > count)
        return kn_draft_complain(draft, mark, "no part '%.*s', expected 1 to %d", (int)(end - number), number, count);
    *slot = kn_slot_of_part(*slot, part - 1);
    snprintf(generic, KN_LINE_MAX, ".parts.N%s", end);
    return true;
}

// If the key of a --set names a probe, such as "probes.plate.size", replace the name in `path`: "probes.NAME.size". Set
// *slot to the slot of that probe or part.
static bool find_probe(kn_draft *draft, kn_mark mark, char path[KN_LINE_MAX], int *slot)
{
    const kn_model_def *def = &draft->scene.model;
    const char *name = path + strlen("probes."), *rest = strchr(name, '.');
    if (strncmp(path, "probes.", strlen("probes.")) != 0 || !rest) return true;
    size_t size = (size_t)(rest - name);
    for (int i = 0; i < def->probe_count; i++)
        if (strlen(def->probe[i].name) == size && memcmp(def->probe[i].name, name, size) == 0) *slot = i + 1;
    if (*slot == 0)
        return kn_draft_complain(draft, mark, "no probe '%.*s', expected one that the scene has", (int)size, name);
    char generic[KN_LINE_MAX];
    if (!find_part(draft, mark, rest, generic, slot)) return false;
    snprintf(path, KN_LINE_MAX, "probes.NAME%.*s", KN_LINE_MAX - 16, generic);
    return true;
}

// Apply --set number `number`: find its key, then parse its value as YAML.
static bool read_set(kn_draft *draft, int number)
{
    const char *set = draft->sets[number], *equals = strchr(set, '=');
    kn_mark mark = {.source = number};
    char path[KN_LINE_MAX], hint[KN_LINE_MAX];
    if (!equals || equals == set || equals - set >= 128 || strspn(set, PATH_CHARACTERS) != (size_t)(equals - set))
        return kn_draft_complain(draft, mark, "expected key=value, e.g. material.k1='300 gf/cm^3'");
    snprintf(path, sizeof path, "%.*s", (int)(equals - set), set);
    int slot = 0;
    if (!find_probe(draft, mark, path, &slot)) return false;
    bool is_group;
    if (!kn_key_find(path, &is_group) && !is_group)
        return kn_draft_complain(draft, mark, "unknown key, %s", kn_key_suggest(path, hint));
    return read_text(draft, number, slot, path, equals + 1, strlen(equals + 1));
}

// Return the hash of the canonical text without the lines "mesh: PATH" of the object and of tools. So a scene keeps its
// hash when its mesh files move.
static uint64_t hash_text(const char *text)
{
    uint64_t hash = KN_HASH_SEED;
    for (const char *from = text;; from++) {
        from = strstr(from, "mesh: ");
        if (!from) return kn_hash_bytes(hash, text, strlen(text));
        const char *line = from;
        while (line > text && line[-1] == ' ') line--;
        if (line == from || line[-1] != '\n') continue;
        hash = kn_hash_bytes(hash, text, (size_t)(line - 1 - text));
        text = from = strchr(from, '\n');
    }
}

kn_scene *kn_scene_parse(const char *name, const char *text, size_t size, const char *const *sets, int set_count,
                         char *error, size_t error_size)
{
    return kn_scene_parse_beside(name, name, text, size, sets, set_count, error, error_size);
}

kn_scene *kn_scene_parse_beside(const char *beside, const char *name, const char *text, size_t size,
                                const char *const *sets, int set_count, char *error, size_t error_size)
{
    kn_draft draft;
    kn_draft_init(&draft, name, sets, error, error_size);
    draft.beside = beside;
    // read the file; then the --set options, which replace values of the file; then the device profile, which gives the
    // device keys that are still missing
    kn_mark start = draft.group[0][KN_KEY_VERSION];
    bool ok = size <= FILE_MAX_BYTES || kn_draft_complain(&draft, start, "larger than 1 MiB, expected a scene");
    ok = ok && read_text(&draft, KN_SOURCE_FILE, 0, "", text, size);
    for (int i = 0; ok && i < set_count; i++) ok = read_set(&draft, i);
    ok = ok && read_profile(&draft);
    if (!ok || !kn_draft_finish(&draft)) return kn_scene_clear(&draft.scene), NULL;
    snprintf(draft.scene.name, sizeof draft.scene.name, "%s", base_name(name));
    kn_scene *scene = malloc(sizeof *scene);
    draft.scene.text = kn_draft_format(&draft);
    if (!scene || !draft.scene.text) {
        kn_draft_complain(&draft, start, "out of memory");
        free(scene);
        kn_scene_clear(&draft.scene);
        return NULL;
    }
    *scene = draft.scene;
    scene->model = draft.built;
    scene->text_hash = hash_text(scene->text);
    kn_draft_lower_clamp(scene);
    return scene;
}

kn_scene *kn_scene_load(const char *path, const char *const *sets, int set_count, char *error, size_t error_size)
{
    if (!*path) return snprintf(error, error_size, "'': expected the name of a scene file"), NULL;
    size_t size;
    char *text = load_file(path, "scene", &size, error, error_size);
    kn_scene *scene = text ? kn_scene_parse(path, text, size, sets, set_count, error, error_size) : NULL;
    free(text);
    return scene;
}
