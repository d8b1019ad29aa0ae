#ifndef KN_CLIENTS_IDENTIFY_NOTE_H
#define KN_CLIENTS_IDENTIFY_NOTE_H
// A note: a line of a table that holds for the whole table, "# load: 50 gf" or "# load = 50 gf".
#include <stdbool.h>

typedef struct kn_note {
    char key[32], value[64]; // the key is in small letters
    int line, at;            // position of the value in the file
} kn_note;

// Read a note. Return false if the line is not one. A key has at most three words, so that a sentence with a colon is
// not taken for a note.
bool kn_note_read(const char *text, int line, kn_note *note);

#endif
