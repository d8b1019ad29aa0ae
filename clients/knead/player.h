#ifndef KN_CLIENTS_PLAYER_H
#define KN_CLIENTS_PLAYER_H
// Player: a hand that follows a path and runs on the thread of a device (device.h). Other threads can read its
// progress.
#include "clients/knead/device.h"
#include "clients/knead/motors.h"

typedef struct kn_player {
    // The device's thread owns `hand` while it runs. Other threads may then read hand.trip[0 .. trips-1] only. After
    // the thread has ended, the caller owns `hand`.
    kn_hand hand;
    // Record of the motor forces, if gripped is false. A grasp (grasp.h) keeps a record of its own.
    kn_motors motors;
    bool gripped; // true: the hand grips a simulated device (grasp.h)
    // mode: a kn_hand_mode. trips: number of faults after which the hand retreated. tries: number of times that the
    // path was begun. The field `cleared` of a trip is valid once `mode` is no longer RETREAT.
    _Atomic(int) mode, trips, tries;
    _Atomic(int) path_ms, given_mn; // path_ms: time since the begin of the path; given_mn: force on the hand
    _Atomic(const char *) piece;    // name of the piece of the path that is being played
    // Path for the next try (replay of the path after a failure), set by another thread. Before the next try begins,
    // the player takes this path and sets `next_path` to NULL.
    _Atomic(const kn_path *) next_path;
} kn_player;

// Initialise a zeroed player.
void kn_player_init(kn_player *player, const kn_hand_def *def);
// Play one millisecond of the path. The function has the type kn_device_hand. player: a kn_player.
kn_hand_out kn_player_tick(void *player, const kn_hand_force *force, int elapsed_ms);

#endif
