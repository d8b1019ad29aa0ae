#ifndef KN_CLIENTS_IDENTIFY_IDENTIFIED_H
#define KN_CLIENTS_IDENTIFY_IDENTIFIED_H
// A number with what the data know of it, and a material made of such numbers as a file that a scene loads.
#include "clients/identify/fit.h"
#include "core/material.h"
#include <jansson.h>

typedef enum kn_known {
    KN_KNOWN,    // within interval, with the confidence that was asked for
    KN_AT_MOST,  // only bounded from above
    KN_AT_LEAST, // only from below
    KN_UNKNOWN   // by neither side
} kn_known;

typedef struct kn_identified {
    const char *name, *unit; // "k1", "Pa": SI
    double value;            // the best, or what was put in its place
    kn_known known;
    kn_fit_interval interval;
    char words[240]; // why it is not known, or what was put in its place; "" where it is known
} kn_identified;

// Sets known by which sides of the interval are open.
void kn_identified_take(kn_identified *number, const char *name, const char *unit, double value,
                        kn_fit_interval interval);

// "46091.3 Pa  [45900 .. 46300]", "<= 945 Pa": as a line of a report says it, without the name.
void kn_identified_print(const kn_identified *number, char *text, size_t size);

void kn_identified_tell(json_t *to, const kn_identified *number); // --json: an object by the number's name

#define KN_SOURCE_MAX 300
// "dough.csv and others", the first of so many files without its folder, for a comment's one line: a character that may
// not stand there is a question mark.
const char *kn_material_source(const char *file, int files, char text[KN_SOURCE_MAX]);

// Whether a scene takes that material: a small one of it is read, so that the limits are core/scene's own. Else why is
// "material.alpha is 1e+21 Pa*s, out of range, expected a number from 1e-06 to 1e+15 Pa*s".
bool kn_material_served(const kn_material *material, char *why, size_t why_size);

// Whether it can be written there, before the work. An exit code, after a complaint.
int kn_material_file_try(const char *subcommand, const char *path);

// The file that a scene names as `material: FILE`: every number with its interval beside it. origin: a sentence on
// where it is from; density 0: not measured, dough's is taken, and said. An exit code, after a complaint: what no scene
// takes is not written (1), and a file that is there and is no material of this command's is not overwritten (2); one
// that is, stays until the new one is whole.
int kn_material_file_write(const char *subcommand, const char *path, const char *origin, const kn_material *material,
                           double density_kg_m3, int count, const kn_identified *number);

#endif
