#ifndef KN_CLIENTS_IDENTIFY_HEADER_H
#define KN_CLIENTS_IDENTIFY_HEADER_H
// Where a table begins in a file that may have anything before it: the names are in the last line of words before the
// first row of numbers, or in the one before that where the last has units alone. A comment is taken for them where
// nothing else can be ("# time height", as numpy writes them).
#include "clients/identify/lines.h"

typedef struct kn_header {
    int names, units; // lines, 1..; 0: none
    char separator;   // the first of tab, ';', ',' that the names have, else ' '
    char of_rows;     // the same, or ' ' where blanks are between the numbers below
} kn_header;

// False: no numbers below any names; names is then the line that could have been it, or 0.
bool kn_header_find(kn_header *header, kn_lines *lines);

// Whether a line holds units, one for each name: "s;mm;N". Half of them need be known.
bool kn_header_is_units(const char *line, char separator);

#endif
