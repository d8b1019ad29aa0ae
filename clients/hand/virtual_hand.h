#ifndef KN_CLIENTS_VIRTUAL_HAND_H
#define KN_CLIENTS_VIRTUAL_HAND_H
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
#include "clients/hand/bus_client.h"
#include "clients/hand/tool_path.h"
#include "core/contact_model.h"
#include "core/safety.h"
#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

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
    const kn_tool_path *path; // path to play; must stay valid while the hand uses it
    double clear_z_m;         // height z to which the hand lifts the tool in a retreat before it moves sideways, m
    int64_t session;          // session number of the first attempt; each further attempt uses the next number
    int tries;                // largest number of attempts, 1 .. KN_HAND_TRIES; 0: KN_HAND_TRIES
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
    double engaged_n;    // magnitude of the last force received with FLAG_ENGAGED, N
    double path_s;
    const char *piece;
    const char *refusal; // reason if the device refused to give a force in this attempt, else NULL
    kn_tool_path_point point;
    int mode_ms, dropped_ms;
    int tries, trips;
    kn_attempt attempt[KN_HAND_TRIES];
    kn_trip trip[KN_HAND_TRIES];
    kn_tool_path way_out;
    kn_tool_path_piece way_out_piece[4];
} kn_hand;

typedef struct kn_hand_out {
    bool end;    // true: the hand has finished and sends no further pose
    bool leaves; // true: the previous session gets no further pose, so another hand may take the tool
    bool send;   // true: send `point` as pose number `seq` of `session`
    int64_t session, seq;
    kn_tool_path_point point;
} kn_hand_out;

// Return a random number for the first session of a hand, so that its sessions do not collide with those of a different
// client. The number is positive and below 2^62, so that adding 1 for each later session does not overflow.
int64_t kn_hand_session(void);

void kn_hand_init(kn_hand *hand, const kn_hand_def *def);

// Advance the hand by one millisecond. `force` is the newest force message since the last call, or NULL if none
// arrived. A message is ignored if it belongs to another session or if its tick is not newer. `elapsed_ms` is 1 + the
// number of 1 ms cycles that this process missed.
kn_hand_out kn_hand_tick(kn_hand *hand, const kn_hand_force *force, int elapsed_ms);

// Tell the hand that the device no longer gives a force. `refusal` is the reason and must outlive the hand. If the hand
// is engaging or playing, it trips. If `again` is true, the hand may try again; otherwise the present attempt is the
// last one.
void kn_hand_refuse(kn_hand *hand, const char *refusal, bool again);

// Set the path of the next attempt. A new path may be needed because a failed attempt may have left a dent. Call this
// function only while the hand is in the mode SILENT.
void kn_hand_take_path(kn_hand *hand, const kn_tool_path *path);

// Recording of the forces of a device's motors, one row every millisecond of the device's clock, with or without a new
// force. The recording is needed because no message shows how the watchdog fades the force when messages stop.

typedef struct kn_motor_record_row {
    int64_t ms, tick; // ms: time of the device's clock; tick: tick number of kneadd's newest force
    const char *doing;
    double position_m[3], force_n[3];
    int attempt, contacts, silent_ms;
} kn_motor_record_row;

typedef struct kn_motor_record { // list of recorded rows; if all fields are zero, nothing is recorded
    kn_motor_record_row *row;
    int count, room; // room: largest number of rows; when the list is full, later rows are dropped
    int64_t ms;
} kn_motor_record;

// Reserve memory for `room` rows. Return false if out of memory.
bool kn_motor_record_open(kn_motor_record *motors, int room);
void kn_motor_record_close(kn_motor_record *motors);

// Add a row for the time `elapsed_ms` after the last row. No memory is allocated.
void kn_motor_record_add(kn_motor_record *motors, const kn_hand *hand, const double position_m[3],
                         const double force_n[3], int elapsed_ms);

// Write the columns time_s,try,doing,x_m,y_m,z_m,fx_n,fy_n,fz_n,contacts,silent_ms,tick. The column `doing` has the
// name of a piece of the path, "engage" or "silent".
void kn_motor_record_csv(FILE *out, const kn_motor_record *motors);

// Player: a hand that follows a path and runs on the thread of a device. Other threads can read the hand's progress.

typedef struct kn_hand_player {
    // The device's thread owns `hand` while it runs. Other threads may then read hand.trip[0 .. trips-1] only. After
    // the thread has ended, the caller owns `hand`.
    kn_hand hand;
    // Record of the motor forces. If `gripped` is false, the player adds the rows; otherwise a closed-loop hand
    // (closed_loop_hand.h) adds them.
    kn_motor_record motors;
    bool gripped; // true: the hand grips a simulated device (closed_loop_hand.h)
    // mode: a kn_hand_mode. trips: number of faults after which the hand retreated. tries: number of attempts to play
    // the path. The field `cleared` of a trip is valid once `mode` is no longer RETREAT.
    _Atomic(int) mode, trips, tries;
    _Atomic(int) path_ms, given_mn; // path_ms: time since the beginning of the path; given_mn: force on the hand
    _Atomic(const char *) piece;    // name of the piece of the path that is being played
    // Path for the next attempt, set by another thread after a failed attempt. Before the next attempt begins, the
    // player takes this path and sets `next_path` to NULL.
    _Atomic(const kn_tool_path *) next_path;
} kn_hand_player;

// Initialise a zeroed player.
void kn_hand_player_init(kn_hand_player *player, const kn_hand_def *def);
// Play one millisecond of the path. The function has the type kn_virtual_device_hand. player: a kn_hand_player.
kn_hand_out kn_hand_player_tick(void *player, const kn_hand_force *force, int elapsed_ms);

// The virtual device: a real-time thread that asks a hand every millisecond for the pose of the tool. The thread
// publishes the pose and gives the newest force to the hand. The hand may follow a path or a pointer: the thread works
// with both.

// Function that plays one millisecond of the hand `self`, called by the device's thread. `force` is the newest force
// since the last call, or NULL if no force has arrived. `elapsed_ms` is 1 + the number of 1 ms cycles that the thread
// missed.
typedef kn_hand_out kn_virtual_device_hand(void *self, const kn_hand_force *force, int elapsed_ms);

typedef struct kn_virtual_device {
    _Atomic(int) missed; // number of 1 ms cycles that the device's thread missed
    atomic_bool done;    // true: the hand has finished, and the thread has ended
    // The fields below are used by virtual_hand.c only.
    kn_virtual_device_hand *hand;
    void *self;
    const char *url;
    char pose_channel[64], force_channel[64], contact_channel[64], *error;
    size_t error_size;
    int priority_error;
    kn_hand_force force;
    kn_hand_out last; // output of the hand in the last cycle in which it sent a pose
    bool fresh;
    kn_bus_client *bus;
    atomic_bool stop;
    sem_t ready;
    pthread_t thread;
} kn_virtual_device;

// Join the message bus at `url` and start the thread of the virtual device. On failure return false with one line in
// error. `device` must be zeroed and must not move in memory.
bool kn_virtual_device_start(kn_virtual_device *device, kn_virtual_device_hand *hand, void *self, const char *url,
                             const char *probe, char *error, size_t error_size);
// Return 0 if the thread runs with SCHED_FIFO, or the errno with which the kernel refused SCHED_FIFO.
int kn_virtual_device_priority_error(const kn_virtual_device *device);
// Stop the thread, wait for its end, and end the session of its poses. The tool stays where it is.
void kn_virtual_device_stop(kn_virtual_device *device);

// Join the message bus, play the hand and leave the bus, all in the thread of the caller. The caller calls
// kn_virtual_device_tick every millisecond until kn_virtual_device_tick returns false. `elapsed_ms` is the time since
// the last call.
bool kn_virtual_device_join(kn_virtual_device *device, kn_virtual_device_hand *hand, void *self, const char *url,
                            const char *probe, char *error, size_t error_size);
bool kn_virtual_device_tick(kn_virtual_device *device, int elapsed_ms);
void kn_virtual_device_leave(kn_virtual_device *device);

#endif
