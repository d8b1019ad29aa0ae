#ifndef KN_CLIENTS_BENCH_H
#define KN_CLIENTS_BENCH_H
// The virtual rheometer: what creep, relax, sweep and tpa have in common. A specimen, 1 cm cube, on the bench:
//
//          load or plate            one element in one dimension (core/network.h), any expression; or with --lattice
//         +---+---+---+            a block of N x N x N cells of a scene's law through core/step.h, as it is served
//         |   1 cm    |
//         +---+---+---+            stress P over strain; force = P S, and S grows as the height falls (S h = S0 h0,
//         ///////////// table       first paper, equation 4) unless --area constant
//
// Compression is positive. SI inside; gf and cm are for reading.
#include "clients/knead/progress.h"
#include "clients/knead/table.h"
#include "core/network.h"
#include "core/scene/scene.h"
#include "core/step.h"

#define KN_BENCH_HEIGHT_M 0.01 // of the papers' specimen; S0 = 1 cm^2
#define KN_BENCH_AREA_M2 1e-4
#define KN_BENCH_TOLERANCE 1e-9 // of core/network.h
#define KN_GF_N 0.00980665
#define KN_GF_CM2_PA 98.0665
#define KN_BENCH_LOADS 16

typedef struct kn_bench_options {
    const char *subcommand, *specimen;
    const char **params, **sets; // of --param, --set
    int param_count, set_count;
    bool constant_area;
    int lattice[3]; // cells; 0: one element
    const char *csv, *png;
    double load_n[KN_BENCH_LOADS];
    int loads;
    double hold_s, rest_s, strain, ramp_per_s, speed_m_s, wait_s, amplitude, low_hz, high_hz;
    int frequencies;
} kn_bench_options;

typedef struct kn_bench {
    const kn_bench_options *opt;
    char title[400]; // what it is, one line
    kn_network net;  // the element; with a lattice the one whose law its edges have
    kn_network_state now;
    kn_drive drive;
    kn_model *model; // NULL: one element
    kn_state *lattice;
    int64_t step;
    double time_s, strain, stress_pa, force_n; // what the instrument reads
    kn_progress bar;                           // of steps of the lattice, while one is open
    int64_t stepped;                           // since it was
} kn_bench;

// Reads the options that the subcommand has: letters of which option belongs to whom stand in one table. *done after
// --help, which prints `help`. Returns an exit code; free with kn_bench_options_free in every case.
int kn_bench_options_parse(kn_bench_options *opt, const char *subcommand, const char *help, int argc, char **argv,
                           bool *done);
void kn_bench_options_free(kn_bench_options *opt);

// Finds out what the specimen is, a material (by name, or that of a scene's file) or an expression, and builds it.
int kn_bench_open(kn_bench *b, const kn_bench_options *opt);
void kn_bench_close(kn_bench *b);
void kn_bench_fresh(kn_bench *b); // an untouched specimen at time 0

// A load (its weight, N) or a strain with its rate takes over now; afterwards the readings are those just after. An
// exit code: a step of strain is impossible where a dashpot answers at once.
int kn_bench_load(kn_bench *b, double load_n);
int kn_bench_strain(kn_bench *b, double from, double rate_per_s);
int kn_bench_swing(kn_bench *b, double amplitude, double omega);
int kn_bench_advance(kn_bench *b, double until_s);

// A bar for that many seconds of a lattice, which take their time, and its end; of an element it is none.
void kn_bench_bar(kn_bench *b, double seconds);
void kn_bench_bar_end(kn_bench *b);

void kn_bench_print(const kn_bench *b); // the lines that begin every report

// An experiment as a subcommand, from its command line to its exit code: run measures, prints and fills the table,
// finish writes what --csv and --png ask for. opt: the defaults.
typedef struct kn_experiment {
    const char *name, *help;
    const char *const *columns;
    int (*run)(kn_bench *b, kn_table *t);
    int (*finish)(const kn_bench *b, const kn_table *t);
} kn_experiment;
int kn_bench_main(const kn_experiment *experiment, kn_bench_options opt, int argc, char **argv);

// The common end of the report's help, the same for all four.
#define KN_BENCH_HELP                                                                                                  \
    "the specimen, a 1 cm cube:\n"                                                                                     \
    "  MATERIAL          clay, dough, fibrotic-liver, jelly, liver, putty, as they are or with -rheological,\n"        \
    "                    -viscoelastic, -plastic; or the file of a scene, for its material\n"                          \
    "  --set KEY=VALUE   any key of a scene, e.g. material.k1='300 gf/cm^3'\n"                                         \
    "  EXPR              springs and dampers, e.g. '(s|d)-d', burgers; knead element --help tells how to write them\n" \
    "  --param P=VALUE   one for each part of EXPR; parts are s1, s2, .. d1, d2, .. in order of appearance:\n"         \
    "                    s1='46 kPa' or '470 gf/cm^3' (per cm of the cube), d1='245 kPa*s' or '2500 gf s/cm^3', and\n" \
    "                    d2='exp(8.16e4 gf s/cm^3, 0.0815 cm^2/gf, 9 gf/cm^2, 80 gf/cm^2)', a damper of\n"             \
    "                    alpha exp(-beta P) between the stresses P0 and P1, constant outside\n"

// Of the three whose stress depends on it.
#define KN_BENCH_AREA_HELP                                                                                             \
    "  --area constant   stress = force/S0; else the section grows as the height falls, S h = S0 h0\n"

#endif
