#ifndef KN_CLIENTS_IDENTIFY_SHAPE_REPORT_H
#define KN_CLIENTS_IDENTIFY_SHAPE_REPORT_H
// What `knead identify shape` prints, also into kn_result, and draws.
#include "clients/identify/shape_options.h"
#include "clients/identify/verdict.h"

void kn_shape_print_object(const kn_shape_options *options, const kn_candidate *first);
void kn_shape_print(const kn_shape_options *options, const kn_evidence *evidence, const kn_candidate *candidate,
                    int count, const kn_verdict *verdict);

// Of the best one in halved cells (kn_candidate_finer), fitted.
void kn_shape_print_finer(const kn_evidence *evidence, const kn_candidate *best, const kn_candidate *finer);

// --png: of the first image what was measured, what was found and the difference; the forces. An exit code, after a
// complaint.
int kn_shape_draw(const kn_shape_options *options, const kn_evidence *evidence, const kn_candidate *best);

#endif
