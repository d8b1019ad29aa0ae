#ifndef KN_CLIENTS_RHEOMETER_H
#define KN_CLIENTS_RHEOMETER_H
// The virtual rheometer: the common part of creep, relax, sweep and tpa. The specimen is a 1 cm cube on a bench:
//
//          level plate              The specimen is one element in one dimension (core/network.h), any expression. With
//         =============             --lattice it is a block of N x N x N cells with a scene's law, stepped by core/step.h
//         |   1 cm    |             as in the server. A plate of prescribed force or height presses it.
//         =============             Force = P S with stress P and section S. S grows as the height h falls, S h = S0 h0
//             table                 (first paper, equation 4), unless --constant-area is given.
//
// The force of the element follows from its stress. The force of a lattice is that on its plate, and its stress is this
// force over the same section S, whatever section the lattice itself has.
//
// Compression is positive. All values are in SI units. The units gf and cm appear only in input and output.
#include "clients/cli/command.h"
#include "clients/cli/curve_table.h"
#include "core/level_plate.h"
#include "core/network.h"
#include "core/scene/scene.h"
#include "core/step.h"
#include "server/option_table.h"

// Height of the specimen, which is a cube as in the papers. The section S0 of the cube is 1 cm^2
// (KN_RHEOMETER_AREA_M2).
#define KN_RHEOMETER_HEIGHT_M 0.01
#define KN_RHEOMETER_AREA_M2 1e-4
// Tolerance of kn_network_advance: local error of one integration step, relative to the largest strain of any spring or
// damper.
#define KN_RHEOMETER_TOLERANCE 1e-9
#define KN_BONDED_PA 1e9 // adhesion of a plate to which the specimen is glued
#define KN_GF_N 0.00980665
#define KN_GF_CM2_PA 98.0665
// longest and shortest time step of a lattice; creep takes seconds
#define KN_RHEOMETER_STEP_S 1e-2
#define KN_RHEOMETER_SHORT_S 1e-4
#define KN_RHEOMETER_LOADS 16

typedef struct kn_rheometer_options {
    const char *subcommand, *specimen;
    const char **params, **sets; // arguments of the options --param and --set
    int param_count, set_count;
    bool constant_area;
    int lattice[3];                  // number of cells along x, y, z; 0: the specimen is one element
    bool table_sticks, plate_slides; // lattice: whether it sticks to the table, and slides on the plate
    double adhesion_pa;              // tension at which the plate comes off the specimen
    const char *csv, *png;
    double load_n[KN_RHEOMETER_LOADS];
    int loads;
    double hold_s, rest_s, strain, ramp_per_s, speed_m_s, wait_s, amplitude, low_hz, high_hz;
    int frequencies;
} kn_rheometer_options;

typedef struct kn_rheometer {
    const kn_rheometer_options *opt;
    char title[400]; // description of the specimen in one line
    kn_network net;  // network of springs and dampers: the specimen itself, or with --lattice the law of each edge
    kn_network_state now;
    kn_drive drive;
    kn_model *model;   // lattice model of the specimen; NULL: the specimen is one element
    bool lattice_runs; // the experiment runs on the lattice, not on the element
    kn_state *lattice, *trial;
    kn_scratch *scratch;
    kn_level_plate plate; // plate of the lattice while it carries a load
    bool flat;            // the plate has squeezed the lattice flat: the time and the readings stay as they are
    int64_t step;
    double time_s, strain, stress_pa, force_n; // latest readings: time, strain, stress and force of the specimen
    kn_progress bar;                           // progress bar, which counts lattice steps while it is open
    int64_t stepped;                           // number of lattice steps since the progress bar was opened
} kn_rheometer;

// Read the command-line options of a rheometer subcommand. One table says which options each subcommand accepts. Return
// KN_OPTIONS_READ, or an exit code: 0 after --help, which prints `help`. Call kn_rheometer_options_free afterwards,
// also after a failure.
int kn_rheometer_options_parse(kn_rheometer_options *opt, const char *subcommand, const char *help, int argc,
                               char **argv);
void kn_rheometer_options_free(kn_rheometer_options *opt);

// Build the specimen: a material (by name, or from the file of a scene) or an expression.
int kn_rheometer_open(kn_rheometer *b, const kn_rheometer_options *opt);
void kn_rheometer_close(kn_rheometer *b);
void kn_rheometer_fresh(kn_rheometer *b); // replace the specimen by an undeformed one and set the time to 0

// Run the experiments that follow on the lattice (true) or on the element.
void kn_rheometer_choose(kn_rheometer *b, bool lattice);
// Give the lattice a time step of which `span_s` is a whole multiple, at least `steps` times if the step is then not too
// short. Replace the lattice by an undeformed one. Call it between experiments. Does nothing without a lattice.
int kn_rheometer_time_step(kn_rheometer *b, double span_s, int steps);

// Change the drive of the specimen at the present time: a load (the weight load_n), a strain (beginning with the value
// `from`, then changing at the rate rate_per_s), or an oscillating strain. Afterwards the readings in `b` are those
// just after the change. Return an exit code. A sudden step of strain fails if the element at first responds as a
// dashpot, because the stress would be infinite.
int kn_rheometer_load(kn_rheometer *b, double load_n);
int kn_rheometer_strain(kn_rheometer *b, double from, double rate_per_s);
int kn_rheometer_swing(kn_rheometer *b, double amplitude, double omega);
// Advance the specimen to the simulated time until_s.
int kn_rheometer_advance(kn_rheometer *b, double until_s);

// Open a progress bar for `seconds` of simulated time (kn_rheometer_bar), and close it (kn_rheometer_bar_end). Only a
// lattice takes long enough to need a bar. Both functions do nothing if the specimen is a single element.
void kn_rheometer_bar(kn_rheometer *b, double seconds);
void kn_rheometer_bar_end(kn_rheometer *b);

void kn_rheometer_print(const kn_rheometer *b); // print the heading, which is the same for all experiments

// A rheometer experiment as a subcommand of knead. kn_rheometer_main runs it, from its command line to its exit code.
// `run` measures, prints the results and fills the table `t`, which --csv writes and --png draws on two `axes` under a
// `title`. The argument `opt` of kn_rheometer_main holds the default options.
typedef struct kn_experiment {
    const char *name, *help;
    const char *const *columns;
    int (*run)(kn_rheometer *b, kn_table *t);
    const kn_axes *axes;
    void (*title)(const kn_rheometer *b, char *text, size_t size);
} kn_experiment;
int kn_rheometer_main(const kn_experiment *experiment, kn_rheometer_options opt, int argc, char **argv);

// Help text on the specimen, shared by creep, relax, sweep and tpa.
#define KN_RHEOMETER_HELP                                                                                              \
    "\nthe specimen, a 1 cm cube:\n"                                                                                   \
    "  MATERIAL          clay, dough, dough-lattice, fibrotic-liver, jelly, liver, putty, alone or with\n"             \
    "                    -rheological, -viscoelastic, -plastic; or a scene, for its material: a file, or a\n"          \
    "                    name that is no material, such as bun\n"                                                      \
    "  --set KEY=VALUE   any key of a scene, e.g. material.k1='300 gf/cm^3'\n"                                         \
    "  EXPR              springs and dampers, e.g. '(s|d)-d', burgers; knead element --help explains the notation\n"   \
    "  --param P=VALUE   value of one part of EXPR; parts are s1, s2, .. d1, d2, .. in order of appearance:\n"         \
    "                    s1='46 kPa' or '470 gf/cm^3' (per cm of the cube), d1='245 kPa*s' or '2500 gf s/cm^3', and\n" \
    "                    d2='exp(8.16e4 gf s/cm^3, 0.0815 cm^2/gf, 9 gf/cm^2, 80 gf/cm^2)', a damper of\n"             \
    "                    alpha exp(-beta P) for stresses P between P0 and P1, constant outside this range\n"

// Help text of --lattice.
#define KN_RHEOMETER_LATTICE_HELP                                                                                      \
    "  --lattice NxNxN   also test a lattice of so many cells, as high as the specimen, by the solver of kneadd,\n"    \
    "                    between a table and a level plate\n"                                                          \
    "  --table HOW       the lattice on the table: slide (without friction, default) or stick\n"                       \
    "  --plate HOW       the lattice on the plate: stick (default) or slide\n"

// Help text of --area, for creep, relax and tpa, whose stress depends on the section of the specimen.
#define KN_RHEOMETER_AREA_HELP                                                                                         \
    "  --constant-area   take stress = force/S0; by default the section grows as the height falls, S h = S0 h0\n"

#endif
