#ifndef KN_CLIENTS_SHAPE_SHAPE_REPORT_H
#define KN_CLIENTS_SHAPE_SHAPE_REPORT_H
// Output of `knead identify shape`: the printed results, the same results in kn_result (--json), and the plot.
#include "clients/shape/shape_options.h"
#include "clients/shape/verdict.h"

void kn_shape_print_object(const kn_shape_options *options, const kn_candidate *first);
void kn_shape_print(const kn_shape_options *options, const kn_evidence *evidence, const kn_candidate *candidate,
                    int count, const kn_verdict *verdict);

// Print the misfit of the best candidate, computed again with cells of half the width (kn_candidate_finer).
void kn_shape_print_finer(const kn_evidence *evidence, const kn_candidate *best, const kn_candidate *finer);

// Draw the plot of --png: the first range image, the fitted structure, their difference, and the forces. Return 0, or
// print an error and return an exit code.
int kn_shape_draw(const kn_shape_options *options, const kn_evidence *evidence, const kn_candidate *best);

#endif
