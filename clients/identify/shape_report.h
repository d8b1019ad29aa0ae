#ifndef KN_CLIENTS_IDENTIFY_SHAPE_REPORT_H
#define KN_CLIENTS_IDENTIFY_SHAPE_REPORT_H
// The printed results of `knead identify shape`, also in kn_result, and its plot.
#include "clients/identify/shape_options.h"
#include "clients/identify/verdict.h"

void kn_shape_print_object(const kn_shape_options *options, const kn_candidate *first);
void kn_shape_print(const kn_shape_options *options, const kn_evidence *evidence, const kn_candidate *candidate,
                    int count, const kn_verdict *verdict);

// Print the best candidate in cells of half the width (kn_candidate_finer), fitted.
void kn_shape_print_finer(const kn_evidence *evidence, const kn_candidate *best, const kn_candidate *finer);

// --png: draw the first image, the fitted structure and the difference, and the forces. Return an exit code, after a
// complaint.
int kn_shape_draw(const kn_shape_options *options, const kn_evidence *evidence, const kn_candidate *best);

#endif
