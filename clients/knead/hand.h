#ifndef KN_CLIENTS_HAND_H
#define KN_CLIENTS_HAND_H
// A virtual hand that plays a path with a tool. Before it plays the path, the hand waits until the server has engaged
// the tool. After a trip the hand retreats and tries again. A trip is a stop of the play: the device's own watchdog
// trips, the server latches a fault, or the device refuses. Call kn_hand_tick once per millisecond. The hand depends
// only on its arguments, so a test can supply the messages of the server.
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

typedef enum kn_hand_trouble { // reason why the hand gave up
    KN_HAND_NO_TROUBLE,
    KN_HAND_NO_ANSWER,   // no force message arrived within 3 s
    KN_HAND_NOT_ENGAGED, // force messages arrived for 3 s, but without FLAG_ENGAGED
    KN_HAND_SPOILT       // all attempts to play the path ended with a trip
} kn_hand_trouble;

typedef struct kn_hand_def {
    const kn_path *path; // path to play; must stay valid while the hand uses it
    double clear_z_m;    // height z to which the hand lifts the tool in a retreat before it moves sideways, m
    int64_t session;     // session number of the first attempt; each further attempt uses the next number
    int tries;           // largest number of attempts, 1 .. KN_HAND_TRIES; 0: KN_HAND_TRIES
    // Fault injection: time on the path at which the hand stops sending poses, in the first attempt only, ms.
    int drop_at_ms;
    int drop_ms;          // fault injection: duration for which no poses are sent, ms; 0: no fault
    int hold_ms, zero_ms; // times hold_ms and zero_ms of the watchdog (core/safety.h), ms; 0: defaults 3 and 20
} kn_hand_def;

typedef struct kn_hand_force {           // fields of the newest message of type contact_force_t
    int64_t session, seq, tick, sent_ns; // sent_ns: time at which the answered pose was sent, CLOCK_MONOTONIC
    double force_n[3], energy_j;
    int32_t flags, fault, contacts;
    // The newest local contact model, if kneadd sends contact models. Each entry of `unit` describes one contact of the
    // tool. All entries belong to one tick.
    kn_contact_unit unit[KN_CONTACT_UNITS];
    int units;
} kn_hand_force;

typedef struct kn_trip {
    const char *piece;   // name of the piece of the path at the trip; "engage" if the path had not begun
    double time_s;       // time on the path at the trip, s
    double force_n;      // last force on the tool while the tool was engaged, N
    const char *refusal; // reason if the device refused to give a force, else NULL
    // True: the device's own watchdog tripped after silent_ms without a force; false: the server latched `fault`.
    bool own;
    int silent_ms;
    int stalled_ms; // part of silent_ms in which this process itself did not run, ms
    kn_fault fault;
    bool cleared; // true: the server cleared the fault after the tool was lifted
} kn_trip;

typedef struct kn_attempt { // one attempt to play the path: its pose numbers, needed to match forces with poses
    int64_t session;
    int64_t play_seq; // number of the pose that holds the path's first point; 0: the server never engaged the tool
    int64_t sent;     // number of poses sent in this attempt
} kn_attempt;

typedef struct kn_hand { // state of a virtual hand; the caller only reads it
    kn_hand_def def;
    kn_hand_mode mode;
    kn_hand_trouble trouble;
    kn_watchdog watchdog;
    kn_hand_force force; // newest force message of this session
    double given_n[3];   // force that the device gives to the hand in this millisecond, N
    double engaged_n;    // |force| of the last force message with FLAG_ENGAGED, N
    double path_s;
    const char *piece;
    const char *refusal; // reason if the device refused to give a force in this attempt, else NULL
    kn_path_point point;
    int mode_ms, dropped_ms;
    int tries, trips;
    kn_attempt attempt[KN_HAND_TRIES];
    kn_trip trip[KN_HAND_TRIES];
    kn_path way_out;
    kn_piece way_out_piece[4];
} kn_hand;

typedef struct kn_hand_out {
    bool end;    // true: the hand has finished and sends no further pose
    bool leaves; // true: the previous session gets no further pose, so another hand may take the tool
    bool send;   // true: send `point` as pose number `seq` of `session`
    int64_t session, seq;
    kn_path_point point;
} kn_hand_out;

void kn_hand_init(kn_hand *hand, const kn_hand_def *def);

// Advance the hand by one millisecond. `force` is the newest force message since the last call, or NULL if none
// arrived. A message is ignored if it belongs to another session or if its tick is not newer. `elapsed_ms` is 1 + the
// number of 1 ms cycles that this process missed.
kn_hand_out kn_hand_tick(kn_hand *hand, const kn_hand_force *force, int elapsed_ms);

// Tell the hand that the device no longer gives a force. `refusal` is the reason and must outlive the hand. If the hand
// is engaging or playing, it trips. If `again` is true, the hand may try again; otherwise the present attempt is the
// last one.
void kn_hand_refuse(kn_hand *hand, const char *refusal, bool again);

// Set the path of the next attempt. A new path may be needed because a failed attempt may have left a dent. Call it
// only while the hand is SILENT.
void kn_hand_take_path(kn_hand *hand, const kn_path *path);

#endif
