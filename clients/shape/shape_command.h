#ifndef KN_CLIENTS_SHAPE_SHAPE_COMMAND_H
#define KN_CLIENTS_SHAPE_SHAPE_COMMAND_H
// The parts of `knead identify shape`: options, input and output.
#include "clients/shape/structure_candidate.h"
#include "clients/viewer/range.h"
#include "server/option_table.h"

// ---- the options (shape_options.c)

// Value of kn_shape_options.at_s that stands for the end of the hold. INFINITY stands for the end of the press.
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
    const char *png, *out, *out_depth;
} kn_shape_options;

// Parse the command line. Return KN_OPTIONS_READ, or an exit code: 0 after --help, KN_EXIT_USAGE after an error. If
// --json is given, kn_result is open afterwards.
int kn_shape_options_parse(kn_shape_options *options, int argc, char **argv);
void kn_shape_options_free(kn_shape_options *options);

// ---- input of measurements (shape_input.c)

// Read the measurements that the options name. `candidate` may be any candidate, since all candidates share the object
// and the press. If readings were left out, sorted or changed in sign, print this on stdout. Return 0, or print an
// error, set all bytes of `measurement` to 0 and return an exit code.
int kn_shape_measured(kn_measurement *measurement, const kn_shape_options *options, const kn_candidate *candidate);

// ---- output of results (shape_report.c)

// Print the results, and add them to kn_result (--json).
void kn_shape_print_object(const kn_shape_options *options, const kn_candidate *first);
void kn_shape_print(const kn_measurement *measurement, const kn_candidate *candidate, int count,
                    const kn_structure_verdict *verdict);

// Print the misfit of the best candidate, computed again with cells of half the width (kn_candidate_finer).
void kn_shape_print_finer(const kn_measurement *measurement, const kn_candidate *best, const kn_candidate *finer);

// Draw the plot of --png: the first range image, the fitted structure, their difference, and the forces. Return 0, or
// print an error and return an exit code.
int kn_shape_draw(const kn_shape_options *options, const kn_measurement *measurement, const kn_candidate *best);

// Draw the range image of a candidate to level[frame.height][frame.width], in the frame of the first image. The image
// is displaced by the shift that the candidate's fit has found. The heights are in units of frame.step_m.
void kn_shape_draw_range(const kn_candidate *candidate, kn_range frame, uint16_t *level);

#endif
