#ifndef KN_CLIENTS_IDENTIFY_OPTIONS_H
#define KN_CLIENTS_IDENTIFY_OPTIONS_H
// Options of `knead identify creep`, `relax` and `sweep`. One table holds the options of all three experiments. Each
// option lists the experiments that accept it.
#include "clients/identify/curve.h"

typedef struct kn_identify_options {
    const char *subcommand; // "identify creep"
    kn_curve_options curve; // how to read the files
    const char **file;
    int files;
    double density_kg_m3; // 0: not given
    const char *out, *png, *csv, *report;
    bool no_models;      // do not compare with other models
    bool late;           // creep: also fit the moment of each load
    bool shear;          // sweep: the moduli are shear moduli
    bool constant_noise; // relax: noise has a constant size, not a constant share of the value
    // models are fitted to readings before this time and judged by those after it; 0: chosen from the data
    double cut_s;
} kn_identify_options;

// Parse the command line of one experiment: 'c' creep, 'r' relax, 's' sweep. Return an exit code. --help prints `help`
// and sets *done. Call kn_identify_options_free in every case, also after an error.
int kn_identify_options_parse(kn_identify_options *opt, const char *subcommand, char experiment, const char *help,
                              int argc, char **argv, bool *done);
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
