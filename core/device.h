#ifndef KN_CORE_DEVICE_H
#define KN_CORE_DEVICE_H
// A haptic device: the mechanical data of its model, its place in the scene, and the scale that fits the scene to its
// motors. The definition comes from the scene's key `device:`. It is a profile of core/devices; values that the scene
// gives replace the profile's.
//
//     scene position = position_m + scale * R * B * device position       B: signed permutation of axes, R: rotation
//     device force   = B^T R^T * force in the scene                       both proper: right-handed stays right-handed
//
// Force scale. The hand gets force_scale times the object's force, so that the 13 N of dough fit a motor of 3.3 N. The
// force scale and the length scale change everything that the hand feels. The power at the hand is force_scale / scale
// times the power at the object. Stiffness and damping at the hand are force_scale * scale times those in the scene.
// The coupling is limited at the hand, so the member `hand` holds the coupling there. The proxy's coupling in the scene
// is `hand` divided by force_scale * scale.
//
// Both frames use SI units. The struct is plain data without pointers. All functions are real-time safe.
#include "core/coupling.h"

typedef struct kn_device_def {
    char name[16];         // name of the profile: touch, falcon, omega, unknown, bench
    double mass_kg;        // mass felt at the device's tip [kg]
    double damping_n_s_m;  // viscous friction of the device's mechanics [N s/m]
    double friction_n;     // dry friction of the device's mechanics [N]
    double encoder_m;      // resolution of a measured position [m]; 0: exact
    double workspace_m[3]; // extent of the workspace along the device's own axes [m]
    double force_limit_n;  // limit of |force| on the hand
    // stiffest wall that the device renders without vibration at 1 kHz, as published
    double stiffness_limit_n_m;
    int force_axes, torque_axes;         // number of axes with a motor, for forces and for torques, 0 .. 3
    double round_trip_s;                 // expected time from sending a pose to receiving its force
    kn_coupling hand;                    // virtual coupling as the hand feels it: see core/coupling.h
    double coupling_n_m, coupling_n_s_m; // stiffness and damping of a proxy's virtual coupling, at the scene's scale
    double force_scale;                  // ratio of the hand's force to the object's force
    double basis[3];         // B in short form: scene axis k is device axis |basis[k]|, 1 .. 3; reversed if negative
    double position_m[3];    // the device's origin in the scene
    double rotation_wxyz[4]; // rotation R from device to scene, a unit quaternion
    double scale;            // length in the scene per length at the device, > 0
} kn_device_def;

// Return NULL, or a static text that says what is wrong with the basis or the rotation, and what was expected.
const char *kn_device_check(const kn_device_def *device);

// Store R B, the map from device axes to scene axes.
void kn_device_axes(const kn_device_def *device, double axes[3][3]);

// Convert a position or velocity from the device to the scene, or a force or torque from the scene to the device. Input
// and output must be different arrays. kn_device_force expects a force or torque of a force message, which is already
// multiplied by force_scale, and only turns it.
void kn_device_position(const kn_device_def *device, const double device_m[3], double scene_m[3]);
void kn_device_velocity(const kn_device_def *device, const double device_m_s[3], double scene_m_s[3]);
void kn_device_force(const kn_device_def *device, const double scene_n[3], double device_n[3]);

#endif
