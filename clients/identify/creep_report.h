#ifndef KN_CLIENTS_IDENTIFY_CREEP_REPORT_H
#define KN_CLIENTS_IDENTIFY_CREEP_REPORT_H
// The page of `knead identify creep --report DIR`: all printed results with plots. The page also checks the identified
// material in two ways. It computes the creep of the material as one element and as a lattice and compares both with
// the data (recreep.h). It also presses a block of the material (squeeze.h).
#include "clients/identify/document.h"
#include "clients/identify/joint.h"
#include "clients/identify/models.h"

#define KN_CREEP_NOTES 100

typedef struct kn_creep_found {
    const char *subcommand;
    int curves;
    const kn_curve *curve;
    const kn_joint *joint;
    const kn_models *models; // comparison with other models; NULL: none was made
    int notes;
    const char (*note)[400];
    bool served; // whether a scene accepts the material
} kn_creep_found;

// Fill an open report. If `served`, the report's folder must already hold material.yaml. If not, the report omits the
// creep and the press of the material. Return an exit code.
int kn_creep_report(kn_document *d, const kn_creep_found *found);

#endif
