#ifndef KN_CLIENTS_REPORT_PLOT_PANELS_H
#define KN_CLIENTS_REPORT_PLOT_PANELS_H
// Plots that compare measured values with those of a model. A plot consists of panels with points and lines, and is
// drawn by clients/cli/plot.h.
//
//     kn_figure_panel p = {.x_label = "time, s", .y_label = "strain"};
//     kn_figure_add(&p, (kn_figure_series){"50 gf", n, time_s, strain, .look = KN_FIGURE_POINTS, .hue = 1});
//     kn_figure_add(&p, (kn_figure_series){"fit", n, time_s, fitted, .look = KN_FIGURE_LINE, .hue = 1});
//     code = kn_figure_draw("identify creep", "fit.png", "dough", &p, 1, 1);
#include <stdbool.h>

#define KN_FIGURE_SERIES 72 // limit of series in a panel: points and a line for each of 32 curves, and 8 more

typedef enum kn_figure_look { KN_FIGURE_POINTS, KN_FIGURE_LINE, KN_FIGURE_DASHES } kn_figure_look;

typedef struct kn_figure_series {
    const char *name; // name in the legend; NULL: the series is not in the legend
    int count;        // number of values in x[] and in y[]
    // Owned by the caller; both must stay valid until kn_figure_draw returns. A point is not drawn if a value is not
    // finite, or is not above 0 on a logarithmic axis.
    const double *x, *y;
    double x_scale, y_scale; // factors on x and y; 0 counts as 1
    kn_figure_look look;
    int hue; // colour: number of a line type of plot.gp, from 1 on; the colours repeat after 8; 0: black
} kn_figure_series;

typedef struct kn_figure_panel {
    const char *title, *x_label, *y_label; // title NULL: the panel has no title
    bool log_x, log_y;                     // whether the axis is logarithmic
    double band;                           // a grey band is drawn from y = -band to y = band; 0: no band
    int series;                            // number of series in of[]
    kn_figure_series of[KN_FIGURE_SERIES];
} kn_figure_panel;

void kn_figure_add(kn_figure_panel *panel, kn_figure_series series); // series beyond KN_FIGURE_SERIES are ignored

// Draw the panels to the PNG file `path`, in rows of `across` panels. If a panel has at most four names, its legend is
// in the corner with the fewest points. If a panel has more names, one common legend is drawn below all panels. Return
// 0, or print an error and return an exit code.
int kn_figure_draw(const char *subcommand, const char *path, const char *title, const kn_figure_panel *panel,
                   int panels, int across);

#endif
