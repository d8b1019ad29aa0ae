#ifndef KN_CLIENTS_IDENTIFY_FIGURE_H
#define KN_CLIENTS_IDENTIFY_FIGURE_H
// Pictures of what was measured beside what a model makes of it: panels of points and lines, by clients/knead/plot.h.
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
    const char *name; // NULL: not in the key
    int count;
    const double *x,
        *y; // the caller's until drawn; what is not finite, or not above 0 on a logarithmic axis, is left out
    double x_scale, y_scale; // 0: 1
    kn_figure_look look;
    int hue; // plot.gp's line types, 1.., again from the first after the eighth; 0: black
} kn_figure_series;

typedef struct kn_figure_panel {
    const char *title, *x_label, *y_label; // title NULL: none
    bool log_x, log_y;
    double band; // grey from -band to band, of residuals; 0: none
    int series;
    kn_figure_series of[KN_FIGURE_SERIES];
} kn_figure_panel;

void kn_figure_add(kn_figure_panel *panel, kn_figure_series series); // one too many is left out

// panels in rows of `across`. Up to four names stand in the corner where the fewest points are, more of them below all
// panels, once. An exit code.
int kn_figure_draw(const char *subcommand, const char *path, const char *title, const kn_figure_panel *panel,
                   int panels, int across);

#endif
