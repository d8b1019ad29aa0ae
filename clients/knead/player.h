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
    bool gripped; // the hand grips a simulated device (grasp.h)
    // mode: a kn_hand_mode. A trip's field `cleared` is valid once mode is no longer RETREAT.
    _Atomic(int) mode, trips, tries;
    _Atomic(int) path_ms, given_mn; // time since the begin of the path, ms; force on the hand, mN
    _Atomic(const char *) piece;    // name of the current piece of the path
    // Path for the next try, set by another thread. Before the next try begins, the player takes this path and stores
    // NULL here.
    _Atomic(const kn_path *) next_path;
} kn_player;

// Initialise a zeroed player.
void kn_player_init(kn_player *player, const kn_hand_def *def);
// Play one millisecond. The function has the type kn_device_hand. player: a kn_player.
kn_hand_out kn_player_tick(void *player, const kn_hand_force *force, int elapsed_ms);

#endif
