#ifndef KN_CLIENTS_IDENTIFY_RELAX_TOLD_H
#define KN_CLIENTS_IDENTIFY_RELAX_TOLD_H
// Output of the results of `knead identify relax`: notes on doubtful results, plots and the HTML report.
#include "clients/report/report_page.h"
#include "clients/identify/model_comparison.h"
#include "clients/identify/options.h"
#include "clients/identify/relaxation_fit.h"

typedef struct kn_relax_told {
    const kn_identify_options *opt;
    const kn_relaxation_fit *fit;
    kn_model_comparison *models; // comparison with other models; NULL: none; kn_relax_draw uses them as scratch
} kn_relax_told;

// Return a sentence on how well the curves determine the scale k1, and which parameters depend on k1.
const char *kn_relax_scale(const kn_relaxation_fit *fit);

// Call `say` once for each doubt about the fit, with `to` and one sentence.
void kn_relax_doubts(const kn_relaxation_fit *fit, void (*say)(void *to, const char *words), void *to);

// Draw one PNG file: the stress over time with the fit, the residuals, and the predictions of other models beside the
// first curve. Return 0, or print an error and return an exit code.
int kn_relax_draw(const kn_relax_told *told, const char *path);

// Fill an open report with the plots, the readings and the material. The functions `write_csv` and `write_material`
// write the files of the readings and of the material to `path`. Return 0, or print an error and return an exit code.
int kn_relax_report(kn_document *d, const kn_relax_told *told,
                    int (*write_csv)(const kn_relax_told *told, const char *path),
                    int (*write_material)(const kn_relax_told *told, const char *path));

#endif
