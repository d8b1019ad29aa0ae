#ifndef KN_CLIENTS_CURVE_TABLE_H
#define KN_CLIENTS_CURVE_TABLE_H
// Table of the curves of an experiment. Its rows of numbers are grouped into series, each with a label. A table can be
// written as CSV or drawn by gnuplot.
#include <stdbool.h>
#include <stdio.h>

#define KN_SERIES_MAX 32

typedef struct kn_table {
    // Names of the columns with units, such as "time_s"; NULL-terminated; the list belongs to the caller.
    const char *const *columns;
    int width;
    double *cell;
    int rows, capacity;
    int series, start[KN_SERIES_MAX]; // series: number of series. start: index of the first row of each series.
    char label[KN_SERIES_MAX][40];
    bool pairs; // true: series 1, 3, 5 ... are the partners of series 0, 2, 4 ... and are drawn dashed
    bool short_of_memory;
} kn_table;

// Initialise an empty table.
void kn_table_init(kn_table *t, const char *const *columns);
void kn_table_free(kn_table *t);
// Begin a new series of rows with this label. The rows added next belong to the new series. If the table already has
// KN_SERIES_MAX series, the call has no effect.
void kn_table_series(kn_table *t, const char *label);
// Append a row of t->width numbers to the table. If memory is short, drop the row and set t->short_of_memory.
void kn_table_add(kn_table *t, const double *row);

// Write the table as CSV. Return 0, or print one line that begins with the name of the subcommand and return an exit
// code.
int kn_table_write(const kn_table *t, const char *subcommand, const char *path);

// Write text as a CSV cell, in quotes if it contains a comma, a quote or a line end (RFC 4180).
void kn_table_text(const char *text, FILE *f);

// Axes and curves of one plot in the picture. x, y: columns of the table. y2: column of a second curve over the same x;
// 0: no second curve, because column 0 can only be an x.
typedef struct kn_axes {
    const char *x_label, *y_label;
    int x, y, y2; // indices of columns of the table
    const char *y_name, *y2_name;
    double x_scale, y_scale;
    bool log_x, log_y, points;
} kn_axes;

// Draw the table as a PNG with `count` plots side by side. Return 0, or print one line and return an exit code.
int kn_table_draw(const kn_table *t, const char *subcommand, const char *path, const char *title, const kn_axes *axes,
                  int count);

#endif
