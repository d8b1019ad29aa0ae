#ifndef KN_CLIENTS_IDENTIFY_OPTIONS_H
#define KN_CLIENTS_IDENTIFY_OPTIONS_H
// The options of `knead identify creep`, `relax` and `sweep`: one table, a letter for each experiment that has one.
#include "clients/identify/curve.h"

typedef struct kn_identify_options {
    const char *subcommand; // "identify creep"
    kn_curve_options curve; // how the files are to be read
    const char **file;
    int files;
    double density_kg_m3; // 0: not given
    const char *out, *png, *csv, *report;
    bool no_models;      // no comparison with other models
    bool late;           // creep: the moment of each load is fitted, too
    bool shear;          // sweep: the moduli are of shear
    bool constant_noise; // relax: deviations of equal size, not of equal share
    double cut_s;        // models are fitted before it and judged after it; 0: found
} kn_identify_options;

// experiment: 'c', 'r' or 's'. *done after --help, which prints `help`. An exit code; free in every case.
int kn_identify_options_parse(kn_identify_options *opt, const char *subcommand, char experiment, const char *help,
                              int argc, char **argv, bool *done);
void kn_identify_options_free(kn_identify_options *opt);

// What all three say in their help.
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
