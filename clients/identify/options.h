#ifndef KN_CLIENTS_IDENTIFY_OPTIONS_H
#define KN_CLIENTS_IDENTIFY_OPTIONS_H
// Options of `knead identify creep`, `relax` and `sweep`. One table holds the options of all three experiments. Each
// option lists the experiments that accept it.
#include "clients/identify/measured_curve.h"
#include "server/option_table.h"

typedef struct kn_identify_options {
    const char *subcommand; // "identify creep"; named in error messages
    kn_curve_options curve; // how to read the files
    const char **file;      // [files] paths of the input files
    int files;
    double density_kg_m3; // density of the material; 0: not given
    const char *out, *png, *csv, *report;
    bool no_models;      // do not compare the result with other material models
    bool late;           // creep: also fit the times at which the loads were applied and removed
    bool shear;          // sweep: the measured moduli are shear moduli
    bool constant_noise; // relax: the noise has the same size for all stresses, not the same share of each stress
    // comparison of models: they are fitted to the readings before this time and judged by the later readings [s]; 0: a
    // time is chosen from the data
    double cut_s;
} kn_identify_options;

// Parse the command line of one experiment: 'c' for creep, 'r' for relax, 's' for sweep. Return KN_OPTIONS_READ, or an
// exit code: 0 after --help, which prints `help`, another one after an error. Call kn_identify_options_free in every
// case, even after an error.
int kn_identify_options_parse(kn_identify_options *opt, const char *subcommand, char experiment, const char *help,
                              int argc, char **argv);
void kn_identify_options_free(kn_identify_options *opt);

// The part of the help text that all three experiments share.
#define KN_IDENTIFY_OUTPUT_HELP                                                                                        \
    "  --out FILE        the material, for `material: FILE` of a scene; every number with its interval beside it\n"    \
    "  --density D       written beside it, e.g. '1.2 g/cm^3' (1.2 g/cm^3, and said)\n"                                \
    "  --report DIR      a page, DIR/index.html, with all that is told here, pictures, curves and the material\n"      \
    "  --png FILE        readings, fit and what is left, by gnuplot\n"                                                 \
    "  --csv FILE        readings and fit\n"                                                                           \
    "  --json            what is printed, as JSON\n"                                                                   \
    "  --no-models       does not compare with other models\n"                                                         \
    "  --cut TIME        models are fitted before and judged after it (a tenth of the time, or half of each part)\n"

#endif
