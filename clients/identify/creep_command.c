// The command `knead identify creep`: find the parameters of the papers' element from creep curves.
#include "clients/identify/creep_fit.h"
#include "clients/identify/identify.h"
#include "clients/cli/commands.h"
#include "clients/cli/command.h"
#include "clients/cli/result.h"
#include "clients/cli/curve_table.h"
#include "server/clock.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

// Each line of the help text is one line here, so that it can be read as it is printed.
// clang-format off
static const char help[] =
    "usage: knead identify creep FILE... [OPTION]...\n\n"
    "Fit a material to the creep of a specimen: its strain under a constant load and after it. A material is a spring\n"
    "k1 beside a damper c1, which restore the shape after the load, and in series with them a damper that keeps the\n"
    "deformation. The viscosity of this second damper is alpha exp(-beta P). P is the stress, limited to P0 .. P1.\n"
    "Several loads give a better result: a small load determines P0, a large load, sampled fast, P1.\n\n"
    "A file is a table of time and height, displacement or strain, with a name and a unit above each column. Load or\n"
    "stress may be further columns. Several columns of displacement with loads in their names are several curves.\n"
    "Readings may be missing or in any order. Lines before the table may give values for the whole file:\n"
    "    # load: 50 gf       # height: 1 cm       # area: 1 cm^2       # release: 60 s\n"
    "    time (s); displacement (mm)\n\n"
    "the readings:\n"
    "  --load W, --stress P   load or stress, for files that do not state it\n"
    "  --height H, --area S   initial height and area of the specimen\n"
    "  --release TIME         time at which the load was removed\n"
    "  --units NAME=UNIT,...  units of columns that have none, e.g. time=s,height=mm\n"
    KN_IDENTIFY_COLUMN_HELP
    KN_IDENTIFY_SHEAR_HELP
    "  --constant-area        take stress = load/S0 (default: the section grows as the height falls, S h = S0 h0)\n"
    "  --late                 also fit the times at which each curve's load was applied and removed;\n"
    "                         all results then count time from the fitted arrival of the load\n\n"
    "a lattice:\n"
    "  --serve STRUCTURE      also fit the material of a lattice: under a weight, the lattice then creeps as the\n"
    "                         specimen does. --out writes a whole scene. STRUCTURE is a (diagonals), b (gas in the\n"
    "                         cells, soft diagonals) or c (gas and diagonals), as in the first paper's figure 4\n"
    "  --spacing H            side of the lattice's cells, 2 to 8 along the specimen (default: 5 mm)\n"
    "  --anyway               write the scene even if it misses a curve by more than 15 % of its strain\n\n"
    "results:\n"
    KN_IDENTIFY_OUTPUT_HELP
    "\n"
    "The 95 % intervals are valid if the model is right and the noise is independent. The output says whether this is\n"
    "so, and which parameters the curves do not determine. It also has the result of the first paper's two-stage\n"
    "method.\n\n"
    "Examples:\n"
    "    knead creep dough --load 10gf,30gf,50gf --csv creep.csv\n"
    "    knead identify creep creep.csv --height 1cm --area 1cm^2 --out mine.yaml --report page\n"
    "    knead creep dough --load 30gf --csv 30gf.csv && knead identify creep 30gf.csv --height 1cm --area 1cm^2\n\n"
    "Exit codes: 0 ok, 1 the fit cannot be used in a scene, 2 bad input, 3 a file cannot be written.\n";
// clang-format on

// ---- printed results of creep

static const double gf_cm2 = 98.0665; // 1 gf/cm^2 in Pa

// Print the parameters in SI units, and beside them in the units of the first paper for a specimen of 1 cm.
static void print_numbers(const kn_creep_fit *j)
{
    static const char *const unit[] = {"gf/cm^3", "gf s/cm^3", "gf s/cm^3", "cm^2/gf", "gf/cm^2", "gf/cm^2"};
    printf("\n%-7s %-44s   %s\n", "", "best value and 95 % interval", "in the first paper's units, for 1 cm");
    for (int i = 0; i < KN_ESTIMATE_NUMBERS; i++) {
        char papers[40] = "";
        const kn_parameter_estimate *n = &j->number[i];
        const double value = i == KN_ESTIMATE_BETA ? n->value * gf_cm2 : n->value / gf_cm2;
        if (n->known == KN_KNOWN) snprintf(papers, sizeof papers, "   %.4g %s", value, unit[i]);
        kn_identify_print_number(n, 7, 44, papers);
    }
}

static void print_curves(const kn_identification *w)
{
    const kn_creep_fit *j = &w->creep;
    char runs[16];
    printf("\n%-20s %9s %9s %10s %9s %9s\n", "curve", "load kPa", "readings", "misfit %", "/ noise", "runs");
    for (int k = 0; k < w->curves; k++) {
        const kn_curve *c = &w->curve[k];
        printf("%-20s %9.4g %9d %10.2g %9.3g %9s", c->name, c->step[0].stress_pa / 1e3, c->count,
               100 * j->rms[k] / kn_curve_largest(c), j->rms[k] / c->noise, kn_identify_runs(j->runs[k], runs));
        if (w->opt.late) printf("   applied %.3g s %s", fabs(j->late_s[k]), j->late_s[k] < 0 ? "early" : "late");
        if (w->opt.late && isfinite(kn_creep_release(c)))
            printf(", held %.3g s %s", fabs(j->held_s[k]), j->held_s[k] < 0 ? "shorter" : "longer");
        printf("\n");
    }
    printf("misfit: rms residual, %% of the largest strain. / noise: rms residual over the noise.\n"
           "runs: standard deviations by which the residuals have fewer runs of one sign than noise has;\n"
           "above 3, the model's curve does not have the shape of the data\n"
           "fit and intervals took %.2g s\n",
           w->took_s);
}

// Compute the deviation of k1, c1, alpha and beta of material `a` from those of `b`, in per cent.
static void two_stage_deviation(const kn_material *a, const kn_material *b, double percent[4])
{
    percent[0] = 100 * (a->k1_pa / b->k1_pa - 1);
    percent[1] = 100 * (a->c1_pa_s / b->c1_pa_s - 1);
    percent[2] = 100 * (a->alpha_pa_s / b->alpha_pa_s - 1);
    percent[3] = 100 * (a->beta_per_pa / b->beta_per_pa - 1);
}

// For each curve, print how far the results of the first paper's own method are from the joint fit.
static void print_stages(const kn_identification *w)
{
    bool first = true;
    for (int k = 0; k < w->curves; k++) {
        kn_two_stage s;
        double deviation[4];
        if (!kn_two_stage_fit(&s, &w->curve[k])) continue;
        if (first) printf("\nthe first paper's two-stage method, curve by curve: deviation from the joint fit\n");
        first = false;
        const kn_material *m = &s.material;
        two_stage_deviation(m, &w->creep.material, deviation);
        printf("%-20s k1 %+.3g %%   c1 %+.3g %%   alpha %+.3g %%   beta %+.3g %%\n", w->curve[k].name, deviation[0],
               deviation[1], deviation[2], deviation[3]);
        json_t *row = kn_result_add("two_stages");
        kn_result_text(row, "curve", w->curve[k].name);
        kn_result_number(row, "k1_pa", m->k1_pa);
        kn_result_number(row, "c1_pa_s", m->c1_pa_s);
        kn_result_number(row, "alpha_pa_s", m->alpha_pa_s);
        kn_result_number(row, "beta_per_pa", m->beta_per_pa);
        kn_two_stage_free(&s);
    }
}

// ---- notes on doubtful results

static int under_load(const kn_curve *c)
{
    int n = 0;
    for (int i = 0; i < c->count; i++) n += kn_creep_load(c, c->time_s[i]) > 0;
    return n;
}

// Return whether the load changed between this reading and the second reading before it. For the first two readings,
// return true.
static bool follows_change(const kn_curve *c, int reading)
{
    return reading < 2 || kn_creep_load(c, c->time_s[reading - 2]) != kn_creep_load(c, c->time_s[reading]);
}

static void doubt_curves(kn_identification *w)
{
    const kn_creep_fit *j = &w->creep;
    for (int k = 0; k < w->curves; k++) {
        const kn_curve *c = &w->curve[k];
        // Without a recovery after the load, k1 and c1 are determined by the creep alone.
        if (!isfinite(kn_creep_release(c)))
            kn_identify_note(w,
                             "%s: the load was never taken off, or the file does not say when: "
                             "k1 and c1 follow from the creep alone, not from a recovery",
                             c->name);
        // The noise is estimated from the median of n differences. The relative error of this estimate is about
        // 1.7/sqrt(n). Residuals pass as noise if they are at most 1 + 5/sqrt(n) times the estimate, which allows for
        // three times its error. Long runs of one sign are ignored if the residuals are below half of the noise.
        const double times = j->rms[k] / c->noise, sure = 1 + 5 / sqrt(c->count);
        if ((j->runs[k] > 3 && times > 0.5) || times > sure)
            kn_identify_note(w,
                             "%s: the residuals of the fit are not noise (%.3g times the noise, runs %.2g). "
                             "The model, the scale of a column or the time of the load is wrong%s. "
                             "The intervals cover noise only",
                             c->name, times, j->runs[k], w->opt.late ? "" : " (--late fits the time)");
        // Without readings under load, only the strain at the end of the load is known.
        if (under_load(c) == 0)
            kn_identify_note(w, "%s: no reading was taken under the load, so only the strain at its end is known",
                             c->name);
    }
}

static void doubt_all(kn_identification *w)
{
    const kn_creep_fit *j = &w->creep;
    char why[300];
    // The report writes the material only if a scene accepts it.
    w->served = kn_material_served(&j->material, why, sizeof why);
    if (!w->served) kn_identify_note(w, "no scene accepts this material: %s", why);
    // A single load covers a short range of stresses, so the data can hardly separate beta, P0 and P1.
    if (w->curves == 1 && j->material.damper == KN_DAMPER_EXPONENTIAL)
        kn_identify_note(w, "only one load: the damper is known only for the stresses under this load. "
                            "Beyond these stresses, beta cannot be told apart from P0 and P1; measure another load");
    // If alpha and beta are strongly correlated, the data determine only a combination of both.
    if (fabs(j->alpha_beta) > 0.98)
        kn_identify_note(w,
                         "alpha and beta are not known separately (correlation %.3f). "
                         "The stresses are between %.3g and %.3g kPa; measure a smaller and a larger load",
                         j->alpha_beta, j->lowest_pa / 1e3, j->highest_pa / 1e3);
    for (int i = 0; i < j->outliers; i++) {
        // An outlier just after a change of load may come from a wrong time of that change.
        const kn_creep_outlier *o = &j->outlier[i];
        const kn_curve *c = &w->curve[o->curve];
        kn_identify_note(w, "%s:%d:1: left out as an outlier, %.3g standard deviations from the curve%s", c->file,
                         o->line, o->deviations,
                         !w->opt.late && follows_change(c, o->reading)
                             ? "; the load changed just before, perhaps at another time than noted: try --late"
                             : "");
    }
}

// Write parameters and curves to --json.
static void tell_json(const kn_identification *w)
{
    const kn_creep_fit *j = &w->creep;
    json_t *to = kn_result();
    kn_identify_tell_numbers(KN_ESTIMATE_NUMBERS, j->number);
    kn_result_number(to, "lowest_stress_pa", j->lowest_pa);
    kn_result_number(to, "highest_stress_pa", j->highest_pa);
    kn_result_number(to, "alpha_beta_correlation", j->alpha_beta);
    kn_result_integer(to, "readings", j->readings);
    kn_result_number(to, "fit_s", w->took_s);
    for (int k = 0; k < w->curves; k++) {
        json_t *row = kn_result_add("curves");
        kn_result_text(row, "name", w->curve[k].name);
        kn_result_number(row, "load_pa", w->curve[k].step[0].stress_pa);
        kn_result_integer(row, "readings", w->curve[k].count);
        kn_result_number(row, "rms_strain", j->rms[k]);
        kn_result_number(row, "noise_strain", w->curve[k].noise);
        kn_result_number(row, "runs", j->runs[k]);
        kn_result_number(row, "late_s", j->late_s[k]);
        kn_result_number(row, "held_s", j->held_s[k]);
    }
}

// ---- plots: the values of a curve

// LAW: number of points of a plotted damper law; MEANS: number of mean residuals in a plot; PAPER_FIGURES: largest
// number of curves for which figures 6 to 9 are drawn
enum { LAW = 100, MEANS = 40, PAPER_FIGURES = 8 };

typedef struct curve_values { // values of one curve; the arrays are in one block of memory
    double *fitted, *stress, *fitted_stress, *left, *since, *came_back, *fitted_back, *equation5, *c2;
    int means;
    double mean_s[MEANS], mean_left[MEANS];
    bool staged; // whether the paper's two-stage method gave a result
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
// systematic deviation that is hidden in the noise of single readings becomes visible. An early mean spans at most half
// of the time that has passed before it. Later means all have the same number of readings.
static void average(curve_values *n, const kn_curve *c)
{
    n->means = 0;
    for (int i = 0, end; i < c->count; i = end) {
        const double from = c->time_s[i];
        // A mean ends when it has its equal share of the remaining readings, or when the time has grown by half since
        // its first reading.
        const int most = (c->count - i) / (MEANS - n->means) + 1;
        double time = 0, sum = 0;
        for (end = i; end < c->count && end - i < most && (end == i || c->time_s[end] < 1.5 * from); end++)
            time += c->time_s[end], sum += n->left[end];
        n->mean_s[n->means] = time / (end - i);
        n->mean_left[n->means++] = sum / sqrt(end - i);
        if (n->means == MEANS) break;
    }
}

// Take c2 from the paper's two-stage method. Leave out values that are off the fitted law by more than a factor of
// 10^1.5, since they are only noise.
static void take_c2(curve_values *v, const kn_material *m)
{
    for (int i = 0; i < v->stages.count; i++) {
        const double c2 = v->stages.c2_pa_s[i];
        v->c2[i] = fabs(log10(c2 / kn_material_c2(m, v->stages.stress_pa[i]))) > 1.5 ? NAN : c2;
    }
}

// Compute the values of one curve: fitted strain, stress by measurement and by fit, residuals, and the result of the
// paper's two-stage method.
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

// Compute the strain that has recovered since the release: by measurement, by the joint fit, and by equation 5 of the
// first paper. All three are counted from the strain of the joint fit at the release, so that they can be compared.
// Return the number of readings.
static int recover(curve_values *n, const kn_curve *c)
{
    const kn_two_stage *s = &n->stages;
    int begin = 0;
    while (begin < c->count && c->time_s[begin] < s->release_s) begin++;
    if (begin == 0 || begin == c->count) return 0;
    // The strain at the release is the strain at the last reading before the release. If a reading was taken exactly at
    // the release, use the strain at this reading.
    const double released = n->fitted[c->time_s[begin] == s->release_s ? begin : begin - 1];
    for (int i = begin; i < c->count; i++) {
        n->since[i - begin] = c->time_s[i] - s->release_s;
        n->came_back[i - begin] = released - c->value[i];
        n->fitted_back[i - begin] = released - n->fitted[i];
        n->equation5[i - begin] = released - s->release_strain + kn_two_stage_recovered(s, n->since[i - begin]);
    }
    return c->count - begin;
}

// ---- the damper law in the plots

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

// ---- figures 6 to 9 of the first paper

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
    // Without a result of the paper's two-stage method, figures 8 and 9 are left out.
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
    // Draw the damper law of the joint fit and that of the two-stage method over the stresses of this curve.
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
// element beside the data. If the load was never removed, or if the curve is too short for the paper's two-stage method
// (creep_fit.h), only figures 6 and 7 are drawn.
static int paper_figures(const kn_identification *w, const char *path, const kn_curve *curve)
{
    curve_values n;
    if (!compute(&n, curve, &w->creep.material)) return out_of_memory(w, path);
    int code = draw_paper(w, path, curve, &n);
    release(&n);
    return code;
}

// ---- the plot of all curves

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

// Draw all creep curves in one PNG. The first two panels show the strain with the fit, on linear and on logarithmic
// axes. The third panel shows means of the residuals of neighbouring readings. Each mean is divided by its own standard
// deviation, which follows from the noise and the number of readings in the mean. The last panel shows the damper law
// c2(P) over the measured stresses, with the points that the paper's two-stage method finds for each curve.
static int draw(kn_identification *w, const char *path)
{
    // an array of this size is too large for the stack
    static curve_values of[KN_CURVES_MAX];
    static kn_figure_panel p[4];
    static law identified;
    int code = KN_EXIT_OK;
    p[0] = (kn_figure_panel){.title = "points: measured; lines: identified", .x_label = "time, s", .y_label = "strain"};
    p[1] = (kn_figure_panel){
        .title = "the same, logarithmic", .x_label = "time, s", .y_label = "strain", .log_x = true, .log_y = true};
    p[2] = (kn_figure_panel){.title = "mean residuals of neighbouring readings; grey: two deviations",
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

// ---- the page of --report

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
                     "The stress is the load over the current area of the specimen%s. "
                     "The noise is estimated from differences between neighbouring readings, without any model.",
                     w->curve[0].constant_area ? ", which is taken as constant" : ", S h = S0 h0");
}

// Write the table of parameters and the links to the material.
static void numbers(kn_document *d, const kn_identification *w)
{
    kn_document_section(d, "The material");
    kn_document_table(d,
                      "k1 and c1 in parallel; in series with both: the damper alpha exp(-beta P), P between P0 and P1",
                      "lnl", "parameter\tbest value and 95 % interval\tremark");
    for (int i = 0; i < KN_ESTIMATE_NUMBERS; i++) kn_identify_page_number(d, &w->creep.number[i]);
    if (w->served) kn_identify_page_material(d);
    kn_document_text(d,
                     "The 95 %% intervals are valid if the model is right and the noise is independent. "
                     "Stresses from %.4g to %.4g kPa were measured under load.",
                     w->creep.lowest_pa / 1e3, w->creep.highest_pa / 1e3);
}

// List the notes, or state that the residuals look like noise.
static void trust(kn_document *d, const kn_identification *w)
{
    kn_document_section(d, "Reliability");
    for (int i = 0; i < w->notes; i++) kn_document_verdict(d, KN_DOCUMENT_BEWARE, "%s", w->note[i]);
    if (w->notes == 0) kn_document_verdict(d, KN_DOCUMENT_HOLDS, "The residuals look like noise in every curve.");
}

// ---- pictures of the fit on the page

// Draw all fits in one plot, then figures 6 to 9 of the first paper for the first curves.
static int fits(kn_document *d, kn_identification *w)
{
    char path[PATH_MAX], name[32], alt[200], caption[300];
    kn_document_section(d, "The fit");
    int code = draw(w, kn_document_file(d, "fit.png", path));
    if (code != KN_EXIT_OK) return code;
    kn_document_picture(d, "fit.png", "Strain over time of every curve with its fit, the residuals, and the damper law",
                        "Points: measured. Lines: the fitted material. "
                        "Below: the residuals in standard deviations of the noise, and the damper law.");
    for (int k = 0; k < w->curves && k < PAPER_FIGURES; k++) {
        const kn_curve *c = &w->curve[k];
        snprintf(name, sizeof name, "figures-%d.png", k + 1);
        code = paper_figures(w, kn_document_file(d, name, path), c);
        if (code != KN_EXIT_OK) return code;
        snprintf(alt, sizeof alt, "Displacement, stress, recovery and damper of %s", c->name);
        snprintf(caption, sizeof caption,
                 "%s, as figures 6 to 9 of Tomokuni, Sugiyama and Hirai: "
                 "displacement, stress by equation 4, recovery with equation 5, and the damper.",
                 c->name);
        kn_document_picture(d, name, alt, caption);
    }
    return KN_EXIT_OK;
}

// List how far the results of the first paper's two-stage method are from the joint fit.
static void two_stages(kn_document *d, const kn_identification *w)
{
    kn_document_section(d, "The first paper's two-stage method");
    kn_document_text(
        d, "The paper determines k1 and c1 from the recovery. "
           "The strain of k1 and c1 is subtracted from the measured strain; the damper follows from the rest. "
           "Each curve is fitted alone; the table gives the deviation from the joint fit in %%. "
           "For dough, k1 and c1 are 2.7 %% low even without noise, since the stress falls while a specimen creeps.");
    kn_document_table(d, "Two-stage method: deviation from the joint fit", "lrrrr", "curve\tk1\tc1\talpha\tbeta");
    for (int k = 0; k < w->curves; k++) {
        kn_two_stage s;
        double deviation[4];
        if (!kn_two_stage_fit(&s, &w->curve[k])) continue;
        two_stage_deviation(&s.material, &w->creep.material, deviation);
        kn_document_row(d, "%s\t%+.3g %%\t%+.3g %%\t%+.3g %%\t%+.3g %%", w->curve[k].name, deviation[0], deviation[1],
                        deviation[2], deviation[3]);
        kn_two_stage_free(&s);
    }
}

// Write the table of the other models that were fitted.
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

// Write all results to an open page: the printed results with plots, and figures 6 to 9 of the first paper for the
// first curves. If w->served is true, the page's folder must already hold material.yaml. If w->served is false, the
// page has no section on lattices.
static int fill_page(kn_document *d, kn_identification *w)
{
    curves(d, w);
    numbers(d, w);
    trust(d, w);
    int code = fits(d, w);
    if (code != KN_EXIT_OK) return code;
    two_stages(d, w);
    if (w->compared) models(d, &w->models);
    return w->served ? kn_served_scene_page(d, w) : KN_EXIT_OK;
}

// ---- the steps of the experiment creep

// Fit all curves at once. Then shift the times of each curve by the fitted lateness of its load.
static int fit(kn_identification *w)
{
    const kn_creep_fit_options how = {.confidence = 0.95, .late = w->opt.late};
    const int64_t began_ns = kn_now_ns();
    const int code = kn_served_scene_cut(w);
    if (code != KN_EXIT_OK) return code;
    if (!kn_creep_fit_run(&w->creep, w->curves, w->curve, &how))
        return kn_complain(w->opt.subcommand, KN_EXIT_USAGE,
                           "%s: no parameters of the element fit these curves; expected creep under a load%s",
                           w->curve[0].file, how.late ? ", and with --late more readings than unknowns" : "");
    w->took_s = 1e-9 * (double)(kn_now_ns() - began_ns);
    kn_creep_fit_settle(&w->creep, w->curves, w->curve);
    return KN_EXIT_OK;
}

static void tell(kn_identification *w)
{
    char error[400];
    print_numbers(&w->creep);
    print_curves(w);
    print_stages(w);
    if (w->opt.serve) kn_served_scene_fit(w);
    // Print the notes last, after all tables.
    if (!kn_identify_compare(w, error)) kn_identify_note(w, "other models were not compared: %s", error);
    printf("\n");
    doubt_curves(w);
    doubt_all(w);
    tell_json(w);
}

// Write every reading with its fitted strain, its stress, and the number of readings that were averaged into it.
static bool csv_rows(const kn_identification *w, FILE *f)
{
    bool ok = true;
    for (int k = 0; ok && k < w->curves; k++) {
        const kn_curve *c = &w->curve[k];
        double *fit = calloc(2 * (size_t)c->count, sizeof *fit), *stress = fit ? fit + c->count : NULL;
        ok = fit && kn_creep_fit_predict(&w->creep.material, c, fit);
        if (ok) kn_creep_stress(c, stress);
        for (int i = 0; ok && i < c->count; i++) {
            kn_table_text(c->name, f);
            fprintf(f, ",%.9g,%.9g,%.9g,%.9g,%.9g\n", c->time_s[i], c->value[i], fit[i], stress[i], c->weight[i]);
        }
        free(fit);
    }
    return ok;
}

static int write_element(const kn_identification *w, const char *path)
{
    const kn_creep_fit *j = &w->creep;
    char origin[600], source[KN_SOURCE_MAX];
    snprintf(origin, sizeof origin, "creep from %s: %d curve%s, %d readings, stresses %.4g to %.4g Pa.",
             kn_identify_source(w, source), w->curves, w->curves == 1 ? "" : "s", j->readings, j->lowest_pa,
             j->highest_pa);
    return kn_material_file_write(w->opt.subcommand, path, origin, NULL, &j->material, w->opt.density_kg_m3,
                                  KN_ESTIMATE_NUMBERS, j->number);
}

// Write the file of --out: the element's material or, with --serve, a scene with the lattice's material.
static int write_out(const kn_identification *w, const char *path)
{
    return w->lattice.rounds > 0 ? kn_served_scene_write(w, path) : write_element(w, path);
}

static int report(kn_identification *w, kn_document *d)
{
    char path[PATH_MAX];
    int code = w->served ? write_element(w, kn_document_file(d, "material.yaml", path)) : KN_EXIT_OK;
    return code == KN_EXIT_OK ? fill_page(d, w) : code;
}

const kn_identify_experiment kn_identify_creep = {.subcommand = "identify creep",
                                                  .title = "Material from creep",
                                                  .help = help,
                                                  .letter = 'c',
                                                  .kind = KN_CURVE_CREEP,
                                                  .fit = fit,
                                                  .tell = tell,
                                                  .csv_head = "curve,time_s,strain,fit_strain,stress_pa,readings",
                                                  .csv_rows = csv_rows,
                                                  .draw = draw,
                                                  .report = report,
                                                  .write_material = write_out};
