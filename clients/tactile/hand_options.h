#ifndef KN_CLIENTS_HAND_OPTIONS_H
#define KN_CLIENTS_HAND_OPTIONS_H
// Command line of `knead hand`.
#include "clients/tactile/haply.h"
#include "clients/tactile/spacenav.h"
#include "server/option_table.h"
#include <stdbool.h>

typedef enum kn_hand_kind { KN_HAND_PADDLE, KN_HAND_SPACENAV, KN_HAND_HAPLY } kn_hand_kind;

// Parsed options. NULL or 0 means that the option was not given, except for baud, puck.turn_rad_s, device_id and
// preset, which hold their defaults.
typedef struct kn_hand_options {
    kn_hand_kind kind;
    const char *probe; // NULL: the first round probe of the scene, or the first probe if none is round
    const char *lcm_url, *mesh_url;
    // Mounting of the device: zero position and axes; NULL: as in the scene's device.
    const char *origin, *basis;
    // scale, force_limit_n: 0 means as in the scene's device. origin_m: valid only if `origin` is not NULL.
    double origin_m[3], scale, force_limit_n;
    double seconds; // time to run; 0: run until a signal
    // unwatched: --no-watchdog was given, so the device gets force without a test of its watchdog.
    bool local, quiet, unwatched;
    const char *tty; // device file of a paddle's serial line
    int baud;
    kn_puck_def puck;         // motion of a tool that a 3D mouse (spacenav) steers
    char host[KN_HAPLY_HOST]; // host name of Haply's Inverse Service
    int port;
    const char *device_id, *preset;
} kn_hand_options;

// Parse the command line. Return KN_OPTIONS_READ, or an exit code: 0 after --help, KN_EXIT_USAGE after a mistake.
int kn_hand_options_parse(kn_hand_options *options, int argc, char **argv);

#endif
