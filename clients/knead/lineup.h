#ifndef KN_CLIENTS_LINEUP_H
#define KN_CLIENTS_LINEUP_H
// Everything that one picture of `knead view` shows: an object, or several side by side at the same moment, seen alike
// and in the colours of one scale; with --compare a last panel, the second object by its distance from the first.
//
//     kn_lineup_open -> { kn_lineup_to a moment -> kn_lineup_stills -> kn_lineup_shoot -> kn_lineup_drop }... -> close
//
// Every int is an exit code; other than KN_EXIT_OK: a line on stderr has said why.
#include "clients/knead/match.h"
#include "clients/knead/shot.h"
#include "clients/knead/view_source.h"

enum { KN_PANELS_MAX = KN_VIEW_FILES_MAX + 1, KN_SCALES = 2 }; // scales: of --color, of --compare

typedef struct kn_lineup { // read only
    const kn_view_options *o;
    int count, panels;
    kn_source source[KN_VIEW_FILES_MAX];
    kn_still still[KN_PANELS_MAX];
    kn_match match;
    kn_shot *shot[KN_PANELS_MAX];
    uint8_t *panel, *rgba; // [o->height][o->width][4], once there is a shot
} kn_lineup;

typedef struct kn_extent { // of what is to be seen, so that it can be the same for many pictures
    float box[2][3];       // low, high: at rest and now
    double most[KN_SCALES];
} kn_extent;
extern const kn_extent kn_extent_none;

int kn_lineup_open(kn_lineup *lineup, const kn_view_options *options);
int kn_lineup_to(kn_lineup *lineup, double at_s);
bool kn_lineup_ended(const kn_lineup *lineup); // all of them

// Options' look, and what is seen of the objects now. extent: widened by it.
int kn_lineup_stills(kn_lineup *lineup, kn_extent *extent);

// framed: the extent's box is in the picture; else every object decides for itself. The stills are spent.
int kn_lineup_shoot(kn_lineup *lineup, const kn_extent *extent, bool framed);
void kn_lineup_drop(kn_lineup *lineup);  // the stills
void kn_lineup_close(kn_lineup *lineup); // zeroed is fine

#endif
