#ifndef KN_CLIENTS_PROBE_OPTIONS_H
#define KN_CLIENTS_PROBE_OPTIONS_H
// Command line of `knead probe`. Lengths, times and speeds are written with their units, as in scenes.
#include "clients/knead/arm.h"
#include "clients/knead/path.h"
#include <stdbool.h>

typedef struct kn_probe_options {
    const char *path;                                       // press, sine, poke, or the name of a CSV file
    const char *probe;                                      // name of a tool; NULL: see find_tool in probe.c
    const char *record, *csv, *motors, *lcm_url, *mesh_url; // file names and URLs; NULL: none, or the default
    kn_path_def shape;                                      // touch_z_m is set later, from the mesh
    int drop_at_ms, drop_ms, tries;
    // --hand: a hand follows the path and grips a simulated device, so path and forces together move the tool. Without
    // --hand the tool follows the path exactly.
    bool gripped;
    kn_grip grip;
    const char *device; // profile of the simulated device; NULL: the scene's device
    int axes, delay_ms;
    double loss;
    bool local, held;
    bool quiet;
} kn_probe_options;

// Parse the command line. Return KN_EXIT_OK, or print one line on stderr and return KN_EXIT_USAGE. *done: --help was
// answered and nothing is left to do.
int kn_probe_options_parse(kn_probe_options *options, int argc, char **argv, bool *done);

#endif
