#include "clients/web/gateway.h"
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

// Bits of a mask that says which fields a request with a given verb must contain.
enum { NAME = 1, VALUE = 2, NUMBER = 4, VIEW = 8 };

static const struct {
    const char *word;
    int fields;
} verbs[KN_VERBS] = {
    [KN_VERB_RESET] = {"reset", 0},          [KN_VERB_UNDO] = {"undo", 0},      [KN_VERB_SNAPSHOT] = {"snapshot", 0},
    [KN_VERB_RESTORE] = {"restore", 0},      [KN_VERB_ESTOP] = {"estop", 0},    [KN_VERB_RECOVER] = {"recover", 0},
    [KN_VERB_RECORD] = {"record", 0},        [KN_VERB_DRAW] = {"draw", NAME},   [KN_VERB_QUALITY] = {"quality", NAME},
    [KN_VERB_MATERIAL] = {"material", NAME}, [KN_VERB_SCENE] = {"scene", NAME}, [KN_VERB_MEASURE] = {"measure", NAME},
    [KN_VERB_SET] = {"set", NAME | VALUE},   [KN_VERB_VIEW] = {"view", VIEW},   [KN_VERB_VERIFY] = {"verify", NUMBER},
    [KN_VERB_PLAY] = {"play", NUMBER},       [KN_VERB_STOP] = {"stop", NUMBER},
};

const char *kn_page_verb_word(kn_page_verb verb) { return verbs[verb].word; }

static bool take_verb(kn_page_request *r, const json_t *value)
{
    const char *word = json_string_value(value);
    for (int v = 0; word && v < KN_VERBS; v++) {
        if (strcmp(word, verbs[v].word) != 0) continue;
        r->verb = (kn_page_verb)v;
        return true;
    }
    return false;
}

bool kn_page_request_is_name(const char *text)
{
    static const char of[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-";
    const size_t size = strlen(text);
    return size > 0 && size < KN_PAGE_REQUEST_NAME && strspn(text, of) == size;
}

static bool take_name(kn_page_request *r, const json_t *value)
{
    const char *name = json_string_value(value);
    if (!name || json_string_length(value) != strlen(name) || !kn_page_request_is_name(name)) return false;
    strcpy(r->name, name);
    return true;
}

static bool take_number(double *to, const json_t *value, double least, double most)
{
    *to = json_number_value(value);
    return json_is_number(value) && *to >= least && *to <= most; // the comparison is false for NaN
}

static bool take_id(kn_page_request *r, const json_t *value)
{
    json_int_t id = json_integer_value(value);
    r->id = (uint32_t)id;
    return json_is_integer(value) && id >= 1 && id <= UINT32_MAX;
}

// Read the fields of a request. Return NULL, or a text that says what was expected.
static const char *take(kn_page_request *r, const json_t *object)
{
    // Count the expected fields. If the object has a different number of fields, it contains an extra field.
    size_t count = 2;
    if (!take_id(r, json_object_get(object, "id"))) return "\"id\", a whole number of 1 to 2^32 - 1";
    if (!take_verb(r, json_object_get(object, "do"))) return "\"do\", one of the verbs in clients/web/DEVELOPING.md";
    int fields = verbs[r->verb].fields;
    if (fields & NAME && (count++, !take_name(r, json_object_get(object, "name"))))
        return "\"name\", of letters, digits and . _ -";
    const json_t *value = json_object_get(object, "value");
    if (fields & VALUE && (count++, !take_number(&r->value, value, -1e300, 1e300))) return "\"value\", a number";
    if (fields & NUMBER && (count++, !take_number(&r->value, value, 1, 999999) || r->value != floor(r->value)))
        return "\"value\", the number of a recording";
    if (fields & VIEW &&
        (count += 3, !take_number(&r->azimuth_deg, json_object_get(object, "azimuth"), -180, 180) ||
                         !take_number(&r->elevation_deg, json_object_get(object, "elevation"), 2, 90) ||
                         !take_number(&r->zoom, json_object_get(object, "zoom"), 1, KN_PAGE_REQUEST_ZOOM)))
        return "\"azimuth\" of -180 to 180, \"elevation\" of 2 to 90, \"zoom\" of 1 to 4";
    // Duplicate keys were refused by the parser, so the number of fields is enough to find an extra one.
    return json_object_size(object) == count ? NULL : "no other field";
}

bool kn_page_request_parse(kn_page_request *r, const char *text, size_t size, char *error, size_t error_size)
{
    json_error_t why;
    *r = (kn_page_request){0};
    // The size is checked before the parser runs, so a large message costs nothing.
    json_t *object = size <= KN_PAGE_REQUEST_MAX ? json_loadb(text, size, JSON_REJECT_DUPLICATES, &why) : NULL;
    const char *expected = json_is_object(object) ? take(r, object) : "a JSON object of at most 256 bytes";
    json_decref(object);
    if (expected) snprintf(error, error_size, "malformed request: expected %s", expected);
    return !expected;
}
