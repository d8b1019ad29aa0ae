#ifndef KN_CLIENTS_MOUNT_H
#define KN_CLIENTS_MOUNT_H
// How a device stands before the scene, as far as core/device.h does not say it: an orientation through its axes, and a
// basis as people write one on a command line.
#include "core/device.h"
#include <stdbool.h>
#include <stddef.h>

// A device nobody has said anything of: axes as the scene's, x to the right, y forward, z up; scales 1; zero at 0.
void kn_mount_init(kn_device_def *device);

// "XYZ", "+Y-XZ": the n-th letter is the device's axis along the scene's n-th. False and what is wrong in error.
bool kn_mount_basis(kn_device_def *device, const char *text, char *error, size_t error_size);

// q_scene = A q_device A^-1 with A = kn_device_axes: a tool that is not turned is not turned.
void kn_mount_orientation(const kn_device_def *device, const double device_wxyz[4], double scene_wxyz[4]);

#endif
