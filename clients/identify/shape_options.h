#ifndef KN_CLIENTS_IDENTIFY_SHAPE_OPTIONS_H
#define KN_CLIENTS_IDENTIFY_SHAPE_OPTIONS_H
// The options of `knead identify shape`.
#include "clients/identify/candidate.h"
#include "clients/viewer/range_file.h"

#define KN_SHAPE_HOLD (-INFINITY) // special value of at_s: the end of the hold. INFINITY: the end of the press

typedef struct kn_shape_options { // paths point into argv
    kn_candidate_def scene;
    const char **sets; // owned
    const char *depth[KN_PRESS_MOMENTS], *points, *force, *log;
    int depths;
    double at_s[KN_PRESS_MOMENTS]; // time of each image, then of the points
    int moments;                   // number of times given
    double force_begin_s;          // time in the force file at which the press begins
    kn_press_def press;
    kn_range_given given;
    bool align, finer, help;
    const char *only;
    int jobs;
    const char *png, *out, *out_depth;
} kn_shape_options;

// Parse the command line. Return an exit code, after a complaint. If --json is given, kn_result is open afterwards.
int kn_shape_options_parse(kn_shape_options *options, int argc, char **argv);
void kn_shape_options_free(kn_shape_options *options);

// Read the measurements that the options name. `candidate` may be any candidate, since all candidates share the object
// and the press. Return an exit code; after a complaint `evidence` is zeroed. Changes to the readings are reported on
// stdout.
int kn_shape_measured(kn_evidence *evidence, const kn_shape_options *options, const kn_candidate *candidate);

#endif
