#include "clients/knead/table.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

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

// ---- gnuplot: its script with the data inside, through a pipe

// In single quotes gnuplot takes everything as it is, but them: a prime stands for one.
static void quote(FILE *f, const char *text)
{
    fputc('\'', f);
    for (; *text; text++) {
        if (*text == '\'')
            fputs("\u2032", f);
        else
            fputc(*text, f);
    }
    fputc('\'', f);
}

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
    quote(f, title);
}

static void write_axes(FILE *f, const kn_table *t, const kn_axes *a)
{
    fprintf(f, "unset logscale\nset format '%%g'\nset xlabel offset 0,0.5 ");
    quote(f, a->x_label);
    fprintf(f, "\nset ylabel ");
    quote(f, a->y_label);
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
    quote(f, title);
    fprintf(f, "\n");
    for (int i = 0; i < count; i++) write_axes(f, t, &axes[i]);
    fprintf(f, "unset multiplot\n");
}

int kn_table_draw(const kn_table *t, const char *subcommand, const char *path, const char *title, const kn_axes *axes,
                  int count)
{
    if (t->short_of_memory) return kn_complain(subcommand, KN_EXIT_DEVICE, "out of memory");
    if (system("command -v gnuplot >/dev/null 2>&1") != 0)
        return kn_complain(subcommand, KN_EXIT_DEVICE,
                           "%s: not drawn, gnuplot is not installed; --csv writes the numbers", path);
    fflush(stdout);
    int image = open(path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666), terminal = dup(STDOUT_FILENO);
    if (image < 0 || terminal < 0)
        return kn_complain(subcommand, KN_EXIT_DEVICE, "%s: %s, expected a file that can be written", path,
                           strerror(errno));
    // gnuplot inherits the file as its standard output: no shell and no script ever sees the path
    void (*before)(int) = signal(SIGPIPE, SIG_IGN);
    dup2(image, STDOUT_FILENO);
    FILE *f = popen("gnuplot 2>/dev/null", "w");
    dup2(terminal, STDOUT_FILENO);
    close(image);
    close(terminal);
    if (f) write_script(f, t, title, axes, count);
    int code = f ? pclose(f) : -1;
    signal(SIGPIPE, before);
    return code == 0 ? KN_EXIT_OK : kn_complain(subcommand, KN_EXIT_DEVICE, "%s: gnuplot could not draw it", path);
}
