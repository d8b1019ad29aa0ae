#ifndef KN_CLIENTS_VIEW_OPTIONS_H
#define KN_CLIENTS_VIEW_OPTIONS_H
// Command line of `knead view`.
#include "clients/viewer/renderer.h"
#include "core/measure.h"
#include "server/option_table.h"

#define KN_VIEW_FILES_MAX 4

// Sources of an object to draw: a running kneadd on the bus, a log, a snapshot, or a scene at rest.
typedef enum kn_view_kind { KN_VIEW_BUS, KN_VIEW_LOG, KN_VIEW_SNAPSHOT, KN_VIEW_SCENE } kn_view_kind;

typedef struct kn_view_options {
    // Names of output files: picture, film, range image; exactly one of the three is set.
    const char *png, *video, *depth;
    int file_count; // number of files, one object each; 0: draw the object on the bus
    const char *file[KN_VIEW_FILES_MAX];
    kn_view_kind kind[KN_VIEW_FILES_MAX]; // kind of each file in `file`, recognised by its first bytes
    const char *scene;                    // scene file to use with a snapshot, or NULL
    const char *url, *mesh_url;
    double at_s[KN_VIEW_FILES_MAX]; // time in each recording of the state to draw; INFINITY: the end of the recording
    double wait_s;                  // longest time to wait for a running kneadd
    double from_s, to_s;            // part of a recording to film; to_s INFINITY: to the end of the recording
    double seconds;                 // length of a film of the served object; 0: not given
    double fps, speed;              // of a film: pictures per second, playing speed relative to real time
    int width, height;
    kn_view_scene look; // camera and style of the picture
    int measure;        // kn_measure that colours the object; -1: none
    const char *top;    // argument of --top, as the user wrote it
    double top_si;      // end of the colour scale in SI units; 0: the largest value in the picture
    bool compare;       // draw two files, and in a third panel the distance of the second object from the first
    bool plain;
    // Options that are applied after all others are known. Angles: of --azimuth and --elevation; NAN: as set by
    // --camera. sized: --size was given. moments: number of times in the list of --at.
    double azimuth_deg, elevation_deg;
    bool sized;
    int moments;
} kn_view_options;

// Parse the command line. Return KN_OPTIONS_READ, or an exit code: 0 after --help, KN_EXIT_USAGE after a mistake. Paths
// and URLs in `options` point into argv.
int kn_view_parse(int argc, char **argv, kn_view_options *options);

// Return true if at least one of the objects has this kind.
bool kn_view_has(const kn_view_options *options, kn_view_kind kind);

#endif
