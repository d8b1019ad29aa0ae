#ifndef KN_CLIENTS_IDENTIFY_PRESS_FIT_H
#define KN_CLIENTS_IDENTIFY_PRESS_FIT_H
// The material of a lattice from presses with a tool: force and depth over time, as a force gauge on a stage records them.
// The lattice of a scene is pressed as the real object was, and its material is fitted until its force is the measured one.
//
//       F  depth of a reading  =  touch + d + compliance F       touch: reading at which the tool touches the object
//       |                                                        d: depth of the tool in the object
//     (   )  tool                                                compliance: of the frame and the gauge, by which the
//     -\_/----  d                                                tool lags behind the stage
//     object
//
// Nobody knows the place of touch well: a record may begin when the force has passed a trigger, or long before the touch.
// So it is an unknown of every press. A tool that touched before the first reading is assumed to have come at the speed of
// the first readings. The compliance is one unknown for all presses, unless it is given. The force of the gauge is taken to
// be 0 without touch, and the depth to be that of a drive, which moves without noise.
//
//     residual i = (model - measured)/sigma,   sigma^2 = noise^2/weight + (0.5 % of the press's largest force)^2       (1)
//
// The search runs the lattice with the scene's own solver. A press longer than 3 s is searched in longer steps, up to 8 ms;
// the residuals are then shifted by the difference from the scene's own solver, and the search goes on, up to twice. The
// first start is the best of a grid of scales of stress and time. Three others thin more, thin less, and have a softer
// spring. The unknowns are freed in stages.
//
// A record can be of a specimen between plates: a press by a plate, or creep, whose strains are then compared. The search
// computes a specimen as an affine block (affine_block.h), which is fast, and shifts the residuals by the difference from
// the specimen's lattice, up to four times. The plate holds the top of that lattice, unless its surface is `slides`. The
// compliance is not applied to specimens: their heights are those between the plates.
//
// The intervals are profiles (profile_interval.h), wider if neighbouring residuals are alike. With two or more presses of
// the object, they also cover the spread between these. The fit is repeated without each of them in turn (by the
// linearised model, which costs nothing), and the jackknife gives the covariance. These repeated fits also predict the
// press that was left out.
#include "clients/identify/served_lattice.h"
#include "core/model.h"
#include <stdint.h>

typedef struct kn_press_record {
    const kn_curve *curve; // a press, or the creep of a specimen under a level plate
    const kn_probe_def *tool;
    kn_served_lattice specimen; // its structure, cells and spacing; cells[0] 0: the record is of the object
    // results; of a creep, model_n, band_n and sigma_n are strains, without a unit
    double touch_m; // reading of depth at which the tool touches
    double left;    // rms difference between the lattice's force and the readings, share of the largest force
    double lone;    // the same for the fit without this press of the object; NAN: there is no such fit
    // readings of a pull that the tool cannot give, since it has no adhesion, are not compared: their impulse
    double pull_n_s;
    double *model_n, *band_n; // [curve->count] force of the lattice, and half of its 95 % band
    double *sigma_n;          // [curve->count] sigma of (1); INFINITY: not compared
} kn_press_record;

#define KN_PRESS_FIT_MARK "knead identify press " // begins the file of an interrupted fit

// Return whether a record is of a specimen, not of the object of the fit.
static inline bool kn_press_of_specimen(const kn_press_record *press) { return press->specimen.cells[0] > 0; }

typedef struct kn_press_fit {
    const char *subcommand;
    // the block that is pressed; specimens have its structure. Its material is the start of the search if its damper
    // depends on the force
    const kn_model_def *object;
    // press[0..fitted-1] are fitted, at least one; the others are only predicted, but for their places of touch
    int presses, fitted;
    kn_press_record press[KN_CURVES_MAX]; // [presses]
    const char *resume;                   // file that keeps the best values of an interrupted fit, "": none
    uint64_t inputs; // hash of all inputs that are not in this struct; a kept fit of other inputs is not used
    // in: compliance of frame and gauge [m/N], NAN: fit it; out: best value
    double compliance_m_n;
    // results
    kn_material material;
    kn_parameter_estimate number[KN_ESTIMATE_NUMBERS], compliance; // compliance.name NULL: it was given
    int replicates; // fitted presses of the object itself; from two on, the intervals cover their spread
    bool resumed;
    int runs; // runs of the lattice, each through all fitted presses
} kn_press_fit;

// Run the fit. Return 0, or print an error and return an exit code. Call kn_press_fit_free afterwards in both cases.
int kn_press_fit_run(kn_press_fit *fit);
void kn_press_fit_free(kn_press_fit *fit);

#endif
