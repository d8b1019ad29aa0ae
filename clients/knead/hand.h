#ifndef KN_CLIENTS_HAND_H
#define KN_CLIENTS_HAND_H
// A virtual hand that plays a path with a tool. The hand waits first until the server has engaged the tool. After a
// trip the hand retreats and tries again. A trip is a stop of the play: the device's own watchdog trips, the server
// latches a fault, or the device refuses. Call kn_hand_tick once per millisecond. The hand depends only on its
// arguments, so a test can take the part of the server.
//
//     ENGAGE --engaged--> PLAY --path ended--> DONE
//        ^                 |  server latched a fault, no force for 20 ms, or the device refuses
//        |                 v
//        +--1.2 s-- SILENT <-- RETREAT            after the third trip, or when nobody answers: GAVE_UP
//        new session          stop, lift, return
//
// The path's time advances by exactly 1 ms per pose sent. A stall of this process stretches the path and never makes
// the pose jump.
#include "clients/knead/path.h"
#include "core/contact_model.h"
#include "core/safety.h"
#include <stdbool.h>
#include <stdint.h>

#define KN_HAND_TRIES 3

typedef enum kn_hand_mode {
    KN_HAND_ENGAGE,
    KN_HAND_PLAY,
    KN_HAND_RETREAT,
    KN_HAND_SILENT,
    KN_HAND_DONE,
    KN_HAND_GAVE_UP
} kn_hand_mode;

typedef enum kn_hand_trouble { // why the hand gave up
    KN_HAND_NO_TROUBLE,
    KN_HAND_NO_ANSWER,   // no force in 3 s
    KN_HAND_NOT_ENGAGED, // forces came, but without FLAG_ENGAGED, for 3 s
    KN_HAND_SPOILT       // every try ended with a trip
} kn_hand_trouble;

typedef struct kn_hand_def {
    const kn_path *path;  // must stay valid while in use
    double clear_z_m;     // height to which a retreat lifts before it goes sideways
    int64_t session;      // session of the first try; later tries count up
    int tries;            // 1 .. KN_HAND_TRIES, 0 = KN_HAND_TRIES
    int drop_at_ms;       // fault injection: path time of the first try at which poses stop, ms
    int drop_ms;          // duration of the gap
    int hold_ms, zero_ms; // of the watchdog (core/safety.h); 0: 3 and 20
} kn_hand_def;

typedef struct kn_hand_force {           // fields of the newest contact_force_t
    int64_t session, seq, tick, sent_ns; // sent_ns: that of the answered pose, CLOCK_MONOTONIC
    double force_n[3], energy_j;
    int32_t flags, fault, contacts;
    // The newest local contact model, if kneadd sends any. One unit describes one contact of the tool. All units belong
    // to one tick.
    kn_contact_unit unit[KN_CONTACT_UNITS];
    int units;
} kn_hand_force;

typedef struct kn_trip {
    const char *piece;   // piece of the path, "engage" before the path began
    double time_s;       // time of the path
    double force_n;      // last force while engaged
    const char *refusal; // reason if the device refused, else NULL
    bool own;            // true: the watchdog tripped after silent_ms; false: the server latched `fault`
    int silent_ms;
    int stalled_ms; // part of silent_ms in which this process did not run
    kn_fault fault;
    bool cleared; // the server cleared the fault when the tool was lifted
} kn_trip;

typedef struct kn_attempt { // pose numbers, needed to match forces with poses
    int64_t session;
    int64_t play_seq; // pose number of the path's first point; 0: never engaged
    int64_t sent;     // number of poses
} kn_attempt;

typedef struct kn_hand { // read only for the caller
    kn_hand_def def;
    kn_hand_mode mode;
    kn_hand_trouble trouble;
    kn_watchdog watchdog;
    kn_hand_force force; // newest force of this session
    double given_n[3];   // force that the device gives to the hand now
    double engaged_n;    // |force| of the last message with FLAG_ENGAGED
    double path_s;
    const char *piece;
    const char *refusal; // reason if the device refused in this try, else NULL
    kn_path_point point;
    int mode_ms, dropped_ms;
    int tries, trips;
    kn_attempt attempt[KN_HAND_TRIES];
    kn_trip trip[KN_HAND_TRIES];
    kn_path way_out;
    kn_piece way_out_piece[4];
} kn_hand;

typedef struct kn_hand_out {
    bool end;    // no further pose will come
    bool leaves; // no further pose of the previous session: another hand may take the tool
    bool send;   // send point as pose number seq of the session
    int64_t session, seq;
    kn_path_point point;
} kn_hand_out;

void kn_hand_init(kn_hand *hand, const kn_hand_def *def);

// Play one millisecond. `force` is the newest message since the last call, or NULL if there was none. A message of
// another session or without a newer tick counts as none. `elapsed_ms` is 1 + the number of cycles that this process
// missed.
kn_hand_out kn_hand_tick(kn_hand *hand, const kn_hand_force *force, int elapsed_ms);

// Tell the hand that the device gives no force any more. `refusal` is the reason and must outlive the hand. A hand that
// is engaging or playing trips. Set `again` if another try may help; otherwise the present try is the last one.
void kn_hand_refuse(kn_hand *hand, const char *refusal, bool again);

// Set the path of the next try, because a failed try may have left a dent. Call it only while the hand is SILENT.
void kn_hand_take_path(kn_hand *hand, const kn_path *path);

#endif
