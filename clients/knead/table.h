#ifndef KN_CLIENTS_TABLE_H
#define KN_CLIENTS_TABLE_H
// Curves of an experiment: rows of numbers, in series that each have a label. Written as CSV, drawn by gnuplot.
#include <stdbool.h>
#include <stdio.h>

#define KN_SERIES_MAX 32

typedef struct kn_table {
    const char *const *columns; // names with units, "time_s", NULL-terminated; the caller's
    int width;
    double *cell;
    int rows, capacity;
    int series, start[KN_SERIES_MAX]; // first row of each
    char label[KN_SERIES_MAX][40];
    bool pairs; // every second series belongs to the one before it and is drawn dashed
    bool short_of_memory;
} kn_table;

void kn_table_init(kn_table *t, const char *const *columns);
void kn_table_free(kn_table *t);
void kn_table_series(kn_table *t, const char *label); // the next rows belong to it; at most KN_SERIES_MAX
void kn_table_add(kn_table *t, const double *row);    // of width numbers

// Both return an exit code and complain in one line in the name of the subcommand.
int kn_table_write(const kn_table *t, const char *subcommand, const char *path);

// A cell of text in such a file, between quotes where a comma, a quote or a line's end is in it (RFC 4180).
void kn_table_text(const char *text, FILE *f);

// One pair of axes. y2: a second curve over the same x, 0 for none (column 0 is never drawn upwards).
typedef struct kn_axes {
    const char *x_label, *y_label;
    int x, y, y2; // columns
    const char *y_name, *y2_name;
    double x_scale, y_scale;
    bool log_x, log_y, points;
} kn_axes;

int kn_table_draw(const kn_table *t, const char *subcommand, const char *path, const char *title, const kn_axes *axes,
                  int count);

#endif
