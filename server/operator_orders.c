#include "server/operator_orders.h"
#include "core/snapshot.h"
#include "proto/knead_event_t.h"
#include "server/clock.h"
#include "server/snapshot_file.h"

#define ORDER_BITS 8 // number of low bits in kn_orders.given that hold the kinds of orders
// interval at which kn_orders_await checks whether a tick has taken the order, ns; the function polls, because the
// servo makes no system call to wake a thread
static const int64_t poll_ns = 500000;

// --- from the operator's thread to the servo thread and back ---

// The number of orders and their kinds share one atomic word, so that a tick never takes a new number without the new
// kind.
int64_t kn_orders_give(kn_orders *orders, kn_order order, kn_quality quality)
{
    if (order == KN_ORDER_QUALITY) atomic_store(&orders->quality, (int)quality);
    int64_t given = atomic_load(&orders->given), more;
    // An order `recover` cancels an earlier emergency stop that no tick has taken yet.
    int64_t ends = order == KN_ORDER_RECOVER ? INT64_C(1) << KN_ORDER_ESTOP : 0;
    do more = ((given & ~ends) | INT64_C(1) << order) + (1 << ORDER_BITS);
    while (!atomic_compare_exchange_weak(&orders->given, &given, more));
    return more >> ORDER_BITS;
}

bool kn_orders_obeyed(const kn_orders *orders, int64_t number, int64_t *tick)
{
    if (atomic_load(&orders->obeyed) < number) return false;
    *tick = atomic_load(&orders->obeyed_tick[number % KN_ORDERS_KEPT]);
    return true;
}

bool kn_orders_await(const kn_orders *orders, int64_t number, int patience_ms, int64_t *tick)
{
    int64_t end_ns = kn_now_ns() + patience_ms * INT64_C(1000000);
    while (!kn_orders_obeyed(orders, number, tick)) {
        if (kn_now_ns() >= end_ns) return false;
        kn_clock_sleep(kn_now_ns() + poll_ns);
    }
    return true;
}

int64_t kn_orders_take(kn_orders *orders, kn_tick_in *in)
{
    int64_t given = atomic_fetch_and(&orders->given, ~((INT64_C(1) << ORDER_BITS) - 1));
    in->reset = given >> KN_ORDER_RESET & 1;
    in->recover = given >> KN_ORDER_RECOVER & 1;
    in->estop = given >> KN_ORDER_ESTOP & 1;
    in->undo = given >> KN_ORDER_UNDO & 1;
    if (given >> KN_ORDER_CHANGE & 1) in->change = orders->change;
    if (given >> KN_ORDER_RESTORE & 1) {
        in->restore = orders->restore->state;
        in->restored_generation = orders->restore->generation;
        in->restored_tick = orders->restore->tick;
    }
    if (given >> KN_ORDER_QUALITY & 1) {
        in->take = KN_QUALITY_CAUSE_COMMAND;
        in->quality = (kn_quality)atomic_load(&orders->quality);
    }
    return given >> ORDER_BITS;
}

// If more than KN_ORDERS_KEPT orders came since the last tick, record this tick only for the latest KN_ORDERS_KEPT of
// these orders.
void kn_orders_done(kn_orders *orders, int64_t taken, const kn_tick_in *in, const kn_tick_out *out)
{
    if (in->restore || in->undo) atomic_store(&orders->restored, out->restored_hash);
    int64_t n = atomic_load(&orders->obeyed);
    if (taken - n > KN_ORDERS_KEPT) n = taken - KN_ORDERS_KEPT;
    while (n < taken) atomic_store(&orders->obeyed_tick[++n % KN_ORDERS_KEPT], in->tick);
    atomic_store(&orders->obeyed, n);
}

// --- undo points ---

// Return the number of undo points that fit into KN_UNDO_BYTES, 1 .. KN_UNDO_POINTS.
static int room_of(const kn_model *model)
{
    size_t room = KN_UNDO_BYTES / kn_state_size(model);
    return room < 1 ? 1 : room > KN_UNDO_POINTS ? KN_UNDO_POINTS : (int)room;
}

size_t kn_undo_bytes(const kn_model *model) { return (size_t)room_of(model) * kn_state_size(model); }

bool kn_undo_init(kn_undo *undo, const kn_model *model)
{
    *undo = (kn_undo){.model = model, .room = room_of(model)};
    // allocate all points now, because the servo saves them in its tick, where it must not allocate
    bool fits = true;
    for (int i = 0; i < undo->room; i++) fits &= (undo->point[i] = kn_state_create(model)) != NULL;
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
    // if nothing touched the object since the newest point, that point equals the object, so skip the point
    if (u->count > 0 && !u->touched) u->count--;
    u->touched = true; // the object now equals the point that was taken, and differs from the remaining points
    if (u->count == 0) return NULL;
    const kn_state *point = newest(u);
    u->count--;
    return point;
}

// --- in the tick ---

// Prepare to replace the object. Save an undo point, except at start-up.
static void begin_replacement(kn_tick *t)
{
    kn_servo *servo = t->servo;
    if (servo->undo && servo->ticks > 0) {
        kn_undo_keep(servo->undo, servo->backend->state(servo->backend->self));
        kn_undo_touched(servo->undo);
    }
    servo->generation++;
    t->out->replaced = true;
    t->hashed = false;
}

// Replace the object by `state`, and record an event with the hash of that state. `generation` 0: an undo. `state` NULL:
// the backend has replaced the object itself, as it lost a circuit.
static void restore(kn_tick *t, const kn_state *state, int64_t generation, int64_t from_tick)
{
    kn_backend *b = t->servo->backend;
    if (state) b->restore(b->self, state);
    t->hashed = false;
    kn_event *e = kn_tick_event(t, KNEAD_EVENT_T_KIND_RESTORE, -1);
    e->arg[0] = (double)generation;
    e->arg[1] = (double)from_tick;
    t->out->restored_hash = t->hash;
    t->servo->untouched = t->servo->settled && t->hash == kn_state_hash(t->servo->model, t->servo->settled);
}

// Replace the object by the newest undo point. An undo saves no undo point, so repeated undos go further back.
static void undo(kn_tick *t)
{
    kn_servo *servo = t->servo;
    const kn_state *point = servo->undo ? kn_undo_take(servo->undo) : NULL;
    if (!point) return;
    servo->generation++;
    t->out->replaced = true;
    restore(t, point, 0, 0);
}

// Tell what the backend did when it lost its circuit, then apply reset, restore and undo, in this order.
static void replace(kn_tick *t)
{
    kn_backend *b = t->servo->backend;
    if (t->servo->lost) {
        t->servo->lost = false;
        begin_replacement(t);
        restore(t, NULL, -1, t->in->tick - 1 - t->in->missed - b->back(b->self));
    }
    if (t->in->reset) {
        begin_replacement(t);
        b->reset(b->self);
        kn_servo_begin(t->servo, t->servo->settled);
        kn_tick_event(t, KNEAD_EVENT_T_KIND_RESET, -1);
    }
    if (t->in->restore) {
        begin_replacement(t);
        restore(t, t->in->restore, t->in->restored_generation, t->in->restored_tick);
    }
    if (t->in->undo) undo(t);
}

// Continue the object in the new model of a scene change.
static void adopt_change(kn_tick *t)
{
    kn_servo *servo = t->servo;
    kn_scene_change *c = t->in->change;
    // carry positions, velocities and the stretch of every Voigt element over to the new model
    kn_carry(servo->model, servo->backend->state(servo->backend->self), c->model, c->carried);
    c->backend.restore(c->backend.self, c->carried);
    servo->scene = c->scene;
    servo->model = c->model;
    servo->backend = &c->backend;
    servo->settings = &c->settings;
    servo->audit = c->audit ? kn_audit_read(c->audit) : NULL;
    servo->settled = c->settled;
    servo->untouched = false;
    // drop the undo points, because they hold states of the old material
    if (servo->undo) {
        servo->undo->count = 0;
        kn_undo_touched(servo->undo);
    }
    // let the force fade under the old safety limits and come back under the new limits
    for (int p = 0; p < t->out->probes; p++) kn_safety_relimit(&servo->safety[p], &c->scene->limits);
    t->change = true;
    t->out->changed = c;
    t->hashed = false;
    // send the hash of the scene's text in two halves, because a double holds only 53 bits
    kn_event *e = kn_tick_event(t, KNEAD_EVENT_T_KIND_SET, -1);
    e->arg[0] = (double)(c->scene->text_hash >> 32);
    e->arg[1] = (double)(c->scene->text_hash & UINT32_MAX);
}

void kn_orders_apply(kn_tick *t)
{
    kn_servo *servo = t->servo;
    replace(t);
    if (t->in->change) adopt_change(t);
    if (t->in->recover) kn_tick_event(t, KNEAD_EVENT_T_KIND_RECOVER, -1);
    if (t->in->estop) kn_tick_event(t, KNEAD_EVENT_T_KIND_ESTOP, -1);
    servo->estopped = t->in->estop || (servo->estopped && !t->in->recover);
}

void kn_orders_take_quality(kn_tick *t, kn_quality to, bool commanded)
{
    kn_servo *servo = t->servo;
    kn_event *e = kn_tick_event(t, KNEAD_EVENT_T_KIND_QUALITY, -1);
    e->arg[0] = servo->quality;
    e->arg[1] = to;
    e->arg[2] = commanded;
    t->change |= to != servo->quality;
    servo->exhausted = !commanded && to == servo->quality;
    servo->quality = to;
    if (commanded) servo->asked = to;
    servo->over = 0;
}
