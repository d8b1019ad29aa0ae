#ifndef KN_CLIENTS_IDENTIFY_HEADER_H
#define KN_CLIENTS_IDENTIFY_HEADER_H
// Find where a table begins in a file that may have any text before the table. The column names are in the last line of
// words before the first row of numbers. If the last line of words holds only units, the names are in the line of words
// above the units. A comment line such as "# time height", which numpy writes, is taken as the line of names only if no
// other line can hold the names.
#include "clients/identify/lines.h"

typedef struct kn_header {
    int names, units; // numbers of the lines that hold the names and the units, from 1 on; 0: there is no such line
    char separator;   // separator of the names: the first of tab, ';' and ',' that the line of names contains, else ' '
    char of_rows;     // separator of the rows: the separator of the names, or ' ' if blanks separate the numbers
} kn_header;

// Find the header. Return false if no numbers follow a line of names. In that case header->names is the number of the
// line that could have held the names, or 0.
bool kn_header_find(kn_header *header, kn_lines *lines);

// Return whether a line holds the units of the columns, such as "s;mm;N": at least half of its cells must be known
// units.
bool kn_header_is_units(const char *line, char separator);

#endif
