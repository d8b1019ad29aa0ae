#ifndef KN_CLIENTS_LINEUP_H
#define KN_CLIENTS_LINEUP_H
// All panels of one picture of `knead view`: an object, or several side by side at the same moment, with the same view
// and colour scale. With --compare a last panel shows the second object, coloured by its distance from the first.
//
//     kn_lineup_open -> { kn_lineup_to a moment -> kn_lineup_stills -> kn_lineup_shoot -> kn_lineup_drop }... -> close
//
// Functions that return int return an exit code. For any code except KN_EXIT_OK a line on stderr has given the reason.
#include "clients/knead/match.h"
#include "clients/knead/shot.h"
#include "clients/knead/view_source.h"

enum { KN_PANELS_MAX = KN_VIEW_FILES_MAX + 1, KN_SCALES = 2 }; // colour scales: of --color, of --compare

typedef struct kn_lineup { // read only
    const kn_view_options *o;
    int count, panels;
    kn_source source[KN_VIEW_FILES_MAX];
    kn_still still[KN_PANELS_MAX];
    kn_match match;
    kn_shot *shot[KN_PANELS_MAX];
    uint8_t *panel, *rgba; // [o->height][o->width][4], allocated with the first picture
} kn_lineup;

typedef struct kn_extent { // extent of the objects, shared by many pictures
    float box[2][3];       // lowest, highest coordinates, at rest and now
    double most[KN_SCALES];
} kn_extent;
extern const kn_extent kn_extent_none;

int kn_lineup_open(kn_lineup *lineup, const kn_view_options *options);
// Take all sources to the time at_s.
int kn_lineup_to(kn_lineup *lineup, double at_s);
bool kn_lineup_ended(const kn_lineup *lineup); // all sources have ended

// Make the stills of all panels at the present moment, with the options' look. A still is an object as the renderer
// needs it (still.h). Widen `extent` so that it contains all stills.
int kn_lineup_stills(kn_lineup *lineup, kn_extent *extent);

// Draw the picture. If `framed` is true, every panel shows the box of `extent`. Otherwise every panel is fitted to its
// own object. The stills cannot be used again.
int kn_lineup_shoot(kn_lineup *lineup, const kn_extent *extent, bool framed);
void kn_lineup_drop(kn_lineup *lineup);  // free the stills
void kn_lineup_close(kn_lineup *lineup); // all zero is allowed

#endif
