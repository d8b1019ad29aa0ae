#ifndef KN_CLIENTS_TRADEOFF_OPTIONS_H
#define KN_CLIENTS_TRADEOFF_OPTIONS_H
// Command line of `knead tradeoff`.
#include "clients/knead/plan.h"
#include "server/option_table.h"

#define KN_TRADEOFF_SETS 64

typedef struct kn_tradeoff_options {
    // Names of files and folders (scene, log, csv, plot, resume), list of hosts, and job of a worker process; NULL: the
    // option was not given.
    const char *scene, *log, *csv, *plot, *resume, *hosts, *job;
    const char *sets[KN_TRADEOFF_SETS];
    int set_count, jobs;
    bool quick, write;
    // Bound [us] on the 90th percentile of the tick times of the point to choose; 0: --budget-us was not given.
    double budget_us;
    // True: the user gave a list for an axis, so the sweep has one point for each combination of listed values.
    bool listed;
    kn_axes_def axes; // values of each varied solver setting, see plan.h
} kn_tradeoff_options;

// Parse the command line. Return KN_OPTIONS_READ, or an exit code: 0 after --help, KN_EXIT_USAGE after a mistake.
int kn_tradeoff_options_parse(kn_tradeoff_options *opt, int argc, char **argv);

#endif
