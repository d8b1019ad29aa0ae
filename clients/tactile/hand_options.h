#ifndef KN_CLIENTS_HAND_OPTIONS_H
#define KN_CLIENTS_HAND_OPTIONS_H
// The command line of `knead hand`.
#include "clients/tactile/haply.h"
#include "clients/tactile/puck.h"
#include <stdbool.h>

typedef enum kn_hand_kind { KN_HAND_PADDLE, KN_HAND_SPACENAV, KN_HAND_HAPLY } kn_hand_kind;

typedef struct kn_hand_options {
    kn_hand_kind kind;
    const char *probe; // NULL: the scene's first round one, else its first probe
    const char *lcm_url, *mesh_url;
    const char *origin, *basis;               // NULL: the scene's device has it
    double origin_m[3], scale, force_limit_n; // 0: so
    double seconds;
    bool local, quiet, unwatched;
    const char *tty; // paddle
    int baud;
    kn_puck_def puck;         // spacenav
    char host[KN_HAPLY_HOST]; // haply
    int port;
    const char *device_id, *preset;
} kn_hand_options;

// KN_EXIT_*; done: --help was answered.
int kn_hand_options_parse(kn_hand_options *options, int argc, char **argv, bool *done);

#endif
