#include "core/scene/keys.h"
#include "core/scene/scene.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Return the unit of a key, or a dimensionless unit if the key has none.
static kn_unit unit_of(const kn_key *key)
{
    kn_unit unit = {0};
    char error[KN_LINE_MAX];
    if (*key->unit) kn_unit_parse(&unit, key->unit, error, sizeof error);
    return unit;
}

int kn_choice_of(const char *words, const char *word)
{
    size_t size = strlen(word);
    for (int i = 0;; i++) {
        size_t n = strcspn(words, "|");
        if (n == size && memcmp(words, word, n) == 0) return i;
        if (words[n] == '\0') return -1;
        words += n + 1;
    }
}

// Read a quantity, convert it to the unit of the key, and check dimension and range. The range of a modulus is not
// checked here: a modulus may be given divided by the height of a specimen, and must be multiplied by this height
// before its range can be checked.
static bool read_number(const kn_key *key, double *value, const char *text, bool *per_height, char problem[KN_LINE_MAX])
{
    kn_quantity q;
    kn_unit unit = unit_of(key), per_metre = unit;
    per_metre.m -= 1;
    // read the number in the key's unit
    if (!kn_quantity_parse(&q, text, problem, KN_LINE_MAX)) return false;
    *value = kn_quantity_in(&q, &unit);
    bool modulus = key->type == KN_TYPE_MODULUS;
    if (modulus) *per_height = false;
    // any number except 0 needs a unit, and the unit must have the dimension of the key's unit
    if (q.bare && *key->unit && *value != 0) {
        snprintf(problem, KN_LINE_MAX, "'%.24s' has no unit", text);
    } else if (modulus && !q.bare && kn_unit_same_dimension(&q.unit, &per_metre)) {
        *per_height = true;
        return true;
    } else if (!q.bare && !kn_unit_same_dimension(&q.unit, &unit)) {
        if (*key->unit) snprintf(problem, KN_LINE_MAX, "'%.24s' is not a quantity in %s", text, key->unit);
        else snprintf(problem, KN_LINE_MAX, "'%.24s' has a unit", text);
    } else if (!modulus && !(*value >= key->least && *value <= key->most)) {
        snprintf(problem, KN_LINE_MAX, "%.24s is out of range", text);
    } else if (key->type == KN_TYPE_INTEGER && *value != floor(*value)) {
        snprintf(problem, KN_LINE_MAX, "%.24s is not a whole number", text);
    } else {
        return true;
    }
    return false;
}

// Read the name of a probe. Channel names will contain this name.
static bool read_name(char *field, const char *text, char problem[KN_LINE_MAX])
{
    size_t size = strlen(text);
    bool fits = size > 0 && size < KN_NAME_MAX && strspn(text, "abcdefghijklmnopqrstuvwxyz0123456789_") == size;
    if (fits) memcpy(field, text, size + 1);
    else snprintf(problem, KN_LINE_MAX, "'%.24s' is not a name", text);
    return fits;
}

// Return the UTF-8 code point at *s and advance *s to the next code point. Return 0 if the bytes are not valid UTF-8.
static unsigned decode(const unsigned char **s)
{
    static const unsigned least[] = {0, 0x80, 0x800, 0x10000};
    const unsigned char *p = *s;
    // the leading bits of the first byte tell how many more bytes belong to the code point
    int more = *p < 0x80 ? 0 : *p >> 5 == 6 ? 1 : *p >> 4 == 14 ? 2 : *p >> 3 == 30 ? 3 : -1;
    if (more < 0) return 0;
    unsigned code = more == 0 ? *p : *p & (0x3fu >> more);
    for (int k = 1; k <= more; k++) {
        if (p[k] >> 6 != 2) return 0;
        code = code << 6 | (p[k] & 0x3fu);
    }
    *s = p + more + 1;
    return code >= least[more] ? code : 0; // an encoding with more bytes than needed is invalid
}

bool kn_key_quotable(const char *text)
{
    for (const unsigned char *s = (const unsigned char *)text; *s;) {
        unsigned c = decode(&s);
        // refuse control characters, line separators and the byte order mark
        if (c < ' ' || (c >= 0x7f && c < 0xa0) || c == 0x2028 || c == 0x2029 || c == 0xfeff) return false;
        // refuse surrogates, and code points that are not characters
        if ((c >= 0xd800 && c < 0xe000) || c == 0xfffe || c == 0xffff || c > 0x10ffff) return false;
    }
    return true;
}

// Read a text, or a file name that ends in one of the key's file endings, which have 4 characters each.
static bool read_long(const kn_key *key, char *field, const char *text, char problem[KN_LINE_MAX])
{
    size_t size = strlen(text);
    bool file = key->type == KN_TYPE_PATH;
    bool fits = size < KN_PATH_MAX && kn_key_quotable(text) &&
                (!file || (size > 4 && kn_choice_of(key->unit, text + size - 4) >= 0));
    if (fits) memcpy(field, text, size + 1);
    else snprintf(problem, KN_LINE_MAX, file ? "not the name of a mesh" : "not a line of text");
    return fits;
}

// Read the hash of a file.
static bool read_hash(uint64_t *field, const char *text, char problem[KN_LINE_MAX])
{
    bool fits = strlen(text) == 16 && strspn(text, "0123456789abcdef") == 16;
    if (fits) *field = strtoull(text, NULL, 16);
    else snprintf(problem, KN_LINE_MAX, "'%.24s' is not a hash", text);
    return fits;
}

static bool read_choice(const kn_key *key, int *field, const char *text, char problem[KN_LINE_MAX])
{
    *field = kn_choice_of(key->unit, text);
    if (*field < 0) snprintf(problem, KN_LINE_MAX, "'%.24s' is unknown", text);
    return *field >= 0;
}

bool kn_key_read(const kn_key *key, void *field, const char *const *text, int count, bool *per_height,
                 char problem[KN_LINE_MAX])
{
    // a flat object has two extents, along x and z
    bool flat = key->type == KN_TYPE_EXTENT && count == 2;
    if (count != key->count && !flat) {
        snprintf(problem, KN_LINE_MAX, "%d value%s given", count, count == 1 ? "" : "s");
        return false;
    }
    for (int i = 0; i < count; i++) {
        double value;
        if (*text[i] == '\0') {
            snprintf(problem, KN_LINE_MAX, "has no value");
            return false;
        }
        if (key->type == KN_TYPE_CHOICE) return read_choice(key, field, text[i], problem);
        if (key->type == KN_TYPE_NAME) return read_name(field, text[i], problem);
        if (kn_key_long(key)) return read_long(key, field, text[i], problem);
        if (key->type == KN_TYPE_HASH) return read_hash(field, text[i], problem);
        if (!read_number(key, &value, text[i], per_height, problem)) return false;
        if (key->type == KN_TYPE_INTEGER) *(int *)field = (int)value;
        else ((double *)field)[flat ? 2 * i : i] = value;
    }
    if (flat) ((double *)field)[1] = 0;
    return true;
}

const char *kn_key_expects(const kn_key *key, char text[KN_LINE_MAX])
{
    char range[64];
    snprintf(range, sizeof range, "from %g to %g", key->least, key->most);
    switch (key->type) {
    case KN_TYPE_CHOICE: snprintf(text, KN_LINE_MAX, "%s", key->unit); break;
    case KN_TYPE_NAME: snprintf(text, KN_LINE_MAX, "1 to %d of a-z 0-9 _", KN_NAME_MAX - 1); break;
    case KN_TYPE_PATH: snprintf(text, KN_LINE_MAX, "a file name that ends in %s", key->unit); break;
    case KN_TYPE_TEXT: snprintf(text, KN_LINE_MAX, "one line of at most %d bytes", KN_PATH_MAX - 1); break;
    case KN_TYPE_HASH: snprintf(text, KN_LINE_MAX, "16 hexadecimal digits"); break;
    case KN_TYPE_INTEGER:
        if (key->least == key->most) snprintf(text, KN_LINE_MAX, "%g", key->least);
        else snprintf(text, KN_LINE_MAX, "a whole number %s%s%s", range, *key->unit ? " " : "", key->unit);
        break;
    case KN_TYPE_MODULUS:
        snprintf(text, KN_LINE_MAX, "a number %s %s (or %s/m with a specimen_height)", range, key->unit, key->unit);
        break;
    case KN_TYPE_EXTENT:
        snprintf(text, KN_LINE_MAX, "a list of 3 (2 for a flat object), each %s %s", range, key->unit);
        break;
    case KN_TYPE_REAL:
        if (key->count > 1)
            snprintf(text, KN_LINE_MAX, "a list of %d, each %s%s%s", key->count, range, *key->unit ? " " : "",
                     key->unit);
        else snprintf(text, KN_LINE_MAX, "a number %s%s%s", range, *key->unit ? " " : "", key->unit);
        break;
    }
    return text;
}

// Return how many digits (15 to 17) must be printed so that the number reads back as the same bits.
static int digits_of(double value)
{
    char text[40];
    for (int digits = 15; digits < 17; digits++) {
        snprintf(text, sizeof text, "%.*g", digits, value);
        if (strtod(text, NULL) == value) return digits;
    }
    return 17;
}

const char *kn_key_print(const kn_key *key, const void *field, char text[KN_LINE_MAX])
{
    const char *space = *key->unit ? " " : "", *unit = key->unit;
    if (key->type == KN_TYPE_NAME) {
        snprintf(text, KN_LINE_MAX, "%s", (const char *)field);
    } else if (key->type == KN_TYPE_HASH) {
        snprintf(text, KN_LINE_MAX, "%016" PRIx64, *(const uint64_t *)field);
    } else if (key->type == KN_TYPE_INTEGER) {
        snprintf(text, KN_LINE_MAX, "%d%s%s", *(const int *)field, space, unit);
    } else if (key->type == KN_TYPE_CHOICE) {
        for (int i = *(const int *)field; i > 0; i--) unit += strcspn(unit, "|") + 1;
        snprintf(text, KN_LINE_MAX, "%.*s", (int)strcspn(unit, "|"), unit);
    } else {
        // print one number or a list; leave out the extent of a flat object along y, which is 0
        const double *value = field;
        int n = snprintf(text, KN_LINE_MAX, key->count > 1 ? "[" : "");
        for (int i = 0; i < key->count; i++)
            if (key->type != KN_TYPE_EXTENT || value[i] != 0)
                n += snprintf(text + n, KN_LINE_MAX - (size_t)n, "%s%.*g%s%s", i ? ", " : "", digits_of(value[i]),
                              value[i], space, unit);
        if (key->count > 1) snprintf(text + n, KN_LINE_MAX - (size_t)n, "]");
    }
    return text;
}

const kn_key *kn_key_find(const char *path, bool *is_group)
{
    size_t size = strlen(path);
    *is_group = false;
    for (const kn_key *key = kn_keys; size > 0 && key < kn_keys + KN_KEY_COUNT; key++) {
        if (strcmp(key->path, path) == 0) return key;
        if (strncmp(key->path, path, size) == 0 && key->path[size] == '.') *is_group = true;
    }
    return NULL;
}

// Return the number of edits that turn `a` into `b` (Levenshtein distance), or 64 if `b` is too long for the table.
static int distance(const char *a, const char *b)
{
    // row[j]: number of edits that turn the first characters of `a`, read so far, into the first j characters of `b`
    int row[64];
    int n = (int)strlen(b);
    if (n >= 64) return 64;
    for (int j = 0; j <= n; j++) row[j] = j;
    for (int i = 1; *a; i++, a++) {
        int diagonal = row[0];
        row[0] = i;
        for (int j = 1; j <= n; j++) {
            int replaced = diagonal + (*a != b[j - 1]), shorter = row[j - 1] < row[j] ? row[j - 1] : row[j];
            diagonal = row[j];
            row[j] = replaced < shorter + 1 ? replaced : shorter + 1;
        }
    }
    return row[n];
}

// Words that differ by this many edits or more are not similar.
static int unlike(const char *word) { return strlen(word) > 4 ? 3 : 2; }

bool kn_word_nearer(const char *wrong, const char *word, int *edits)
{
    const int now = distance(wrong, word);
    if (now >= (*edits ? *edits : unlike(wrong))) return false;
    *edits = now;
    return true;
}

// Return the last name of a path: "k1" of "material.k1".
static const char *leaf_of(const char *path) { return strrchr(path, '.') ? strrchr(path, '.') + 1 : path; }

// Write the names of all keys and mappings in one mapping: "expected one of: k1, c1, damper". The path of the mapping
// is the first `size` characters of `parent`, dot included.
static void list_below(const char *parent, size_t size, char text[KN_LINE_MAX])
{
    const char *last = "";
    int n = snprintf(text, KN_LINE_MAX, "expected one of:");
    for (const kn_key *key = kn_keys; key < kn_keys + KN_KEY_COUNT && n < KN_LINE_MAX; key++) {
        const char *name = key->path + size;
        if (strncmp(key->path, parent, size) != 0) continue;
        size_t length = strcspn(name, ".");
        if (strncmp(last, name, length + (name[length] == '.')) == 0) continue;
        n += snprintf(text + n, KN_LINE_MAX - (size_t)n, "%s %.*s", *last ? "," : "", (int)length, name);
        last = name;
    }
}

// Return the number of characters at the beginning of two texts that are equal.
static size_t common(const char *a, const char *b)
{
    size_t n = 0;
    while (a[n] && a[n] == b[n]) n++;
    return n;
}

// Compare one existing path (the first `size` characters of `path`) with the best suggestion so far for a wrong path.
// If the existing path is better, write it into `text`. The better path is the one whose last name differs from the
// last name of the wrong path by fewer edits. If the numbers of edits are equal, the better path is the one that has
// the longer beginning in common with the wrong path. `handicap` is added to the number of edits. *least and *near are
// the number of edits and the length of the common beginning of the best suggestion.
static void consider(const char *wrong, const char *path, size_t size, int handicap, int *least, size_t *near,
                     char text[KN_LINE_MAX])
{
    const char *name = leaf_of(wrong);
    char candidate[KN_LINE_MAX];
    // find the last name of the existing path
    const char *last = path + size;
    while (last > path && last[-1] != '.') last--;
    snprintf(candidate, sizeof candidate, "%.*s", (int)(path + size - last), last);
    int edits = distance(name, candidate) + handicap;
    size_t shared = common(wrong, path);
    if (edits > *least || (edits == *least && shared <= *near)) return;
    *least = edits, *near = shared;
    snprintf(text, KN_LINE_MAX, "did you mean %.*s?", (int)size, path);
}

const char *kn_key_suggest(const char *path, char text[KN_LINE_MAX])
{
    const char *name = leaf_of(path);
    size_t parent = (size_t)(name - path);
    int least = unlike(name);
    // no key has a longer beginning in common with the wrong path than the whole wrong path; so at first a suggestion
    // gets better only by fewer edits
    size_t near = strlen(path);
    for (const kn_key *key = kn_keys; key < kn_keys + KN_KEY_COUNT; key++) {
        // consider the name in the mapping of the wrong path, then the whole path, which must be one edit better
        bool sibling = strncmp(key->path, path, parent) == 0;
        if (sibling) consider(path, key->path, parent + strcspn(key->path + parent, "."), 0, &least, &near, text);
        consider(path, key->path, strlen(key->path), 1, &least, &near, text);
    }
    if (least == unlike(name)) list_below(path, parent, text);
    return text;
}

// Write the line of one key for the table of `knead check --keys`.
static void describe(const kn_key *key, char *line, size_t size)
{
    static const char *const required[] = {[KN_WHEN_ALWAYS] = "required",
                                           [KN_WHEN_BLOCK] = "required if no mesh",
                                           [KN_WHEN_MESH] = "required if mesh",
                                           [KN_WHEN_CONSTANT] = "required if constant",
                                           [KN_WHEN_EXPONENTIAL] = "required if exponential",
                                           [KN_WHEN_RAMP] = "required if ramp",
                                           [KN_WHEN_FORCE] = "required if exp., ramp",
                                           [KN_WHEN_PLATE] = "required if plate",
                                           [KN_WHEN_ROUND] = "required if round",
                                           [KN_WHEN_LONG] = "required if long",
                                           [KN_WHEN_BOX] = "required if box, cross",
                                           [KN_WHEN_SURFACE] = "required if mesh"};
    // columns: path, value, range, default or requirement, meaning
    char range[64] = "", value[64];
    const char *unit = key->type == KN_TYPE_CHOICE ? "" : key->unit;
    if (key->type == KN_TYPE_CHOICE) snprintf(value, sizeof value, "%s", key->unit);
    else if (key->type == KN_TYPE_NAME) snprintf(value, sizeof value, "a-z 0-9 _");
    else if (key->type == KN_TYPE_PATH) snprintf(value, sizeof value, "FILE%s", key->unit);
    else if (key->type == KN_TYPE_TEXT) snprintf(value, sizeof value, "text");
    else if (key->type == KN_TYPE_HASH) snprintf(value, sizeof value, "16 hexadecimal digits");
    else if (key->type == KN_TYPE_EXTENT)
        snprintf(value, sizeof value, "%d or %d x %s", key->count - 1, key->count, unit);
    else if (key->count > 1) snprintf(value, sizeof value, "%d x %s", key->count, *unit ? unit : "number");
    else snprintf(value, sizeof value, "%s", *unit ? unit : "number");
    if (key->most > 0) snprintf(range, sizeof range, "%g .. %g", key->least, key->most);
    const char *fallback = !key->fallback ? required[key->when] : *key->fallback ? key->fallback : "none";
    snprintf(line, size, "%-24s %-26s %-15s %-23s %s", key->path, value, range, fallback, key->meaning);
}

const char *const *kn_scene_keys(void)
{
    // every call writes the same lines into static memory; the first line is the heading
    static char line[KN_KEY_COUNT + 1][KN_LINE_MAX];
    static const char *lines[KN_KEY_COUNT + 2];
    snprintf(line[0], KN_LINE_MAX, "%-24s %-26s %-15s %-23s %s", "key", "value", "range", "default", "meaning");
    for (int id = 0; id < KN_KEY_COUNT; id++) describe(&kn_keys[id], line[id + 1], KN_LINE_MAX);
    for (int i = 0; i <= KN_KEY_COUNT; i++) lines[i] = line[i];
    return lines;
}
