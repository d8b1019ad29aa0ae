#ifndef KN_CLIENTS_IDENTIFY_RELAX_TOLD_H
#define KN_CLIENTS_IDENTIFY_RELAX_TOLD_H
// What `knead identify relax` has found, for eyes and for programs.
#include "clients/identify/document.h"
#include "clients/identify/models.h"
#include "clients/identify/options.h"
#include "clients/identify/relaxation.h"

typedef struct kn_relax_told {
    const kn_identify_options *opt;
    const kn_relaxation *fit;
    kn_models *models; // NULL: none; drawing works in their memory
} kn_relax_told;

// A sentence on what these curves know of the scale, and what rests on it.
const char *kn_relax_scale(const kn_relaxation *fit);

// Calls say for each sentence on what is to be doubted.
void kn_relax_doubts(const kn_relaxation *fit, void (*say)(void *to, const char *words), void *to);

// Stress over time with the fit; what is left; the models beside the first curve. One PNG; an exit code.
int kn_relax_draw(const kn_relax_told *told, const char *path);

// Fills an open document, with its pictures, the readings and the material. An exit code.
int kn_relax_report(kn_document *d, const kn_relax_told *told,
                    int (*write_csv)(const kn_relax_told *told, const char *path),
                    int (*write_material)(const kn_relax_told *told, const char *path));

#endif
