#include "clients/sweep/stability_trial.h"
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "clients/cli/output.h"
#include "clients/cli/plot.h"
#include "clients/cli/result.h"
#include "server/clock.h"
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

// Relative error of the time step above which a cell of a map counts as coarse.
#define COARSE 0.25

static int cells_of(const kn_stability_atlas *a) { return a->first[a->maps]; }

// Find the map, the column and the row that belong to a cell index.
static void place(const kn_stability_atlas *a, int cell, int *map, int *column, int *row)
{
    *map = 0;
    while (cell >= a->first[*map + 1]) ++*map;
    *column = (cell - a->first[*map]) % a->map[*map].columns;
    *row = (cell - a->first[*map]) / a->map[*map].columns;
}

// --- survey ---------------------------------------------------------------------------------------------------------

// Run the trial of a cell in a process of its own, so that the survey survives a death of the trial. A cell whose
// process cannot be started or does not end well is DIED. Then the results of all solvers are discarded, because they
// have not all been compared with the reference.
static void try_cell(const kn_stability_atlas *a, int cell)
{
    int status = -1;
    const pid_t child = fork();
    if (child == 0) {
        int map, column, row;
        kn_stability_trial trial;
        place(a, cell, &map, &column, &row);
        _exit(!kn_stability_map_trial(&a->map[map], column, row, &trial) ||
              !kn_stability_trial_run(&trial, (1u << KN_WAYS) - 1, &a->cell[cell]));
    }
    if (child > 0) waitpid(child, &status, 0);
    if (status == 0) return;
    const char *why = status == -1          ? strerror(errno)
                      : WIFSIGNALED(status) ? strsignal(WTERMSIG(status))
                                            : "out of memory";
    for (int w = 0; w < KN_WAYS; w++) {
        kn_score *s = &a->cell[cell].score[w];
        s->verdict = KN_STABILITY_TRIAL_DIED;
        snprintf(s->reason, sizeof s->reason, "%s", why);
    }
}

int kn_stability_atlas_survey(kn_stability_atlas *a, bool quick, int family)
{
    // Keep only the maps of `family`, and number the cells of these maps consecutively.
    int all = kn_stability_maps(a->map, quick);
    a->maps = a->first[0] = 0;
    for (int m = 0; m < all; m++) {
        if (family >= 0 && a->map[m].family != family) continue;
        a->map[a->maps] = a->map[m];
        a->first[a->maps + 1] = a->first[a->maps] + a->map[m].columns * a->map[m].rows;
        a->maps++;
    }
    // The processes of the trials write their results into memory that they share with this process.
    size_t bytes = (size_t)cells_of(a) * sizeof *a->cell;
    a->cell = mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (a->cell == MAP_FAILED) return kn_complain("stability", KN_EXIT_DEVICE, "out of memory");
    const int64_t begin_ns = kn_now_ns();
    kn_progress bar = kn_progress_open("stability", cells_of(a));
    // Empty the buffer of stdout before forking. Otherwise each child process would have a copy of it.
    fflush(stdout);
    for (int c = 0; c < cells_of(a); c++) {
        try_cell(a, c);
        kn_progress_step(&bar, c + 1);
    }
    kn_progress_close(&bar);
    a->seconds = 1e-9 * (double)(kn_now_ns() - begin_ns);
    return KN_EXIT_OK;
}

void kn_stability_atlas_free(kn_stability_atlas *a) { munmap(a->cell, (size_t)cells_of(a) * sizeof *a->cell); }

// --- print ----------------------------------------------------------------------------------------------------------

// Character printed in a map for each judgement of a cell, in the order of kn_judgement.
static const char mark[KN_JUDGEMENTS + 1] = ".r~x!D";

static bool bad(kn_judgement v) { return v != KN_STABILITY_TRIAL_RIGHT && v != KN_STABILITY_TRIAL_REFUSED; }

// Return the index of the first map after map m that belongs to a different family than map m.
static int family_end(const kn_stability_atlas *a, int m)
{
    int end = m;
    while (end < a->maps && a->map[end].family == a->map[m].family) end++;
    return end;
}

// Print one row per solver: how many cells have each judgement. Add the rows to the JSON result.
static void print_counts(const kn_stability_atlas *a, const char *name, int from, int to)
{
    int coarse = 0, loose = 0;
    double most = 0; // largest error among the cells that the default solver gets right
    // Summarise the errors of the default solver only. The counts `coarse` and `loose` concern the reference solution,
    // not a solver.
    for (int c = from; c < to; c++) {
        const kn_score *s = &a->cell[c].score[KN_WAY_DEFAULT];
        if (s->verdict == KN_STABILITY_TRIAL_RIGHT) most = fmax(most, fmax(s->force, s->shape));
        coarse += a->cell[c].step_error > COARSE;
        loose += a->cell[c].loose;
    }
    for (int w = 0; w < KN_WAYS; w++) {
        int count[KN_JUDGEMENTS] = {0};
        for (int c = from; c < to; c++) count[a->cell[c].score[w].verdict]++;
        json_t *row = kn_result_add("families");
        kn_result_text(row, "family", name);
        kn_result_text(row, "solver", kn_way_name[w]);
        kn_result_integer(row, "cells", to - from);
        if (w == 0) kn_result_number(row, "most", most);
        printf("%-8s %-8s %6d", w ? "" : name, kn_way_name[w], to - from);
        for (int v = 0; v < KN_JUDGEMENTS; v++) {
            printf(" %10d", count[v]);
            kn_result_integer(row, kn_judgement_name[v], count[v]);
        }
        if (w == 0) printf(" %8d %6d %6.2f %%", coarse, loose, 100 * most);
        printf("\n");
    }
}

static void print_table(const kn_stability_atlas *a)
{
    printf("%-8s %-8s %6s", "family", "solver", "cells");
    for (int v = 0; v < KN_JUDGEMENTS; v++) printf(" %10s", kn_judgement_name[v]);
    printf(" %8s %6s %8s\n", "coarse", "loose", "most");
    for (int m = 0, end; m < a->maps; m = end) {
        end = family_end(a, m);
        print_counts(a, kn_stability_families[a->map[m].family], a->first[m], a->first[end]);
    }
    // Print the total over all families only if there is more than one family.
    if (family_end(a, 0) < a->maps) print_counts(a, "all", 0, cells_of(a));
    printf("\ncoarse: the error of the time step alone exceeds %g %%; loose: the reference missed its tolerance in "
           "at least one step\n",
           100 * COARSE);
}

// Print the names of the solvers as column headings above the maps.
static void print_ticks(const kn_stability_map *m)
{
    printf("%-16s", "");
    for (int w = 0; w < KN_WAYS; w++) printf("%-*s", m->columns + 3 > 9 ? m->columns + 3 : 9, kn_way_name[w]);
    printf("\n");
}

// Print a map as blocks of characters, one block per solver, side by side.
static void print_map(const kn_stability_atlas *a, int map)
{
    const kn_stability_map *m = &a->map[map];
    printf("\n%s: %s\n%16s%s =", kn_stability_families[m->family], m->title, "", m->across);
    for (int i = 0; i < m->columns; i++) printf(" %g", m->x[i]);
    printf("\n");
    print_ticks(m);
    for (int j = 0; j < m->rows; j++) {
        if (m->y_text[j]) printf("%14s  ", m->y_text[j]);
        else printf("%14g  ", m->y[j]);
        for (int w = 0; w < KN_WAYS; w++) {
            for (int i = 0; i < m->columns; i++)
                putchar(mark[a->cell[a->first[map] + j * m->columns + i].score[w].verdict]);
            printf("%*s", m->columns + 3 > 9 ? 3 : 9 - m->columns, "");
        }
        printf("\n");
    }
}

// Print each reason for which the default solver refused a scene, with the number of cells that have this reason.
static void print_reasons(const kn_stability_atlas *a)
{
    bool title = false;
    for (int c = 0; c < cells_of(a); c++) {
        const kn_score *s = &a->cell[c].score[KN_WAY_DEFAULT];
        // Count the cells with the same reason. Print a reason only at the first cell with this reason.
        int count = 0, before = 0;
        for (int d = 0; d < cells_of(a) && s->verdict == KN_STABILITY_TRIAL_REFUSED; d++) {
            const kn_score *other = &a->cell[d].score[KN_WAY_DEFAULT];
            bool same = other->verdict == KN_STABILITY_TRIAL_REFUSED && !strcmp(other->reason, s->reason);
            before += same && d < c;
            count += same;
        }
        if (count == 0 || before > 0) continue;
        if (!title) printf("\nrefused by the default solver:\n");
        title = true;
        printf("%6d  %s\n", count, s->reason);
    }
}

// Print each cell in which the default solver fails (function `bad`). Return the number of these cells.
static int print_bad(const kn_stability_atlas *a)
{
    int count = 0;
    for (int c = 0; c < cells_of(a); c++) {
        const kn_score *s = &a->cell[c].score[KN_WAY_DEFAULT];
        if (!bad(s->verdict)) continue;
        int map, i, j;
        place(a, c, &map, &i, &j);
        const kn_stability_map *m = &a->map[map];
        if (count++ == 0) printf("\nnot solved right by the default solver:\n");
        printf("  %s, %s: %s %g, ", kn_stability_families[m->family], m->title, m->across, m->x[i]);
        if (m->y_text[j]) printf("%s", m->y_text[j]);
        else printf("%s %g", m->down, m->y[j]);
        if (s->verdict == KN_STABILITY_TRIAL_DIED) {
            printf(": died, %s\n", s->reason);
            continue;
        }
        printf(": %s, force %.2g %%, shape %.2g %%, variation %.2f times, step %.2g %%%s\n",
               kn_judgement_name[s->verdict], 100 * s->force, 100 * s->shape, s->variation, 100 * a->cell[c].step_error,
               a->cell[c].loose ? ", loose" : "");
    }
    return count;
}

bool kn_stability_atlas_print(const kn_stability_atlas *a)
{
    print_table(a);
    printf("\n. right   r refused   ~ chattering   x wrong   ! diverged   D died\n");
    for (int m = 0; m < a->maps; m++) print_map(a, m);
    print_reasons(a);
    int count = print_bad(a);
    kn_result_integer(kn_result(), "cells", cells_of(a));
    kn_result_integer(kn_result(), "bad", count);
    printf("\nthe default solver is right, or refuses with a reason, in %d of %d cells\n", cells_of(a) - count,
           cells_of(a));
    return count == 0;
}

// --- files ----------------------------------------------------------------------------------------------------------

int kn_stability_atlas_write(const kn_stability_atlas *a, const char *path)
{
    kn_beside out;
    FILE *f = kn_output_open(&out, "stability", path);
    if (!f) return KN_EXIT_DEVICE;
    fprintf(f, "family,map,across,x,down,y,solver,verdict,force_error,shape_error,variation,step_error,loose,reason\n");
    for (int c = 0; c < cells_of(a); c++) {
        int map, i, j;
        place(a, c, &map, &i, &j);
        const kn_stability_map *m = &a->map[map];
        for (int w = 0; w < KN_WAYS; w++) {
            const kn_score *s = &a->cell[c].score[w];
            fprintf(f, "%s,\"%s\",\"%s\",%g,\"%s\",", kn_stability_families[m->family], m->title, m->across, m->x[i],
                    m->down);
            if (m->y_text[j]) fprintf(f, "\"%s\",", m->y_text[j]);
            else fprintf(f, "%g,", m->y[j]);
            fprintf(f, "%s,%s,%.4g,%.4g,%.4g,%.4g,%d,\"%s\"\n", kn_way_name[w], kn_judgement_name[s->verdict], s->force,
                    s->shape, s->variation, a->cell[c].step_error, a->cell[c].loose, s->reason);
        }
    }
    return kn_output_close(&out, "stability");
}

// Colours of the judgements in the drawing, RRGGBB.
static const char *const colour[KN_JUDGEMENTS] = {"56b4e9", "d0d0d0", "e69f00", "d55e00", "000000", "000000"};

// Write the gnuplot commands that draw one map.
static void draw_map(FILE *f, const kn_stability_atlas *a, int map)
{
    const kn_stability_map *m = &a->map[map];
    // Write the data of the map for gnuplot: column, row counted from the bottom, judgement.
    fprintf(f, "$map%d << END\n", map);
    for (int j = 0; j < m->rows; j++)
        for (int i = 0; i < m->columns; i++)
            fprintf(f, "%d %d %d\n", i, m->rows - 1 - j,
                    (int)a->cell[a->first[map] + j * m->columns + i].score[KN_WAY_DEFAULT].verdict);
    // Label the axes with the values of the two parameters of the map.
    fprintf(f, "END\nset xtics (");
    for (int i = 0; i < m->columns; i++) fprintf(f, "%s'%.3g' %d", i ? "," : "", m->x[i], i);
    fprintf(f, ") rotate by 45 right\nset ytics (");
    for (int j = 0; j < m->rows; j++) {
        fprintf(f, j ? "," : "");
        char number[32];
        snprintf(number, sizeof number, "%.3g", m->y[j]);
        kn_plot_quote(f, m->y_text[j] ? m->y_text[j] : number);
        fprintf(f, " %d", m->rows - 1 - j);
    }
    fprintf(f, ")\nset xrange [-0.5:%g]\nset yrange [-0.5:%g]\n", m->columns - 0.5, m->rows - 0.5);
    kn_plot_label(f, "xlabel", m->across);
    kn_plot_label(f, "ylabel", m->y_text[0] ? "" : m->down);
    kn_plot_label(f, "title", m->title);
    fprintf(f, "plot $map%d using 1:2:(0.46):(0.46):3 with boxxyerror fs solid noborder lc palette notitle", map);
    // Mark the cells without a right result with a letter, because not all readers and printers distinguish the
    // colours.
    for (int v = KN_STABILITY_TRIAL_REFUSED; v < KN_JUDGEMENTS; v++)
        fprintf(f, ", $map%d using 1:($3 == %d ? $2 : NaN):('%c') with labels font 'sans,12' tc rgb '%s' notitle", map,
                v, mark[v], v < KN_STABILITY_TRIAL_DIVERGED ? "black" : "white");
    fprintf(f, "\n");
}

// Write the legend below the maps: the colours of the judgements, and the letters for cells without a right result.
static void write_legend(FILE *f, int columns, int high)
{
    fprintf(f,
            "set origin 0,0\nset size 1,%g\nset lmargin 0\nset rmargin 0\nset tmargin 0\nset bmargin 0\n"
            "unset title\nunset xlabel\nunset ylabel\nunset tics\nunset border\nset xrange [0:1]\nset yrange [0:1]\n"
            "set key center center maxrows %d samplen 1.5\nplot ",
            60.0 / high, columns < 3 ? 2 : 1);
    for (int v = 0; v < KN_JUDGEMENTS; v++)
        fprintf(f, "NaN with points pt 5 ps 2.5 lc rgb '#%s' title '%s%s%.1s', ", colour[v], kn_judgement_name[v],
                v ? "  " : "", v ? &mark[v] : "");
    fprintf(f, "NaN notitle\n");
}

int kn_stability_atlas_draw(const kn_stability_atlas *a, const char *path)
{
    // Place at most 4 maps side by side. Leave 60 pixels for the title above and 60 pixels for the legend below.
    int code = KN_EXIT_OK, columns = a->maps < 4 ? a->maps : 4, rows = (a->maps + columns - 1) / columns;
    const int wide = 420 * columns < 840 ? 840 : 420 * columns, high = 320 * rows + 120;
    FILE *f = kn_plot_open("stability", path, wide, high, &code);
    if (!f) return code;
    fprintf(f,
            "unset grid\nset border 0\nset tics scale 0\nunset colorbox\nset cbrange [0:%d]\n"
            "set palette maxcolors %d defined (",
            KN_JUDGEMENTS - 1, KN_JUDGEMENTS);
    for (int v = 0; v < KN_JUDGEMENTS; v++) fprintf(f, "%s%d '#%s'", v ? ", " : "", v, colour[v]);
    fprintf(f, ")\nset multiplot title 'the default solver at the extremes' font 'sans,14'\n");
    for (int m = 0; m < a->maps; m++) {
        fprintf(f, "set origin %g,%g\nset size %g,%g\n", (double)(m % columns) / columns,
                (60.0 + 320 * (rows - 1 - m / columns)) / high, 1.0 / columns, 310.0 / high);
        draw_map(f, a, m);
    }
    write_legend(f, columns, high);
    fprintf(f, "unset multiplot\n");
    return kn_plot_close(f, "stability", path);
}
