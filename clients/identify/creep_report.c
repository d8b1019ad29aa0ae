#include "clients/identify/creep_report.h"
#include "clients/identify/creep_fit.h"
#include "clients/cli/commands.h"
#include "clients/cli/command.h"
#include <math.h>
#include <stdlib.h>

// LAW: number of points in the plotted curve of a damper law; MEANS: number of mean residuals drawn in a plot;
// PAPER_FIGURES: largest number of curves that are also plotted one by one
enum { LAW = 100, MEANS = 40, PAPER_FIGURES = 8 };

typedef struct curve_values { // values of one curve; the arrays are in one block of memory
    double *fitted, *stress, *fitted_stress, *left, *since, *came_back, *fitted_back, *equation5, *c2;
    int means;
    double mean_s[MEANS], mean_left[MEANS];
    bool staged; // whether the paper's two stages could be computed
    kn_two_stage stages;
} curve_values;

static void release(curve_values *v)
{
    if (v->staged) kn_two_stage_free(&v->stages);
    free(v->fitted);
    *v = (curve_values){0};
}

static bool allocate(curve_values *v, int count)
{
    double **const each[] = {&v->fitted,    &v->stress,      &v->fitted_stress, &v->left, &v->since,
                             &v->came_back, &v->fitted_back, &v->equation5,     &v->c2};
    *v = (curve_values){.fitted = calloc(9 * (size_t)count, sizeof(double))};
    for (int i = 1; v->fitted && i < 9; i++) *each[i] = v->fitted + (size_t)i * (size_t)count;
    return v->fitted;
}

// Average the residuals of neighbouring readings and divide each mean by the standard deviation of the mean. A
// systematic deviation that is hidden in the noise of single readings becomes visible. Among the early readings a mean
// spans at most half of the time before it. Later each mean has the same number of readings.
static void average(curve_values *n, const kn_curve *c)
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

// Take c2 from the paper's two stages. Values that differ from the fitted law by more than a factor of 10^1.5 are only
// noise, so they are left out.
static void take_c2(curve_values *v, const kn_material *m)
{
    for (int i = 0; i < v->stages.count; i++) {
        const double c2 = v->stages.c2_pa_s[i];
        v->c2[i] = fabs(log10(c2 / kn_material_c2(m, v->stages.stress_pa[i]))) > 1.5 ? NAN : c2;
    }
}

// Compute the fitted strain, both stresses and the residuals of a curve, and its two stages.
static bool compute(curve_values *v, const kn_curve *c, const kn_material *material)
{
    if (!allocate(v, c->count)) return false;
    if (!kn_creep_fit_predict(material, c, v->fitted)) {
        release(v);
        return false;
    }
    kn_creep_stress(c, v->stress);
    for (int i = 0; i < c->count; i++) {
        v->fitted_stress[i] = kn_creep_load(c, c->time_s[i]) * (c->constant_area ? 1 : 1 - v->fitted[i]);
        v->left[i] = (c->value[i] - v->fitted[i]) * sqrt(c->weight[i]) / c->noise;
    }
    average(v, c);
    v->staged = kn_two_stage_fit(&v->stages, c);
    if (v->staged) take_c2(v, material);
    return true;
}

// Compute the recovered strain since the release, by measurement, by the joint fit and by equation 5. All three are
// counted from the strain of the joint fit at the release, so that they can be compared. Return the number of readings.
static int recover(curve_values *n, const kn_curve *c)
{
    const kn_two_stage *s = &n->stages;
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

static int draw_paper(const kn_identification *w, const char *path, const kn_curve *c, curve_values *n)
{
    const kn_two_stage *s = &n->stages;
    static kn_figure_panel p[4];
    static law joint_law, stages_law;
    const double height = c->height_m > 0 ? 1e3 * c->height_m : 1;
    const char *displacement = c->height_m > 0 ? "displacement, mm" : "strain";
    p[0] = (kn_figure_panel){.title = "displacement (figure 6)", .x_label = "time, s", .y_label = displacement};
    kn_identify_plot(&p[0], "measured", c->count, c->time_s, c->value, height, KN_FIGURE_POINTS, 1);
    kn_identify_plot(&p[0], "identified", c->count, c->time_s, n->fitted, height, KN_FIGURE_LINE, 2);
    p[1] =
        (kn_figure_panel){.title = "stress, by equation 4 (figure 7)", .x_label = "time, s", .y_label = "stress, kPa"};
    kn_identify_plot(&p[1], "from the measured displacement", c->count, c->time_s, n->stress, 1e-3, KN_FIGURE_POINTS,
                     1);
    kn_identify_plot(&p[1], "from the identified displacement", c->count, c->time_s, n->fitted_stress, 1e-3,
                     KN_FIGURE_LINE, 2);
    // If the paper's two stages could not be computed, figures 8 and 9 are left out.
    if (!n->staged) return kn_figure_draw(w->opt.subcommand, path, c->name, p, 2, 2);

    const int back = recover(n, c);
    p[2] = (kn_figure_panel){
        .title = "recovery (figure 8)", .x_label = "time since the release, s", .y_label = displacement};
    kn_identify_plot(&p[2], "measured", back, n->since, n->came_back, height, KN_FIGURE_POINTS, 1);
    kn_identify_plot(&p[2], "identified", back, n->since, n->fitted_back, height, KN_FIGURE_LINE, 2);
    kn_identify_plot(&p[2], "equation 5 alone", back, n->since, n->equation5, height, KN_FIGURE_DASHES, 0);
    p[3] = damper_panel("damper (figure 9)");
    double low = INFINITY, high = 0;
    for (int i = 0; i < s->count; i++) low = fmin(low, s->stress_pa[i]), high = fmax(high, s->stress_pa[i]);
    // Both laws are drawn over the stresses of this curve.
    follow(&joint_law, &w->creep.material, low, high);
    follow(&stages_law, &s->material, low, high);
    kn_figure_add(&p[3], (kn_figure_series){"by subtraction", s->count, s->stress_pa, s->c2_pa_s, 1e-3, 1e-3,
                                            KN_FIGURE_POINTS, 1});
    add_law(&p[3], &joint_law, "identified", KN_FIGURE_LINE, 2);
    add_law(&p[3], &stages_law, "fitted to the points", KN_FIGURE_DASHES, 0);
    return kn_figure_draw(w->opt.subcommand, path, c->name, p, 4, 2);
}

static int out_of_memory(const kn_identification *w, const char *path)
{
    return kn_complain(w->opt.subcommand, KN_EXIT_DEVICE, "%s: not drawn, out of memory", path);
}

// Draw figures 6 to 9 of the first paper for one creep curve whose load was removed. Each figure shows the identified
// element beside the data. If the load was never removed, or if the curve is too short for the paper's two stages
// (creep_fit.h), only figures 6 and 7 are drawn.
static int paper_figures(const kn_identification *w, const char *path, const kn_curve *curve)
{
    curve_values n;
    if (!compute(&n, curve, &w->creep.material)) return out_of_memory(w, path);
    int code = draw_paper(w, path, curve, &n);
    release(&n);
    return code;
}

// ---- all curves

static void add_curve(kn_figure_panel p[4], const kn_curve *c, const curve_values *n, int hue)
{
    // Only the first panel names the curves, since a curve has the same colour in all panels.
    for (int i = 0; i < 2; i++) {
        kn_identify_plot(&p[i], i ? NULL : c->name, c->count, c->time_s, c->value, 1, KN_FIGURE_POINTS, hue);
        kn_identify_plot(&p[i], NULL, c->count, c->time_s, n->fitted, 1, KN_FIGURE_LINE, hue);
    }
    kn_identify_plot(&p[2], NULL, n->means, n->mean_s, n->mean_left, 1, KN_FIGURE_LINE, hue);
    const kn_two_stage *s = &n->stages;
    if (!n->staged) return;
    kn_figure_add(&p[3], (kn_figure_series){NULL, s->count, s->stress_pa, n->c2, 1e-3, 1e-3, KN_FIGURE_POINTS, hue});
}

int kn_creep_draw(kn_identification *w, const char *path)
{
    static curve_values of[KN_CURVES_MAX]; // these are too large for the stack
    static kn_figure_panel p[4];
    static law identified;
    int code = KN_EXIT_OK;
    p[0] = (kn_figure_panel){.title = "points: measured; lines: identified", .x_label = "time, s", .y_label = "strain"};
    p[1] = (kn_figure_panel){
        .title = "the same, logarithmic", .x_label = "time, s", .y_label = "strain", .log_x = true, .log_y = true};
    p[2] = (kn_figure_panel){.title = "residuals, means of neighbours; grey: two standard deviations",
                             .x_label = "time, s",
                             .y_label = "(measured - identified)/deviation",
                             .log_x = true,
                             .band = 2};
    p[3] = damper_panel("damper; points: by the first paper's two-stage method");
    for (int k = 0; k < w->curves && code == KN_EXIT_OK; k++)
        if (compute(&of[k], &w->curve[k], &w->creep.material)) add_curve(p, &w->curve[k], &of[k], k + 1);
        else code = out_of_memory(w, path);
    follow(&identified, &w->creep.material, w->creep.lowest_pa, w->creep.highest_pa);
    add_law(&p[3], &identified, "identified law", KN_FIGURE_LINE, 0);
    if (code == KN_EXIT_OK) code = kn_figure_draw(w->opt.subcommand, path, "creep", p, 4, 2);
    for (int k = 0; k < w->curves; k++) release(&of[k]);
    return code;
}

// ---- the page

static void curves(kn_document *d, const kn_identification *w)
{
    const kn_creep_fit *j = &w->creep;
    kn_document_section(d, "Measurements");
    kn_document_table(d, "Curves and their residuals", "lrrrrr",
                      "curve\tload, kPa\treadings\tlargest strain\tmisfit, % of the largest strain\tmisfit / noise");
    for (int k = 0; k < w->curves; k++) {
        const kn_curve *c = &w->curve[k];
        const double most = kn_curve_largest(c);
        kn_document_row(d, "%s\t%.4g\t%d\t%.4g\t%.2g\t%.3g", c->name, c->step[0].stress_pa / 1e3, c->count, most,
                        100 * j->rms[k] / most, j->rms[k] / c->noise);
    }
    kn_document_text(d,
                     "The stress is the load over the current area of the specimen%s. The noise is estimated from the "
                     "differences between neighbouring readings, without any model.",
                     w->curve[0].constant_area ? ", which is taken as constant" : ", S h = S0 h0");
}

// Write the table of parameters and the links to the material.
static void numbers(kn_document *d, const kn_identification *w)
{
    kn_document_section(d, "The material");
    kn_document_table(d, "k1 parallel to c1, in series with the damper alpha exp(-beta P), P between P0 and P1", "lnl",
                      "parameter\tbest value and 95 % interval\tremark");
    for (int i = 0; i < KN_ESTIMATE_NUMBERS; i++) kn_identify_page_number(d, &w->creep.number[i]);
    if (w->served) {
        kn_identify_page_material(d);
        kn_document_link(d, "scene.yaml", "a block of this material under a plate: kneadd --scene scene.yaml");
    }
    kn_document_text(d,
                     "The 95 %% intervals are valid if the model is right and the noise is independent. Stresses from "
                     "%.4g to %.4g kPa were measured under load.",
                     w->creep.lowest_pa / 1e3, w->creep.highest_pa / 1e3);
}

// List the notes, or state that the residuals look like noise.
static void trust(kn_document *d, const kn_identification *w)
{
    kn_document_section(d, "Reliability");
    for (int i = 0; i < w->notes; i++) kn_document_verdict(d, KN_DOCUMENT_BEWARE, "%s", w->note[i]);
    if (w->notes == 0) kn_document_verdict(d, KN_DOCUMENT_HOLDS, "The residuals look like noise in every curve.");
}

// ---- pictures of the fit

// Draw all fits in one plot, then the paper's figures for the first curves.
static int fits(kn_document *d, kn_identification *w)
{
    char path[PATH_MAX], name[32], alt[200], caption[300];
    kn_document_section(d, "The fit");
    int code = kn_creep_draw(w, kn_document_file(d, "fit.png", path));
    if (code != KN_EXIT_OK) return code;
    kn_document_picture(d, "fit.png", "Strain over time of every curve with its fit, the residuals, and the damper law",
                        "Points: measured. Lines: the fitted material. Below: the residuals in standard deviations of "
                        "the noise, and the damper over the measured stresses.");
    for (int k = 0; k < w->curves && k < PAPER_FIGURES; k++) {
        const kn_curve *c = &w->curve[k];
        snprintf(name, sizeof name, "figures-%d.png", k + 1);
        code = paper_figures(w, kn_document_file(d, name, path), c);
        if (code != KN_EXIT_OK) return code;
        snprintf(alt, sizeof alt, "Displacement, stress, recovery and damper of %s", c->name);
        snprintf(caption, sizeof caption,
                 "%s, as figures 6 to 9 of Tomokuni, Sugiyama and Hirai: displacement, stress by equation 4, recovery "
                 "with equation 5, and the damper.",
                 c->name);
        kn_document_picture(d, name, alt, caption);
    }
    return KN_EXIT_OK;
}

void kn_creep_two_stage_deviation(const kn_material *a, const kn_material *b, double percent[4])
{
    percent[0] = 100 * (a->k1_pa / b->k1_pa - 1);
    percent[1] = 100 * (a->c1_pa_s / b->c1_pa_s - 1);
    percent[2] = 100 * (a->alpha_pa_s / b->alpha_pa_s - 1);
    percent[3] = 100 * (a->beta_per_pa / b->beta_per_pa - 1);
}

// List how far the results of the first paper's two stages differ from the joint fit.
static void two_stages(kn_document *d, const kn_identification *w)
{
    kn_document_section(d, "The first paper's two-stage method");
    kn_document_text(
        d, "The paper determines k1 and c1 from the recovery, then the damper from the displacement without its Voigt "
           "part. Each curve is fitted alone; the table gives the deviation from the joint fit in %%. For dough, k1 "
           "and c1 are 2.7 %% low even without noise, since the stress falls while a specimen creeps.");
    kn_document_table(d, "Two-stage method: deviation from the joint fit", "lrrrr", "curve\tk1\tc1\talpha\tbeta");
    for (int k = 0; k < w->curves; k++) {
        kn_two_stage s;
        double deviation[4];
        if (!kn_two_stage_fit(&s, &w->curve[k])) continue;
        kn_creep_two_stage_deviation(&s.material, &w->creep.material, deviation);
        kn_document_row(d, "%s\t%+.3g %%\t%+.3g %%\t%+.3g %%\t%+.3g %%", w->curve[k].name, deviation[0], deviation[1],
                        deviation[2], deviation[3]);
        kn_two_stage_free(&s);
    }
}

// Write the table of other models.
static void models(kn_document *d, const kn_model_comparison *m)
{
    char text[1000];
    kn_document_section(d, "Other models");
    kn_document_table(d, "Models, fitted to the early readings and tested on the later ones", "lrrrr",
                      "model (figure 2 of the paper)\tparameters\terror fitted, %\terror later, %\tAICc");
    for (int i = 0; i < m->rows; i++) {
        const kn_model_comparison_row *r = &m->row[i];
        if (!r->fitted) continue;
        kn_document_row(d, "%s%s%s%s\t%d\t%.3g\t%.3g\t%.1f", r->model.name, *r->model.letters ? " (" : "",
                        r->model.letters, *r->model.letters ? ")" : "", r->unknowns, 100 * r->early, 100 * r->held,
                        r->aicc - m->row[kn_model_comparison_best(m)].aicc);
    }
    kn_model_comparison_verdict(m, text, sizeof text);
    kn_document_text(d, "Verdict: %s.", text);
}

int kn_creep_report(kn_document *d, kn_identification *w)
{
    curves(d, w);
    numbers(d, w);
    trust(d, w);
    int code = fits(d, w);
    if (code != KN_EXIT_OK) return code;
    two_stages(d, w);
    if (w->compared) models(d, &w->models);
    return w->served ? kn_creep_validation(d, w) : KN_EXIT_OK;
}
