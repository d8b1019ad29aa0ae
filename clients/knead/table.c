#include "clients/knead/table.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include "clients/knead/plot.h"
#include <errno.h>
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

static double cell(const kn_table *t, int row, int column)
{
    return t->cell[(size_t)row * (size_t)t->width + (size_t)column];
}

static int end_of(const kn_table *t, int series)
{
    return series + 1 < t->series ? t->start[series + 1] : t->rows;
}

int kn_table_write(const kn_table *t, const char *subcommand, const char *path)
{
    if (t->short_of_memory) return kn_complain(subcommand, KN_EXIT_DEVICE, "out of memory");
    FILE *f = fopen(path, "w");
    if (!f)
        return kn_complain(subcommand, KN_EXIT_DEVICE, "%s: %s, expected a file that can be written", path,
                           strerror(errno));
    for (int c = 0; c < t->width; c++) fprintf(f, "%s%c", t->columns[c], c + 1 < t->width ? ',' : '\n');
    for (int r = 0; r < t->rows; r++)
        for (int c = 0; c < t->width; c++) fprintf(f, "%.10g%c", cell(t, r, c), c + 1 < t->width ? ',' : '\n');
    if ((ferror(f) | fclose(f)) == 0) return KN_EXIT_OK;
    return kn_complain(subcommand, KN_EXIT_DEVICE, "%s: could not be written to its end", path);
}

// ---- gnuplot

static void write_data(FILE *f, const kn_table *t, int series)
{
    fprintf(f, "$series%d << END\n", series);
    for (int r = t->start[series]; r < end_of(t, series); r++)
        for (int c = 0; c < t->width; c++) fprintf(f, "%.9g%c", cell(t, r, c), c + 1 < t->width ? ' ' : '\n');
    fprintf(f, "END\n");
}

static void write_curve(FILE *f, const kn_table *t, const kn_axes *a, int series, int y, const char *name)
{
    static const char *const colour[] = {"0b6b6b", "d9822b", "5b3a8c", "b02a37",
                                         "2f7d32", "1f4e9c", "7a7a7a", "b8860b"};
    bool dashed = y == a->y2 || (t->pairs && series % 2);
    int hue = t->series == 1 ? y == a->y2 : t->pairs ? series / 2 : series;
    char title[100];
    snprintf(title, sizeof title, "%s%s%s", name ? name : "", name && t->series > 1 ? ", " : "",
             !name || t->series > 1 ? t->label[series] : "");
    fprintf(f, "$series%d using ($%d*%g):($%d*%g) with %s lw 2 %s lc rgb '#%s' title ", series, a->x + 1, a->x_scale,
            y + 1, a->y_scale, a->points ? "linespoints pt 7 ps 0.6" : "lines", dashed ? "dt 2" : "", colour[hue % 8]);
    kn_plot_quote(f, title);
}

static void write_axes(FILE *f, const kn_table *t, const kn_axes *a)
{
    fprintf(f, "unset logscale\nset format '%%g'\nset xlabel offset 0,0.5 ");
    kn_plot_quote(f, a->x_label);
    fprintf(f, "\nset ylabel ");
    kn_plot_quote(f, a->y_label);
    if (a->log_x) fprintf(f, "\nset logscale x\nset format x '%%g'");
    if (a->log_y)
        fprintf(f, "\nset logscale y\nset format y '%%g'");
    else
        fprintf(f, "\nset yrange [*<0:*]");
    if (a->log_y) fprintf(f, "\nset yrange [*:*]");
    fprintf(f, "\nplot ");
    for (int s = 0; s < t->series; s++) {
        if (s) fprintf(f, ", ");
        write_curve(f, t, a, s, a->y, a->y_name);
        if (!a->y2) continue;
        fprintf(f, ", ");
        write_curve(f, t, a, s, a->y2, a->y2_name);
    }
    fprintf(f, "\n");
}

static void write_script(FILE *f, const kn_table *t, const char *title, const kn_axes *axes, int count)
{
    fprintf(f, "set terminal pngcairo noenhanced size %d,480 font 'sans,11'\n", 600 * count);
    fprintf(f, "set grid\nset key bmargin center horizontal\n");
    for (int s = 0; s < t->series; s++) write_data(f, t, s);
    fprintf(f, "set multiplot layout 1,%d title ", count);
    kn_plot_quote(f, title);
    fprintf(f, "\n");
    for (int i = 0; i < count; i++) write_axes(f, t, &axes[i]);
    fprintf(f, "unset multiplot\n");
}

int kn_table_draw(const kn_table *t, const char *subcommand, const char *path, const char *title, const kn_axes *axes,
                  int count)
{
    if (t->short_of_memory) return kn_complain(subcommand, KN_EXIT_DEVICE, "out of memory");
    int code;
    FILE *f = kn_plot_open(subcommand, path, &code);
    if (!f) return code;
    write_script(f, t, title, axes, count);
    return kn_plot_close(f, subcommand, path);
}
