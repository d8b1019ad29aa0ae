#include "clients/cli/curve_table.h"
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "clients/cli/output.h"
#include "clients/cli/plot.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void kn_table_init(kn_table *t, const char *const *columns)
{
    memset(t, 0, sizeof *t);
    t->columns = columns;
    while (columns[t->width]) t->width++;
}

void kn_table_free(kn_table *t)
{
    free(t->cell);
    t->cell = NULL;
}

void kn_table_series(kn_table *t, const char *label)
{
    if (t->series == KN_SERIES_MAX) return;
    snprintf(t->label[t->series], sizeof t->label[0], "%s", label);
    t->start[t->series++] = t->rows;
}

void kn_table_add(kn_table *t, const double *row)
{
    if (t->rows == t->capacity) {
        int capacity = t->capacity ? 2 * t->capacity : 1024;
        double *cell = realloc(t->cell, (size_t)capacity * (size_t)t->width * sizeof *cell);
        t->short_of_memory |= !cell;
        if (!cell) return;
        t->cell = cell;
        t->capacity = capacity;
    }
    memcpy(t->cell + (size_t)t->rows++ * (size_t)t->width, row, (size_t)t->width * sizeof *row);
}

// Return the number in this row and column of the table.
static double cell(const kn_table *t, int row, int column)
{
    return t->cell[(size_t)row * (size_t)t->width + (size_t)column];
}

// Return the row after the last row of a series.
static int end_of(const kn_table *t, int series) { return series + 1 < t->series ? t->start[series + 1] : t->rows; }

void kn_table_text(const char *text, FILE *f)
{
    const bool quoted = text[strcspn(text, ",\"\r\n")];
    if (quoted) putc('"', f);
    for (const char *c = text; *c; c++) {
        // Inside a quoted cell, write each quote twice (RFC 4180).
        if (*c == '"') putc('"', f);
        putc(*c, f);
    }
    if (quoted) putc('"', f);
}

int kn_table_write(const kn_table *t, const char *subcommand, const char *path)
{
    if (t->short_of_memory) return kn_complain(subcommand, KN_EXIT_DEVICE, "out of memory");
    kn_beside out;
    FILE *f = kn_output_open(&out, subcommand, path);
    if (!f) return KN_EXIT_DEVICE;
    for (int c = 0; c < t->width; c++) fprintf(f, "%s%c", t->columns[c], c + 1 < t->width ? ',' : '\n');
    for (int r = 0; r < t->rows; r++)
        for (int c = 0; c < t->width; c++) fprintf(f, "%.10g%c", cell(t, r, c), c + 1 < t->width ? ',' : '\n');
    return kn_output_close(&out, subcommand);
}

// ---- gnuplot

// Write the rows of a series as a named data block of gnuplot.
static void write_data(FILE *f, const kn_table *t, int series)
{
    fprintf(f, "$series%d << END\n", series);
    for (int r = t->start[series]; r < end_of(t, series); r++)
        for (int c = 0; c < t->width; c++) fprintf(f, "%.9g%c", cell(t, r, c), c + 1 < t->width ? ' ' : '\n');
    fprintf(f, "END\n");
}

// Sizes of the parts of the picture, pixels.
enum { PANEL = 600, HEIGHT = 460, HEAD = 44, FOOT = 56, LEFT = 98, RIGHT = 26 };

// Return true if a curve is drawn dashed: the second curve of a plot, or the second series of a pair.
static bool dashed(const kn_table *t, const kn_axes *a, int series, int y)
{
    return (a->y2 && y == a->y2) || (t->pairs && series % 2);
}

// Return the line type of a curve. If there is only one series, each of its two curves has its own colour.
// Otherwise the two curves of a series have the same colour, and the two series of a pair have the same colour.
static int hue(const kn_table *t, const kn_axes *a, int series, int y)
{
    if (t->series == 1) return 1 + (a->y2 && y == a->y2);
    return 1 + (t->pairs ? series / 2 : series);
}

// Write the plot command of one curve.
static void write_curve(FILE *f, const kn_table *t, const kn_axes *a, int series, int y)
{
    // If there are several series, the second curve of each is only a reference and is drawn without points.
    const bool bound = a->y2 && y == a->y2 && t->series > 1;
    fprintf(f, "$series%d using ($%d*%g):($%d*%g) with %s lt %d%s notitle, ", series, a->x + 1, a->x_scale, y + 1,
            a->y_scale, a->points && !bound ? "linespoints" : "lines", hue(t, a, series, y),
            dashed(t, a, series, y) ? " dt 2" : "");
}

// Write a key inside the axes that names the two curves. The names of the series are written once, below the panels.
static void write_names(FILE *f, const kn_table *t, const kn_axes *a)
{
    const char *const names[] = {a->y_name, a->y2 ? a->y2_name : NULL};
    for (int i = 0; i < 2; i++) {
        if (!names[i]) continue;
        if (t->series == 1) fprintf(f, "NaN with %s lt %d", a->points ? "linespoints" : "lines", 1 + i);
        else fprintf(f, "NaN with lines lw 2 lc rgb '#444444'");
        fprintf(f, "%s title ", i ? " dt 2" : "");
        kn_plot_quote(f, names[i]);
        fprintf(f, ", ");
    }
    fprintf(f, "NaN notitle\n");
}

// Write one panel: labels, ranges, curves and key.
static void write_axes(FILE *f, const kn_table *t, const kn_axes *a)
{
    fprintf(f, "unset logscale\nset format '%%g'\nset key top right opaque\n");
    kn_plot_label(f, "xlabel", a->x_label);
    kn_plot_label(f, "ylabel", a->y_label);
    fprintf(f, "set xrange [*:*]\nset yrange [*%s:*]\n", a->log_y ? "" : "<0");
    if (a->log_x) fprintf(f, "set logscale x\n");
    if (a->log_y) fprintf(f, "set logscale y\n");
    fprintf(f, "plot ");
    for (int s = 0; s < t->series; s++) {
        write_curve(f, t, a, s, a->y);
        if (a->y2) write_curve(f, t, a, s, a->y2);
    }
    write_names(f, t, a);
}

// Return the number of rows in the legend. A row has room for three series under each panel. A single series needs no
// legend, so return 0.
static int legend_rows(const kn_table *t, int count)
{
    const int across = 3 * count;
    return t->series > 1 ? (t->series + across - 1) / across : 0;
}

// Write the names of the series below the panels.
static void write_legend(FILE *f, const kn_table *t, const kn_axes *a, int rows, int high)
{
    kn_plot_legend(f, false, rows, high);
    for (int s = 0; s < t->series; s++) {
        fprintf(f, "NaN with %s lt %d%s title ", a->points ? "linespoints" : "lines", hue(t, a, s, a->y),
                dashed(t, a, s, a->y) ? " dt 2" : "");
        kn_plot_quote(f, t->label[s]);
        fprintf(f, ", ");
    }
    fprintf(f, "NaN notitle\n");
}

// Write the whole gnuplot script: data, panels from left to right, legend.
static void write_script(FILE *f, const kn_table *t, const char *title, const kn_axes *axes, int count, int high)
{
    const int rows = legend_rows(t, count), wide = PANEL * count;
    for (int s = 0; s < t->series; s++) write_data(f, t, s);
    kn_plot_panels(f, title);
    for (int i = 0; i < count; i++) {
        fprintf(f,
                "set lmargin at screen %g\nset rmargin at screen %g\nset bmargin at screen %g\n"
                "set tmargin at screen %g\n",
                (double)(PANEL * i + LEFT) / wide, (double)(PANEL * (i + 1) - RIGHT) / wide,
                (double)(FOOT + KN_PLOT_ROW * rows + (rows ? 8 : 0)) / high, 1 - (double)HEAD / high);
        write_axes(f, t, &axes[i]);
    }
    if (rows) write_legend(f, t, &axes[0], rows, high);
    fprintf(f, "unset multiplot\n");
}

int kn_table_draw(const kn_table *t, const char *subcommand, const char *path, const char *title, const kn_axes *axes,
                  int count)
{
    if (t->short_of_memory) return kn_complain(subcommand, KN_EXIT_DEVICE, "out of memory");
    int code;
    const int high = HEIGHT + KN_PLOT_ROW * legend_rows(t, count);
    FILE *f = kn_plot_open(subcommand, path, PANEL * count, high, &code);
    if (!f) return code;
    write_script(f, t, title, axes, count, high);
    return kn_plot_close(f, subcommand, path);
}
