#ifndef KN_CLIENTS_PLAYER_H
#define KN_CLIENTS_PLAYER_H
// A hand that plays a path, as a device's hand, and its news for whoever looks on from another thread.
#include "clients/knead/device.h"
#include "clients/knead/motors.h"

typedef struct kn_player {
    kn_hand hand; // the device's thread's; once that has ended the caller's. Before that, hand.trip[0 .. trips-1] may
                  // be read
    kn_motors motors; // where the hand itself is the device; a grasp adds its own
    bool gripped;
    _Atomic(int) mode, trips, tries; // kn_hand_mode; a trip's `cleared` is known when mode has left RETREAT
    _Atomic(int) path_ms, given_mn;
    _Atomic(const char *) piece;
    _Atomic(const kn_path *) next_path; // for the hand: taken before the next try begins, NULL then
} kn_player;

void kn_player_init(kn_player *player, const kn_hand_def *def);                       // player must be zeroed
kn_hand_out kn_player_tick(void *player, const kn_hand_force *force, int elapsed_ms); // a kn_device_hand

#endif
