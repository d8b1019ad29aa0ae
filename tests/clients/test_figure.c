// Panels of points and lines: values that cannot be drawn are left out, and the picture is as large as its panels
// need.
#include "clients/report/report_page.h"
#include "clients/cli/commands.h"
#include "tests/clients/heard.h"

// Draw a figure, and read width and height of the PNG; 0 if there is no picture.
static int draw(const kn_figure_panel *panel, int panels, int across, int size[2])
{
    unsigned char head[25] = {0};
    const int code = kn_figure_draw("identify creep", "figure.png", "it's a test", panel, panels, across);
    bool png = kn_read("figure.png", (char *)head, sizeof head) == 24 && !memcmp(head + 1, "PNG", 3);
    for (int i = 0; i < 2; i++) size[i] = png ? head[16 + 4 * i + 2] << 8 | head[16 + 4 * i + 3] : 0;
    return code;
}

TEST("a figure with NaN, infinite and negative values is drawn, also on logarithmic axes")
{
    if (system("command -v gnuplot >/dev/null 2>&1") != 0) SKIP("gnuplot is not installed");
    int size[2];
    const double x[] = {0, 1, 2, 3}, y[] = {1, NAN, INFINITY, -4};
    static kn_figure_panel p = {.title = "a", .x_label = "b", .y_label = "c", .log_x = true, .log_y = true, .band = 2};
    kn_figure_add(&p, (kn_figure_series){"points", 4, x, y, .hue = 1});
    kn_figure_add(&p, (kn_figure_series){"line", 4, x, y, .look = KN_FIGURE_LINE, .hue = 9});
    CHECK(draw(&p, 1, 1, size) == KN_EXIT_OK); // no point remains
    CHECK(size[0] == 600 && size[1] > 400);
    p.log_y = p.log_x = false;
    CHECK(draw(&p, 1, 1, size) == KN_EXIT_OK);
}

TEST("three panels in two columns take two rows, and many series names make the picture taller")
{
    int few[2], many[2];
    const double x[] = {0, 1, 2}, y[] = {1, 3, 2};
    static kn_figure_panel p[3];
    for (int i = 0; i < 3; i++) kn_figure_add(&p[i], (kn_figure_series){"a", 3, x, y, .look = KN_FIGURE_LINE});
    CHECK(draw(p, 3, 2, few) == KN_EXIT_OK);
    CHECK(few[0] == 1200 && few[1] > 800);
    for (int i = 0; i < 6; i++) kn_figure_add(&p[0], (kn_figure_series){"b", 3, x, y, .hue = i});
    CHECK(draw(p, 3, 2, many) == KN_EXIT_OK);
    CHECK(many[1] > few[1]);
    for (int i = 0; i < 2 * KN_FIGURE_SERIES; i++) kn_figure_add(&p[0], (kn_figure_series){"c", 3, x, y, .hue = i});
    CHECK(p[0].series == KN_FIGURE_SERIES);
    CHECK(draw(p, 1, 1, many) == KN_EXIT_OK);
}

TESTS_MAIN
