#ifndef KN_CLIENTS_IDENTIFY_CREEP_REPORT_H
#define KN_CLIENTS_IDENTIFY_CREEP_REPORT_H
// The HTML page of `knead identify creep --report DIR`: all printed results with plots. For the page, the identified
// material is also checked in two ways. First, the creep of one element and of a lattice of the material are computed
// and compared with the data (recreep.h). Second, a block of the material is pressed (squeeze.h).
#include "clients/report/report_page.h"
#include "clients/identify/creep_fit.h"
#include "clients/identify/model_comparison.h"

#define KN_CREEP_NOTES 100

typedef struct kn_creep_found {
    const char *subcommand;
    int curves;
    const kn_curve *curve;
    const kn_creep_fit *joint;
    const kn_model_comparison *models; // comparison with other material models; NULL: no comparison was made
    int notes;                         // number of notes
    const char (*note)[400];           // [notes] sentences on doubtful results
    bool served;                       // whether a scene accepts the identified material
} kn_creep_found;

// Fill an open report. If found->served, the report's folder must already hold material.yaml. Otherwise the report
// omits the computed creep and the simulated press of the material. Return 0, or print an error and return an exit
// code.
int kn_creep_report(kn_document *d, const kn_creep_found *found);

#endif
