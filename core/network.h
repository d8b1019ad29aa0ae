#ifndef KN_CORE_NETWORK_H
#define KN_CORE_NETWORK_H
// Test bench for any element of springs and dampers, in one dimension: a drive loads or stretches the element, and its
// response is computed.
//
// The state is the strain x of every part. In a stage of length h, a part takes up the strain D under the stress s,
//
//     spring  s = k (x + D)              damper  D = h g(s),  g(s) = s / (c exp(-beta clamp(|s|, p0, p1)))          (1)
//
// (or a ramp from c to c_min between p0 and p1 in place of the exponential). A damper may have a stroke: x stays
// between two stops. A step ends where x meets a stop. From then on the damper is rigid (D = 0), until the stress of
// the damper changes sign. A step ends there, too.
//
// Parts in series carry one stress s, and their D add up. Parts in parallel share one D, and their s add up. The drive
// prescribes s, or D, or a relation between s and D. Equation (1) is linear, except for force-dependent dampers, which
// Newton's method linearises. From the parts upwards, the equations are combined to one line D = slope s + offset for
// the whole tree. This line and the drive give the stress s of the whole tree, and from it follow the stresses of the
// parts. A stage with h = 0 is a jump: dampers are rigid, and springs that nothing holds yield at once.
//
// Time integration: the singly diagonally implicit Runge-Kutta method of order 4 with embedded order 3 (kn_sdirk_row
// below). The method is L-stable and stiffly accurate, so the massless joints between parts need no extra work. The
// estimated error sets the step length. The code shares nothing with core/law.h and core/step.h, because the lattice is
// tested against a network. No function allocates. None is for the tick, because the number of steps depends on the
// tolerance.
//
// Signs: compression is positive, as on a test bench. In a creep test the specimen keeps its volume, so its section S
// grows as its height h falls. The weight W then gives the stress P = W h/(S0 h0), i.e. stress = load (1 - strain)
// (first paper, see element.h, equation 4).
#include "core/element.h"
#include "core/material.h"
#include <stdint.h>

// Coefficients of the time integration: Hairer and Wanner, Solving ODEs II, table IV.6.5. The last stage is the result
// of the step. If D[m] is KN_SDIRK_GAMMA h times the rate in stage m, then stage j starts from the strain x + sum over
// m < j of row[j][m] / KN_SDIRK_GAMMA * D[m]. Since KN_SDIRK_GAMMA is a power of two, the division has no rounding
// error.
#define KN_SDIRK_STAGES 5
#define KN_SDIRK_GAMMA 0.25 // diagonal of the method

// time of each stage since the beginning of the step, divided by the step length h
static const double kn_sdirk_time[KN_SDIRK_STAGES] = {1. / 4, 3. / 4, 11. / 20, 1. / 2, 1};
static const double kn_sdirk_row[KN_SDIRK_STAGES][KN_SDIRK_STAGES] = {{0},
                                                                      {1. / 2},
                                                                      {17. / 50, -1. / 25},
                                                                      {371. / 1360, -137. / 2720, 15. / 544},
                                                                      {25. / 24, -49. / 48, 125. / 16, -85. / 12}};
// weights of the stages in the error estimate: the solution of order 4 minus the solution of order 3
static const double kn_sdirk_error[KN_SDIRK_STAGES] = {-3. / 16, -27. / 32, 25. / 32, 0, 1. / 4};

typedef struct kn_part {
    double modulus;                   // > 0. Spring: stiffness k, Pa. Damper: c of equation (1) or of the ramp, Pa s
    double beta_per_pa, p0_pa, p1_pa; // damper: beta, p0, p1 of equation (1); beta = 0: c is constant or a ramp
    double c_min_pa_s;                // damper: c_min of the ramp, which requires beta = 0; c_min = 0: no ramp
    bool stroke;                      // damper: its strain is limited by two stops
    double stop[2];                   // damper: least strain, <= 0, and largest strain, >= 0; compression is positive
} kn_part;

typedef struct kn_network {
    kn_element element;
    kn_part part[KN_ELEMENT_MAX]; // parts of the element; the index is the leaf number in the element
} kn_network;

typedef enum kn_drive_kind {
    KN_DRIVE_STRESS, // stress = value
    KN_DRIVE_LOAD,   // stress = value (1 - strain): a weight on a body that keeps its volume
    KN_DRIVE_STRAIN  // strain = value + rate (t - start) + amplitude sin(omega (t - start))
} kn_drive_kind;

typedef struct kn_drive {
    kn_drive_kind kind;
    double value;                                 // STRESS: stress [Pa]; LOAD: nominal stress [Pa]; STRAIN: strain
    double start_s, rate_per_s, amplitude, omega; // STRAIN: see kn_drive_kind; omega in rad/s
} kn_drive;

typedef struct kn_network_state { // plain data of the caller: a copy is a snapshot; all 0: a specimen at rest
    double time_s;
    double strain, stress_pa;           // strain and stress between the two ends at time_s
    double part_strain[KN_ELEMENT_MAX]; // strain x of each part
    double part_stress[KN_ELEMENT_MAX]; // stress of each part in the last stage, where Newton's method starts
    int8_t at_stop[KN_ELEMENT_MAX];     // damper at a stop: 1 fully compressed, -1 fully drawn, 0 between the stops
    double largest;                     // largest strain of a part so far; the tolerance is relative to this strain
    double step_s;                      // step length that the error of the last step allows
    long steps, rejected; // steps: number of steps taken; rejected: number of steps repeated with a shorter length
} kn_network_state;

// Return the network of a scene's material: (s1|d1)-d2 without parts that are zero or rigid.
kn_network kn_network_of(const kn_material *mat);

// Fill in `mat` and return true if a scene's material can represent the network: s|d, s-d, d or (s|d)-d, in any order.
// Only the damper in series may depend on the stress.
bool kn_network_material(const kn_network *net, kn_material *mat);

// Return NULL if the network can be simulated. Else return a static text about the first wrong part, and store the
// number of this part in *leaf.
const char *kn_network_check(const kn_network *net, int *leaf);

bool kn_part_thins(const kn_part *part); // true if the part's damping depends on the stress

// Return the damping c of a damper at a stress of either sign, Pa s, or the stiffness k of a spring, Pa.
double kn_part_modulus(const kn_network *net, int leaf, double stress_pa);

// Change over to a new drive at state->time_s. Springs that no damper holds yield at once. Afterwards, the state's
// strain and stress are those just after this jump. Return false if the drive's jump of strain would need an infinite
// stress; the state is then unchanged.
bool kn_network_jump(const kn_network *net, kn_network_state *state, const kn_drive *drive);

// Advance the state under the drive until the time until_s. `tolerance`: largest local error of a step, relative to the
// largest strain of a part. A tolerance of 1e-9 gives at least six exact digits after thousands of seconds. Return
// false if no step converges, which happens only with absurd parameters.
bool kn_network_advance(const kn_network *net, kn_network_state *state, const kn_drive *drive, double until_s,
                        double tolerance);

#endif
