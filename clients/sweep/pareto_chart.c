#include "clients/sweep/pareto_chart.h"
#include "clients/cli/commands.h"
#include "clients/cli/plot.h"
#include <math.h>
#include <string.h>

// ---- the table

static void print_head(void)
{
    printf("%69s | %-20s| %-13s| %s\n", "us of a tick", "force: error, %", "shape", "effects a hand notices");
    printf("%-8s %8s %-7s %3s  %-18s %-3s %8s %6s | %6s %5s %6s | %6s %5s | %6s %6s %6s %5s %6s\n", "lattice", "step",
           "solver", "", "CG iterations", "on", "p50", "p90", "solver", "step", "all", "solver", "all", "peak %",
           "lag ms", "mm deep", "N/ms", "TV/pk");
}

// Print a share (0 to 1) as a percentage, or "-" if the share is unknown.
static void put_percent(double share, int width, int digits)
{
    if (isfinite(share)) printf(" %*.*f", width, digits, 100 * share);
    else printf(" %*s", width, "-");
}

// Write the name of a lattice, which is its node spacing. A mesh has no spacing.
static const char *lattice_of(const kn_sweep_run *run, char text[16])
{
    if (run->spacing_m > 0) snprintf(text, 16, "%.4g mm", 1e3 * run->spacing_m);
    else snprintf(text, 16, "mesh");
    return text;
}

static void print_row(const kn_pareto_row *r, const kn_pareto_row *const named[KN_QUALITY_OWN])
{
    char lattice[16], effort[64];
    const kn_sweep_run *run = r->run;
    printf("%-8s %5.4g ms %-7s %s  %-18s cpu %8.1f %6.1f |", lattice_of(run, lattice), 1e3 * run->dt_s,
           kn_method_name(run->method), run->precision == KN_PRECISION_F64 ? "f64" : "f32",
           kn_sweep_run_effort(run, effort), r->median_us, r->p90_us);
    put_percent(r->force.solver, 6, 3);
    put_percent(r->force.step, 5, 2);
    put_percent(r->force.all, 6, 2);
    putchar(r->front ? '*' : ' ');
    printf("|");
    put_percent(r->shape.solver, 6, 3);
    put_percent(r->shape.all, 5, 2);
    printf("%c|", r->shape_front ? '*' : ' ');
    printf(" %+6.2f", 100 * r->peak);
    if (isfinite(r->lag_s)) printf(" %+6.2f", 1e3 * r->lag_s);
    else printf(" %6s", "-");
    printf(" %+6.3f %5.2f %6.2f", 1e3 * r->depth_m, r->jump_n, r->variation);
    if (r->chatters) printf("  chatters");
    if (r->latched) printf("  latched");
    if (run->own) printf("  scene");
    // Print the names of quality that this point was given: fast, balanced, accurate.
    for (kn_quality q = 0; q < KN_QUALITY_OWN; q++)
        if (named[q] == r) printf("  %s", kn_quality_name(q));
    putchar('\n');
}

// Print the heading above the table rows of one lattice.
static void print_lattice(const kn_pareto_front *front, const kn_pareto_row *r)
{
    char lattice[16];
    printf("-- %s, %d nodes: converged, the force jumps by %.2f N/ms, TV/pk %.2f", lattice_of(r->run, lattice),
           r->run->nodes, r->reference_jump_n, r->reference_variation);
    // If the lattice has no error of its own, it is the finest lattice, or a mesh.
    if (r->run->spacing_m == 0) puts("; the error against a finer mesh is not known");
    else if (r->force.lattice == 0) puts("; the finest here");
    else
        printf("; force %.2f %%, shape %.2f %% from that of %.4g mm\n", 100 * r->force.lattice, 100 * r->shape.lattice,
               1e3 * front->finest_m);
}

void kn_pareto_chart_print(const kn_pareto_front *front, const kn_sweep_plan *plan,
                           const kn_pareto_row *const named[KN_QUALITY_OWN])
{
    print_head();
    for (int i = 0; i < front->count; i++) {
        // The rows are sorted by lattice, so a row with another number of nodes begins a new lattice.
        const kn_pareto_row *r = &front->row[i];
        if (i == 0 || r->run->nodes != r[-1].run->nodes) print_lattice(front, r);
        print_row(r, named);
    }
    printf("solver: against f64, same step, secant, 5 linearisations, CG to 1e-8; ");
    if (plan->fine) puts("step: that against f64 at 1/16 of the scene's step;");
    else puts("step: not measured (--quick);");
    puts("all: against f64 at 1/16, plus the error of the lattice. *: no cheaper point is more accurate. The other "
         "columns: effects a hand notices.");
    for (int i = 0; i < plan->notes; i++) puts(plan->note[i]);
}

// ---- the picture

// Largest number of lattices that are drawn in a colour of their own.
enum { LATTICES = 6 };

typedef struct marker { // plot symbol of a point, which depends on solver and precision
    int type;
    const char *name;
} marker;

static const marker markers[] = {{7, "blend"}, {9, "secant"}, {11, "tangent"},
                                 {15, "rk4"},  {5, "f64"},    {13, "smaller step"}};
enum { MARKERS = sizeof markers / sizeof *markers };

// Return the index of the plot symbol of a point in the list of markers. The first three markers have the order of
// kn_method.
static int marker_of(const kn_pareto_row *r, const kn_sweep_plan *plan)
{
    if (r->run->method == KN_METHOD_RK4) return 3;
    if (r->run->dt_s < plan->scene->model.solver.dt_s) return 5;
    if (r->run->precision == KN_PRECISION_F64) return 4;
    return (int)r->run->method;
}

static bool usable(const kn_pareto_row *r) { return !r->chatters && !r->latched; }

// One panel of the picture. A panel shows either the shape error or the force error. The error is either the total
// error or the part due to the solver. The named points may be marked.
typedef struct panel {
    const char *title;
    bool shape, all, named;
} panel;

static const panel panels[] = {{"contact force: error of the solver", .named = true},
                               {"residual shape: error of the solver", .shape = true, .named = true},
                               {"contact force: with step and lattice", .all = true}};
enum { PANELS = sizeof panels / sizeof *panels };

typedef struct picture {
    const kn_pareto_front *front;
    const kn_sweep_plan *plan;
    const kn_pareto_row *const *named;
    int lattices, nodes[LATTICES];
    bool used[LATTICES][MARKERS], any_bad;
} picture;

// Return the error of a point that the panel shows on its vertical axis, %.
static double height(const panel *p, const kn_pareto_row *r)
{
    const kn_pareto_errors *e = p->shape ? &r->shape : &r->force;
    return 100 * (p->all ? e->all : e->solver);
}

// Return the index of a point's lattice among the lattices of the picture. The last index stands for all lattices
// beyond the number of colours.
static int lattice_number(const picture *pic, const kn_pareto_row *r)
{
    int l = 0;
    while (l < pic->lattices - 1 && pic->nodes[l] != r->run->nodes) l++;
    return l;
}

// Write a Pareto front as a staircase from left to right: the front of one lattice, or of all lattices if `lattice` <
// 0.
static void write_front(FILE *f, const picture *pic, int panel_number, int lattice)
{
    const panel *p = &panels[panel_number];
    fprintf(f, "$front%d_%d << END\n", panel_number, lattice + 1);
    for (double us = -1, least = INFINITY;;) {
        // Find the next corner of the staircase: the fastest usable point that is slower than the last corner and has a
        // smaller error.
        const kn_pareto_row *next = NULL;
        for (int i = 0; i < pic->front->count; i++) {
            const kn_pareto_row *r = &pic->front->row[i];
            if ((lattice >= 0 && r->run->nodes != pic->nodes[lattice]) || !usable(r)) continue;
            if (r->median_us <= us || !(height(p, r) < least)) continue;
            if (!next || r->median_us < next->median_us) next = r;
        }
        if (!next) break;
        us = next->median_us;
        least = height(p, next);
        fprintf(f, "%.6g %.6g\n", us, least);
    }
    fprintf(f, "END\n");
}

// Write one line of data per point. The columns are: median time per tick in us, error in %, index of the lattice,
// index of the marker, 1 if the point chatters or is latched and 0 otherwise, 90th percentile (p90) of the time in us.
static void write_points(FILE *f, const picture *pic, int panel_number)
{
    fprintf(f, "$points%d << END\n", panel_number);
    for (int i = 0; i < pic->front->count; i++) {
        const kn_pareto_row *r = &pic->front->row[i];
        fprintf(f, "%.6g %.6g %d %d %d %.6g\n", r->median_us, height(&panels[panel_number], r), lattice_number(pic, r),
                marker_of(r, pic->plan), !usable(r), r->p90_us);
    }
    fprintf(f, "END\n");
}

// Set the ranges of the logarithmic axes with a small margin, and axis ticks at round numbers.
static void write_ranges(FILE *f, const picture *pic, const panel *p)
{
    double us[2] = {INFINITY, 0}, error[2] = {INFINITY, 0};
    for (int i = 0; i < pic->front->count; i++) {
        const kn_pareto_row *r = &pic->front->row[i];
        us[0] = fmin(us[0], r->median_us), us[1] = fmax(us[1], r->p90_us);
        if (height(p, r) > 0) error[0] = fmin(error[0], height(p, r)), error[1] = fmax(error[1], height(p, r));
    }
    fprintf(f, "set xrange [%g:%g]\nset yrange [%g:%g]\nset xtics (1", us[0] / 1.5, us[1] * 1.2, error[0] / 1.8,
            error[1] * 1.5);
    for (double ten = 1; ten < 1e5; ten *= 10) fprintf(f, ", %g, %g, %g", 2 * ten, 5 * ten, 10 * ten);
    fprintf(f, ")\nset ytics (0.001");
    for (double ten = 0.001; ten < 100; ten *= 10) fprintf(f, ", %g, %g, %g", 2 * ten, 5 * ten, 10 * ten);
    fprintf(f, ")\n");
}

// Draw a ring around each named point (fast, balanced, accurate) and write the names beside the ring.
static void write_names(FILE *f, const picture *pic, const panel *p)
{
    static const char *const place[KN_QUALITY_OWN] = {"right offset -1.4,-0.6", "center offset 0,-1.3",
                                                      "center offset 0,1.3"};
    for (kn_quality q = 0; q < KN_QUALITY_OWN; q++) {
        const kn_pareto_row *r = pic->named[q];
        char words[64] = "";
        // Skip this name if the same point was already marked for the previous name.
        if (!r || !p->named || (q > 0 && r == pic->named[q - 1])) continue;
        // One point may have several names, so collect all its names in one label.
        for (kn_quality same = q; same < KN_QUALITY_OWN && pic->named[same] == r; same++)
            snprintf(words + strlen(words), sizeof words - strlen(words), "%s%s", same > q ? ", " : "",
                     kn_quality_name(same));
        // The panel of the shape error shows rings without names, because the panel of the force error has the names.
        if (p->shape) words[0] = '\0';
        fprintf(f, "set label %d '%s' at %g,%g %s point pt 6 ps 2.2 lw 2 lc rgb 'black' front\n", (int)q + 1, words,
                r->median_us, height(p, r), strchr(words, ',') ? "left offset -0.8,-1.4" : place[q]);
    }
}

static void write_panel(FILE *f, const picture *pic, int number)
{
    const panel *p = &panels[number];
    fprintf(f, "unset label\nset title '%s' offset 0,-0.4\nset ylabel '%s' offset 0.8,0\n", p->title,
            number == 0 ? "error, %, relative L2" : "");
    fprintf(f, "set origin %g,0.19\nset size %g,0.74\n", (double)number / PANELS, 1.0 / PANELS);
    write_ranges(f, pic, p);
    write_names(f, pic, p);
    fprintf(f, "plot ");
    // Draw the Pareto fronts: one of all lattices, or one for each lattice.
    for (int l = p->all ? -1 : 0; l < (p->all ? 0 : pic->lattices); l++)
        fprintf(f, "$front%d_%d using 1:2 with steps lw 2.5 lc rgb '#90%s' notitle, ", number, l + 1,
                l < 0 ? "000000" : kn_plot_colour[l]);
    // Draw a thin line from each point's median to its p90.
    for (int l = 0; l < pic->lattices && !p->all; l++)
        fprintf(f,
                "$points%d using ($3==%d ? $1 : NaN):2:($6-$1):(0) with vectors nohead lw 1.2 lc rgb '#b0%s' "
                "notitle, ",
                number, l, kn_plot_colour[l]);
    // Draw the points, with one plot for each lattice and marker that occur together.
    for (int l = 0; l < pic->lattices; l++)
        for (int m = 0; m < MARKERS; m++)
            if (pic->used[l][m])
                fprintf(f,
                        "$points%d using ($3==%d && $4==%d ? $1 : NaN):2 with points pt %d ps 1.2 "
                        "lc rgb '#%s' notitle, ",
                        number, l, m, markers[m].type, kn_plot_colour[l]);
    // Draw a red cross on each point that chatters or is latched.
    if (pic->any_bad)
        fprintf(f, "$points%d using ($5==1 ? $1 : NaN):2 with points pt 2 ps 1.8 lw 2 lc rgb '#cc0000' notitle, ",
                number);
    fprintf(f, "NaN notitle\n");
}

// Write the legend below the panels, as the key of a plot without axes.
static void write_legend(FILE *f, const picture *pic)
{
    fprintf(f, "unset title\nunset xlabel\nunset ylabel\nunset border\nunset tics\nunset grid\nunset logscale\n"
               "unset label\nset key at screen 0.5,0.01 center bottom font 'sans,10' maxrows 3 Left reverse\n"
               "set key samplen 1.5 width 1 "
               "spacing 1.3\nset origin 0,0\nset size 1,0.19\nset xrange [0:1]\nset yrange [0:1]\nplot ");
    for (int l = 0; l < pic->lattices; l++) {
        const kn_pareto_row *r = pic->front->row;
        char text[100] = "", off[48] = "";
        // Find any point of this lattice. All points of one lattice have the same spacing and lattice error.
        while (r->run->nodes != pic->nodes[l]) r++;
        if (r->run->spacing_m > 0) snprintf(text, sizeof text, "%.3g mm, ", 1e3 * r->run->spacing_m);
        if (r->force.lattice > 0)
            snprintf(off, sizeof off, ": force %.1f %% from %.3g mm", 100 * r->force.lattice,
                     1e3 * pic->front->finest_m);
        fprintf(f, "NaN with lines lw 5 lc rgb '#%s' title '%s%d nodes%s', ", kn_plot_colour[l], text, pic->nodes[l],
                off);
    }
    for (int m = 0; m < MARKERS; m++) {
        bool any = false;
        for (int l = 0; l < pic->lattices; l++) any |= pic->used[l][m];
        if (any)
            fprintf(f, "NaN with points pt %d ps 1.3 lc rgb '#555555' title '%s', ", markers[m].type, markers[m].name);
    }
    fprintf(f, "NaN with lines lw 1.2 lc rgb '#999999' title 'to its p90', ");
    if (pic->any_bad) fprintf(f, "NaN with points pt 2 ps 1.6 lw 2 lc rgb '#cc0000' title 'chatters or latched', ");
    fprintf(f, "NaN notitle\n");
}

static void write_script(FILE *f, const picture *pic)
{
    char title[200];
    // Write the data blocks first, because the plot commands that follow refer to them.
    for (int p = 0; p < PANELS; p++) {
        for (int l = -1; l < pic->lattices; l++) write_front(f, pic, p, l);
        write_points(f, pic, p);
    }
    snprintf(title, sizeof title, "%s: processor time of a tick against its error, one core", pic->plan->scene->name);
    kn_plot_panels(f, title);
    fprintf(f, "set logscale xy\n"
               "set lmargin 9\nset rmargin 1.8\nset xlabel 'median of a 1 ms tick under the tool, µs' offset 0,0.4\n");
    for (int p = 0; p < PANELS; p++) write_panel(f, pic, p);
    write_legend(f, pic);
    fprintf(f, "unset multiplot\n");
}

int kn_pareto_chart_draw(const kn_pareto_front *front, const kn_sweep_plan *plan,
                         const kn_pareto_row *const named[KN_QUALITY_OWN], const char *path)
{
    int code;
    picture pic = {.front = front, .plan = plan, .named = named};
    // Collect the lattices and the markers that occur among the points.
    for (int i = 0; i < front->count; i++) {
        const kn_pareto_row *r = &front->row[i];
        bool begins = i == 0 || r->run->nodes != r[-1].run->nodes;
        if (begins && pic.lattices < LATTICES) pic.nodes[pic.lattices++] = r->run->nodes;
        pic.used[lattice_number(&pic, r)][marker_of(r, plan)] = true;
        pic.any_bad |= !usable(r);
    }
    FILE *f = kn_plot_open("tradeoff", path, 1280, 560, &code);
    if (!f) return code;
    write_script(f, &pic);
    return kn_plot_close(f, "tradeoff", path);
}
