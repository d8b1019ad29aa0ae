#ifndef KN_CLIENTS_IDENTIFY_HEADING_H
#define KN_CLIENTS_IDENTIFY_HEADING_H
// What stands above a column of numbers, and quantities in notes beside them, as instruments and people write them:
//
//     time_s   time (s)   time [s]   t / s   Time, s   Strain %   displacement_mm 10 gf   ω [rad/s]   G' (kPa)
//
// Units are those of core/scene/units.h and: min, h, sec, %, percent, kHz, mPa, GPa, kN, uN, bar, dyn, `-` or `1`
// (none); with ², ^2 or 2, · or . or *, µ. After `_` a unit may be in small letters, since _pa can only mean Pa there.
#include "core/scene/units.h"
#include <stdbool.h>
#include <stddef.h>

#define KN_HEADING_NAME 80

typedef struct kn_measure { // SI value = number * times / over, two numbers since 5/1000 is 0.005 to the bit
    kn_unit dimension;      // only m, kg, s, rad
    double times, over;
} kn_measure;

typedef struct kn_heading {
    char name[KN_HEADING_NAME];      // as written, without the unit
    char word[KN_HEADING_NAME];      // the name in small letters, one blank between words, Greek letters spelt out,
                                     // primes as ': what to compare with
    char unit_text[KN_HEADING_NAME]; // as written; empty: none
    bool has_unit;
    kn_measure unit;
} kn_heading;

// False: no unit that is known. error: a clause that says so; NULL: not wanted.
bool kn_measure_parse(kn_measure *m, const char *text, char *error, size_t error_size);
bool kn_measure_is(const kn_measure *m, const char *unit); // of its dimension, e.g. "Pa"; "1": without one
double kn_measure_si(const kn_measure *m, double number);

void kn_heading_read(kn_heading *h, const char *text); // always gives a name, if only an empty one

// "50 gf", "0,5 cm", "10 %", "1 min" -> SI in the dimension of unit. A number without a unit is one only if unit is
// "1".
// A weight may be a mass: in N, "50 g" is 50 gf.
bool kn_heading_quantity(const char *text, const char *unit, double *value, char *error, size_t error_size);

#endif
