#include "clients/identify/creep_report.h"
#include "clients/identify/creep_figures.h"
#include "clients/report/plot_panels.h"
#include "clients/identify/recreep.h"
#include "clients/identify/squeeze.h"
#include "clients/identify/creep_fit.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define GF_CM2_PA 98.0665   // 1 gf/cm^2 in Pa; gf/cm^2 is the unit of stress in the first paper
enum { PAPER_FIGURES = 8 }; // largest number of curves that are also plotted one by one

// ---- data and results

static void curves(kn_document *d, const kn_creep_found *f)
{
    const kn_creep_fit *j = f->joint;
    kn_document_section(d, "Measurements");
    kn_document_table(d, "Curves and their residuals", "lrrrrr",
                      "curve\tload, kPa\treadings\tlargest strain\tmisfit, % of the largest strain\tmisfit / noise");
    for (int k = 0; k < f->curves; k++) {
        const kn_curve *c = &f->curve[k];
        double most = 0;
        for (int i = 0; i < c->count; i++) most = fmax(most, c->value[i]);
        kn_document_row(d, "%s\t%.4g\t%d\t%.4g\t%.2g\t%.3g", c->name, c->step[0].stress_pa / 1e3, c->count, most,
                        100 * j->rms[k] / most, j->rms[k] / c->noise);
    }
    kn_document_text(d,
                     "The stress is the load over the current area of the specimen%s. The noise is estimated from the "
                     "differences between neighbouring readings, without any model.",
                     f->curve[0].constant_area ? ", which is taken as constant" : ", S h = S0 h0");
}

// Write the table of parameters and the links to the material.
static void numbers(kn_document *d, const kn_creep_found *f)
{
    kn_document_section(d, "The material");
    kn_document_table(d, "k1 parallel to c1, in series with the damper alpha exp(-beta P), P between P0 and P1", "lnl",
                      "parameter\tbest value and 95 % interval\tremark");
    for (int i = 0; i < KN_ESTIMATE_NUMBERS; i++) {
        char text[120];
        const kn_parameter_estimate *n = &f->joint->number[i];
        kn_parameter_estimate_text(n, text, sizeof text);
        kn_document_row(d, "%s\t%s\t%s", n->name, text, n->words);
    }
    if (f->served) {
        kn_document_link(d, "material.yaml", "the material, for `material: material.yaml` in a scene");
        kn_document_link(d, "scene.yaml", "a block of this material under a plate: kneadd --scene scene.yaml");
    }
    kn_document_text(d,
                     "The 95 %% intervals are valid if the model is right and the noise is independent. Stresses from "
                     "%.4g to %.4g kPa were measured under load.",
                     f->joint->lowest_pa / 1e3, f->joint->highest_pa / 1e3);
}

// List the notes, or state that the residuals look like noise.
static void trust(kn_document *d, const kn_creep_found *f)
{
    kn_document_section(d, "Reliability");
    for (int i = 0; i < f->notes; i++) kn_document_verdict(d, KN_DOCUMENT_BEWARE, "%s", f->note[i]);
    if (f->notes == 0) kn_document_verdict(d, KN_DOCUMENT_HOLDS, "The residuals look like noise in every curve.");
}

// ---- pictures of the fit

// Draw all fits in one plot, then the paper's figures for the first curves.
static int fits(kn_document *d, const kn_creep_found *f)
{
    char path[PATH_MAX], name[KN_CURVE_NAME + 40], alt[200];
    kn_document_section(d, "The fit");
    kn_document_file(d, "fit.png", path);
    int code = kn_creep_figures_fits(f->subcommand, path, f->curves, f->curve, f->joint);
    if (code != KN_EXIT_OK) return code;
    kn_document_picture(d, "fit.png", "Strain over time of every curve with its fit, the residuals, and the damper law",
                        "Points: measured. Lines: the fitted material. Below: the residuals in standard deviations of "
                        "the noise, and the damper over the measured stresses.");
    for (int k = 0; k < f->curves && k < PAPER_FIGURES; k++) {
        const kn_curve *c = &f->curve[k];
        snprintf(name, sizeof name, "figures-%d.png", k + 1);
        snprintf(alt, sizeof alt, "Displacement, stress, recovery and damper of %s", c->name);
        code = kn_creep_figures_paper(f->subcommand, kn_document_file(d, name, path), c, f->joint);
        if (code != KN_EXIT_OK) return code;
        snprintf(name, sizeof name, "figures-%d.png", k + 1);
        char caption[300];
        snprintf(caption, sizeof caption,
                 "%s, as figures 6 to 9 of Tomokuni, Sugiyama and Hirai: displacement, stress by equation 4, recovery "
                 "with equation 5, and the damper.",
                 c->name);
        kn_document_picture(d, name, alt, caption);
    }
    return KN_EXIT_OK;
}

// List how far the results of the first paper's two stages differ from the joint fit.
static void two_stages(kn_document *d, const kn_creep_found *f)
{
    kn_document_section(d, "The first paper's two-stage method");
    kn_document_text(
        d, "The paper determines k1 and c1 from the recovery, then the damper from the displacement without its Voigt "
           "part. Each curve is fitted alone; the table gives the deviation from the joint fit in %%. For dough, k1 "
           "and c1 are 2.7 %% low even without noise, since the stress falls while a specimen creeps.");
    kn_document_table(d, "Two-stage method: deviation from the joint fit", "lrrrr", "curve\tk1\tc1\talpha\tbeta");
    for (int k = 0; k < f->curves; k++) {
        kn_two_stage s;
        if (!kn_two_stage_fit(&s, &f->curve[k])) continue;
        const kn_material *a = &s.material, *b = &f->joint->material;
        kn_document_row(d, "%s\t%+.3g %%\t%+.3g %%\t%+.3g %%\t%+.3g %%", f->curve[k].name,
                        100 * (a->k1_pa / b->k1_pa - 1), 100 * (a->c1_pa_s / b->c1_pa_s - 1),
                        100 * (a->alpha_pa_s / b->alpha_pa_s - 1), 100 * (a->beta_per_pa / b->beta_per_pa - 1));
        kn_two_stage_free(&s);
    }
}

// Write the table of other models.
static void models(kn_document *d, const kn_model_comparison *m)
{
    char text[1000];
    if (!m) return;
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

// ---- creep computed with the identified material

// Write a scene with the paper's block of this material, for the lattices and for kneadd.
static int write_scene(const kn_document *d, const char *subcommand, char path[PATH_MAX])
{
    FILE *f = fopen(kn_document_file(d, "scene.yaml", path), "w");
    if (!f) return kn_complain(subcommand, KN_EXIT_DEVICE, "%s: %s", path, strerror(errno));
    fprintf(f, "# The first paper's block, 5 x 5 x 3 cm, of the identified material, under its plate.\n"
               "version: 1\n"
               "object: {size: [5 cm, 5 cm, 3 cm], spacing: 1 cm, structure: diagonals}\n"
               "material: material.yaml\n"
               "gravity: 0 m/s^2\n"
               "support: bonded\n"
               "device: bench\n"
               "probes:\n"
               "  - {name: plate, shape: plate, size: [1 cm, 6 cm]}\n"
               "  - {name: finger, shape: sphere, radius: 1.5 cm}\n");
    return fclose(f) == 0 ? KN_EXIT_OK : kn_complain(subcommand, KN_EXIT_DEVICE, "%s: cannot be written", path);
}

// Add one curve to both panels: the measured strain, and the strain of the element or of the lattices.
static void lay_over(kn_figure_panel *panel, const kn_curve *c, const kn_recreep *l, int hue)
{
    kn_figure_add(&panel[0], (kn_figure_series){c->name, c->count, c->time_s, c->value, .hue = hue});
    kn_figure_add(&panel[1], (kn_figure_series){NULL, c->count, c->time_s, c->value, .hue = hue});
    kn_figure_add(&panel[0], (kn_figure_series){NULL, c->count, c->time_s, l->strain[KN_RECREEP_ELEMENT],
                                                .look = KN_FIGURE_LINE, .hue = hue});
    for (int way = KN_RECREEP_DIAGONALS; way < KN_RECREEP_WAYS; way++)
        kn_figure_add(&panel[1], (kn_figure_series){NULL, c->count, c->time_s, l->strain[way],
                                                    .look = way == KN_RECREEP_GAS ? KN_FIGURE_LINE : KN_FIGURE_DASHES,
                                                    .hue = hue});
}

// Compare the lattices with the element and state how far they differ.
static void judge_lattices(kn_document *d, const double worst[KN_RECREEP_WAYS])
{
    const double diagonals = worst[KN_RECREEP_DIAGONALS], gas = worst[KN_RECREEP_GAS];
    // Lattices that differ from the element by less than 5 % count as equal to it.
    const bool near = fmax(diagonals, gas) < 0.05;
    kn_document_verdict(
        d, near ? KN_DOCUMENT_HOLDS : KN_DOCUMENT_BEWARE,
        near ? "Lattices of this material creep as its element does: they differ by %.2g %% with diagonals and by %.2g "
               "%% with gas."
             : "These are the parameters of one element. Under these loads, lattices of this material strain "
               "differently, by up to %.2g %% of the largest strain with diagonals alone and by %.2g %% with gas. Run "
               "knead creep scene.yaml --lattice 2x2x2 to see the creep of a lattice.",
        100 * diagonals, 100 * gas);
}

// Compute the creep of the material under every curve's loads (recreep.h), and report and plot the differences.
static int loops(kn_document *d, const kn_creep_found *f, const char *scene)
{
    char path[PATH_MAX];
    kn_figure_panel *panel = calloc(2, sizeof *panel);
    kn_recreep *back = calloc((size_t)f->curves, sizeof *back);
    double worst[KN_RECREEP_WAYS] = {0}; // largest difference from the element, over all curves
    int code = panel && back ? KN_EXIT_OK : kn_complain(f->subcommand, KN_EXIT_DEVICE, "out of memory");
    kn_document_table(d, "Root mean square differences, % of the largest strain", "lrrrrrr",
                      "curve\tlargest strain\telement from data\tdiagonals from data\twith gas from data\t"
                      "diagonals from element\twith gas from element");
    for (int k = 0; k < f->curves && code == KN_EXIT_OK; k++) {
        code = kn_recreep_run(&back[k], f->subcommand, scene, &f->curve[k]);
        // Each curve has one row: differences from the data and from the element.
        const double *data = back[k].from_data, *element = back[k].from_element;
        kn_document_row(d, "%s\t%.3g\t%.3g\t%.3g\t%.3g\t%.3g\t%.3g", f->curve[k].name, kn_recreep_largest(&f->curve[k]),
                        100 * data[KN_RECREEP_ELEMENT], 100 * data[KN_RECREEP_DIAGONALS], 100 * data[KN_RECREEP_GAS],
                        100 * element[KN_RECREEP_DIAGONALS], 100 * element[KN_RECREEP_GAS]);
        for (int way = 0; way < KN_RECREEP_WAYS; way++) worst[way] = fmax(worst[way], element[way]);
        lay_over(panel, &f->curve[k], &back[k], k + 1);
    }
    if (code == KN_EXIT_OK) judge_lattices(d, worst);
    for (int p = 0; panel && p < 2; p++) {
        panel[p].title = p ? "dashed: lattice with diagonals; solid: with gas" : "lines: the element";
        panel[p].x_label = "time, s";
        panel[p].y_label = "strain";
    }
    if (code == KN_EXIT_OK)
        code = kn_figure_draw(f->subcommand, kn_document_file(d, "back.png", path), "measured and simulated creep",
                              panel, 2, 2);
    for (int k = 0; back && k < f->curves; k++) kn_recreep_free(&back[k]);
    free(back);
    free(panel);
    return code;
}

// Press a block of the material with the first paper's press, and report the force and the dent.
static int pressed(kn_document *d, const kn_creep_found *f, const char *scene)
{
    char path[3][PATH_MAX];
    const char *png[2] = {kn_document_file(d, "held.png", path[0]), kn_document_file(d, "left.png", path[1])};
    kn_squeeze q;
    kn_figure_panel panel = {.x_label = "time, s", .y_label = "force, N"};
    int code = kn_squeeze_run(&q, f->subcommand, scene, png);
    if (code == KN_EXIT_OK) {
        kn_figure_add(&panel,
                      (kn_figure_series){"plate", (int)q.ticks, q.time_s, q.force_n, .look = KN_FIGURE_LINE, .hue = 1});
        code =
            kn_figure_draw(f->subcommand, kn_document_file(d, "press.png", path[2]), "the paper's press", &panel, 1, 1);
    }
    if (code == KN_EXIT_OK) {
        kn_document_text(
            d,
            "A block of this material, 5 x 5 x 3 cm, under the paper's plate, pressed 1 cm deep at 1 cm/s and held for "
            "30 s. The force is %.3g N at most and %.3g N at the end of the hold. Of %.3g mm, %.3g mm remain.",
            q.peak_n, q.held_n, 1e3 * q.pressed_m, 1e3 * q.left_m);
        kn_document_picture(d, "press.png", "Force of the plate over time", "The force on the plate.");
        kn_document_picture(d, "held.png", "The block under the plate", "At the end of the hold.");
        kn_document_picture(d, "left.png", "The block with its dent", "After the plate has left.");
    }
    kn_squeeze_free(&q);
    return code;
}

static int way_back(kn_document *d, const kn_creep_found *f)
{
    char scene[PATH_MAX];
    kn_document_section(d, "Simulated creep");
    kn_document_text(
        d,
        "The fitted material creeps again under the same loads: as one element, integrated to a tolerance by separate "
        "code, and as blocks of %d x %d x %d cells in the solver that serves scenes. The edges of a lattice turn as "
        "the block gives way; those of a single element do not. So the two differ more as the strain grows. With "
        "diagonals alone a block gives way more than the element; with gas in its cells as well, it gives way less.",
        KN_RECREEP_CELLS, KN_RECREEP_CELLS, KN_RECREEP_CELLS);
    int code = write_scene(d, f->subcommand, scene);
    if (code == KN_EXIT_OK) code = loops(d, f, scene);
    if (code != KN_EXIT_OK) return code;
    kn_document_picture(d, "back.png", "Measured strain, and the strain of the element and of the lattices",
                        "Points: measured. Left: the element. Right: lattices.");
    return pressed(d, f, scene);
}

int kn_creep_report(kn_document *d, const kn_creep_found *f)
{
    curves(d, f);
    numbers(d, f);
    trust(d, f);
    int code = fits(d, f);
    if (code != KN_EXIT_OK) return code;
    two_stages(d, f);
    models(d, f->models);
    return f->served ? way_back(d, f) : KN_EXIT_OK;
}
