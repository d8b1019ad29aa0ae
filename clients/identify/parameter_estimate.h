#ifndef KN_CLIENTS_IDENTIFY_PARAMETER_ESTIMATE_H
#define KN_CLIENTS_IDENTIFY_PARAMETER_ESTIMATE_H
// An identified parameter: its value, and how well the data determine this value. Identified parameters form a
// material, which is written as a file that a scene loads.
#include "clients/identify/least_squares.h"
#include "core/material.h"
#include <jansson.h>

// Indices of the six parameters of the papers' element in all arrays of parameters. If the damper is constant, the
// entry KN_ESTIMATE_ALPHA holds its damping c2.
enum {
    KN_ESTIMATE_K1,
    KN_ESTIMATE_C1,
    KN_ESTIMATE_ALPHA,
    KN_ESTIMATE_BETA,
    KN_ESTIMATE_P0,
    KN_ESTIMATE_P1,
    KN_ESTIMATE_NUMBERS
};
extern const char *const kn_estimate_name[KN_ESTIMATE_NUMBERS]; // "k1", ...
extern const char *const kn_estimate_unit[KN_ESTIMATE_NUMBERS]; // "Pa", ...

// Return the material with these six parameters and an exponential damper.
kn_material kn_estimate_material(const double value[KN_ESTIMATE_NUMBERS]);

typedef enum kn_known {
    KN_KNOWN,    // the value lies within `interval` with the requested confidence
    KN_AT_MOST,  // the data give the value an upper limit only
    KN_AT_LEAST, // the data give the value a lower limit only
    KN_UNKNOWN   // the data give the value no limit
} kn_known;

typedef struct kn_parameter_estimate {
    const char *name, *unit; // for example name "k1" and unit "Pa"; all units are SI
    double value;            // best value; if the data do not determine the parameter, the value used instead
    kn_known known;
    kn_fit_interval interval;
    char words[240]; // reason why the value is not known, or which value was used instead; "" if the value is known
} kn_parameter_estimate;

// Set all fields of `number`. The field `known` follows from the open sides of the interval.
void kn_parameter_estimate_set(kn_parameter_estimate *number, const char *name, const char *unit, double value,
                               kn_fit_interval interval);

// Format value and interval as one text, such as "46091.3 Pa [45900 .. 46300]" or "<= 945 Pa", without the name.
void kn_parameter_estimate_text(const kn_parameter_estimate *number, char *text, size_t size);

void kn_parameter_estimate_tell(
    json_t *to, const kn_parameter_estimate *number); // add an object under the parameter's name to the JSON output

#define KN_SOURCE_MAX 300
// Format the source of a material for a comment, such as "dough.csv and others": the first file's name without its
// folder. Characters that a comment must not contain become question marks.
const char *kn_material_source(const char *file, int files, char text[KN_SOURCE_MAX]);

// Return whether a scene accepts the material. The function parses a small scene with this material, so the limits of
// core/scene apply. If the scene is refused, `why` receives a clause like "material.alpha is 1e+21 Pa*s, out of range,
// expected a number from 1e-06 to 1e+15 Pa*s".
bool kn_material_served(const kn_material *material, char *why, size_t why_size);

// Check before the fit that the material file can be written. Return 0, or print an error and return an exit code.
int kn_material_file_try(const char *subcommand, const char *path);

// Write the file that a scene names as `material: FILE`, with the interval of every parameter as a comment. `origin` is
// a sentence on the source of the data. If `density_kg_m3` is 0, the density was not measured, so the density of dough
// is written with a remark. Return 0, or print an error and return an exit code. A material that no scene accepts is
// not written (exit code 1). An existing file that this command did not write is not overwritten (exit code 2). An
// existing material file is replaced only when the new file is complete.
// If `scene` is not NULL, the file is a whole scene: `scene` is the text of all keys but material and density.
int kn_material_file_write(const char *subcommand, const char *path, const char *origin, const char *scene,
                           const kn_material *material, double density_kg_m3, int count,
                           const kn_parameter_estimate *number);

#endif
