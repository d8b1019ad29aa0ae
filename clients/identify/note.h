#ifndef KN_CLIENTS_IDENTIFY_NOTE_H
#define KN_CLIENTS_IDENTIFY_NOTE_H
// A note: a line in a file of measurements that applies to the whole table, such as "# load: 50 gf" or "# load = 50
// gf".
#include <stdbool.h>

typedef struct kn_note {
    char key[32], value[64]; // for example key "load" and value "50 gf"; the key is in small letters
    int line, at;            // line number of the value, and position of its first character in that line, from 1
} kn_note;

// Read a note. Return false if the line is not a note. A key has at most three words, so that a sentence with a colon
// is not taken for a note.
bool kn_note_read(const char *text, int line, kn_note *note);

#endif
