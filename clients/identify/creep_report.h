#ifndef KN_CLIENTS_IDENTIFY_CREEP_REPORT_H
#define KN_CLIENTS_IDENTIFY_CREEP_REPORT_H
// The page of `knead identify creep --report DIR`: all that was told, with pictures; and the way back: the material
// creeps again as one element and as a lattice, laid over the data (recreep.h), and a block of it is pressed.
#include "clients/identify/document.h"
#include "clients/identify/joint.h"
#include "clients/identify/models.h"

#define KN_CREEP_NOTES 100

typedef struct kn_creep_found {
    const char *subcommand;
    int curves;
    const kn_curve *curve;
    const kn_joint *joint;
    const kn_models *models; // NULL: none were compared
    int notes;
    const char (*note)[400];
    bool served; // a scene takes the material
} kn_creep_found;

// Fills an open document, in whose folder material.yaml is already if it is served; else there is no way back. An exit
// code.
int kn_creep_report(kn_document *d, const kn_creep_found *found);

#endif
