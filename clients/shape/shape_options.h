#ifndef KN_CLIENTS_SHAPE_SHAPE_OPTIONS_H
#define KN_CLIENTS_SHAPE_SHAPE_OPTIONS_H
// The options of `knead identify shape`.
#include "clients/shape/structure_candidate.h"
#include "clients/viewer/range.h"
#include "server/option_table.h"

// special value of kn_shape_options.at_s: the end of the hold. The value INFINITY means the end of the press
#define KN_SHAPE_HOLD (-INFINITY)

typedef struct kn_shape_options { // all paths are pointers into argv
    kn_candidate_def scene;
    const char **sets; // values of the --set options; the array is owned
    const char *depth[KN_PRESS_MOMENTS], *points, *force, *log;
    int depths;                    // number of range images in depth[]
    double at_s[KN_PRESS_MOMENTS]; // time of each range image in depth[], followed by the time of the points
    int moments;                   // number of times in at_s[]
    double force_begin_s;          // time in the force file at which the press begins
    kn_press_def press;
    kn_range_given given;
    bool align, finer;
    const char *only;
    int jobs;
    const char *png, *out, *out_depth;
} kn_shape_options;

// Parse the command line. Return KN_OPTIONS_READ, or an exit code: 0 after --help, KN_EXIT_USAGE after an error. If
// --json is given, kn_result is open afterwards.
int kn_shape_options_parse(kn_shape_options *options, int argc, char **argv);
void kn_shape_options_free(kn_shape_options *options);

#endif
