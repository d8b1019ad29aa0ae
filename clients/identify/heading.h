#ifndef KN_CLIENTS_IDENTIFY_HEADING_H
#define KN_CLIENTS_IDENTIFY_HEADING_H
// Parse the name and unit above a column of numbers, and quantities in notes, in the spellings of instruments and
// people:
//
//     time_s   time (s)   time [s]   t / s   Time, s   Strain %   displacement_mm 10 gf   ω [rad/s]   G' (kPa)
//
// The known units are those of core/scene/units.h, and min, h, sec, %, percent, kHz, mPa, GPa, kN, uN, bar and dyn. The
// unit `-` or `1` means that the quantity has no dimension. Powers may be written with ², ^2 or 2, products with ·, .
// or *, and micro as µ. After an underscore a unit may be in small letters, since _pa can only mean Pa.
#include "core/scene/units.h"
#include <stdbool.h>
#include <stddef.h>

#define KN_HEADING_NAME 80

// A unit. SI value = number * times / over. Two factors are kept, since 5/1000 is exactly 0.005 but 5 * 0.001 need not
// be.
typedef struct kn_measure {
    kn_unit dimension; // only the powers of m, kg, s and rad in this struct are used
    double times, over;
} kn_measure;

typedef struct kn_heading {
    char name[KN_HEADING_NAME]; // name as written in the file, without the unit
    // the name in a form for comparison: small letters, single blanks between words, Greek letters spelt out, primes
    // as '
    char word[KN_HEADING_NAME];
    char unit_text[KN_HEADING_NAME]; // unit as written in the file; empty: the heading has no unit
    bool has_unit;
    kn_measure unit;
} kn_heading;

// Parse a unit. If the unit is unknown, return false and write one clause to `error`, which may be NULL.
bool kn_measure_parse(kn_measure *m, const char *text, char *error, size_t error_size);
// Return whether `m` has the dimension of `unit`, such as "Pa"; "1" means no dimension.
bool kn_measure_is(const kn_measure *m, const char *unit);
double kn_measure_si(const kn_measure *m, double number); // return a number in the unit `m` converted to SI

void kn_heading_read(kn_heading *h, const char *text); // parse a heading; the name is always set and may be empty

// Read a quantity like "50 gf", "0,5 cm", "10 %" or "1 min" and convert it to SI. The quantity must have the dimension
// of `unit`. A number without a unit is accepted only if `unit` is "1". If `unit` is "N", a mass is read as its weight:
// "50 g" is 50 gf. On failure return false with one clause in `error`.
bool kn_heading_quantity(const char *text, const char *unit, double *value, char *error, size_t error_size);

#endif
