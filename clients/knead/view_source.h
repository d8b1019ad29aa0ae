#ifndef KN_CLIENTS_VIEW_SOURCE_H
#define KN_CLIENTS_VIEW_SOURCE_H
// Sources of the objects of `knead view`: a running kneadd, a recording that is stepped to a moment, a snapshot, or a
// scene at rest.
//
//     kn_source_open -> kn_source_to a moment -> kn_source_still, as often as pictures are needed -> kn_source_close
//
// Each function that returns an int returns an exit code. If the code is not KN_EXIT_OK, the function has printed the
// reason on stderr.
#include "clients/knead/live.h"
#include "clients/knead/still.h"
#include "clients/knead/view_options.h"
#include "server/replay.h"
#include "server/snapshot.h"

typedef struct kn_source { // source of one object to draw; read-only for the caller
    kn_view_kind kind;
    const char *path; // name of the file; NULL: the source is the bus
    // Time of the state to draw. For a recording, since its first session began; for the bus, since it was opened.
    double time_s;
    bool ended;        // true: the source has no state later than time_s
    kn_replay *replay; // replay of the recording; NULL for other kinds of sources
    kn_live live;      // state received from the bus; used by a bus source only
    // Scene or snapshot only:
    kn_scene *scene;
    kn_model *model;
    kn_state *state;
    kn_saved *saved; // contents of the snapshot file; used by a snapshot source only
    int64_t opened_ms;
    bool told;       // true: the warning about an unknown scene has been printed
    kn_gauge *gauge; // computes measures of the object; created when a measure is needed for the first time
    int gauged;      // number of changes of the recording's model until `gauge` was created
} kn_source;

// Open a source. file: index of the file in `options`. If `options` has no files, join the bus and wait for the first
// complete mesh and the tools.
int kn_source_open(kn_source *source, const kn_view_options *options, int file);

// Move a source forward to the moment at_s. A recording is stepped to the tick nearest to at_s, or to its end. On the
// bus, receive messages until at_s. A snapshot, a scene at rest, and a recording that has ended do not change.
int kn_source_to(kn_source *source, double at_s);

// Make a still of the object at the present moment, with the values of --color and the edges of --style. `still` must
// be zeroed except for still->view.
int kn_source_still(kn_source *source, const kn_view_options *options, kn_still *still);
// Close a source. A zeroed struct is allowed.
void kn_source_close(kn_source *source);

#endif
