#ifndef KN_CLIENTS_HAPTIC_LOOP_H
#define KN_CLIENTS_HAPTIC_LOOP_H
// A simulated haptic device held by a simulated person. It computes the next pose of the device from the force that the
// renderer returns. The tests and `knead zwidth` use it, and so does the simulated hand of closed_loop_hand.h.
//
//     intended path --arm spring, damper-- hand mass --grip spring, damper-- device mass -- force F (held)
//                                                                             | viscous + Coulomb friction
//                                                            encoder: position_m, every period, in steps
//
//     m x'' = F + bias - b x' - c x'/|x'| + g (X - x) + g_d (X' - x')            device
//     M X'' = a (P - X) + a_d (P' - X') - g (X - x) - g_d (X' - x')              hand
//
// x, X and P are the positions of the device, of the hand and on the intended path. m and M are the masses of device
// and hand. b is the viscous friction of the device and c its Coulomb friction. g and g_d are spring and damper of the
// grip, a and a_d spring and damper of the arm. Without a hand only the terms F + bias - b x' - c x'/|x'| remain.
//
// Position is sampled and force is held over one period (zero-order hold). Within a period the motion is integrated
// with 20 steps of semi-implicit Euler. Friction is implicit, so it never reverses a motion. The simulation is
// deterministic, computes in double precision and allocates no memory.
//
// This is a simulation: it leaves out motor current, structure and cogging. A real device has a smaller stability
// margin.
//
// The parameters of the hands are within commonly used ranges. They were chosen and not fitted to a person:
//     light    grip  300 N/m, 1 N s/m    50 g    arm 100 N/m,  1 N s/m
//     normal         800      3         100 g        300       4
//     firm          2500      8         200 g        800      10
//     none     no hand: a constant bias without the damping of a person, which is the worst case
#include "core/coupling.h"
#include "core/device.h"
#include "core/passivity.h"
#include "core/scene/scene.h"
#include "core/step.h"
#include <stdbool.h>
#include <stddef.h>

typedef enum kn_grip { KN_GRIP_NONE, KN_GRIP_LIGHT, KN_GRIP_NORMAL, KN_GRIP_FIRM } kn_grip;
#define KN_GRIPS 4

// Definition of a simulated device and of the hand that holds it. A field that is 0 takes its default, if it has one.
typedef struct kn_held_device_def {
    double mass_kg;       // mass of the device, as felt at its tip
    double damping_n_s_m; // viscous friction of the device
    double coulomb_n;     // Coulomb (dry) friction of the device
    double encoder_m;     // position step of the encoder; 0: the encoder is exact
    double force_limit_n; // largest |force| that the device can give; 0: no limit
    double period_s;      // period at which position is sampled and force is held; default 1 ms
    double velocity_hz;   // cut-off frequency of the low-pass that measures the velocity, default 100 Hz
    // number of axes along which the device moves freely. 1: only z, and x, y follow the path; 3 (default): all axes
    int axes;
    kn_grip grip;
    double bias_n[3]; // constant external force on the device, with or without a hand
} kn_held_device_def;

typedef struct kn_held_device { // state of a simulated device and hand; the caller only reads it
    kn_held_device_def def;
    double position_m[3]; // encoder reading at the last sample
    // Measured velocity: difference of the encoder readings, after a first-order low-pass.
    double velocity_m_s[3];
    double force_n[3];             // force on the device during the last period, after saturation at force_limit_n
    double x_m[3], v_m_s[3];       // true position and velocity of the device
    double hand_m[3], hand_m_s[3]; // true position and velocity of the hand
} kn_held_device;

// Return the definition of a simulated device with the mass, friction, encoder and force limit of a device profile. All
// axes are free, and no hand holds the device.
kn_held_device_def kn_held_device_of(const kn_device_def *device);

// Place the simulated device and the hand that holds it at rest at the position `at_m`. `def` is copied.
void kn_held_device_init(kn_held_device *arm, const kn_held_device_def *def, const double at_m[3]);

// Advance the simulation of device and hand by one sampling period. `force_n` is the force on the device, computed from
// arm->position_m and held over the period. `path_m` and `path_m_s` are position and velocity of the intended path at
// the beginning of the period. If no hand holds the device, the path sets only x and y of a device with one free axis.
// Afterwards arm->position_m is the next encoder reading. The work done on the device is the scalar product of force_n
// and the change of position_m.
void kn_held_device_tick(kn_held_device *arm, const double force_n[3], const double path_m[3],
                         const double path_m_s[3]);

// Return the resolution of the force of a virtual coupling, N: the change of the force when the encoder reading changes
// by one step. Such a step also changes the measured velocity, so the coupling's spring and its damper both contribute.
double kn_held_device_resolution_n(const kn_held_device *arm, const kn_coupling *coupling);

const char *kn_grip_name(kn_grip grip); // name of the grip: "none", "light", "normal" or "firm"
bool kn_grip_find(const char *name, kn_grip *grip);
extern const char kn_grip_names[]; // all names, for messages: "none, light, normal or firm"

// Root mean square of the part of a signal above 10 Hz, which a fingertip feels as a buzz. The filter is a second-order
// Butterworth high-pass (bilinear transform, at the given sampling rate). The sum of squares of the filtered signal
// starts at the last reset. Apply the filter to the force and not to the position: a chatter at 500 Hz has an amplitude
// of micrometres only.
#define KN_BUZZ_HZ 10.0
#define KN_BUZZ_UNHEARD_N 2e-3 // amplitude below which an oscillation of the force is not counted, N

// High-pass filter with a sum of squares; callers use the functions below and do not write the fields.
typedef struct kn_buzz {
    double b, a1, a2; // filter coefficients: y = b (x - 2 x1 + x2) - a1 y1 - a2 y2, input x, output y
    double x1, x2, y1, y2;
    double sum;
    long count;
} kn_buzz;

// Start the high-pass filter. `first` is the value of the signal up to now, so that a constant signal counts as no
// buzz.
void kn_buzz_init(kn_buzz *buzz, double period_s, double first);
void kn_buzz_add(kn_buzz *buzz, double value);
// Clear the sum of squares, but keep the state of the high-pass filter.
void kn_buzz_reset(kn_buzz *buzz);
// Return the root mean square of the filtered signal since the last reset, or 0 if no value was added.
double kn_buzz_rms(const kn_buzz *buzz);

// Counter of the reversals (turns) of a signal. A reversal counts if the signal goes back by more than a hysteresis. A
// step or a stroke gives one or two reversals; a buzz gives many. A signal that reverses 20 times a second oscillates
// at 10 Hz.
typedef struct kn_turns {
    double hysteresis, extreme; // hysteresis: > 0; extreme: extreme value of the signal since the last reversal
    int up;                     // direction in which the signal moves, 1 or -1; 0: not known yet
    int count;
} kn_turns;
void kn_turns_add(kn_turns *turns, double value);
// Return the hysteresis for reversals of a force with this resolution, N: twice the rms force that counts as a buzz.
double kn_turns_hysteresis_n(double resolution_n);

// Pad: a lumped model of an object under a tool. One edge with three elements along z stands for the contact: a Voigt
// element (spring k1 parallel to damper c1) in series with the force-dependent damper c2(F). A virtual coupling (spring
// k_vc, damper b_vc) connects the device to a proxy on the surface of the pad. Simulated haptic loops use a pad,
// because a lattice would take a thousand times as long.
//
//     device --[ k_vc, b_vc ]-- proxy on the surface --[ k1 | c1 ]--[ c2(F) ]-- ground
//
//     F = Q - G w                    F: contact force at the end of the step dt
//     Q = k_vc (d - s) + b_vc d'     d: depth of the device, s: depth of the surface, d': speed of the device
//     G = b_vc + dt k_vc
//     w = (F - H)/A + F/c2(F)        w: speed of the surface at the end of the step
//     H = k1 e,  A = c1 + dt k1      e: displacement of the Voigt element, m
//
// F >= 0. After the tool has left, the displacement e of the Voigt element creeps back to 0, and the flow of damper c2
// remains. The proxy has no mass. No function allocates memory.

typedef struct kn_lumped_object_def {
    const char *name;
    // Stiffness k1 and damping c1 of the Voigt element. If both are 0, the object is a wall: its surface never moves.
    double k1_n_m, c1_n_s_m;
    // Damping of the damper c2 at the force from_n (c2_n_s_m) and at the force to_n (c2_least_n_s_m). Between the two
    // forces the damping falls exponentially. If c2_n_s_m is 0, there is no damper c2.
    double c2_n_s_m, c2_least_n_s_m;
    double from_n, to_n;
} kn_lumped_object_def;

// Predefined pads: a wall, dough, clay, soft jelly, stiff jelly. Each pad except the wall stands for an object under a
// probe of about 1 cm. The dampers of dough together act like 1 kN s/m at rest and like 46 N s/m while dough flows.
#define KN_LUMPED_OBJECTS 5
extern const kn_lumped_object_def kn_lumped_objects[KN_LUMPED_OBJECTS];

typedef struct kn_lumped_object { // state of a pad (lumped object); the caller only reads it
    kn_lumped_object_def def;
    // Displacement of the Voigt element (voigt_m) and of the damper c2 (flow_m). The depth of the surface is voigt_m +
    // flow_m.
    double voigt_m, flow_m;
    double force_n;
    bool touching;
} kn_lumped_object;

// Initialise a pad (lumped object): undeformed, and not touched by a tool.
void kn_lumped_object_init(kn_lumped_object *pad, const kn_lumped_object_def *def);

// Advance a pad by one step of dt_s. depth_m: depth of the device below the undeformed surface, negative if the device
// is above the surface. speed_m_s: rate of change of depth_m. Return the contact force F, N.
double kn_lumped_object_tick(kn_lumped_object *pad, const kn_coupling *coupling, double dt_s, double depth_m,
                             double speed_m_s);

// Return the energy stored in the spring k1 of the pad [J].
double kn_lumped_object_stored_j(const kn_lumped_object *pad);

// A pad (lumped object) with its virtual coupling, for use as the object of a simulated loop (kn_haptic_loop_run). The
// undeformed surface is at z = 0.
typedef struct kn_lumped_object_contact {
    kn_lumped_object pad;
    kn_coupling coupling;
} kn_lumped_object_contact;

// Step a pad by 1 ms under a device at `position_m`, and write the force on the device to `force_n`. The force acts
// along z only. Return the energy stored in the pad, J. The function has the type kn_haptic_loop_object. contact: a
// kn_lumped_object_contact.
double kn_lumped_object_touch(void *contact, const double position_m[3], const double velocity_m_s[3],
                              double force_n[3]);

// Slab: the lattice of a scene under one of the scene's tools, for use as the object of a simulated loop
// (kn_haptic_loop_run). A slab steps the whole lattice, whereas a pad is one lumped element.

typedef struct kn_lattice_object {
    kn_model *model;
    kn_state *state;
    kn_scratch *scratch;
    kn_input input;
    kn_output output;
    // Height [m] in the scene at which the tool just touches the middle of the object. In the simulated loop, this
    // height is z = 0.
    double touch_m;
    bool diverged;
} kn_lattice_object;

// Build the lattice of `scene` with one of its tools and the virtual coupling `coupling`. tool: name of the tool; NULL:
// the first tool that can be coupled. kn_lattice_object_close frees the memory. Return false and one line in `error` on
// failure.
bool kn_lattice_object_open(kn_lattice_object *slab, const kn_scene *scene, const char *tool,
                            const kn_coupling *coupling, char *error, size_t error_size);
void kn_lattice_object_close(kn_lattice_object *slab);

// Step the lattice by one time step and write the force on the device to `force_n`. Return -1, because the energy
// stored in the lattice is not known. The function has the type kn_haptic_loop_object. slab: a kn_lattice_object.
double kn_lattice_object_touch(void *slab, const double position_m[3], const double velocity_m_s[3], double force_n[3]);

// Reader of a device profile without a scene. The texts `device.KEY=VALUE` of the option --set can replace values of
// the profile.

// Load a device profile, apply the texts of --set in `sets`, and write the result to `device`. name: name of the
// profile, or path of its file. Return 0, or print an error message that begins with the name of the subcommand and
// return an exit code.
int kn_device_profile_load(kn_device_def *device, const char *subcommand, const char *name, const char *const *sets,
                           int set_count);

// Haptic loop in simulated time. The loop consists of device and hand, the link in both directions, an object, and the
// client's passivity controller. The result states whether the loop buzzes (vibrates audibly or palpably), and how much
// energy it gives to the hand.
//
//     +--> position, velocity --> object --> force --> round trip --> passivity --> saturation --+
//     |                                                                                          |
//     +------------------------------- arm, hand, 1 ms held <------------------------------------+
//
// Press and lean: the loop buzzes if, over the last second,
//     rms of the force above 10 Hz      > 1.5 (k_vc q + b_vc q a / T) + 2 mN, or
//     rms of the position above 10 Hz   > 1.5 q + 2 um
// k_vc, b_vc: virtual coupling. q: encoder step. T: period, 1 ms. a: weight of the newest difference in the velocity
// filter. The term in parentheses is the resolution of the force: one encoder step changes the force by that much.
//
// Tap: the loop buzzes if the force reverses its direction of change more than KN_HAPTIC_LOOP_TURNS times per stroke.
// Slide: the loop buzzes if the force along z or x reverses more than 20 times in the last second (10 Hz).
// A reversal (turn) counts only if it is larger than twice the bound on the force of a press. Taps and slides are
// judged by reversals, because cells or a ridge shake a sliding tool, and a light hand swings by itself on soft
// objects. The position alone would not show a chatter of 500 Hz.

// A tap counts as a buzz if the force reverses its direction more often than this per stroke.
#define KN_HAPTIC_LOOP_TURNS 10.0
#define KN_HAPTIC_LOOP_TRIP_MAX_MS 64

// Step an object by one period of 1 ms and write the force on the device to `force_n`. position_m, velocity_m_s: of the
// device; z points up, and the undeformed surface of the object is at z = 0. Return the energy stored in the object, J,
// or a value below 0 if the energy is not known.
typedef double kn_haptic_loop_object(void *self, const double position_m[3], const double velocity_m_s[3],
                                     double force_n[3]);

typedef enum kn_haptic_loop_motion {
    KN_HAPTIC_LOOP_LEAN, // no hand: a constant force of 1 N pushes the resting device into the surface for 4 s
    // The hand moves in 1 s from 2 mm above the surface to the place where its springs would press with 2 N against a
    // wall, and stays there for 3 s.
    KN_HAPTIC_LOOP_PRESS,
    KN_HAPTIC_LOOP_TAP,  // the hand moves 10 mm up and down at 2 Hz, 10 times
    KN_HAPTIC_LOOP_SLIDE // the hand presses 1 cm beside the object's middle; 1 s later it moves 2 cm along x at 10 mm/s
} kn_haptic_loop_motion;

typedef struct kn_haptic_loop_def {
    // Device and hand. The grip NONE is allowed only with the motion LEAN, which sets the field bias_n.
    kn_held_device_def arm;
    // Virtual coupling as felt at the hand. The resolution of the force and the energy reservoir of the passivity
    // controller are computed from it.
    kn_coupling coupling;
    // Round trip from a pose to the force that answers it, 0 .. KN_HAPTIC_LOOP_TRIP_MAX_MS [ms]. 0: the force arrives
    // in the period of its pose. 1: the force arrives one period later, as from a server on the same machine.
    int trip_ms;
    bool passivity; // true: the passivity controller acts on the force; false: it only observes
    kn_haptic_loop_motion motion;
} kn_haptic_loop_def;

typedef struct kn_haptic_loop_result {
    // Root mean square of force and position above 10 Hz. For a tap the mean is over the whole run, otherwise over the
    // last second.
    double force_rms_n, position_rms_m;
    double resolution_n; // change of the force when the encoder reading changes by one step
    // Number of reversals of the force: per stroke of a tap, or in the last second of a slide.
    double turns;
    // Largest energy that one stroke gave to the hand, >= 0. A stroke lasts from one time in the air to the next.
    double returned_j;
    double peak_n;
    int strokes;
    int64_t acted; // number of 1 ms periods in which the passivity controller damped the force
    bool finite, buzzes;
} kn_haptic_loop_result;

// Simulate the motion `def->motion` on an object, which must be in its initial state. self: first argument of the
// function `object`. No memory is allocated.
kn_haptic_loop_result kn_haptic_loop_run(const kn_haptic_loop_def *def, kn_haptic_loop_object *object, void *self);

#endif
