#ifndef KN_CLIENTS_TABLE_H
#define KN_CLIENTS_TABLE_H
// Table of the curves of an experiment. Its rows of numbers are grouped into series, each with a label. A table can be
// written as CSV or drawn by gnuplot.
#include <stdbool.h>
#include <stdio.h>

#define KN_SERIES_MAX 32

typedef struct kn_table {
    const char *const *columns; // names with units, such as "time_s", NULL-terminated; borrowed
    int width;
    double *cell;
    int rows, capacity;
    int series, start[KN_SERIES_MAX]; // first row of each series
    char label[KN_SERIES_MAX][40];
    bool pairs; // series 1, 3, 5 .. belong to series 0, 2, 4 .. and are drawn dashed
    bool short_of_memory;
} kn_table;

// Initialise an empty table.
void kn_table_init(kn_table *t, const char *const *columns);
void kn_table_free(kn_table *t);
// Begin a series. The next rows belong to it. Beyond KN_SERIES_MAX the call has no effect.
void kn_table_series(kn_table *t, const char *label);
// Append a row of t->width numbers. If memory is short, drop the row and set short_of_memory.
void kn_table_add(kn_table *t, const double *row);

// Write the table as CSV. Return an exit code. On failure, print one line that begins with the name of the subcommand.
int kn_table_write(const kn_table *t, const char *subcommand, const char *path);

// Write text as a CSV cell, in quotes if it contains a comma, a quote or a line end (RFC 4180).
void kn_table_text(const char *text, FILE *f);

// One of the plots in the picture. y2: column of a second curve over the same x; 0: no second curve (column 0 can only
// be an x).
typedef struct kn_axes {
    const char *x_label, *y_label;
    int x, y, y2; // columns
    const char *y_name, *y2_name;
    double x_scale, y_scale;
    bool log_x, log_y, points;
} kn_axes;

// Draw the table as a PNG with `count` plots side by side. Return an exit code. On failure, print one line.
int kn_table_draw(const kn_table *t, const char *subcommand, const char *path, const char *title, const kn_axes *axes,
                  int count);

#endif
