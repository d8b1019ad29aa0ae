#ifndef KN_CLIENTS_IDENTIFY_SHAPE_OPTIONS_H
#define KN_CLIENTS_IDENTIFY_SHAPE_OPTIONS_H
// What `knead identify shape` was asked for.
#include "clients/identify/candidate.h"
#include "clients/viewer/range_file.h"

#define KN_SHAPE_HOLD (-INFINITY) // among moments: the end of the hold; INFINITY: the end of the press

typedef struct kn_shape_options { // paths point into argv
    kn_candidate_def scene;
    const char **sets; // owned
    const char *depth[KN_PRESS_MOMENTS], *points, *force, *log;
    int depths;
    double at_s[KN_PRESS_MOMENTS]; // of each image, then of the points
    int moments;                   // that were told
    double force_begin_s;          // in the file of the force, when the press begins
    kn_press_def press;
    kn_range_given given;
    bool align, finer, help;
    const char *only;
    int jobs;
    const char *png, *out, *out_depth;
} kn_shape_options;

// An exit code, after a complaint. --json has opened kn_result then.
int kn_shape_options_parse(kn_shape_options *options, int argc, char **argv);
void kn_shape_options_free(kn_shape_options *options);

// What was measured, by the options, in the scene that all candidates press. candidate: any of them. An exit code,
// after a complaint; evidence is zeroed then. What was done to the readings is told on stdout.
int kn_shape_measured(kn_evidence *evidence, const kn_shape_options *options, const kn_candidate *candidate);

#endif
