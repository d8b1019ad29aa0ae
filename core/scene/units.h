#ifndef KN_CORE_SCENE_UNITS_H
#define KN_CORE_SCENE_UNITS_H
// Quantities in ordinary notation: "470 gf/cm^3", "2500 gf s/cm^3", "5 mm", "9.81 m/s^2", "8.3e-4 1/Pa".
//
//     quantity = number [unit]
//     unit     = factor { ("*" | " " | "/") factor }        left to right: "gf/cm^2*s" is (gf/cm^2) s
//     factor   = ("1" | name) ["^" integer]
//
// A space means "times" only before the first "/": "kg/m s^2" is ambiguous and is refused.
// Names, case-sensitive: m cm mm um, s ms us, Hz, kg g, N mN gf kgf, Pa kPa MPa atm, rad deg, %.
// 1 gf = 9.80665e-3 N, 1 atm = 101325 Pa exactly. An angle is a dimension of its own, so a coefficient of friction of
// 30 deg is refused.
//
// Every unit except gf, kgf, atm and deg is an SI unit times a power of ten. The power is added to the exponent of the
// number before strtod rounds once. So "5 mm", "0.5 cm" and "0.005 m" give the same bits.
//
// The functions allocate no memory.
#include <stdbool.h>
#include <stddef.h>

// A unit as a product of powers. The members are the exponents in
// 10^ten 9.80665^gf 1.01325^atm (pi/180)^deg m^m kg^kg s^s rad^rad.
typedef struct kn_unit {
    int m, kg, s, rad;
    int ten;
    int gf, atm, deg;
} kn_unit;

typedef struct kn_quantity {
    char digits[48]; // sign, digits and decimal point of the number, without the exponent
    int exponent;    // exponent of ten, as written
    bool bare;       // the number is written without a unit
    kn_unit unit;    // unit of the number; dimensionless if `bare`
} kn_quantity;

// Parse the text of a unit or of a quantity. On failure return false and write one clause into `error`, a buffer of
// error_size bytes, e.g. "unknown unit 'kpa'".
bool kn_unit_parse(kn_unit *unit, const char *text, char *error, size_t error_size);
bool kn_quantity_parse(kn_quantity *q, const char *text, char *error, size_t error_size);

bool kn_unit_same_dimension(const kn_unit *a, const kn_unit *b);

// Return the quantity `q` in multiples of `unit`. `unit` must have the dimension of q, unless q is written without a
// unit. The result is infinite if the value exceeds the range of a double.
double kn_quantity_in(const kn_quantity *q, const kn_unit *unit);

#endif
