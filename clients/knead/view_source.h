#ifndef KN_CLIENTS_VIEW_SOURCE_H
#define KN_CLIENTS_VIEW_SOURCE_H
// Where `knead view` gets an object from: a running kneadd, a recording that is stepped to a moment, a snapshot, or a
// scene at rest.
//
//     kn_source_open -> kn_source_to a moment -> kn_source_still, as often as pictures are wanted -> kn_source_close
//
// Every int is an exit code; other than KN_EXIT_OK: a line on stderr has said why.
#include "clients/knead/live.h"
#include "clients/knead/still.h"
#include "clients/knead/view_options.h"
#include "server/replay.h"
#include "server/snapshot.h"

typedef struct kn_source { // read only
    kn_view_kind kind;
    const char *path;  // NULL: the bus
    double time_s;     // a recording's: since its first session began; the bus's: since it was opened
    bool ended;        // nothing comes after that
    kn_replay *replay; // of a recording
    kn_live live;      // of the bus
    kn_scene *scene;   // of a scene or a snapshot: these three
    kn_model *model;
    kn_state *state;
    kn_saved *saved; // of a snapshot
    int64_t opened_ms;
    bool told;       // that its scene is not known
    kn_gauge *gauge; // while one is needed
    int gauged;      // of the model after so many changes in the recording
} kn_source;

// The options' file of that number; the bus until the first whole mesh is there and its tools are, when there are none.
int kn_source_open(kn_source *source, const kn_view_options *options, int file);

// To the tick nearest to at_s of a recording, or its end; of the bus, until that moment; nothing else moves. One that
// has `ended` before stays where it is.
int kn_source_to(kn_source *source, double at_s);

// What it is now, with --color's numbers and --style's edges. still: zeroed but for view.
int kn_source_still(kn_source *source, const kn_view_options *options, kn_still *still);
void kn_source_close(kn_source *source); // zeroed is fine

#endif
