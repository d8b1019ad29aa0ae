#ifndef KN_CORE_AHEAD_H
#define KN_CORE_AHEAD_H
// Where a tool of several parts will meet the skin next: places of the skin that it is nearest to and that it does not
// press, beside those that it does. (A tool of one convex part has one such place, see kn_clearance.)
//
// A sweep looks at every node of the skin, a part of them per tick: those that are nearer to the tool than all of their
// neighbours, and next to no patch, are places until the next sweep is through. Where exactly such a place is, how far
// off and which way, is looked at whenever it is asked for: from its node along the skin by (d + r) of the gradient's
// part along it, which leads to the nearest point when the tool is a ball of radius r there.
#include "core/patch.h"
#include "core/state.h"

typedef struct kn_place {
    int node;
    double gap_m;     // > 0: of the tool from the skin
    double normal[3]; // out of the object, unit
    double arm_m[3];  // from the tool's position to the point of it that will touch
} kn_place;

typedef struct kn_ahead kn_ahead;

// Borrows both. reach_m: farther off nothing is told. NULL: no memory, or tool p is of one convex part.
kn_ahead *kn_ahead_create(const kn_model *model, const kn_patches *patches, int p, double reach_m);
void kn_ahead_destroy(kn_ahead *ahead); // NULL is fine
void kn_ahead_reset(kn_ahead *ahead);

// A part of a sweep, once per tick. Real-time safe, as the next.
void kn_ahead_look(kn_ahead *ahead, const kn_state *state);

// The places of the last sweep as they are now, at most `most`; returns how many are within reach and not touched.
int kn_ahead_places(const kn_ahead *ahead, const kn_state *state, int most, kn_place place[]);

#endif
