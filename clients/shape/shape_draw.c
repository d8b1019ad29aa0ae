// The plot of `knead identify shape`, by gnuplot.
#include "clients/shape/shape_report.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include "clients/knead/plot.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

// width and height of the plot [pixels]; largest number of heights drawn along one axis of a map
enum { WIDE = 1180, HIGH = 900, ACROSS = 200 };

// Write one map of heights, or of the difference a - b, thinned to about ACROSS heights along each axis.
static void map(FILE *f, const kn_range *r, const uint16_t *a, double a_step_m, const uint16_t *b, double b_step_m)
{
    const int every = (r->width > r->height ? r->width : r->height) / ACROSS + 1;
    for (int y = 0; y < r->height; y += every)
        for (int x = 0; x < r->width; x += every) {
            const size_t at = (size_t)y * (size_t)r->width + (size_t)x;
            const double z_m = a[at] == 0 || (b && b[at] == 0)
                                   ? (double)NAN
                                   : (a[at] - 1) * a_step_m - (b ? (b[at] - 1) * b_step_m : 0);
            fprintf(f, "%.5g %.5g %.5g\n", 1e3 * (r->left_m + x * r->pixel_m), 1e3 * (r->top_m - y * r->pixel_m),
                    1e3 * z_m);
        }
    fputs("e\n", f);
}

// Draw the measured image, the fitted structure in the same frame, and the difference.
static void draw_maps(FILE *f, const kn_evidence *e, const kn_candidate *best, uint16_t *level)
{
    const kn_relief *r = &e->relief[0];
    const kn_surface *s = best->best.surface;
    const double most = ceil(3e3 * hypot(best->misfit[0].height_m, r->noise_m) / 0.05) * 0.05;
    kn_range frame = r->frame;
    frame.left_m += best->shift_m[0];
    frame.top_m += best->shift_m[1];
    frame.step_m = 1e-6 * ceil(3 * r->tall_m / 0.065534);
    kn_range_draw(&frame, (const float(*)[3])best->best.pressed.shape_m[0], s->triangle_count,
                  (const int(*)[3])s->triangle, level);
    fprintf(f,
            "set size ratio -1\nset xlabel 'x, mm'\nset ylabel 'y, mm'\nset cblabel 'height, mm'\n"
            "set palette defined (0 '#440154', 1 '#3b528b', 2 '#21918c', 3 '#5ec962', 4 '#fde725')\n"
            "set cbrange [%g:%g]\nset title 'measured'\nplot '-' with image notitle\n",
            1e3 * r->frame.lowest_m, 1e3 * r->frame.highest_m);
    map(f, &frame, r->level, r->frame.step_m, NULL, 0);
    fprintf(f, "set title 'found: %s'\nplot '-' with image notitle\n", best->name);
    map(f, &frame, level, frame.step_m, NULL, 0);
    fprintf(f,
            "set palette defined (-1 '#0072b2', 0 '#f4f4f4', 1 '#d55e00')\nset cbrange [%g:%g]\n"
            "set cblabel 'found - measured, mm'\nset title 'difference'\nplot '-' with image notitle\n",
            -most, most);
    map(f, &frame, level, frame.step_m, r->level, r->frame.step_m);
}

// Draw the measured and the fitted force over time.
static void draw_force(FILE *f, const kn_evidence *e, const kn_candidate *best)
{
    double residual[KN_PULL_BINS], model_n[KN_PULL_BINS];
    if (!e->pulled) return;
    kn_pull_compare(&e->pull, &e->press, &best->best.pressed, residual, model_n);
    fputs("set size noratio\nset title 'force'\nset xrange [*:] noextend\nset xlabel 'time, s'\nset ylabel 'force, "
          "N'\nset key top right\n"
          "plot '-' with points lt 1 ps 0.5 title 'measured', '-' with lines lt 2 title 'found'\n",
          f);
    for (int pass = 0; pass < 2; pass++) {
        for (int b = 0; b < e->pull.bins; b++)
            fprintf(f, "%.6g %.6g\n", e->pull.bin_s[b], pass ? model_n[b] : e->pull.bin_n[b]);
        fputs("e\n", f);
    }
}

int kn_shape_draw(const kn_shape_options *o, const kn_evidence *e, const kn_candidate *best)
{
    const kn_range *frame = &e->relief[0].frame;
    const bool pictured = frame->width > 0;
    int code = KN_EXIT_OK;
    uint16_t *level = malloc((size_t)frame->width * (size_t)frame->height * sizeof *level + 1);
    if (!level) return kn_complain("identify shape", KN_EXIT_INTERNAL, "out of memory");
    FILE *f = kn_plot_open("identify shape", o->png, WIDE, HIGH, &code);
    if (f) {
        fputs(pictured ? "set multiplot layout 2,2\n" : "", f);
        if (pictured) draw_maps(f, e, best, level);
        draw_force(f, e, best);
        fputs(pictured ? "unset multiplot\n" : "", f);
        code = kn_plot_close(f, "identify shape", o->png);
    }
    free(level);
    return code;
}
