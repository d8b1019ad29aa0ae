#ifndef KN_CLIENTS_HAND_H
#define KN_CLIENTS_HAND_H
// A virtual hand with a device of its own watchdog: plays a path, engages first, gets out of the way after a trip, and
// tries again. One call per ms; pure, so that a test can play the server.
//
//     ENGAGE --engaged--> PLAY --path ended--> DONE
//        ^                 |  server latched a fault, no force for 20 ms, or the device refuses
//        |                 v
//        +--1.2 s-- SILENT <-- RETREAT            after the third trip, or when nobody answers: GAVE_UP
//        new session          stop, lift, return
//
// Path time advances by exactly 1 ms per pose sent: a stall of this process stretches the path, it never makes a jump.
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

typedef enum kn_hand_trouble { // why it gave up
    KN_HAND_NO_TROUBLE,
    KN_HAND_NO_ANSWER,   // not one force in 3 s
    KN_HAND_NOT_ENGAGED, // forces came, but not FLAG_ENGAGED, for 3 s
    KN_HAND_SPOILT       // as many trips as tries
} kn_hand_trouble;

typedef struct kn_hand_def {
    const kn_path *path;  // borrowed
    double clear_z_m;     // a retreat lifts to here before it goes sideways
    int64_t session;      // of the first try; the next ones count up
    int tries;            // 1 .. KN_HAND_TRIES, 0 = KN_HAND_TRIES
    int drop_at_ms;       // fault injection: at this time of the first try's path no pose is sent
    int drop_ms;          // for so long
    int hold_ms, zero_ms; // of its watchdog; 0: 3 and 20
} kn_hand_def;

typedef struct kn_hand_force {           // of contact_force_t: the newest one
    int64_t session, seq, tick, sent_ns; // the last as the pose had it: CLOCK_MONOTONIC of its sending
    double force_n[3], energy_j;
    int32_t flags, fault, contacts;
    kn_contact_unit unit[KN_CONTACT_UNITS]; // the newest local model, where kneadd sends any: what came of one tick's
    int units;
} kn_hand_force;

typedef struct kn_trip {
    const char *piece;   // of the path, "engage" before it began
    double time_s;       // of the path
    double force_n;      // the last one given while all was well
    const char *refusal; // the device refused, for this reason; NULL: not that
    bool own;            // by the own watchdog: no force for silent_ms; else the server latched fault
    int silent_ms;
    int stalled_ms; // of them this process itself did not run
    kn_fault fault;
    bool cleared; // the server took the fault back when the tool was lifted
} kn_trip;

typedef struct kn_attempt { // pose numbers, for whoever reads the forces' echoes
    int64_t session;
    int64_t play_seq; // of the path's first point; 0: never engaged
    int64_t sent;     // poses
} kn_attempt;

typedef struct kn_hand { // read only for the caller
    kn_hand_def def;
    kn_hand_mode mode;
    kn_hand_trouble trouble;
    kn_watchdog watchdog;
    kn_hand_force force; // newest of this session
    double given_n[3];   // what the device gives to the hand now
    double engaged_n;    // |force| of the last message with FLAG_ENGAGED
    double path_s;
    const char *piece;
    const char *refusal; // of this try
    kn_path_point point;
    int mode_ms, dropped_ms;
    int tries, trips;
    kn_attempt attempt[KN_HAND_TRIES];
    kn_trip trip[KN_HAND_TRIES];
    kn_path way_out;
    kn_piece way_out_piece[4];
} kn_hand;

typedef struct kn_hand_out {
    bool end;    // nothing will come any more
    bool leaves; // nothing more of the session before: another hand may have the tool
    bool send;   // point, as pose seq of session
    int64_t session, seq;
    kn_path_point point;
} kn_hand_out;

void kn_hand_init(kn_hand *hand, const kn_hand_def *def);

// One ms. force: the newest message since the last call, NULL when there was none; one of another session, or of
// no newer tick, counts as none.
// elapsed_ms: 1 + cycles that this process missed.
kn_hand_out kn_hand_tick(kn_hand *hand, const kn_hand_force *force, int elapsed_ms);

// The device gives no force any more, for that reason: a trip, if the hand engages or plays. again: another try may help.
// refusal is borrowed.
void kn_hand_refuse(kn_hand *hand, const char *refusal, bool again);

// The path of the next try, since a spoilt one may have left a dent. Only while the hand is SILENT.
void kn_hand_take_path(kn_hand *hand, const kn_path *path);

#endif
