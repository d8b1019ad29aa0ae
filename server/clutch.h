#ifndef KN_SERVER_CLUTCH_H
#define KN_SERVER_CLUTCH_H
// A device's workspace is smaller than the scene: while the clutch is held the hand moves and the tool stays, and from
// there on the tool is offset from the device by that much. What the hand feels fades meanwhile (core/safety.h).
#include "server/servo.h"

// A new hand: no offset.
void kn_clutch_open(kn_clutch *clutch);

// The pose of the tool, from that of the device.
void kn_clutch_move(kn_clutch *clutch, const kn_pose *device, kn_pose *tool);

#endif
