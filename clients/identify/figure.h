#ifndef KN_CLIENTS_IDENTIFY_FIGURE_H
#define KN_CLIENTS_IDENTIFY_FIGURE_H
// Plots of measured values beside a model's: panels of points and lines, drawn by clients/knead/plot.h.
//
//     kn_figure_panel p = {.x_label = "time, s", .y_label = "strain"};
//     kn_figure_add(&p, (kn_figure_series){"50 gf", n, time_s, strain, .look = KN_FIGURE_POINTS, .hue = 1});
//     kn_figure_add(&p, (kn_figure_series){"fit", n, time_s, fitted, .look = KN_FIGURE_LINE, .hue = 1});
//     code = kn_figure_draw("identify creep", "fit.png", "dough", &p, 1, 1);
#include <stdbool.h>

#define KN_FIGURE_SERIES 72 // points and a line for each of 32 curves, and a few more
#define KN_FIGURE_PANELS 6

typedef enum kn_figure_look { KN_FIGURE_POINTS, KN_FIGURE_LINE, KN_FIGURE_DASHES, KN_FIGURE_STAIRS } kn_figure_look;

typedef struct kn_figure_series {
    const char *name; // NULL: not in the legend
    int count;
    // Owned by the caller; must stay valid until kn_figure_draw returns. Values that are not finite, or not above 0 on
    // a logarithmic axis, are left out.
    const double *x, *y;
    double x_scale, y_scale; // factors on x and y; 0 counts as 1
    kn_figure_look look;
    int hue; // colour: a line type of plot.gp, from 1 on, repeating after the eighth; 0: black
} kn_figure_series;

typedef struct kn_figure_panel {
    const char *title, *x_label, *y_label; // title NULL: none
    bool log_x, log_y;
    double band; // grey band of residuals from -band to band; 0: none
    int series;
    kn_figure_series of[KN_FIGURE_SERIES];
} kn_figure_panel;

void kn_figure_add(kn_figure_panel *panel, kn_figure_series series); // ignored beyond KN_FIGURE_SERIES

// Draw the panels in rows of `across`. Up to four names are shown in the corner with the fewest points; more names are
// shown once, below all panels. Return an exit code.
int kn_figure_draw(const char *subcommand, const char *path, const char *title, const kn_figure_panel *panel,
                   int panels, int across);

#endif
