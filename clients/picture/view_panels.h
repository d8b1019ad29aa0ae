#ifndef KN_CLIENTS_VIEW_PANELS_H
#define KN_CLIENTS_VIEW_PANELS_H
// Sources of the objects of `knead view`: a running kneadd, a recording that is stepped to a moment, a snapshot, or a
// scene at rest.
//
//     open -> to a moment -> still, as often as pictures are needed -> close
//
// Each function that returns an int returns an exit code. If the code is not KN_EXIT_OK, the function has printed the
// reason on stderr.
#include "clients/hand/live_server.h"
#include "clients/picture/object_still.h"
#include "clients/viewer/renderer.h"
#include "core/lattice/measure.h"
#include "server/option_table.h"
#include "server/log_replay.h"
#include "server/snapshot_file.h"

// Command line of `knead view`.

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
    double at_s[KN_VIEW_FILES_MAX]; // time of the state to draw, for each recording; INFINITY: the recording's end
    double wait_s;                  // longest time to wait for a running kneadd
    double from_s, to_s;            // part of a recording to film; to_s INFINITY: to the end of the recording
    double seconds;                 // length of a film of the served object; 0: not given
    double fps, speed;              // pictures per second of a film, and its speed relative to real time
    int width, height;
    kn_view_scene look; // camera and style of the picture
    int measure;        // kn_measure that colours the object; -1: none
    const char *top;    // argument of --top, as the user wrote it
    double top_si;      // upper end of the colour scale, SI units; 0: computed from the largest value in the picture
    bool compare;       // draw two files and a third panel: the distance of the second object from the first
    bool plain;
    // Options that are applied when all others are known. azimuth_deg, elevation_deg: NAN if the option was not given,
    // so that --camera decides. sized: true if --size was given. moments: number of times in the list of --at.
    double azimuth_deg, elevation_deg;
    bool sized;
    int moments;
} kn_view_options;

// Parse the command line. Return KN_OPTIONS_READ, or an exit code: 0 after --help, KN_EXIT_USAGE after a mistake. Paths
// and URLs in `options` point into argv.
int kn_view_parse(int argc, char **argv, kn_view_options *options);

// Return true if at least one of the objects has this kind.
bool kn_view_has(const kn_view_options *options, kn_view_kind kind);

typedef struct kn_view_source { // source of one object to draw; read-only for the caller
    kn_view_kind kind;
    const char *path; // name of the file; NULL: the source is the bus
    // Time of the state to draw. In a recording, the time counts from the beginning of the first session; for the bus,
    // from the opening of the source.
    double time_s;
    bool ended;          // true: the source has no state later than time_s
    kn_replay *replay;   // replay of the recording; NULL for other kinds of sources
    kn_live_server live; // state received from the bus; used by a bus source only
    // Scene, model and state of a scene at rest or of a snapshot; NULL for a recording and for the bus.
    kn_scene *scene;
    kn_model *model;
    kn_state *state;
    kn_saved *saved; // contents of the snapshot file; used by a snapshot source only
    int64_t opened_ms;
    bool told;       // true: the warning about a missing scene has been printed
    kn_gauge *gauge; // computes measures of the object; created when a measure is needed for the first time
    int gauged;      // number of model changes in the recording when `gauge` was created
} kn_view_source;

// Open a source. file: index of the file in `options`. If `options` has no files, join the bus and wait for the first
// complete mesh and the tools.
int kn_view_source_open(kn_view_source *source, const kn_view_options *options, int file);

// Move a source forward to the moment at_s. A recording is stepped to the tick nearest to at_s, or to its end. On the
// bus, receive messages until at_s. A snapshot, a scene at rest, and a recording that has ended do not change.
int kn_view_source_to(kn_view_source *source, double at_s);

// Make a still of the object at the present moment, with the values of --color and the edges of --style. `still` must
// be zeroed except for still->view.
int kn_view_source_still(kn_view_source *source, const kn_view_options *options, kn_object_still *still);
// Close a source. A zeroed struct is allowed.
void kn_view_source_close(kn_view_source *source);

// All panels of one picture of `knead view`: an object, or several side by side at the same moment, with the same view
// and colour scale. With --compare a last panel shows the second object, coloured by its distance from the first.
//
//     open -> { to a moment -> stills -> shoot -> drop }... -> close
//
// Functions that return int return an exit code. If the code is not KN_EXIT_OK, they have printed one line on stderr.

// KN_VIEW_SCALES: number of colour scales, one for the measure of --color and one for the distance of --compare.
enum { KN_VIEW_PANELS_MAX = KN_VIEW_FILES_MAX + 1, KN_VIEW_SCALES = 2 };

typedef struct kn_view_panels { // panels of the picture; the caller only reads the fields
    const kn_view_options *o;
    int count, panels;
    kn_view_source source[KN_VIEW_FILES_MAX];
    kn_object_still still[KN_VIEW_PANELS_MAX];
    kn_vertex_match match;
    kn_object_picture *shot[KN_VIEW_PANELS_MAX];
    uint8_t *panel, *rgba; // [o->height][o->width][4], allocated with the first picture
} kn_view_panels;

typedef struct kn_view_extent { // extent of all objects; pictures that share an extent all show the same box
    float box[2][3];            // lowest and highest coordinates of all objects, at rest and at the present time
    double most[KN_VIEW_SCALES];
} kn_view_extent;
extern const kn_view_extent kn_view_extent_none;

int kn_view_panels_open(kn_view_panels *lineup, const kn_view_options *options);
// Advance all recordings or live sources to the time at_s.
int kn_view_panels_to(kn_view_panels *lineup, double at_s);
bool kn_view_panels_ended(const kn_view_panels *lineup); // true: all recordings have ended

// Create the stills of all panels at the present time, with the colours and view of the options. A still is the data of
// an object that the renderer needs (object_still.h). Widen `extent` so that it contains all stills.
int kn_view_panels_stills(kn_view_panels *lineup, kn_view_extent *extent);

// Draw all panels into the picture. If `framed` is true, every panel shows the box of `extent`. Otherwise every panel
// is fitted to its own object. Drawing consumes the stills, so they cannot be drawn a second time.
int kn_view_panels_shoot(kn_view_panels *lineup, const kn_view_extent *extent, bool framed);
void kn_view_panels_drop(kn_view_panels *lineup);  // free the stills of all panels
void kn_view_panels_close(kn_view_panels *lineup); // free everything; a struct that is all zero is allowed

#endif
