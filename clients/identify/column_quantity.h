#ifndef KN_CLIENTS_IDENTIFY_COLUMN_QUANTITY_H
#define KN_CLIENTS_IDENTIFY_COLUMN_QUANTITY_H
// Parse the name and unit above a column of numbers, and quantities in notes, in the spellings of instruments and
// people:
//
//     time_s   time (s)   time [s]   t / s   Time, s   Strain %   displacement_mm 10 gf   ω [rad/s]   G' (kPa)
//
// The known units are those of core/scene/units.h, and min, h, sec, %, percent, kHz, mPa, GPa, kN, uN, bar and dyn. The
// unit `-` or `1` means that the quantity has no dimension. Powers may be written with ², ^2 or 2, products with ·, .
// or *, and micro as µ. After an underscore a unit may be in small letters, since _pa can only mean Pa.
//
// The physical quantity of a column (time, height, load ...) is found from its name, in the spellings of instruments,
// and from its unit.
#include "core/scene/units.h"
#include <stdbool.h>
#include <stddef.h>

#define KN_HEADING_NAME 80

// A unit. SI value = number * times / over. Two factors are kept, since 5/1000 is exactly 0.005 but 5 * 0.001 need not
// be.
typedef struct kn_column_unit {
    kn_unit dimension; // only the powers of m, kg, s and rad in this struct are used
    double times, over;
} kn_column_unit;

typedef struct kn_heading {
    char name[KN_HEADING_NAME]; // name as written in the file, without the unit
    // the name in a form for comparison: small letters, single blanks between words, Greek letters spelt out, primes
    // as '
    char word[KN_HEADING_NAME];
    char unit_text[KN_HEADING_NAME]; // unit as written in the file; empty: the heading has no unit
    bool has_unit;
    kn_column_unit unit;
} kn_heading;

// Parse a unit. If the unit is unknown, return false and write one clause to `error`, which may be NULL.
bool kn_column_unit_parse(kn_column_unit *m, const char *text, char *error, size_t error_size);
// Return whether `m` has the dimension of `unit`, such as "Pa"; "1" means no dimension.
bool kn_column_unit_is(const kn_column_unit *m, const char *unit);
double kn_column_unit_si(const kn_column_unit *m, double number); // return a number in the unit `m` converted to SI

void kn_heading_read(kn_heading *h, const char *text); // parse a heading; the name is always set and may be empty

// Read a quantity like "50 gf", "0,5 cm", "10 %" or "1 min" and convert it to SI. The quantity must have the dimension
// of `unit`. A number without a unit is accepted only if `unit` is "1". If `unit` is "N", a mass is read as its weight:
// "50 g" is 50 gf. On failure return false with one clause in `error`.
bool kn_heading_quantity(const char *text, const char *unit, double *value, char *error, size_t error_size);

// Replace control characters by '?', since names and notes are shown on terminals.
void kn_text_clean(char *text);

// ---- the quantity of a column

typedef enum kn_column_quantity {
    KN_TIME,
    KN_HEIGHT,
    KN_DISPLACEMENT,
    KN_STRAIN,
    KN_COMPLIANCE,
    KN_LOAD,
    KN_STRESS,
    KN_MODULUS,
    KN_FREQUENCY,
    KN_STORAGE,
    KN_LOSS,
    KN_TANGENT,
    KN_PHASE
} kn_column_quantity;

const char *kn_column_quantity_name(kn_column_quantity quantity); // "time", "height", "storage modulus", ...

struct kn_table_reader; // table_reader.h

// Return the index of the column that holds a quantity, or -1. A column whose quantity is certain (kn_column_is_sure)
// is preferred. If the unit of the only matching column is missing or has the wrong dimension, print an error and set
// *code to an exit code. If `code` is NULL, print nothing.
int kn_column_find(struct kn_table_reader *s, kn_column_quantity quantity, int *code);

// Return whether the quantity in a column that was found is certain. It is certain if the column has a unit, or if the
// quantity needs no unit and the column's name is the quantity's own word or letter. An uncertain column may hold
// something else, so a column that certainly holds another usable quantity is preferred.
bool kn_column_is_sure(const kn_heading *column, kn_column_quantity quantity);

// Return the column of the first of `count` quantities for which the table has a column, and set *found to that
// quantity. A column whose quantity is certain (kn_column_is_sure) is preferred to an uncertain one. If there is no
// column, return -1. On an error print the error, set *code to an exit code and return -1. *code must be KN_EXIT_OK
// before the call.
int kn_column_find_first(struct kn_table_reader *s, int count, const kn_column_quantity *wanted,
                         kn_column_quantity *found, int *code);

// Find several columns of one quantity that are headed by their loads, such as "10 gf [mm]" or "displacement_mm 10 gf".
// Store the index of each column in column[] and its load in load_n[]. Return the number of columns, at most `most`.
int kn_column_find_loads(const struct kn_table_reader *s, int most, int column[], double load_n[]);

#endif
