#ifndef KN_CLIENTS_IDENTIFY_IDENTIFY_H
#define KN_CLIENTS_IDENTIFY_IDENTIFY_H
// The course that `knead identify creep`, `relax` and `sweep` share: options, curves, fit, printed results, and the files
// with table, plot, page and material. identify.c runs the course; an experiment gives the steps that are its own.
#include "clients/report/report_page.h"
#include "clients/report/plot_panels.h"
#include "clients/identify/creep_fit.h"
#include "clients/identify/model_comparison.h"
#include "clients/identify/options.h"
#include "clients/identify/relaxation_fit.h"
#include "clients/identify/sweep_fit.h"

#define KN_IDENTIFY_NOTES 100
#define KN_IDENTIFY_POINTS 200 // number of points of a plotted model

struct kn_identify_experiment;

typedef struct kn_identification {
    const struct kn_identify_experiment *experiment;
    kn_identify_options opt;
    kn_curve curve[KN_CURVES_MAX];
    int curves;
    kn_creep_fit creep;         // creep: the fit
    kn_relaxation_fit relax;    // relax: the fit
    kn_sweep_fit sweep;         // sweep: the fits of all elements
    double modulus_scale;       // sweep: factor on the measured moduli
    double took_s;              // creep: duration of the fit [s]
    bool served;                // creep: a scene accepts the material
    kn_model_comparison models; // comparison with other material models
    bool compared;              // whether the comparison was made
    int notes;
    char note[KN_IDENTIFY_NOTES][400]; // notes on what is doubtful, as sentences
} kn_identification;

// Functions that return int return 0, or print an error and return an exit code.
typedef struct kn_identify_experiment {
    const char *subcommand, *title, *help; // title: heading of the page
    char letter;                           // names the experiment in options.h
    kn_curve_kind kind;
    int (*fit)(kn_identification *w);
    void (*tell)(kn_identification *w);                    // print the results and add them to --json
    const char *csv_head;                                  // names of the columns of --csv
    bool (*csv_rows)(const kn_identification *w, FILE *f); // write the rows; false: they cannot be computed
    int (*draw)(kn_identification *w, const char *path);   // draw the plot of --png
    int (*report)(kn_identification *w, kn_document *d);   // fill the page
    int (*write_material)(const kn_identification *w, const char *path);
} kn_identify_experiment;

extern const kn_identify_experiment kn_identify_creep, kn_identify_relax, kn_identify_sweep;
int kn_identify_shape_main(int argc, char **argv);

// Add a note: print it, and store it for the page and for --json.
__attribute__((format(printf, 2, 3))) void kn_identify_note(kn_identification *w, const char *format, ...);

// Fit other models to the same curves, print and tell the comparison. Return false with one sentence in `error` if it
// was not possible. With --no-models do nothing and return true.
bool kn_identify_compare(kn_identification *w, char error[400]);

// Print a parameter with its interval, and its words in the next line. The name and the interval take at least `name`
// and `interval` characters; `more` follows the interval.
void kn_identify_print_number(const kn_parameter_estimate *number, int name, int interval, const char *more);
void kn_identify_tell_numbers(int count, const kn_parameter_estimate *number);     // add to "numbers" of --json
void kn_identify_page_number(kn_document *d, const kn_parameter_estimate *number); // add a row to a table of the page

// Format the result of kn_fit_runs; "-" if there were too few readings.
const char *kn_identify_runs(double runs, char text[16]);

// Add the section with the table of --csv, named `csv`, and with the material, if it may be written, to the page.
int kn_identify_page_files(const kn_identification *w, kn_document *d, const char *csv, const char *words,
                           bool material);
void kn_identify_page_material(kn_document *d); // add a link to material.yaml

// Add a series to a panel; `scale` multiplies y.
void kn_identify_plot(kn_figure_panel *p, const char *name, int count, const double *x, const double *y, double scale,
                      kn_figure_look look, int hue);

// Fill x[KN_IDENTIFY_POINTS] with numbers from `low` to `high` that rise by equal factors.
void kn_identify_points(double low, double high, double *x);

#endif
