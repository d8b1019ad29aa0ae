#ifndef KN_SERVER_UNDO_H
#define KN_SERVER_UNDO_H
// Undo points: copies of the object from before it was kneaded. A point is saved before every press, that is, in the
// tick in which a tool enters the model while no other tool is in the model. A point is also saved before every reset
// and restore. The last KN_UNDO_POINTS are kept, or fewer if the object is large. A change of the material drops all
// points.
//
// Undo points are kept in memory only. They depend on the ticks alone, so a replay has the same undo points. Dough
// moves by itself, so comparing the states of two points would not show whether anything touched the object. A new
// point is added only if something pressed or replaced the object since the newest one.
#include "core/state.h"

#define KN_UNDO_POINTS 16 // largest number of undo points
// Memory limit for all undo points together, bytes; one point is kept even above the limit.
#define KN_UNDO_BYTES ((size_t)64 << 20)

typedef struct kn_undo {
    const kn_model *model;
    kn_state *point[KN_UNDO_POINTS]; // ring buffer of the undo points
    int room, first, count;
    bool touched; // true if the object has been pressed or replaced since the newest undo point
} kn_undo;

// Prepare for undo points of `model`, which must outlive `undo`; return false when memory is short.
bool kn_undo_init(kn_undo *undo, const kn_model *model);
void kn_undo_free(kn_undo *undo);            // a zeroed kn_undo is allowed
size_t kn_undo_bytes(const kn_model *model); // return the memory that all undo points take, bytes

// Save an undo point. If nothing has touched the object since the newest point, replace the newest point. Otherwise
// replace the oldest point if there is no room. An object with non-finite numbers is not saved. Real-time safe: copies
// one state.
void kn_undo_keep(kn_undo *undo, const kn_state *now);
// Record that something presses or replaces the object.
static inline void kn_undo_touched(kn_undo *undo) { undo->touched = true; }

// Drop all undo points.
static inline void kn_undo_forget(kn_undo *undo)
{
    undo->count = 0;
    undo->touched = true;
}

// Return the newest undo point after which the object was touched, and remove the point. Return NULL if there is no
// such point. The state stays valid until the next kn_undo_keep. Real-time safe.
const kn_state *kn_undo_take(kn_undo *undo);

#endif
