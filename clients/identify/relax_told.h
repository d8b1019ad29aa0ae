#ifndef KN_CLIENTS_IDENTIFY_RELAX_TOLD_H
#define KN_CLIENTS_IDENTIFY_RELAX_TOLD_H
// The results of `knead identify relax`: notes, plots and the report.
#include "clients/identify/document.h"
#include "clients/identify/models.h"
#include "clients/identify/options.h"
#include "clients/identify/relaxation.h"

typedef struct kn_relax_told {
    const kn_identify_options *opt;
    const kn_relaxation *fit;
    kn_models *models; // comparison with other models; NULL: none; kn_relax_draw uses them as scratch
} kn_relax_told;

// Return a sentence on how well the curves determine the scale k1, and which parameters depend on k1.
const char *kn_relax_scale(const kn_relaxation *fit);

// Call `say` with each sentence of doubt about the fit.
void kn_relax_doubts(const kn_relaxation *fit, void (*say)(void *to, const char *words), void *to);

// Draw the stress over time with the fit, the residuals, and the models beside the first curve. The result is one PNG.
// Return an exit code.
int kn_relax_draw(const kn_relax_told *told, const char *path);

// Fill an open report with the pictures, the readings and the material. Return an exit code.
int kn_relax_report(kn_document *d, const kn_relax_told *told,
                    int (*write_csv)(const kn_relax_told *told, const char *path),
                    int (*write_material)(const kn_relax_told *told, const char *path));

#endif
