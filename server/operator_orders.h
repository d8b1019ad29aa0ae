#ifndef KN_SERVER_OPERATOR_ORDERS_H
#define KN_SERVER_OPERATOR_ORDERS_H
// Orders of an operator to the servo: reset, restore, undo, a change of the scene, recover, emergency stop, quality.
//
//     operator's thread    kn_orders_give -- number             number --> kn_orders_obeyed --> tick
//                                |                                               ^
//     servo thread         kn_orders_take --> kn_tick_in --> kn_servo_tick --> kn_orders_done
//                                                            kn_orders_apply
//
// The tick and its replay apply orders by the same functions, from kn_tick_in. An event records each order.
//
// Undo points are copies of the object from before it was kneaded. A point is saved before every press, that is, in the
// tick in which a tool enters the model while no other tool is in the model. A point is also saved before every reset
// and restore. The last KN_UNDO_POINTS are kept, or fewer if the object is large. A change of the material drops all
// points. Undo points are kept in memory only. They depend on the ticks alone, so a replay has the same undo points.
// Dough moves by itself, so comparing the states of two points would not show whether anything touched the object. A
// new point is added only if something pressed or replaced the object since the newest one.
#include "server/servo.h"
#include <stdatomic.h>

#define KN_ORDERS_KEPT 64 // number of latest orders for which kn_orders_obeyed can return the tick
#define KN_UNDO_POINTS 16 // largest number of undo points
// Memory limit for all undo points together, bytes; one point is kept even above the limit.
#define KN_UNDO_BYTES ((size_t)64 << 20)

typedef enum kn_order { // an operator's order to the next tick; several orders of one kind before a tick count as one
    KN_ORDER_RESET,     // restore the object to its initial state
    // Change to another quality of the scene (kn_point.live); if there are several such orders, the last one counts.
    KN_ORDER_QUALITY,
    // Clear latched faults, and an ESTOP order that no tick has taken yet; each tool must be lifted to engage again.
    KN_ORDER_RECOVER,
    KN_ORDER_ESTOP,   // emergency stop: forces fade and stay 0 until KN_ORDER_RECOVER
    KN_ORDER_RESTORE, // replace the object by kn_orders.restore
    KN_ORDER_UNDO,    // return the object to its state before the last press, reset or restore
    KN_ORDER_CHANGE   // continue the object in the model of kn_orders.change
} kn_order;

typedef struct kn_orders { // orders on their way from the operator's thread to the next tick; zeroed: none
    // Upper bits: number of orders given, << 8; lower 8 bits: bit (1 << kn_order) for each order that waits for the
    // next tick.
    _Atomic int64_t given;
    atomic_int quality;             // quality that the latest KN_ORDER_QUALITY requests
    const struct kn_saved *restore; // argument of KN_ORDER_RESTORE; must stay valid until a tick has taken the order
    // Argument of KN_ORDER_CHANGE. The change must stay valid until a tick has taken a later change and no thread uses
    // this change any more. Both must be true.
    kn_scene_change *change;
    // State hash of the object after the latest restore or undo; 0: there was nothing to undo.
    _Atomic uint64_t restored;
    _Atomic int64_t obeyed;                      // number of orders that ticks have taken
    _Atomic int64_t obeyed_tick[KN_ORDERS_KEPT]; // tick that took order number n, stored at index n % KN_ORDERS_KEPT
} kn_orders;

typedef struct kn_undo {
    const kn_model *model;
    kn_state *point[KN_UNDO_POINTS]; // ring buffer of the undo points
    int room, first, count;
    bool touched; // true if the object has been pressed or replaced since the newest undo point
} kn_undo;

// --- for the operator's thread ---

// Give an order to the next tick, and return the order's number. Any thread may call this, but KN_ORDER_QUALITY must
// always come from the same thread.
int64_t kn_orders_give(kn_orders *orders, kn_order order, kn_quality quality);
// Return whether a tick has taken the order with this number, and put that tick in *tick. Any thread may call this. The
// answer is valid until ticks have taken KN_ORDERS_KEPT later orders.
bool kn_orders_obeyed(const kn_orders *orders, int64_t number, int64_t *tick);
// Wait until a tick has taken the order with this number, at most patience_ms. Return the last answer of
// kn_orders_obeyed.
bool kn_orders_await(const kn_orders *orders, int64_t number, int patience_ms, int64_t *tick);

// --- for the servo thread; real-time safe ---

// Take the orders that were given since the last tick. Return the total number of orders given so far.
int64_t kn_orders_take(kn_orders *orders, kn_tick_in *in);
// Apply the orders in kn_tick_in: reset, restore, undo and change, in this order, then recover and emergency stop.
// (kn_orders_take_quality applies a change of quality.)
void kn_orders_apply(kn_tick *t);
// Change to the quality point `to`, and record the change as an event. If `to` is the present quality point, the event
// records that no lower quality point exists.
void kn_orders_take_quality(kn_tick *t, kn_quality to, bool commanded);
// Tell the threads that gave orders that this tick has taken them. `taken`: the number that kn_orders_take returned.
void kn_orders_done(kn_orders *orders, int64_t taken, const kn_tick_in *in, const kn_tick_out *out);

// --- undo points ---

// Allocate the undo points for an object of `model`, which must outlive `undo`. Return false when memory is short.
bool kn_undo_init(kn_undo *undo, const kn_model *model);
void kn_undo_free(kn_undo *undo);            // a zeroed kn_undo is allowed
size_t kn_undo_bytes(const kn_model *model); // return the memory that all undo points take, bytes

// Save an undo point. If nothing has touched the object since the newest point, replace the newest point. Otherwise
// replace the oldest point if there is no room. An object with non-finite numbers is not saved. Real-time safe: copies
// one state.
void kn_undo_keep(kn_undo *undo, const kn_state *now);
// Record that something presses or replaces the object.
static inline void kn_undo_touched(kn_undo *undo) { undo->touched = true; }
// Return the newest undo point after which the object was touched, and remove the point. Return NULL if there is no
// such point. The state stays valid until the next kn_undo_keep. Real-time safe.
const kn_state *kn_undo_take(kn_undo *undo);

#endif
