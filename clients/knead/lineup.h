#ifndef KN_CLIENTS_LINEUP_H
#define KN_CLIENTS_LINEUP_H
// All panels of one picture of `knead view`: an object, or several side by side at the same moment, with the same view
// and colour scale. With --compare a last panel shows the second object, coloured by its distance from the first.
//
//     kn_lineup_open -> { kn_lineup_to a moment -> kn_lineup_stills -> kn_lineup_shoot -> kn_lineup_drop }... -> close
//
// Functions that return int return an exit code. If the code is not KN_EXIT_OK, they have printed one line on stderr.
#include "clients/knead/match.h"
#include "clients/knead/shot.h"
#include "clients/knead/view_source.h"

// KN_SCALES counts the colour scales: one of --color, one of --compare
enum { KN_PANELS_MAX = KN_VIEW_FILES_MAX + 1, KN_SCALES = 2 };

typedef struct kn_lineup { // panels of the picture; the caller only reads the fields
    const kn_view_options *o;
    int count, panels;
    kn_source source[KN_VIEW_FILES_MAX];
    kn_still still[KN_PANELS_MAX];
    kn_match match;
    kn_shot *shot[KN_PANELS_MAX];
    uint8_t *panel, *rgba; // [o->height][o->width][4], allocated with the first picture
} kn_lineup;

typedef struct kn_extent { // extent of all objects, which several pictures share, so that all show the same box
    float box[2][3];       // lowest and highest coordinates of all objects, at rest and at the present time
    double most[KN_SCALES];
} kn_extent;
extern const kn_extent kn_extent_none;

int kn_lineup_open(kn_lineup *lineup, const kn_view_options *options);
// Advance all recordings or live sources to the time at_s.
int kn_lineup_to(kn_lineup *lineup, double at_s);
bool kn_lineup_ended(const kn_lineup *lineup); // true: all recordings have ended

// Create the stills of all panels at the present time, with the colours and view of the options. A still is the data of
// an object that the renderer needs (still.h). Widen `extent` so that it contains all stills.
int kn_lineup_stills(kn_lineup *lineup, kn_extent *extent);

// Draw all panels into the picture. If `framed` is true, every panel shows the box of `extent`. Otherwise every panel
// is fitted to its own object. Drawing consumes the stills, so they cannot be drawn a second time.
int kn_lineup_shoot(kn_lineup *lineup, const kn_extent *extent, bool framed);
void kn_lineup_drop(kn_lineup *lineup);  // free the stills of all panels
void kn_lineup_close(kn_lineup *lineup); // free everything; a struct that is all zero is allowed

#endif
