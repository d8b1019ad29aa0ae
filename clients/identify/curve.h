#ifndef KN_CLIENTS_IDENTIFY_CURVE_H
#define KN_CLIENTS_IDENTIFY_CURVE_H
// Measured curves from CSV files of rheometers, texture analysers and spreadsheets (sheet.h reads the text). The values
// are converted to SI, sorted by time, and thinned to as many readings as a fit needs. Every change to the readings is
// reported.
//
//     creep   time and strain | displacement | height | compliance. The load is a column load | stress, and its changes
//             are the steps; or it is in the notes or options. A file may have several curves: columns headed by their
//             loads ("10 gf [mm]"), or tables one below the other, where time begins anew with another load
//             (`knead creep --csv`)
//     relax   time and stress | load | modulus; optionally strain | displacement | height
//     sweep   frequency, Hz or rad/s, and storage and loss modulus, or |modulus| and tan delta | phase angle
//
// Notes are lines "# key: value" anywhere in a file. The keys are load, stress, height, area, strain, release (the time
// at which the load was removed), begin (the time at which the load was applied; relax: at which the strain was
// reached) and section, whose only value is constant. The notes of a file override the options, which apply to all
// files.
//
// A reading is left out if it is missing, or if it was taken before the load or while the load changed. Readings of the
// same time are averaged. If there are more than KN_CURVE_READINGS readings, they are thinned: neighbours whose times
// since the last change of load differ by less than a certain factor become one weighted reading. Thinning never joins
// readings across a change of load.
//
// Compression is positive (core/network.h). Strain is displacement divided by initial height h0. Stress is force
// divided by the current area S. S follows from the current height h by S h = S0 h0 (first paper, equation 4). A column
// of stress in the file is used instead.
#include <stdbool.h>

#define KN_CURVE_STEPS 32
#define KN_CURVES_MAX 32
#define KN_CURVE_NAME 64
#define KN_CURVE_READINGS 600 // approximate limit; more readings are thinned
#define KN_CURVE_LEAST 8      // fewer readings are refused

typedef enum kn_curve_kind {
    KN_CURVE_CREEP, // value: strain. The load is known: step[]
    // value: stress, Pa, or modulus, Pa, if the strain is unknown. The strain is in other[], or it is the constant
    // `strain`
    KN_CURVE_RELAX,
    KN_CURVE_SWEEP // value: G', other: G'', Pa; time_s is the frequency, Hz
} kn_curve_kind;

typedef struct kn_curve_step { // a load that applies from time_s on
    double time_s;
    double stress_pa; // nominal stress W/S0: load over initial area
    // The load was applied between the readings at early_s and late_s. time_s is where the straight lines through the
    // strains before and after meet, or the middle between both times if noise hides the corner. If the time is known
    // exactly, early_s = late_s = time_s.
    double early_s, late_s;
} kn_curve_step;

typedef struct kn_curve {
    kn_curve_kind kind;
    char name[KN_CURVE_NAME]; // file name without folder and ending, plus the column if a file has several
    const char *file;         // as given
    int count;
    double *time_s; // rising; two may be equal where the value jumps; creep: time 0 is the moment of the first load
    double *value;
    double *other;  // sweep: loss modulus; relax: strain, NULL if the file has none
    double *weight; // number of readings in each entry, >= 1
    int *line;      // line number in the file of the first reading of each entry
    // Standard deviation of one reading of value, > 0, from second differences of neighbours (kn_curve_noise). A fit
    // uses sigma_i = noise/sqrt(weight_i). Sweep: the standard deviation of ln(value) and ln(other), since a modulus
    // spans decades.
    double noise;
    // creep
    int steps;
    kn_curve_step step[KN_CURVE_STEPS]; // the first is at time 0; 0 Pa: no load
    bool constant_area;                 // stress is taken as the nominal stress, not as nominal stress x (1 - strain)
    double height_m, area_m2;           // of the specimen; 0: not known, since the file gives strain and stress
    // relax
    double strain;  // the strain that is held; 0: not known, and value is a modulus
    double begin_s; // time at which the strain was reached (0 if time is counted from that moment)
} kn_curve;

// Options that apply to all files. 0 or NULL: not given; a note in the file must then give the value.
typedef struct kn_curve_options {
    double height_m, area_m2, load_n, stress_pa; // creep: load or nominal stress
    // creep: time at which the load was removed; 0: as in the file, else never
    double release_s;
    double strain; // relax: the strain that is held
    bool constant_area;
    const char *units;      // "time=s,modulus=Pa", for columns whose names have no unit; NULL: none
    const char *subcommand; // "identify creep", for complaints
} kn_curve_options;

// Append the curves of a file to curve[] and increase *count. A file with several columns headed by their loads has one
// curve for each column. Print each change to the readings (sorted, left out, thinned) as one line on stdout. Return an
// exit code, after one line of complaint.
int kn_curve_load(kn_curve curve[KN_CURVES_MAX], int *count, kn_curve_kind kind, const char *file,
                  const kn_curve_options *options);
void kn_curve_free(kn_curve *curve);

// Return the standard deviation of independent noise on a smooth curve. For every three neighbours, take the difference
// of the middle value from the straight line through the other two, scaled to the noise of one reading. The median of
// these differences ignores jumps and outliers. If more than half of the readings equal the next one (a coarse gauge),
// the noise is one step of the gauge over sqrt(12). The result is at least 1e-6 of the largest value, and never 0.
double kn_curve_noise(int count, const double *time_s, const double *value);

#endif
