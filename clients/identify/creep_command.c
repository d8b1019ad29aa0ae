// The command `knead identify creep`: find the parameters of the papers' element from creep curves.
#include "clients/identify/creep_report.h"
#include "clients/identify/creep_fit.h"
#include "clients/cli/commands.h"
#include "clients/cli/command.h"
#include "clients/cli/result.h"
#include "clients/cli/curve_table.h"
#include "server/clock.h"
#include <math.h>
#include <stdlib.h>

// Each line of the help text is one line here, so that it can be read as it is printed.
// clang-format off
static const char help[] =
    "usage: knead identify creep FILE... [OPTION]...\n\n"
    "Fit the material of a virtual object to creep measurements: how far a specimen gave way under a load, and how far it\n"
    "recovered afterwards. The result is k1 and c1, which restore the shape, and the damper alpha exp(-beta P) between P0\n"
    "and P1, which does not.\n\n"
    "    knead identify creep 10gf.csv 30gf.csv 50gf.csv --out dough.yaml\n"
    "    knead identify creep all.csv --height 1cm --area 1cm^2 --release 60 --report dough\n\n"
    "A file is a table with a name and a unit above each column: time; height, displacement or strain; and load or stress\n"
    "if they were recorded. Lines before the table may give values that hold for the whole file:\n"
    "    # load: 50 gf       # height: 1 cm       # area: 1 cm^2       # release: 60 s\n"
    "    time (s); displacement (mm)\n"
    "The separator (comma, semicolon or tab) and decimal commas are detected. Readings may be missing and in any order.\n"
    "Several columns of displacement with a load in their names are several curves. Each additional load improves the\n"
    "result: P0 needs a load below it, P1 a large load that is sampled fast.\n\n"
    "  --load W, --stress P   load or stress, for files that do not state it\n"
    "  --height H, --area S   initial height and area of the specimen\n"
    "  --release TIME         time at which the load was removed\n"
    "  --units NAME=UNIT,...  units of columns that have none, e.g. time=s,height=mm\n"
    "  --constant-area        stress is load/S0 (default: the section grows as the height falls, S h = S0 h0)\n"
    "  --late                 also fit a time offset and a duration for each load, in case they differ from the file; the\n"
    "                         offset is at most the length of the curve; all results count time from the fitted start\n"
    KN_IDENTIFY_OUTPUT_HELP
    "\nThe output gives the best parameters over all curves together, with 95 % intervals. The intervals are valid if the\n"
    "model is right and the noise is independent; the output tells if that is so, and which parameters these curves cannot\n"
    "determine. For comparison it also gives the result of the first paper's two-stage method.\n"
    "Exit codes: 0 ok, 1 the fit cannot be used in a scene, 2 bad input, 3 a file cannot be written.\n";
// clang-format on

// ---- printed results

static const double gf_cm2 = 98.0665; // 1 gf/cm^2 in Pa

// Print the parameters, and beside them those in the units of the first paper, for a specimen of 1 cm.
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
    printf("misfit: rms residual, %% of the largest strain. / noise: rms residual over the noise. runs: number of sign "
           "runs, in\n"
           "standard deviations below that of noise; above 3 the model has another shape than the data\n"
           "fit and intervals took %.2g s\n",
           w->took_s);
}

// Compare with the first paper's own method, curve by curve.
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
        kn_creep_two_stage_deviation(m, &w->creep.material, deviation);
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

// ---- notes on what is doubtful

static int under_load(const kn_curve *c)
{
    int n = 0;
    for (int i = 0; i < c->count; i++) n += kn_creep_load(c, c->time_s[i]) > 0;
    return n;
}

// Return whether the load changed within the two readings before this one.
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
            kn_identify_note(
                w,
                "%s: the load was never taken off, or the file does not say when: k1 and c1 follow from the creep "
                "alone, not from a recovery",
                c->name);
        // The noise is estimated from a median of n differences, with a relative error of 1.7/sqrt(n). So residuals up
        // to about three such errors above the noise are accepted. Long runs of one sign are accepted if the residuals
        // are below half of the noise.
        const double times = j->rms[k] / c->noise, sure = 1 + 5 / sqrt(c->count);
        if ((j->runs[k] > 3 && times > 0.5) || times > sure)
            kn_identify_note(
                w,
                "%s: the residuals of the fit are not noise (%.3g times the noise, runs %.2g): the model, the time "
                "of the load%s or a scale is wrong, and the intervals cover noise only",
                c->name, times, j->runs[k], w->opt.late ? "" : " (--late fits it)");
        // Without readings under load, only the strain at the end of the load is known.
        if (under_load(c) == 0)
            kn_identify_note(w, "%s: no reading under the load: the creep is known only from the strain at its end",
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
        kn_identify_note(
            w, "only one load: the damper is known only for the stresses under this load, and beyond them beta "
               "cannot be told from P0 and P1; measure another load");
    // If alpha and beta are strongly correlated, the data determine only a combination of both.
    if (fabs(j->alpha_beta) > 0.98)
        kn_identify_note(
            w,
            "alpha and beta are not known separately (correlation %.3f): the stresses lie within %.3g to %.3g kPa; "
            "measure a smaller and a larger load",
            j->alpha_beta, j->lowest_pa / 1e3, j->highest_pa / 1e3);
    for (int i = 0; i < j->outliers; i++) {
        // An outlier just after a change of load may come from a wrong time of that change.
        const kn_creep_outlier *o = &j->outlier[i];
        const kn_curve *c = &w->curve[o->curve];
        kn_identify_note(w, "%s:%d:1: left out, %.3g standard deviations from the curve, unlike its neighbours%s",
                         c->file, o->line, o->deviations,
                         !w->opt.late && follows_change(c, o->reading)
                             ? "; it follows a change of the load, whose time may be wrong: try --late"
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

// ---- the steps of the experiment

// Fit all curves at once, and shift the curves to the fitted times of their loads.
static int fit(kn_identification *w)
{
    const kn_creep_fit_options how = {.confidence = 0.95, .late = w->opt.late};
    const int64_t began_ns = kn_now_ns();
    if (!kn_creep_fit_run(&w->creep, w->curves, w->curve, &how))
        return kn_complain(w->opt.subcommand, KN_EXIT_USAGE,
                           "%s: no parameters of the element fit these curves; expected creep under a load%s",
                           w->curve[0].file, how.late ? ", in more readings than --late has parameters to fit" : "");
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
    // Print the notes last, after all tables.
    if (!kn_identify_compare(w, error)) kn_identify_note(w, "other models were not compared: %s", error);
    printf("\n");
    doubt_curves(w);
    doubt_all(w);
    tell_json(w);
}

// Write every reading with the fitted strain, the stress and its weight.
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

static int write_material(const kn_identification *w, const char *path)
{
    const kn_creep_fit *j = &w->creep;
    char origin[600], source[KN_SOURCE_MAX];
    snprintf(origin, sizeof origin, "creep from %s: %d curve%s, %d readings, stresses %.4g to %.4g Pa.",
             kn_material_source(w->opt.file[0], w->opt.files, source), w->curves, w->curves == 1 ? "" : "s",
             j->readings, j->lowest_pa, j->highest_pa);
    return kn_material_file_write(w->opt.subcommand, path, origin, &j->material, w->opt.density_kg_m3,
                                  KN_ESTIMATE_NUMBERS, j->number);
}

static int report(kn_identification *w, kn_document *d)
{
    char path[PATH_MAX];
    int code = w->served ? write_material(w, kn_document_file(d, "material.yaml", path)) : KN_EXIT_OK;
    return code == KN_EXIT_OK ? kn_creep_report(d, w) : code;
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
                                                  .draw = kn_creep_draw,
                                                  .report = report,
                                                  .write_material = write_material};
