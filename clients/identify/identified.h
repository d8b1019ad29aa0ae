#ifndef KN_CLIENTS_IDENTIFY_IDENTIFIED_H
#define KN_CLIENTS_IDENTIFY_IDENTIFIED_H
// An identified parameter: its value and how well the data determine it. A material of identified parameters is written
// as a file that a scene loads.
#include "clients/identify/fit.h"
#include "core/material.h"
#include <jansson.h>

typedef enum kn_known {
    KN_KNOWN,    // within interval, with the requested confidence
    KN_AT_MOST,  // bounded from above only
    KN_AT_LEAST, // bounded from below only
    KN_UNKNOWN   // bounded on neither side
} kn_known;

typedef struct kn_identified {
    const char *name, *unit; // "k1", "Pa": SI
    double value;            // the best value; if the data do not determine it, the value used instead
    kn_known known;
    kn_fit_interval interval;
    char words[240]; // why the value is not known, or which value was used instead; "" if it is known
} kn_identified;

// Set all fields of `number`. `known` follows from the open sides of the interval.
void kn_identified_take(kn_identified *number, const char *name, const char *unit, double value,
                        kn_fit_interval interval);

// Format value and interval as one text, such as "46091.3 Pa [45900 .. 46300]" or "<= 945 Pa", without the name.
void kn_identified_print(const kn_identified *number, char *text, size_t size);

void kn_identified_tell(json_t *to, const kn_identified *number); // --json: an object under the parameter's name

#define KN_SOURCE_MAX 300
// Format the source of a material for a comment, such as "dough.csv and others": the first file's name without its
// folder. Characters that a comment must not contain become question marks.
const char *kn_material_source(const char *file, int files, char text[KN_SOURCE_MAX]);

// Return whether a scene accepts the material. The function parses a small scene with this material, so that the limits
// are those of core/scene. If not, `why` is a clause like "material.alpha is 1e+21 Pa*s, out of range, expected a
// number from 1e-06 to 1e+15 Pa*s".
bool kn_material_served(const kn_material *material, char *why, size_t why_size);

// Check before the fit that the file can be written. Return an exit code, after a complaint.
int kn_material_file_try(const char *subcommand, const char *path);

// Write the file that a scene names as `material: FILE`, with the interval of every parameter as a comment. `origin`: a
// sentence on the source. `density_kg_m3` 0: not measured; the density of dough is then written with a remark. Return
// an exit code, after a complaint. A material that no scene accepts is not written (exit code 1). An existing file that
// this command did not write is not overwritten (exit code 2). An existing material file is replaced only when the new
// file is complete.
int kn_material_file_write(const char *subcommand, const char *path, const char *origin, const kn_material *material,
                           double density_kg_m3, int count, const kn_identified *number);

#endif
