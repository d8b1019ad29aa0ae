#ifndef KN_CLIENTS_TRADEOFF_OPTIONS_H
#define KN_CLIENTS_TRADEOFF_OPTIONS_H
// Command line of `knead tradeoff`.
#include "clients/knead/plan.h"

#define KN_TRADEOFF_SETS 64

typedef struct kn_tradeoff_options {
    // File and folder names, hosts, and the job of a worker process; NULL: not given.
    const char *scene, *log, *csv, *plot, *resume, *hosts, *job;
    const char *sets[KN_TRADEOFF_SETS];
    int set_count, jobs;
    bool quick, write;
    double budget_us; // 0: not given
    bool listed;      // an axis was given: the sweep has one point for each combination of the values in the lists
    kn_axes_def axes; // values of each axis, see plan.h
} kn_tradeoff_options;

// Parse the command line. Return an exit code. On failure, print an error message. *done: --help was answered.
int kn_tradeoff_options_parse(kn_tradeoff_options *opt, int argc, char **argv, bool *done);

#endif
