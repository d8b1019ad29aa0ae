#ifndef KN_CLIENTS_PROBE_OPTIONS_H
#define KN_CLIENTS_PROBE_OPTIONS_H
// Command line of `knead probe`. Lengths, times and speeds are written with their units, as in scenes.
#include "clients/hand/haptic_loop.h"
#include "clients/hand/tool_path.h"
#include "server/option_table.h"
#include <stdbool.h>

typedef struct kn_probe_options {
    // path of the tool: "press", "sine", "poke", or the name of a CSV file with poses.
    const char *path;
    const char *probe; // name of a tool; NULL: see find_tool in probe.c
    // Names of output files, and URLs of the two buses; NULL: no such file, or the default URL.
    const char *record, *csv, *motors, *lcm_url, *mesh_url;
    // Shape of a press, sine or poke; its touch_z_m is computed later from the mesh.
    kn_tool_path_def shape;
    int drop_at_ms, drop_ms, tries;
    // --hand: a hand follows the path and grips a simulated device, so path and forces together move the tool. Without
    // the option --hand the tool follows the path exactly.
    bool gripped;
    kn_grip grip;
    const char *device; // name of the profile of the simulated device; NULL: the device in the scene
    int axes, delay_ms;
    double loss;
    bool local, held;
    bool quiet;
} kn_probe_options;

// Parse the command line. Return KN_OPTIONS_READ, or an exit code: 0 after --help, KN_EXIT_USAGE after a mistake.
int kn_probe_options_parse(kn_probe_options *options, int argc, char **argv);

#endif
