#ifndef KN_CLIENTS_VIEW_OPTIONS_H
#define KN_CLIENTS_VIEW_OPTIONS_H
// What `knead view` was asked for.
#include "clients/viewer/renderer.h"
#include "core/gauge.h"

#define KN_VIEW_FILES_MAX 4

typedef enum kn_view_kind { KN_VIEW_BUS, KN_VIEW_LOG, KN_VIEW_SNAPSHOT, KN_VIEW_SCENE } kn_view_kind;

typedef struct kn_view_options {
    const char *png, *video, *depth; // what is written: one of them
    int file_count;                  // what is drawn; 0: the bus
    const char *file[KN_VIEW_FILES_MAX];
    kn_view_kind kind[KN_VIEW_FILES_MAX]; // told by their first bytes
    const char *scene;                    // that a snapshot is of, or NULL
    const char *url, *mesh_url;
    double at_s[KN_VIEW_FILES_MAX]; // of each recording; INFINITY: end
    double wait_s;                  // for a server
    double from_s, to_s;            // a film's part of the recording; INFINITY: to its end
    double seconds;                 // a film of what is live; 0: not given
    double fps, speed, orbit_deg_s; // of a film
    int width, height;
    kn_view_scene look; // where from, style
    int measure;        // kn_measure; -1: none
    const char *top;    // as asked for
    double top_si;      // 0: what the picture needs
    bool compare;       // two files, and a panel with the second's distance from the first
    bool plain, help;
} kn_view_options;

extern const char kn_view_help[];

// An exit code, after a complaint. Paths and URLs point into argv.
int kn_view_parse(int argc, char **argv, kn_view_options *options);

bool kn_view_has(const kn_view_options *options, kn_view_kind kind); // among its files

#endif
