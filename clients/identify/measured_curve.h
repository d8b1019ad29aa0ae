#ifndef KN_CLIENTS_IDENTIFY_MEASURED_CURVE_H
#define KN_CLIENTS_IDENTIFY_MEASURED_CURVE_H
// Measured curves from CSV files of rheometers, texture analysers and spreadsheets. table_reader.h reads the text. The
// values are converted to SI, checked, and thinned to as many readings as a fit needs. Every change to the
// readings is printed on stdout.
//
//     creep   Columns: time, and one of strain, displacement, height or compliance. The load is either a column of load
//             or stress, whose changes are the load steps, or it is given by the notes or options. A file may have
//             several curves. The curves are columns headed by their loads ("10 gf [mm]"), or tables one below the
//             other, each with a new load and with time counted anew (as `knead creep --csv` writes them)
//     relax   Columns: time, and one of stress, load or modulus. Optional: one of strain, displacement or height
//     sweep   Columns: frequency (Hz or rad/s), and storage and loss modulus. Instead of the two moduli: the absolute
//             modulus, and tan delta or the phase angle
//     press   Columns: time, force, and depth or height of a tool that presses an object. The note tool names the tool. The
//             notes height and area say that a specimen was pressed
//
// Notes are lines "# key: value" anywhere in a file. The keys are load, stress, height, area, strain, release (the time
// at which the load was removed), begin (creep: the time at which the load was applied; relax: the time at which the
// strain was reached) and section. The only value of section is "constant". The options apply to all files, except that
// the size of a pressed specimen comes from its notes only. The notes of a file override the options for that file.
//
// A reading is left out if it is missing, or if it was taken before the load or while the load changed. Readings of the
// same time are averaged. If there are more than KN_CURVE_READINGS readings, they are thinned: neighbours become one
// weighted reading if the ratio of their times since the last change of load is below a limit. Thinning never joins
// readings across a change of load.
//
// A curve of shear, by the names of its columns or by an option, becomes one of compression: stress
// sqrt(3) tau and strain sqrt(3) gamma / (2 (1 + nu)), so that E = 2 (1 + nu) G, which is 3 G if the volume is kept. In
// shear the section is constant, and strains may exceed 1.
//
// Compression is positive (core/network.h). Strain is displacement divided by initial height h0. Stress is force
// divided by the current area S. S follows from the current height h by S h = S0 h0 (first paper, equation 4). If the
// file has a column of stress, that column is used instead.
#include <stdbool.h>

#define KN_CURVE_STEPS 32
#define KN_CURVES_MAX 32
#define KN_CURVE_NAME 64
#define KN_CURVE_READINGS 600 // approximate limit of readings in a curve; more readings are thinned
#define KN_CURVE_LEAST 8      // least number of readings in a curve; a curve with fewer readings is refused

typedef enum kn_curve_kind {
    KN_CURVE_CREEP, // value[] holds the strain; step[] holds the loads
    // value[] holds the stress [Pa], or the modulus [Pa] if the strain is unknown. other[] holds the strain; if other
    // is NULL, the strain is the constant `strain`
    KN_CURVE_RELAX,
    KN_CURVE_SWEEP, // value[] holds G' and other[] holds G'' [Pa]; time_s[] holds the frequency [Hz]
    KN_CURVE_PRESS // value[] holds the force [N] and other[] the depth [m] of a tool, from any zero, downwards positive
} kn_curve_kind;

typedef struct kn_curve_step { // a load that acts from time_s until the next step
    double time_s;
    double stress_pa; // nominal stress W/S0: load W over initial area S0 [Pa]
    // The load was applied between the readings at early_s and late_s. Two straight lines are drawn: through the
    // strains before the change of load and through the strains after it. time_s is where both lines meet. If noise
    // hides the corner, time_s is the middle between early_s and late_s. If the time is known exactly, early_s, late_s
    // and time_s are equal.
    double early_s, late_s;
} kn_curve_step;

typedef struct kn_curve {
    kn_curve_kind kind;
    // file name without folder and ending, plus the column's name if a file has several curves
    char name[KN_CURVE_NAME];
    const char *file; // path of the file as the user gave it
    int count;        // number of entries in each array below; an entry is a reading or a mean of readings
    // [count] times in rising order; two times are equal where value[] jumps. Creep: the first load is applied at time
    // 0
    double *time_s;
    double *value;  // [count] measured values; kn_curve_kind says which quantity
    double *other;  // [count] sweep: loss modulus; relax: strain, or NULL if the file has no strain
    double *load;   // [count] creep, while the file is read: recorded load or stress; NULL in a finished curve
    double *weight; // [count] number of readings that were averaged into each entry, >= 1
    int *line;      // [count] line number in the file of the first reading of each entry
    // Standard deviation of one reading of value[], > 0, from second differences of neighbours (kn_curve_noise). A fit
    // uses sigma_i = noise/sqrt(weight_i). In a sweep `noise` is the standard deviation of ln(value) and ln(other),
    // since a modulus spans decades.
    double noise;
    double height_m, area_m2; // creep, relax, press: size of the specimen; 0: not stated
    double young;             // measured in shear, with E = young G; 0: in compression
    // the next fields are for creep curves only
    int steps;                          // number of load steps
    kn_curve_step step[KN_CURVE_STEPS]; // load steps; step[0] is at time 0; a stress of 0 Pa means no load
    bool constant_area;                 // true: the stress is the nominal stress W/S0; false: it is W/S0 (1 - strain)
    bool unknown_stress;                // a compliance whose stress is not stated: step[0] is then 1 Pa
    // the next fields are for relaxation curves only
    double strain;            // the strain that is held; 0: the strain is unknown, and value[] holds a modulus
    double begin_s;           // time at which the held strain was reached; 0 if time is counted from that moment
    char tool[KN_CURVE_NAME]; // press: value of the note tool; "" if the file has none
} kn_curve;

// Options that apply to all files. 0 or NULL means that an option is not given. A note in the file must then give the
// value, if the experiment needs one.
typedef struct kn_curve_options {
    double height_m, area_m2, load_n, stress_pa; // for creep, one of load_n and stress_pa (nominal stress) is enough
    // creep: time at which the load was removed; 0: the file gives that time, or the load was never removed
    double release_s;
    double strain; // relax: the strain that is held during the relaxation
    bool constant_area;
    bool shear, compression; // read a file as one of shear, or of compression, whatever its names say
    double poisson;          // shear: Poisson's ratio of the material; 0: 0.5, it keeps its volume
    const char *units;       // units of columns whose names have no unit, such as "time=s,modulus=Pa"; NULL: not given
    const char *roles;       // what columns hold, such as "Crosshead=displacement"; NULL: not given
    const char *subcommand;  // name of the subcommand in error messages, such as "identify creep"
} kn_curve_options;

// Append the curves of a file to curve[] and increase *count. A file with several columns headed by their loads has one
// curve for each column. Print each change to the readings (left out, averaged, thinned) as one line on stdout. Return
// 0, or print an error of one line and return an exit code.
int kn_curve_load(kn_curve curve[KN_CURVES_MAX], int *count, kn_curve_kind kind, const char *file,
                  const kn_curve_options *options);
void kn_curve_free(kn_curve *curve);

// Return the standard deviation of independent noise on a smooth curve. For every three neighbours, take the difference
// of the middle value from the straight line through the other two, scaled to the noise of one reading. The median of
// these differences ignores jumps and outliers. If more than half of the readings equal their successor, the gauge is
// coarse, and the noise is one step of the gauge over sqrt(12). The result is at least 1e-6 of the largest value, and
// never 0.
double kn_curve_noise(int count, const double *time_s, const double *value);

int kn_curve_peak(const kn_curve *curve); // return the index of the largest entry of value[], the first of equal ones
double kn_curve_largest(const kn_curve *curve); // return the largest entry of value[], or 0 if all are negative

// Return the first reading of a press whose force is more than noise. The two readings that follow it have such a force,
// too, since among thousands of readings without touch a single one may stand out. `curve->noise` must be set. If there is
// no such reading, return that of the largest force.
int kn_curve_touch(const kn_curve *curve);

// Find the time at which a load was applied from the strain that it causes. Under a constant load the strain rises ever
// more slowly. The straight line through the first readings under load therefore meets the initial level of the strain
// at the time of the load or before, never later. This holds for any material, with or without flat readings before the
// load. The meeting time is thus a lower limit of the time of the load.
//
// Return the time at which the straight line through the first rising strains meets the initial level of the strain. If
// the first three readings are flat, the initial level is their mean; otherwise it is 0. Set *least_s to the earliest
// possible time, four standard deviations before the returned time. Return -INFINITY if the noise hides the rise of the
// strain, or if the first reading is more than four standard deviations of the noise below the initial level. There
// must be at least 3 readings, and the times must rise.
double kn_strain_onset(int count, const double *time_s, const double *strain, double noise, double *least_s);

#endif
