#ifndef KN_CLIENTS_IDENTIFY_HEADER_H
#define KN_CLIENTS_IDENTIFY_HEADER_H
// Find where a table begins in a file that may have any text before it. The column names are in the last line of words
// before the first row of numbers. If the last line of words holds only units, the names are in the line of words above
// the units. A comment line is taken as the line of names only if no other line can be ("# time height", as numpy
// writes them).
#include "clients/identify/lines.h"

typedef struct kn_header {
    int names, units; // line numbers, 1..; 0: none
    char separator;   // the first of tab, ';' and ',' that the line of names contains, else ' '
    char of_rows;     // separator of the rows: the separator of the names, or ' ' if blanks separate the numbers
} kn_header;

// Find the header. Return false if there are no numbers below any names; `names` is then the line that could have held
// the names, or 0.
bool kn_header_find(kn_header *header, kn_lines *lines);

// Return whether a line holds the units of the columns, such as "s;mm;N". At least half of the cells must be known
// units.
bool kn_header_is_units(const char *line, char separator);

#endif
