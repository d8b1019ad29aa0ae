#include "clients/identify/header.h"
#include "clients/identify/cell.h"
#include "clients/identify/heading.h"
#include "clients/identify/note.h"
#include <stdio.h>
#include <string.h>

static char separator_of(const char *line)
{
    return strchr(line, '\t') ? '\t' : strchr(line, ';') ? ';' : strchr(line, ',') ? ',' : ' ';
}

typedef struct census { // what one line of the file contains
    int cells, numbers, missing;
    bool first; // whether the first cell is a number
} census;

static census count_cells(const char *line, char separator)
{
    census n = {0};
    kn_cell c;
    double value;
    bool ignored;
    for (const char *at = line; kn_cell_next(separator, &at, &c); n.cells++) {
        kn_cell_content is = kn_cell_read(&c, separator, &value, &ignored, &ignored);
        n.numbers += is == KN_CELL_NUMBER;
        n.first |= n.cells == 0 && is == KN_CELL_NUMBER;
        n.missing += is == KN_CELL_MISSING;
    }
    return n;
}

// State of the search for the header.
typedef struct search {
    // line number of the last plain line that may hold the names, and of the last commented line that may hold them; 0:
    // no such line so far
    int header, commented;
    char separator, commented_separator;
    int cells, commented_cells;
    int data; // line number of the first row of numbers; 0: not found so far
    char of_rows;
} search;

// Return whether the line is a row of numbers below a line of names with `cells` cells. At least half of its cells are
// numbers or missing, and it has no more cells than there are names. One number after a word is not a row:
// "Diameter;25" stands before tables.
static bool is_row(const char *line, char separator, int cells)
{
    census n = count_cells(line, separator);
    if (n.numbers == 0 || (n.numbers == 1 && !n.first && n.cells > 1 && n.missing == 0)) return false;
    return 2 * (n.numbers + n.missing) >= n.cells && n.cells - n.missing <= cells;
}

// Return the separator of the line's cells if it is a row below these names. Return 0 if it is not a row.
static char row_separator(const char *line, int header, char separator, int cells)
{
    if (!header) return 0;
    if (is_row(line, separator, cells)) return separator;
    return count_cells(line, ' ').numbers > 1 && is_row(line, ' ', cells) ? ' ' : 0;
}

// Look at one line: a row ends the search, a line of words becomes the candidate for the names.
static void look_at(search *found, const kn_lines *l)
{
    const char *line = l->text + strspn(l->text, " \t");
    kn_note note;
    const bool comment = *line == '#';
    if (comment) line += strspn(line, "# \t");
    if (!*line || (comment && kn_note_read(l->text, 0, &note))) return;
    // A row is tried against the plain candidate first, then against the commented one.
    const char separator = separator_of(line);
    const census n = count_cells(line, separator);
    char of_rows = row_separator(line, found->header, found->separator, found->cells);
    if (!of_rows) of_rows = row_separator(line, found->commented, found->commented_separator, found->commented_cells);
    if (!comment && of_rows) {
        found->data = l->number;
        found->of_rows = of_rows;
        return;
    }
    // A line of words with at least two cells may be the names.
    if (n.numbers > 0 || n.cells - n.missing < 2) return;
    if (comment) {
        found->commented = l->number;
        found->commented_separator = separator;
        found->commented_cells = n.cells;
    } else {
        found->header = l->number;
        found->separator = separator;
        found->cells = n.cells;
    }
}

bool kn_header_is_units(const char *line, char separator)
{
    int units = 0, others = 0;
    kn_cell c;
    for (const char *at = line; kn_cell_next(separator, &at, &c);) {
        char text[KN_HEADING_NAME];
        kn_measure m;
        if (c.length == 0 || (c.length == 2 && !strncmp(c.text, "[]", 2))) continue;
        if (strchr("([", *c.text) && c.length > 2) c.text++, c.length -= 2;
        snprintf(text, sizeof text, "%.*s", c.length, c.text);
        if (kn_measure_parse(&m, text, NULL, 0)) units++;
        else others++;
    }
    return units > 0 && units >= others;
}

bool kn_header_find(kn_header *header, kn_lines *lines)
{
    search found = {0}, before = {0};
    int units = 0;
    // Read up to the first row of numbers. Remember the candidate before the last one, in case the last line holds only
    // units.
    while (!found.data && kn_lines_next(lines)) {
        const search was = found;
        look_at(&found, lines);
        if (found.header == was.header) continue;
        before = was;
        if (kn_header_is_units(lines->text, found.separator)) units = found.header;
    }
    // The line of units counts only if it is directly the last candidate and another candidate is above it.
    const bool below = units > 0 && units == found.header && before.header > 0;
    if (below) *header = (kn_header){before.header, units, before.separator, found.of_rows};
    else if (found.header) *header = (kn_header){found.header, 0, found.separator, found.of_rows};
    else *header = (kn_header){found.commented, 0, found.commented_separator, found.of_rows};
    return found.data > 0;
}
