#ifndef KN_CORE_DEVICE_H
#define KN_CORE_DEVICE_H
// What a haptic device is: its class's numbers, how it stands in the scene, how the scene is made to fit its motors.
// Filled in from a scene's `device:` (a profile of core/devices, and what the scene says instead).
//
//     scene position = position_m + scale * R * B * device position       B: signed permutation of axes, R: rotation
//     device force   = B^T R^T * force, the scene's                       either proper: right-handed stays so
//
// Force scale. The hand is given force_scale times what the object feels, so that dough's 13 N fits a motor of 3.3 N.
// With it and the length scale everything the hand has to do with is another: power is force_scale / scale of that at
// the object, stiffness and damping felt are force_scale * scale of those in the scene. The coupling is a limit of the
// hand's side, hence hand.* below; the proxy's in the scene are those divided by force_scale * scale.
//
// Units of either frame SI. Plain data, borrows nothing.
#include "core/coupling.h"

typedef struct kn_device_def {
    char name[16];                       // of the profile: touch, falcon, omega, unknown, bench
    double mass_kg;                      // as felt at the tip
    double damping_n_s_m;                // viscous friction of its mechanics
    double friction_n;                   // dry friction
    double encoder_m;                    // step of a position as read; 0: exact
    double workspace_m[3];               // extent along its own axes
    double force_limit_n;                // of |force|: the scene's clamp
    double stiffness_limit_n_m;          // what its makers or users call its stiffest clean wall, at 1 kHz
    int force_axes, torque_axes;         // actuated, 0 .. 3
    double round_trip_s;                 // from a pose going out to its force coming in, expected
    kn_coupling hand;                    // felt by the hand: see core/coupling.h
    double coupling_n_m, coupling_n_s_m; // of a proxy in the scene
    double force_scale;                  // of the hand's force to the object's
    double basis[3];                     // scene axis k is device axis |basis[k]|, 1 .. 3, backwards when negative
    double position_m[3];                // of the device's origin
    double rotation_wxyz[4];             // R
    double scale;                        // of lengths
} kn_device_def;

// NULL, or what is wrong with the basis or the rotation, and what was expected.
const char *kn_device_check(const kn_device_def *device);

// R B, from device axes to scene axes.
void kn_device_axes(const kn_device_def *device, double axes[3][3]);

// Of a position and a velocity of the device in the scene, and of a scene's force or torque on the device. None of the
// two vectors may be the other. Force and torque as the scene's messages give them: force_scale is in them already.
void kn_device_position(const kn_device_def *device, const double device_m[3], double scene_m[3]);
void kn_device_velocity(const kn_device_def *device, const double device_m_s[3], double scene_m_s[3]);
void kn_device_force(const kn_device_def *device, const double scene_n[3], double device_n[3]);

#endif
