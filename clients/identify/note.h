#ifndef KN_CLIENTS_IDENTIFY_NOTE_H
#define KN_CLIENTS_IDENTIFY_NOTE_H
// A line of a table that says something of all of it: "# load: 50 gf", "# load = 50 gf".
#include <stdbool.h>

typedef struct kn_note {
    char key[32], value[64]; // the key in small letters
    int line, at;            // where the value stands
} kn_note;

// False: it is none. Of up to three words before the mark: a sentence with a colon is none.
bool kn_note_read(const char *text, int line, kn_note *note);

#endif
