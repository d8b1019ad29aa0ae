#ifndef KN_CLIENTS_SHAPE_SHAPE_COMMAND_H
#define KN_CLIENTS_SHAPE_SHAPE_COMMAND_H
// The parts of `knead identify shape`: input and output.
#include "clients/shape/shape_options.h"

// Read the measurements that the options name. `candidate` may be any candidate, since all candidates share the object
// and the press. Report changes to the readings on stdout. Return 0, or print an error, set all bytes of `measurement`
// to 0 and return an exit code.
int kn_shape_measured(kn_measurement *measurement, const kn_shape_options *options, const kn_candidate *candidate);

// Print the results, and add them to kn_result (--json).
void kn_shape_print_object(const kn_shape_options *options, const kn_candidate *first);
void kn_shape_print(const kn_measurement *measurement, const kn_candidate *candidate, int count,
                    const kn_structure_verdict *verdict);

// Print the misfit of the best candidate, computed again with cells of half the width (kn_candidate_finer).
void kn_shape_print_finer(const kn_measurement *measurement, const kn_candidate *best, const kn_candidate *finer);

// Draw the plot of --png: the first range image, the fitted structure, their difference, and the forces. Return 0, or
// print an error and return an exit code.
int kn_shape_draw(const kn_shape_options *options, const kn_measurement *measurement, const kn_candidate *best);

// Draw the range image of a candidate in the frame of the first image, as displaced by the candidate's fit. The heights
// have the frame's step; level[frame.height][frame.width].
void kn_shape_draw_range(const kn_candidate *candidate, kn_range frame, uint16_t *level);

#endif
