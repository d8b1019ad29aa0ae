#ifndef KN_SERVER_CLUTCH_H
#define KN_SERVER_CLUTCH_H
// The clutch lets a device reach a scene that is larger than the device's workspace. While the clutch is held, the hand
// moves and the tool stays. Afterwards the tool is offset from the device by the hand's motion. The force on the hand
// fades while the clutch is held (core/safety.h).
#include "server/servo.h"

// Reset the clutch to no offset, for a new session.
void kn_clutch_open(kn_clutch *clutch);

// Compute the pose of the tool from the pose of the device.
void kn_clutch_move(kn_clutch *clutch, const kn_pose *device, kn_pose *tool);

#endif
