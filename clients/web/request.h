#ifndef KN_CLIENTS_REQUEST_H
#define KN_CLIENTS_REQUEST_H
// Requests of a page, each a JSON object in a text message. The parser is pure: it takes bytes and returns a checked
// request, or the reason for refusing the request.
//
//     {"id": 7, "do": "undo"}                                  the answer has the same id
//     {"id": 8, "do": "set", "name": "k1", "value": 460000}    a verb needs all of its fields and accepts no other
//
//     do                                            fields
//     reset undo snapshot restore estop recover     none
//     record picture                                none
//     quality material scene style measure          name: 1..63 characters a-z A-Z 0-9 . _ -, a name sent to the page
//     set                                           name; value: a finite number
//     view                                          azimuth and elevation, degrees; zoom: 1..KN_REQUEST_ZOOM
//     verify play stop                              value: the number of a recording, 1..999999
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define KN_REQUEST_MAX 256 // largest size of a request message, bytes
// Largest zoom factor of the camera that a request may set.
#define KN_REQUEST_ZOOM 4
#define KN_REQUEST_NAME 64 // size of a name in a request, bytes including NUL

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
    uint32_t id; // number chosen by the page; the answer has the same number
    kn_verb verb;
    char name[KN_REQUEST_NAME];
    double value;
    double azimuth_deg, elevation_deg, zoom; // of the camera; ranges -180..180, 2..90, 1..KN_REQUEST_ZOOM
} kn_request;

// Return the word that stands for a verb in the field "do" of a request, such as "undo".
const char *kn_verb_word(kn_verb verb);
bool kn_request_is_name(const char *text); // returns true if a request may contain the name `text`

// Parse and check a request. `text` need not end in NUL. If the request is invalid, return false and write to `error`
// what is wrong and what was expected.
bool kn_request_parse(kn_request *request, const char *text, size_t size, char *error, size_t error_size);

#endif
