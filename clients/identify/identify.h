#ifndef KN_CLIENTS_IDENTIFY_IDENTIFY_H
#define KN_CLIENTS_IDENTIFY_IDENTIFY_H
// The steps that `knead identify creep`, `press`, `relax` and `sweep` share: read options and curves, fit, print results, and
// write the files (table, plot, page, material). identify.c runs this sequence. Each experiment supplies the steps that
// differ.
#include "clients/report/report_page.h"
#include "clients/identify/creep_fit.h"
#include "clients/identify/model_comparison.h"
#include "clients/identify/press_fit.h"
#include "clients/identify/relaxation_fit.h"
#include "clients/identify/served_lattice.h"
#include "core/network.h"
#include "core/scene/scene.h"
#include "server/option_table.h"

// ---- the options
//
// Options of `knead identify creep`, `press`, `relax` and `sweep`. One table holds the options of all experiments. Each
// option lists the experiments that accept it.

typedef struct kn_identify_options {
    const char *subcommand; // name of the subcommand in error messages, such as "identify creep"
    kn_curve_options curve; // options that say how to read the input files
    const char **file;      // [files] paths of the input files
    int files;
    double density_kg_m3; // density of the material; 0: not given
    char serve;       // creep: structure 'a', 'b' or 'c' of the lattice to which the material is fitted, too; 0: none
    double spacing_m; // creep: spacing of that lattice; 0: not given
    bool anyway;      // creep, press: write the scene of a lattice that does not follow the curves
    const char *tool, *object; // press: the tool and the scene of the object
    // press: paths of creep records, and of presses that are only predicted; file[] holds the presses, creep[] and held[]
    const char **creep, **held;
    int creeps, helds;
    double compliance_m_n; // press: compliance of frame and gauge; NAN: not given
    const char *out, *png, *csv, *report;
    bool no_models;      // option --no-models: do not compare the result with other material models
    bool late;           // creep: also fit the times at which the loads were applied and removed
    bool constant_noise; // relax: the noise is the same at all stresses; false: it is a fixed share of the stress
    // for the comparison of models: the models are fitted to the readings before this time and judged by the later
    // readings [s]; 0: the time is chosen from the data
    double cut_s;
} kn_identify_options;

// Parts of the help text: of all experiments, of creep, relax and sweep, of creep and relax.
#define KN_IDENTIFY_COLUMN_HELP                                                                                        \
    "  --column NAME=QUANTITY,...\n"                                                                                   \
    "                         quantities of columns whose names are not known, e.g. Crosshead=displacement\n"
#define KN_IDENTIFY_SHEAR_HELP                                                                                         \
    "  --shear, --compression\n"                                                                                       \
    "                         read all files as of shear, or of compression (default: as the columns' names say)\n"    \
    "  --poisson NU           Poisson's ratio nu, for E = 2 (1 + nu) G of a file in shear (default: 0.5, E = 3 G)\n"
#define KN_IDENTIFY_OUTPUT_HELP                                                                                        \
    "  --out FILE             the material, for `material: FILE` of a scene, with an interval for every parameter\n"   \
    "  --density D            density of the material, written to the file (default: 1.2 g/cm^3, with a remark)\n"     \
    "  --report DIR           folder for a page, DIR/index.html, with all results, plots, curves and the material\n"   \
    "  --png FILE             plot of readings, fit and residuals (needs gnuplot)\n"                                   \
    "  --csv FILE             table of readings and fit\n"                                                             \
    "  --json                 print the results as JSON\n"                                                             \
    "  --no-models            do not compare the result with other material models\n"                                  \
    "  --cut TIME             fit other models before TIME, test them after it (default: chosen from the data)\n"

// ---- the fit of sweep (sweep_command.c)
//
// A fit of the springs and dampers of the first paper's figure 2 to storage and loss modulus over frequency. Elements
// that no experiment can tell apart form one class (core/oneport.h). Each class has one row in the table of results and
// is represented by its Voigt form.
//
// The residuals are differences of ln G' and ln G'' (G': storage modulus, G'': loss modulus). G' and G'' have equal
// weights. The logarithms give every decade of the modulus the same weight. The oscillations are small, so the stress
// stays near zero. There the damping c2 of the papers' stress-dependent damper is c_max, and the experiment does not
// show how c2 falls with the stress.

#define KN_SWEEP_FIT_ROWS KN_CATALOGUE
#define KN_SWEEP_FIT_PARTS 4
// A model whose AICc exceeds the least AICc by more than this has little support (Burnham and Anderson, Model
// selection, 2.6)
#define KN_SWEEP_FIT_NEAR 4

typedef struct kn_sweep_fit_row {
    char expression[KN_ELEMENT_TEXT]; // the element as an expression of springs s and dampers d, such as "(s|d)-d"
    char letters[16];                 // letters of the elements in the first paper's figure 2, such as "d f"
    const char *name;                 // name of the model, such as "Jeffreys"; NULL: the model has no name
    kn_network net;                   // the element with the fitted parameters
    bool fitted, is_material;         // is_material: whether a scene can have this element
    kn_material material;             // the fitted material; set if is_material is true
    int parts;                        // number of springs and dampers
    // [parts] values of the springs and dampers; for a material k1, c1, c2
    kn_parameter_estimate number[KN_SWEEP_FIT_PARTS];
    double error;      // mean of |model/measured - 1| over both moduli
    double aicc, runs; // AICc of the fit; result of kn_fit_runs for the residuals
} kn_sweep_fit_row;

typedef struct kn_sweep_fit {
    int rows, readings; // number of rows in row[]; number of measured frequencies
    kn_sweep_fit_row row[KN_SWEEP_FIT_ROWS];
    // Indices of rows; -1: no row. best: the row with the fewest parameters among the rows whose AICc is at most
    // KN_SWEEP_FIT_NEAR above the least AICc. material: the row chosen by the same rule among the elements that a scene
    // can have.
    int best, material;
} kn_sweep_fit;

// ---- the sequence of steps of an experiment

#define KN_IDENTIFY_NOTES 100
#define KN_IDENTIFY_POINTS 200 // number of points of a plotted model

struct kn_identify_experiment;

typedef struct kn_identification {
    const struct kn_identify_experiment *experiment;
    kn_identify_options opt;
    kn_curve curve[KN_CURVES_MAX];
    int curves;
    kn_creep_fit creep;                 // creep: the fit
    kn_relaxation_fit relax;            // relax: the fit
    kn_sweep_fit sweep;                 // sweep: the fits of all elements
    double took_s;                      // creep: duration of the fit [s]
    bool served;                        // creep: a scene accepts the material
    kn_served_lattice lattice;          // creep: with --serve, the material of a lattice
    kn_press_fit press;                 // press: the fit
    kn_scene *scene[1 + KN_CURVES_MAX]; // press: the object and the tools
    kn_model_comparison models;         // comparison with other material models
    bool compared;                      // whether other models were compared
    int notes;
    char note[KN_IDENTIFY_NOTES][400]; // notes on what is doubtful, as sentences
} kn_identification;

// Functions that return int return 0, or print an error and return an exit code.
typedef struct kn_identify_experiment {
    const char *subcommand, *title, *help; // title: heading of the page; help: text of --help
    char letter;                           // letter of the experiment in the table of options: c, p, r or s
    kn_curve_kind kind;
    int (*fit)(kn_identification *w);
    void (*tell)(kn_identification *w); // print the results, and add them to the JSON output
    const char *csv_head;               // names of the columns of --csv
    // write the rows of --csv; false: the fitted values cannot be computed
    bool (*csv_rows)(const kn_identification *w, FILE *f);
    int (*draw)(kn_identification *w, const char *path); // draw the plot of --png
    int (*report)(kn_identification *w, kn_document *d); // fill the page
    int (*write_material)(const kn_identification *w, const char *path);
} kn_identify_experiment;

extern const kn_identify_experiment kn_identify_creep, kn_identify_press, kn_identify_relax, kn_identify_sweep;
int kn_identify_shape_main(int argc, char **argv);

// Name the files of the material, and that they were of shear (parameter_estimate.h).
const char *kn_identify_source(const kn_identification *w, char text[KN_SOURCE_MAX]);

// Add a note on the results: print the note, and store it for the page and for --json.
__attribute__((format(printf, 2, 3))) void kn_identify_note(kn_identification *w, const char *format, ...);

// A lattice that is off by more than this share of the largest value does not follow the measurement.
#define KN_IDENTIFY_FOLLOWS 0.15

// Fit other models to the same curves. Print the comparison and add it to the JSON output. If the comparison is not
// possible, return false with one sentence in `error`. With --no-models do nothing and return true.
bool kn_identify_compare(kn_identification *w, char error[400]);

// Print a parameter with its interval, and in the next line the remark number->words. `name` and `interval` are the
// least widths of the columns for name and interval, in characters. The text `more` follows the interval.
void kn_identify_print_number(const kn_parameter_estimate *number, int name, int interval, const char *more);
// add parameters to "numbers" of the JSON output
void kn_identify_tell_numbers(int count, const kn_parameter_estimate *number);
// add a parameter as a row to the table on the page
void kn_identify_page_number(kn_document *d, const kn_parameter_estimate *number);

// Format the result of kn_fit_runs; "-" if there were too few readings.
const char *kn_identify_runs(double runs, char text[16]);

// Write the table of --csv to the file `csv` of the page's folder and, if `material` is true, also write the material.
// Add a section to the page with a link to each of these files.
int kn_identify_page_files(const kn_identification *w, kn_document *d, const char *csv, const char *words,
                           bool material);
void kn_identify_page_material(kn_document *d); // add a link to material.yaml to the page

// Add a series of points or a line to a panel of a plot. `scale` multiplies y.
void kn_identify_plot(kn_figure_panel *p, const char *name, int count, const double *x, const double *y, double scale,
                      kn_figure_look look, int hue);

// Fill x[KN_IDENTIFY_POINTS] with a geometric progression from `low` to `high`.
void kn_identify_points(double low, double high, double *x);

// ---- the lattice of creep's --serve (served_scene.c)

// Choose the cells of the lattice that the options ask for. Return 0, or print an error and return an exit code.
int kn_served_scene_cut(kn_identification *w);
// Fit the lattice, and print its parameters with what is left on each curve.
void kn_served_scene_fit(kn_identification *w);
// Write the first paper's block with the lattice's material as a scene. Its label says what is left on each curve. Return 0,
// or print an error and return an exit code.
int kn_served_scene_write(const kn_identification *w, const char *path);
// Add the section on lattices to the page: how far blocks with the element's parameters are from the curves and, with
// --serve, the lattice. Its scene is written beside the page.
int kn_served_scene_page(kn_document *d, const kn_identification *w);

#endif
