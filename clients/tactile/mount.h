#ifndef KN_CLIENTS_MOUNT_H
#define KN_CLIENTS_MOUNT_H
// Mounting of a device in the scene, beyond core/device.h: turning an orientation into the scene's axes, and reading a
// basis from the command line.
#include "core/device.h"
#include <stdbool.h>
#include <stddef.h>

// Set a device to default values: axes as in the scene (x to the right, y forward, z up), scales 1, origin at 0.
void kn_mount_init(kn_device_def *device);

// Read a basis such as "XYZ" or "+Y-XZ". The n-th letter names the axis of the device that points along the n-th axis
// of the scene. If the text is malformed, write the reason to `error` and return false.
bool kn_mount_basis(kn_device_def *device, const char *text, char *error, size_t error_size);

// Turn an orientation into the scene's axes: q_scene = A q_device A^-1 with A = kn_device_axes. An unrotated tool stays
// unrotated.
void kn_mount_orientation(const kn_device_def *device, const double device_wxyz[4], double scene_wxyz[4]);

#endif
