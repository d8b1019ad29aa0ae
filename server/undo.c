#include "server/undo.h"

// Return the number of points that fit into KN_UNDO_BYTES, 1 .. KN_UNDO_POINTS.
static int room_of(const kn_model *model)
{
    size_t room = KN_UNDO_BYTES / kn_state_kept(model);
    return room < 1 ? 1 : room > KN_UNDO_POINTS ? KN_UNDO_POINTS : (int)room;
}

size_t kn_undo_bytes(const kn_model *model) { return (size_t)room_of(model) * kn_state_kept(model); }

bool kn_undo_init(kn_undo *undo, const kn_model *model)
{
    *undo = (kn_undo){.model = model, .room = room_of(model)};
    // allocate all points now, since the servo saves them in its tick
    bool fits = true;
    for (int i = 0; i < undo->room; i++) fits &= (undo->point[i] = kn_state_keep(model)) != NULL;
    if (!fits) kn_undo_free(undo);
    return fits;
}

void kn_undo_free(kn_undo *undo)
{
    for (int i = 0; i < KN_UNDO_POINTS; i++) kn_state_destroy(undo->point[i]);
    *undo = (kn_undo){0};
}

static kn_state *newest(const kn_undo *u) { return u->point[(u->first + u->count - 1) % u->room]; }

void kn_undo_keep(kn_undo *u, const kn_state *now)
{
    if (now->bad) return;
    // if the object was touched, add a point (replacing the oldest if the ring is full); otherwise overwrite the newest
    // point
    if (u->count == 0 || u->touched) {
        if (u->count < u->room) u->count++;
        else u->first = (u->first + 1) % u->room;
    }
    kn_state_copy(u->model, newest(u), now);
    u->touched = false;
}

const kn_state *kn_undo_take(kn_undo *u)
{
    // if nothing touched the object since the newest point, that point equals the object: skip it
    if (u->count > 0 && !u->touched) u->count--;
    u->touched = true; // the object now equals the point taken, so the remaining points differ from the object
    if (u->count == 0) return NULL;
    const kn_state *point = newest(u);
    u->count--;
    return point;
}
