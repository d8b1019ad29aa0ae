#ifndef KN_CLIENTS_TRADEOFF_OPTIONS_H
#define KN_CLIENTS_TRADEOFF_OPTIONS_H
// What `knead tradeoff` is asked for.
#include "clients/knead/plan.h"

#define KN_TRADEOFF_SETS 64

typedef struct kn_tradeoff_options {
    const char *scene, *log, *csv, *plot, *resume, *hosts, *job;
    const char *sets[KN_TRADEOFF_SETS];
    int set_count, jobs;
    bool quick, write;
    double budget_us; // 0: not asked
    bool listed;      // an axis was given: the product of the lists
    kn_axes_def axes;
} kn_tradeoff_options;

// An exit code; *done after --help.
int kn_tradeoff_options_parse(kn_tradeoff_options *opt, int argc, char **argv, bool *done);

#endif
