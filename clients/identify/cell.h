#ifndef KN_CLIENTS_IDENTIFY_CELL_H
#define KN_CLIENTS_IDENTIFY_CELL_H
// The cells of a line of a table (sheet.h), and the numbers in them.
#include <stdbool.h>
#include <stddef.h>

typedef struct kn_cell {
    const char *text; // in its line: without the blanks and the quotes around it; not ended by a NUL
    int length;
    bool quoted;
} kn_cell;

typedef enum kn_cell_content { KN_CELL_NUMBER, KN_CELL_MISSING, KN_CELL_TEXT } kn_cell_content;

// The cell that begins at *at, which moves to the next one; NULL: there is none. False at the line's end. A separator
// of ' ' stands for any blanks; a line that ends with another one has an empty cell after it.
bool kn_cell_next(char separator, const char **at, kn_cell *cell);

// *comma, *point: set if the number has such a decimal mark; a comma is none where it separates, unless quoted.
kn_cell_content kn_cell_read(const kn_cell *cell, char separator, double *value, bool *comma, bool *point);

// As much of it as there is room for: doubled quotes within quotes are one, control characters '?', for it is shown on
// terminals.
void kn_cell_text(char *to, size_t size, const kn_cell *cell);

#endif
