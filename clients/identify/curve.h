#ifndef KN_CLIENTS_IDENTIFY_CURVE_H
#define KN_CLIENTS_IDENTIFY_CURVE_H
// Measured curves out of CSV files as rheometers, texture analysers and spreadsheets write them (sheet.h reads the
// text), in SI, in the order of time, and thinned to what a fit needs. Whatever was done to the readings is said.
//
//     creep   time and strain | displacement | height | compliance; the load from a column load | stress, whose
//             changes are the steps, or from the notes or options. Several curves in a file: columns headed by their
//             loads ("10 gf [mm]"), or one below the other, time beginning anew with another load (`knead creep --csv`)
//     relax   time and stress | load | modulus; perhaps strain | displacement | height
//     sweep   frequency, Hz or rad/s, and storage and loss modulus, or |modulus| and tan delta | phase angle
//
// Notes, lines "# key: value" anywhere in a file: load, stress, height, area, release (when the load was taken off),
// begin (when it came; relax: when the strain was reached), strain, section: constant. A file's notes go before the
// options, which are of all files.
//
// Readings are left out before the load, while it changes, and where they are missing; those of one time are averaged;
// more than KN_CURVE_READINGS are thinned, never across a change of load: neighbours whose times since the last change
// differ by less than a factor become one reading of that weight.
//
// Compression is positive, as on a bench (core/network.h). Strain is displacement over the initial height; stress is
// force over the area that the sample has by then, S h = S0 h0 (first paper, equation 4), unless the file gives stress
// itself.
#include <stdbool.h>

#define KN_CURVE_STEPS 32
#define KN_CURVES_MAX 32
#define KN_CURVE_NAME 64
#define KN_CURVE_READINGS 600 // about; more are thinned
#define KN_CURVE_LEAST 8      // fewer are refused

typedef enum kn_curve_kind {
    KN_CURVE_CREEP, // value: strain. The load is known: step[]
    KN_CURVE_RELAX, // value: stress, Pa; or modulus, Pa, where no strain is known. The strain: other, or held
    KN_CURVE_SWEEP  // value: G', other: G'', Pa; time_s is the frequency, Hz
} kn_curve_kind;

typedef struct kn_curve_step { // a load from a moment on
    double time_s;
    double stress_pa;       // load over S0: the nominal stress W/S0
    double early_s, late_s; // the readings between which it came; time_s is where the lines on either side of it meet,
                            // their middle where the noise is too large for that. Both are time_s where it is known
} kn_curve_step;

typedef struct kn_curve {
    kn_curve_kind kind;
    char name[KN_CURVE_NAME]; // of the file without folder and ending, and of the column where a file has several
    const char *file;         // as given
    int count;
    double *time_s; // rising, two may be equal where the value jumps; creep: 0 is when the first load came
    double *value;
    double *other;  // sweep: loss modulus; relax: strain, NULL where it is not in the file
    double *weight; // how many readings each stands for, >= 1
    int *line;      // of the file, of the first of these
    double noise;   // standard deviation of one reading of value, from second differences of neighbours; see
                    // kn_curve_noise. > 0. A fit takes sigma_i = noise/sqrt(weight_i). Sweep: of ln value and ln other,
                    // that is relative, since a modulus spans decades
    // creep
    int steps;
    kn_curve_step step[KN_CURVE_STEPS]; // the first at time 0; 0 Pa: released
    bool constant_area;                 // stress is the nominal one, not nominal x (1 - strain)
    double height_m, area_m2;           // of the specimen; 0: unknown, the file gives strain and stress
    // relax
    double strain;  // held, after a step; 0: unknown, value is a modulus
    double begin_s; // when the strain was reached (0 where time counts from there)
} kn_curve;

// What options say of all files; 0 or NULL: not given, then the file's own lines must say it.
typedef struct kn_curve_options {
    double height_m, area_m2, load_n, stress_pa; // of creep: load or nominal stress
    double release_s;                            // creep: when the load was taken off; 0: the file says, or never
    double strain;                               // relax: held
    bool constant_area;
    const char *units;      // "time=s,modulus=Pa", for columns whose names have none; NULL: none
    const char *subcommand; // "identify creep", for complaints
} kn_curve_options;

// Adds the curves of a file to curve[*count..] (a wide file has one per column of load), and prints on stdout what was
// done to its readings (sorted, left out, thinned), one line each. Returns an exit code, after one line of complaint.
int kn_curve_load(kn_curve curve[KN_CURVES_MAX], int *count, kn_curve_kind kind, const char *file,
                  const kn_curve_options *options);
void kn_curve_free(kn_curve *curve);

// Standard deviation of independent noise on values over time, whatever smooth curve is under it: of each three
// neighbours the middle one less the straight line through the others, scaled by what that keeps of independent noise;
// the median of their sizes, so that jumps and outliers do not count. Where most readings repeat (a coarse gauge), a
// step of the gauge over sqrt(12). Never 0: 1e-6 of the largest value at least.
double kn_curve_noise(int count, const double *time_s, const double *value);

#endif
