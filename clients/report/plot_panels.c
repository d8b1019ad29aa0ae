#include "clients/report/report_page.h"
#include "clients/cli/plot.h"
#include <math.h>
#include <stdio.h>

// sizes of the parts of a plot [pixels]
enum { PANEL = 600, HIGH = 446, HEAD = 40, LEFT = 92, RIGHT = 26, TOP = 38, FOOT = 62 };
// largest number of names for a legend in a panel's corner; with more names, the legend is below all panels
enum { IN_A_CORNER = 4 };

void kn_figure_add(kn_figure_panel *panel, kn_figure_series series)
{
    if (series.x_scale == 0) series.x_scale = 1;
    if (series.y_scale == 0) series.y_scale = 1;
    if (panel->series < KN_FIGURE_SERIES && series.count > 0) panel->of[panel->series++] = series;
}

// Compute the scaled point i of a series. Return false if the point cannot be drawn on the panel's axes.
static bool point(const kn_figure_panel *p, const kn_figure_series *s, int i, double at[2])
{
    at[0] = s->x[i] * s->x_scale;
    at[1] = s->y[i] * s->y_scale;
    return isfinite(at[0]) && isfinite(at[1]) && !(p->log_x && at[0] <= 0) && !(p->log_y && at[1] <= 0);
}

// ---- the corner of a panel for the legend

typedef struct extent {
    double low[2], high[2];
} extent;

static void on_axes(const kn_figure_panel *p, double at[2])
{
    if (p->log_x) at[0] = log(at[0]);
    if (p->log_y) at[1] = log(at[1]);
}

static extent measure(const kn_figure_panel *p)
{
    extent e = {{INFINITY, INFINITY}, {-INFINITY, -INFINITY}};
    for (int s = 0; s < p->series; s++)
        for (int i = 0; i < p->of[s].count; i++) {
            double at[2];
            if (!point(p, &p->of[s], i, at)) continue;
            on_axes(p, at);
            for (int k = 0; k < 2; k++) e.low[k] = fmin(e.low[k], at[k]), e.high[k] = fmax(e.high[k], at[k]);
        }
    return e;
}

// Return the corner in which the legend hides the fewest points. For each series, compute the share of its points that
// lie in this corner. Set *hidden to the sum of the shares of all series. Shares give each series the same weight, even
// if one series has more points than another.
static const char *key_corner(const kn_figure_panel *p, const extent *e, double *hidden)
{
    static const char *const names[2][2] = {{"bottom left", "bottom right"}, {"top left", "top right"}};
    // small extra weights prefer top right and bottom left if several corners are empty
    double weight[2][2] = {{0, 1e-3}, {1e-3, 0}};
    for (int s = 0; s < p->series; s++)
        for (int i = 0; i < p->of[s].count; i++) {
            double at[2];
            if (!point(p, &p->of[s], i, at)) continue;
            on_axes(p, at);
            // Count the points in each quarter of the panel, except near its middle lines.
            const double x = (at[0] - e->low[0]) / (e->high[0] - e->low[0]),
                         y = (at[1] - e->low[1]) / (e->high[1] - e->low[1]);
            if (fabs(x - 0.5) > 0.12 && fabs(y - 0.5) > 0.12) weight[y > 0.5][x > 0.5] += 1.0 / p->of[s].count;
        }
    int best = 3;
    for (int c = 0; c < 4; c++)
        if (weight[c >> 1][c & 1] < weight[best >> 1][best & 1]) best = c;
    *hidden = weight[best >> 1][best & 1];
    return names[best >> 1][best & 1];
}

// ---- output for gnuplot

// Write the data of a panel as gnuplot data blocks.
static void put_data(FILE *f, int number, const kn_figure_panel *p)
{
    for (int s = 0; s < p->series; s++) {
        fprintf(f, "$d%d_%d << END\n", number, s);
        for (int i = 0; i < p->of[s].count; i++) {
            double at[2];
            if (point(p, &p->of[s], i, at)) fprintf(f, "%.9g %.9g\n", at[0], at[1]);
            // an empty line in the data makes a gap in the plotted line
            else if (p->of[s].look != KN_FIGURE_POINTS) fputc('\n', f);
        }
        fprintf(f, "END\n");
    }
}

static int names(const kn_figure_panel *p)
{
    int n = 0;
    for (int s = 0; s < p->series; s++) n += p->of[s].name != NULL;
    return n;
}

static const char *colour_of(const kn_figure_series *s)
{
    return s->hue > 0 ? kn_plot_colour[(s->hue - 1) % KN_PLOT_COLOURS] : "000000";
}

static void put_series(FILE *f, int number, int index, const kn_figure_series *s, bool named)
{
    static const char *const looks[] = {"points pt 7 ps 0.45", "lines lw 2", "lines lw 2 dt 2"};
    fprintf(f, "$d%d_%d using 1:2 with %s lc rgb '#%s%s' ", number, index, looks[s->look],
            s->look == KN_FIGURE_POINTS ? "80" : "", colour_of(s));
    if (s->name && named) {
        fputs("title ", f);
        kn_plot_quote(f, s->name);
    } else {
        fputs("notitle", f);
    }
    fputs(", ", f);
}

static void put_panel(FILE *f, int number, const kn_figure_panel *p)
{
    fprintf(f, "unset logscale\nset format '%%g'\nset xrange [*:*]\nset yrange [*%s:*]\nunset object\n",
            p->log_y || p->band > 0 ? "" : "<0");
    if (p->log_x) fprintf(f, "set logscale x\n");
    if (p->log_y) fprintf(f, "set logscale y\n");
    if (p->band > 0)
        fprintf(f, "set object 1 rectangle from graph 0, first %g to graph 1, first %g behind fc rgb '#eeeeee' lw 0\n",
                -p->band, p->band);
    kn_plot_label(f, "title", p->title);
    kn_plot_label(f, "xlabel", p->x_label);
    kn_plot_label(f, "ylabel", p->y_label);
    double hidden;
    const extent e = measure(p);
    const char *corner = key_corner(p, &e, &hidden);
    const int rows = names(p) <= IN_A_CORNER ? names(p) : 0;
    // all corners hold points, so make room for the names above the points
    if (rows > 0 && hidden > 0.01) {
        fprintf(f, "set offsets 0, 0, graph %g, 0\n", 0.06 + 0.075 * rows);
        corner = "top right";
    } else {
        fprintf(f, "set offsets 0, 0, 0, 0\n");
    }
    fprintf(f, "set key %s opaque\nset key font 'sans,10'\nplot ", corner);
    // a panel without points needs a range, otherwise gnuplot fails
    if (e.low[0] > e.high[0]) fprintf(f, "[1:10] [1:10] ");
    for (int s = 0; s < p->series; s++) put_series(f, number, s, &p->of[s], names(p) <= IN_A_CORNER);
    fprintf(f, "NaN notitle\n");
}

// Place a panel on the page, so that the axes of all panels line up.
static void put_place(FILE *f, int column, int row, int wide, int high)
{
    const double top = high - HEAD - HIGH * row;
    fprintf(f,
            "set lmargin at screen %g\nset rmargin at screen %g\nset tmargin at screen %g\nset bmargin at screen %g\n",
            (double)(PANEL * column + LEFT) / wide, (double)(PANEL * (column + 1) - RIGHT) / wide, (top - TOP) / high,
            (top - HIGH + FOOT) / high);
}

// Return the first panel that has too many names for a corner, or NULL. The names of this panel form the legend below
// all panels, so a name must have the same colour in every panel.
static const kn_figure_panel *legend_of(const kn_figure_panel *panel, int panels)
{
    for (int i = 0; i < panels; i++)
        if (names(&panel[i]) > IN_A_CORNER) return &panel[i];
    return NULL;
}

static int legend_rows(const kn_figure_panel *p, int across)
{
    return p ? (names(p) + 4 * across - 1) / (4 * across) : 0;
}

// Draw the legend with the names of the panel p below all panels.
static void put_legend(FILE *f, const kn_figure_panel *p, int rows, int high)
{
    kn_plot_legend(f, true, rows, high);
    for (int s = 0; s < p->series; s++) {
        if (!p->of[s].name) continue;
        fprintf(f, "NaN with %s lc rgb '#%s' title ",
                p->of[s].look == KN_FIGURE_POINTS ? "points pt 7 ps 0.9" : "lines lw 2", colour_of(&p->of[s]));
        kn_plot_quote(f, p->of[s].name);
        fputs(", ", f);
    }
    fprintf(f, "NaN notitle\n");
}

int kn_figure_draw(const char *subcommand, const char *path, const char *title, const kn_figure_panel *panel,
                   int panels, int across)
{
    const kn_figure_panel *many = legend_of(panel, panels);
    const int rows = legend_rows(many, across), wide = PANEL * across;
    const int high = HEAD + HIGH * ((panels + across - 1) / across) + (rows ? KN_PLOT_ROW * rows + 8 : 0);
    int code;
    FILE *f = kn_plot_open(subcommand, path, wide, high, &code);
    if (!f) return code;
    for (int i = 0; i < panels; i++) put_data(f, i, &panel[i]);
    kn_plot_panels(f, title);
    fprintf(f, "set grid\n");
    for (int i = 0; i < panels; i++) {
        put_place(f, i % across, i / across, wide, high);
        put_panel(f, i, &panel[i]);
    }
    if (rows) put_legend(f, many, rows, high);
    fprintf(f, "unset multiplot\n");
    return kn_plot_close(f, subcommand, path);
}
