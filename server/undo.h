#ifndef KN_SERVER_UNDO_H
#define KN_SERVER_UNDO_H
// What the object was before it was kneaded: a point before every press (the tick in which a tool enters the model
// while none is in it), every reset and every restore; the last KN_UNDO_POINTS of them, fewer of a large object; none
// from before a change of the material. In memory alone, and a function of the ticks: a replay has the same points.
// Dough moves by itself, so it is not by the states that two points are told apart, but by whether anything pressed or
// replaced the object in between.
#include "core/state.h"

#define KN_UNDO_POINTS 16
#define KN_UNDO_BYTES ((size_t)64 << 20) // of all of them

typedef struct kn_undo {
    const kn_model *model;
    kn_state *point[KN_UNDO_POINTS]; // a ring
    int room, first, count;
    bool touched; // since the newest was kept
} kn_undo;

bool kn_undo_init(kn_undo *undo, const kn_model *model); // borrows model; false when memory is short
void kn_undo_free(kn_undo *undo);                        // one that is all 0 is fine
size_t kn_undo_bytes(const kn_model *model);

// A point: the oldest goes when there is no room, the newest when nothing has touched the object since. Not of an
// object gone bad. Real-time safe: one copy of the state.
void kn_undo_keep(kn_undo *undo, const kn_state *now);
static inline void kn_undo_touched(kn_undo *undo) { undo->touched = true; }

static inline void kn_undo_forget(kn_undo *undo)
{
    undo->count = 0;
    undo->touched = true;
}

// The newest point since which the object has been touched; it is dropped. NULL: none. Valid until the next keep.
// Real-time safe.
const kn_state *kn_undo_take(kn_undo *undo);

#endif
