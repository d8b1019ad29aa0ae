#ifndef KN_CLIENTS_PROBE_OPTIONS_H
#define KN_CLIENTS_PROBE_OPTIONS_H
// The command line of `knead probe`. Lengths, times and speeds come with their units, as in scenes.
#include "clients/knead/arm.h"
#include "clients/knead/path.h"
#include <stdbool.h>

typedef struct kn_probe_options {
    const char *path;                                       // press, sine, poke, or a CSV file
    const char *probe;                                      // NULL: the scene's first
    const char *record, *csv, *motors, *lcm_url, *mesh_url; // NULL: none, or the default
    kn_path_def shape;                                      // touch_z_m is the scene's to say
    int drop_at_ms, drop_ms, tries;
    bool gripped; // a simulated device in a hand goes where path and forces take it; else the path is the tool's
    kn_grip grip;
    const char *device; // profile of it, NULL: the scene's
    int axes, delay_ms;
    double loss;
    bool local, held;
    bool quiet;
} kn_probe_options;

// KN_EXIT_OK, or KN_EXIT_USAGE after one line on stderr. *done: --help was answered, nothing is left to do.
int kn_probe_options_parse(kn_probe_options *options, int argc, char **argv, bool *done);

#endif
