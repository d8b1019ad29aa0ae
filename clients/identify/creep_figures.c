#include "clients/identify/creep_figures.h"
#include "clients/report/plot_panels.h"
#include "clients/identify/creep_fit.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { LAW = 100 }; // number of points in the plotted curve of a damper law

enum { MEANS = 40 }; // number of mean residuals drawn in a plot

typedef struct numbers { // values of one curve, in one block of memory
    double *fitted, *stress, *fitted_stress, *left, *since, *came_back, *fitted_back, *equation5;
    int means;
    double mean_s[MEANS], mean_left[MEANS];
} numbers;

static bool allocate(numbers *n, int count)
{
    double *all = calloc(8 * (size_t)count, sizeof *all);
    if (!all) return false;
    double **const each[] = {&n->fitted, &n->stress,    &n->fitted_stress, &n->left,
                             &n->since,  &n->came_back, &n->fitted_back,   &n->equation5};
    for (int i = 0; i < 8; i++) *each[i] = all + (size_t)i * (size_t)count;
    return true;
}

// Average the residuals of neighbouring readings and divide each mean by the standard deviation of the mean. A
// systematic deviation that is hidden in the noise of single readings becomes visible. Among the early readings a mean
// spans at most half of the time before it. Later each mean has the same number of readings.
static void average(numbers *n, const kn_curve *c)
{
    n->means = 0;
    for (int i = 0, end; i < c->count; i = end) {
        const double from = c->time_s[i];
        // A mean ends when it contains an equal share of the remaining readings, or when the time has grown by half.
        const int most = (c->count - i) / (MEANS - n->means) + 1;
        double time = 0, sum = 0;
        for (end = i; end < c->count && end - i < most && (end == i || c->time_s[end] < 1.5 * from); end++)
            time += c->time_s[end], sum += n->left[end];
        n->mean_s[n->means] = time / (end - i);
        n->mean_left[n->means++] = sum / sqrt(end - i);
        if (n->means == MEANS) break;
    }
}

// Compute the fitted strain, both stresses and the residuals of a curve.
static bool compute(numbers *n, const kn_curve *c, const kn_creep_fit *joint)
{
    if (!allocate(n, c->count)) return false;
    if (!kn_creep_fit_predict(&joint->material, c, n->fitted)) {
        free(n->fitted);
        return false;
    }
    kn_creep_stress(c, n->stress);
    for (int i = 0; i < c->count; i++) {
        n->fitted_stress[i] = kn_creep_load(c, c->time_s[i]) * (c->constant_area ? 1 : 1 - n->fitted[i]);
        n->left[i] = (c->value[i] - n->fitted[i]) * sqrt(c->weight[i]) / c->noise;
    }
    average(n, c);
    return true;
}

// Compute the recovered strain since the release, by measurement, by the joint fit and by equation 5. All three are
// counted from the strain of the joint fit at the release, so that they can be compared. Return the number of readings.
static int recover(numbers *n, const kn_curve *c, const kn_two_stage *s)
{
    int begin = 0;
    while (begin < c->count && c->time_s[begin] < s->release_s) begin++;
    if (begin == 0 || begin == c->count) return 0;
    // The strain at the release is that of the last reading before it, unless a reading is exactly there.
    const double released = n->fitted[c->time_s[begin] == s->release_s ? begin : begin - 1];
    for (int i = begin; i < c->count; i++) {
        n->since[i - begin] = c->time_s[i] - s->release_s;
        n->came_back[i - begin] = released - c->value[i];
        n->fitted_back[i - begin] = released - n->fitted[i];
        n->equation5[i - begin] = released - s->release_strain + kn_two_stage_recovered(s, n->since[i - begin]);
    }
    return c->count - begin;
}

// ---- the damper's law

typedef struct law {
    double stress[LAW], c2[LAW];
} law;

// Compute points of the damper law of a material over a range of stresses.
static void follow(law *l, const kn_material *m, double low_pa, double high_pa)
{
    for (int i = 0; i < LAW; i++) {
        l->stress[i] = low_pa + (high_pa - low_pa) * i / (LAW - 1);
        l->c2[i] = kn_material_c2(m, l->stress[i]);
    }
}

static kn_figure_panel damper_panel(const char *title)
{
    return (kn_figure_panel){.title = title, .x_label = "stress, kPa", .y_label = "damper c2, kPa s", .log_y = true};
}

static void add_law(kn_figure_panel *p, const law *l, const char *name, kn_figure_look look, int hue)
{
    kn_figure_add(p, (kn_figure_series){name, LAW, l->stress, l->c2, 1e-3, 1e-3, look, hue});
}

// ---- figures 6 to 9

static void add(kn_figure_panel *p, const char *name, int count, const double *x, const double *y, double scale,
                kn_figure_look look, int hue)
{
    kn_figure_add(p, (kn_figure_series){name, count, x, y, 1, scale, look, hue});
}

static int draw_paper(const char *subcommand, const char *path, const kn_curve *c, const kn_creep_fit *joint,
                      numbers *n, const kn_two_stage *s)
{
    static kn_figure_panel p[4];
    static law joint_law, stages_law;
    const double height = c->height_m > 0 ? 1e3 * c->height_m : 1;
    const char *displacement = c->height_m > 0 ? "displacement, mm" : "strain";
    p[0] = (kn_figure_panel){.title = "displacement (figure 6)", .x_label = "time, s", .y_label = displacement};
    add(&p[0], "measured", c->count, c->time_s, c->value, height, KN_FIGURE_POINTS, 1);
    add(&p[0], "identified", c->count, c->time_s, n->fitted, height, KN_FIGURE_LINE, 2);
    p[1] =
        (kn_figure_panel){.title = "stress, by equation 4 (figure 7)", .x_label = "time, s", .y_label = "stress, kPa"};
    add(&p[1], "from the measured displacement", c->count, c->time_s, n->stress, 1e-3, KN_FIGURE_POINTS, 1);
    add(&p[1], "from the identified displacement", c->count, c->time_s, n->fitted_stress, 1e-3, KN_FIGURE_LINE, 2);
    // If the paper's two stages could not be computed, figures 8 and 9 are left out.
    if (!s) return kn_figure_draw(subcommand, path, c->name, p, 2, 2);

    const int back = recover(n, c, s);
    p[2] = (kn_figure_panel){
        .title = "recovery (figure 8)", .x_label = "time since the release, s", .y_label = displacement};
    add(&p[2], "measured", back, n->since, n->came_back, height, KN_FIGURE_POINTS, 1);
    add(&p[2], "identified", back, n->since, n->fitted_back, height, KN_FIGURE_LINE, 2);
    add(&p[2], "equation 5 alone", back, n->since, n->equation5, height, KN_FIGURE_DASHES, 0);
    p[3] = damper_panel("damper (figure 9)");
    double low = INFINITY, high = 0;
    for (int i = 0; i < s->count; i++) low = fmin(low, s->stress_pa[i]), high = fmax(high, s->stress_pa[i]);
    // Both laws are drawn over the stresses of this curve.
    follow(&joint_law, &joint->material, low, high);
    follow(&stages_law, &s->material, low, high);
    kn_figure_add(&p[3], (kn_figure_series){"by subtraction", s->count, s->stress_pa, s->c2_pa_s, 1e-3, 1e-3,
                                            KN_FIGURE_POINTS, 1});
    add_law(&p[3], &joint_law, "identified", KN_FIGURE_LINE, 2);
    add_law(&p[3], &stages_law, "fitted to the points", KN_FIGURE_DASHES, 0);
    return kn_figure_draw(subcommand, path, c->name, p, 4, 2);
}

int kn_creep_figures_paper(const char *subcommand, const char *path, const kn_curve *curve, const kn_creep_fit *joint)
{
    numbers n;
    kn_two_stage stages;
    if (!compute(&n, curve, joint))
        return kn_complain(subcommand, KN_EXIT_DEVICE, "%s: not drawn, out of memory", path);
    const bool staged = kn_two_stage_fit(&stages, curve);
    int code = draw_paper(subcommand, path, curve, joint, &n, staged ? &stages : NULL);
    if (staged) kn_two_stage_free(&stages);
    free(n.fitted);
    return code;
}

// ---- all curves

typedef struct all { // too large for the stack
    numbers of[KN_CURVES_MAX];
    kn_two_stage stages[KN_CURVES_MAX];
    bool staged[KN_CURVES_MAX];
    kn_figure_panel panel[4];
    law law;
    int computed;
} all;

// Remove the values of c2 from the paper's two stages that differ from the fitted law by more than a factor of 10^1.5,
// since such values are only noise.
static void clip(kn_two_stage *s, const kn_material *m)
{
    for (int i = 0; i < s->count; i++)
        if (fabs(log10(s->c2_pa_s[i] / kn_material_c2(m, s->stress_pa[i]))) > 1.5) s->c2_pa_s[i] = NAN;
}

static void add_curve(all *a, int k, const kn_curve *c, const kn_creep_fit *joint)
{
    const numbers *n = &a->of[k];
    // Only the first panel names the curves, since a curve has the same colour in all panels.
    add(&a->panel[0], c->name, c->count, c->time_s, c->value, 1, KN_FIGURE_POINTS, k + 1);
    add(&a->panel[0], NULL, c->count, c->time_s, n->fitted, 1, KN_FIGURE_LINE, k + 1);
    add(&a->panel[1], NULL, c->count, c->time_s, c->value, 1, KN_FIGURE_POINTS, k + 1);
    add(&a->panel[1], NULL, c->count, c->time_s, n->fitted, 1, KN_FIGURE_LINE, k + 1);
    add(&a->panel[2], NULL, n->means, n->mean_s, n->mean_left, 1, KN_FIGURE_LINE, k + 1);
    // Add the points of the two stages to the damper panel, if this curve has them.
    a->staged[k] = kn_two_stage_fit(&a->stages[k], c);
    if (!a->staged[k]) return;
    const kn_two_stage *s = &a->stages[k];
    clip(&a->stages[k], &joint->material);
    kn_figure_add(&a->panel[3],
                  (kn_figure_series){NULL, s->count, s->stress_pa, s->c2_pa_s, 1e-3, 1e-3, KN_FIGURE_POINTS, k + 1});
}

// Compute and draw all curves in four panels.
static int draw_all(all *a, const char *subcommand, const char *path, int curves, const kn_curve *curve,
                    const kn_creep_fit *joint)
{
    a->panel[0] =
        (kn_figure_panel){.title = "points: measured; lines: identified", .x_label = "time, s", .y_label = "strain"};
    a->panel[1] = (kn_figure_panel){
        .title = "the same, logarithmic", .x_label = "time, s", .y_label = "strain", .log_x = true, .log_y = true};
    a->panel[2] = (kn_figure_panel){.title = "residuals, means of neighbours; grey: two standard deviations",
                                    .x_label = "time, s",
                                    .y_label = "(measured - identified)/deviation",
                                    .log_x = true,
                                    .band = 2};
    a->panel[3] = damper_panel("damper; points: by the first paper's two-stage method");
    for (int k = 0; k < curves; k++) {
        if (!compute(&a->of[k], &curve[k], joint))
            return kn_complain(subcommand, KN_EXIT_DEVICE, "%s: not drawn, out of memory", path);
        a->computed++;
        add_curve(a, k, &curve[k], joint);
    }
    follow(&a->law, &joint->material, joint->lowest_pa, joint->highest_pa);
    add_law(&a->panel[3], &a->law, "identified law", KN_FIGURE_LINE, 0);
    return kn_figure_draw(subcommand, path, "creep", a->panel, 4, 2);
}

int kn_creep_figures_fits(const char *subcommand, const char *path, int curves, const kn_curve *curve,
                          const kn_creep_fit *joint)
{
    all *a = calloc(1, sizeof *a);
    if (!a) return kn_complain(subcommand, KN_EXIT_DEVICE, "%s: not drawn, out of memory", path);
    int code = draw_all(a, subcommand, path, curves, curve, joint);
    for (int k = 0; k < curves; k++)
        if (a->staged[k]) kn_two_stage_free(&a->stages[k]);
    for (int k = 0; k < a->computed; k++) free(a->of[k].fitted);
    free(a);
    return code;
}
