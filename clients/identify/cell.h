#ifndef KN_CLIENTS_IDENTIFY_CELL_H
#define KN_CLIENTS_IDENTIFY_CELL_H
// The cells of one line of a table (sheet.h), and the numbers in the cells.
#include <stdbool.h>
#include <stddef.h>

typedef struct kn_cell {
    const char *text; // points into the line of the table, past blanks and an opening quote; not terminated by NUL
    int length;
    bool quoted;
} kn_cell;

typedef enum kn_cell_content { KN_CELL_NUMBER, KN_CELL_MISSING, KN_CELL_TEXT } kn_cell_content;

// Read the cell at *at. Move *at to the next cell, or set *at to NULL after the last cell. Return false at the end of
// the line. The separator ' ' stands for any number of blanks or tabs. If a line ends with any other separator, an
// empty cell follows that separator.
bool kn_cell_next(char separator, const char **at, kn_cell *cell);

// Read the number in a cell. Set *comma if the number has a decimal comma, and *point if it has a decimal point. A
// comma is no decimal mark if the comma is the separator and the cell is not quoted.
kn_cell_content kn_cell_read(const kn_cell *cell, char separator, double *value, bool *comma, bool *point);

// Copy the cell's text to `to`, shortened to `size` bytes. Doubled quotes within quotes become one quote. Control
// characters become '?', since the text is shown on terminals.
void kn_cell_text(char *to, size_t size, const kn_cell *cell);

#endif
