#ifndef KN_CLIENTS_REQUEST_H
#define KN_CLIENTS_REQUEST_H
// What a page asks for in words: one JSON object per text message. Pure: bytes in, a checked request or what was
// expected out.
//
//     {"id": 7, "do": "undo"}                                  answered under the same id
//     {"id": 8, "do": "set", "name": "k1", "value": 460000}    a verb has its own fields, all needed; no other is taken
//
//     do                                            fields
//     reset undo snapshot restore estop recover     .
//     record picture                                .
//     quality material scene style measure          name: 1..63 of a-z A-Z 0-9 . _ -, one that the page was told
//     set                                           name; value: finite
//     view                                          azimuth, elevation, degrees; zoom, 1..KN_REQUEST_ZOOM
//     verify play stop                              value: the number of a recording, 1..999999
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define KN_REQUEST_MAX 256 // bytes of a message
#define KN_REQUEST_ZOOM 4
#define KN_REQUEST_NAME 64 // bytes, its NUL among them

typedef enum kn_verb {
    KN_VERB_RESET,
    KN_VERB_UNDO,
    KN_VERB_SNAPSHOT,
    KN_VERB_RESTORE,
    KN_VERB_ESTOP,
    KN_VERB_RECOVER,
    KN_VERB_RECORD,
    KN_VERB_PICTURE,
    KN_VERB_QUALITY,
    KN_VERB_MATERIAL,
    KN_VERB_SCENE,
    KN_VERB_STYLE,
    KN_VERB_MEASURE,
    KN_VERB_SET,
    KN_VERB_VIEW,
    KN_VERB_VERIFY,
    KN_VERB_PLAY,
    KN_VERB_STOP,
    KN_VERBS
} kn_verb;

typedef struct kn_request {
    uint32_t id; // the page's
    kn_verb verb;
    char name[KN_REQUEST_NAME];
    double value;
    double azimuth_deg, elevation_deg, zoom; // -180..180, 2..90
} kn_request;

const char *kn_verb_word(kn_verb verb);
bool kn_request_is_name(const char *text); // that a request may say

// text need not end in a NUL. False and what is wrong, what was expected, in error.
bool kn_request_parse(kn_request *request, const char *text, size_t size, char *error, size_t error_size);

#endif
