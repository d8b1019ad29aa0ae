#ifndef KN_CLIENTS_VIEW_OPTIONS_H
#define KN_CLIENTS_VIEW_OPTIONS_H
// What `knead view` was asked for.
#include "clients/viewer/renderer.h"
#include "core/gauge.h"

typedef struct kn_view_options {
    const char *png, *video; // what is written
    const char *log, *scene; // what is drawn; both NULL: the bus
    const char *url, *mesh_url;
    double at_s;   // INFINITY: end
    double wait_s; // for a server
    double from_s, to_s, seconds; // a film's part of the recording; of what is live. to_s INFINITY, seconds 0: none given
    double fps, speed, orbit_deg_s; // of a film
    int width, height;
    kn_view_scene look; // where from, style
    int measure;        // kn_measure; -1: none
    const char *top;    // as asked for
    double top_si;      // 0: what the picture needs
    bool plain, help;
} kn_view_options;

extern const char kn_view_help[];

// An exit code, after a complaint. Paths and URLs point into argv.
int kn_view_parse(int argc, char **argv, kn_view_options *options);

#endif
