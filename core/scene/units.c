#include "core/scene/units.h"

#include <ctype.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// The unit factors that are not powers of ten. kn_quantity_in multiplies by these factors or divides by them.
#define GF_NEWTON 9.80665               // 1 kgf in N: standard gravity, exact by definition
#define ATM_PASCAL 1.01325              // 1 atm in 1e5 Pa: exact by definition
#define DEG_RADIAN 0.017453292519943295 // 1 deg in rad

// Largest number of factors in a unit, and largest exponent of a number. No real quantity needs more, and the sums of
// exponents stay small integers.
enum { FACTORS_MAX = 8, EXPONENT_MAX = 9999 };

static const struct {
    const char *name;
    kn_unit unit;
} units[] = {
    {"%", {.ten = -2}},
    {"m", {.m = 1}},
    {"cm", {.m = 1, .ten = -2}},
    {"mm", {.m = 1, .ten = -3}},
    {"um", {.m = 1, .ten = -6}},
    {"s", {.s = 1}},
    {"ms", {.s = 1, .ten = -3}},
    {"us", {.s = 1, .ten = -6}},
    {"Hz", {.s = -1}},
    {"kg", {.kg = 1}},
    {"g", {.kg = 1, .ten = -3}},
    {"N", {.m = 1, .kg = 1, .s = -2}},
    {"mN", {.m = 1, .kg = 1, .s = -2, .ten = -3}},
    {"gf", {.m = 1, .kg = 1, .s = -2, .ten = -3, .gf = 1}},
    {"kgf", {.m = 1, .kg = 1, .s = -2, .gf = 1}},
    {"Pa", {.m = -1, .kg = 1, .s = -2}},
    {"kPa", {.m = -1, .kg = 1, .s = -2, .ten = 3}},
    {"MPa", {.m = -1, .kg = 1, .s = -2, .ten = 6}},
    {"atm", {.m = -1, .kg = 1, .s = -2, .ten = 5, .atm = 1}},
    {"rad", {.rad = 1}},
    {"deg", {.rad = 1, .deg = 1}},
};

// Multiply a unit by a power of another unit.
static void multiply(kn_unit *u, const kn_unit *by, int power)
{
    u->m += by->m * power;
    u->kg += by->kg * power;
    u->s += by->s * power;
    u->rad += by->rad * power;
    u->ten += by->ten * power;
    u->gf += by->gf * power;
    u->atm += by->atm * power;
    u->deg += by->deg * power;
}

// Return the unit with this name, or NULL if there is none. "1" is a unit, too, because "1/Pa" needs it.
static const kn_unit *find(const char *name, size_t size)
{
    static const kn_unit one = {0};
    if (size == 1 && *name == '1') return &one;
    for (size_t i = 0; i < sizeof units / sizeof *units; i++)
        if (strlen(units[i].name) == size && memcmp(units[i].name, name, size) == 0) return &units[i].unit;
    return NULL;
}

// Write an error message that quotes at most 24 characters of the text. Always return false.
static bool fail(char *error, size_t size, const char *format, const char *text, int length)
{
    snprintf(error, size, format, length > 24 ? 24 : length, text);
    return false;
}

// Read a power such as "^-2" at *p. A power has one digit and perhaps a minus sign. Without "^", *power becomes 1.
// Return false if no such power follows "^".
static bool read_power(const char **p, int *power)
{
    *power = 1;
    if (**p != '^') return true;
    const char *q = *p + 1;
    int sign = *q == '-' ? -1 : 1;
    if (*q == '-') q++;
    if (!isdigit((unsigned char)*q) || isdigit((unsigned char)q[1])) return false;
    *power = sign * (*q - '0');
    *p = q + 1;
    return true;
}

bool kn_unit_parse(kn_unit *unit, const char *text, char *error, size_t error_size)
{
    *unit = (kn_unit){0};
    const char *p = text + strspn(text, " ");
    int sign = 1;
    for (int factor = 0;; factor++) {
        // read the name of a unit and its power
        size_t size = 0;
        while (isalnum((unsigned char)p[size])) size++;
        if (*p == '%') size = 1;
        const kn_unit *found = find(p, size);
        if (size == 0) return fail(error, error_size, "a unit's name is missing in '%.*s'", text, 24);
        if (!found) return fail(error, error_size, "unknown unit '%.*s'", p, (int)size);
        if (factor == FACTORS_MAX) return fail(error, error_size, "too many factors in the unit '%.*s'", text, 24);
        const char *name = p;
        int power;
        p += size;
        if (!read_power(&p, &power)) return fail(error, error_size, "no one-digit power after '%.*s'", name, (int)size);
        multiply(unit, found, sign * power);
        // read the operator before the next factor: "/", "*" or a space; after a "/", a space is ambiguous
        size_t spaces = strspn(p, " ");
        p += spaces;
        if (*p == '\0') return true;
        if (*p == '/') sign = -1;
        else if (*p == '*') sign = 1;
        else if (spaces == 0) return fail(error, error_size, "cannot read the unit at '%.*s'", p, 24);
        else if (sign < 0) return fail(error, error_size, "ambiguous after '/': write * or / before '%.*s'", p, 24);
        else continue;
        p += 1 + strspn(p + 1, " ");
    }
}

// Return the number of characters of a decimal number without sign and exponent, or 0 if there is no digit.
static size_t scan_digits(const char *p)
{
    size_t n = strspn(p, "0123456789"), fraction = 0;
    if (p[n] == '.') fraction = strspn(p + n + 1, "0123456789");
    if (n + fraction == 0) return 0;
    return p[n] == '.' ? n + 1 + fraction : n;
}

bool kn_quantity_parse(kn_quantity *q, const char *text, char *error, size_t error_size)
{
    // keep the digits as text, so that kn_quantity_in rounds the number only once
    *q = (kn_quantity){.bare = true};
    const char *p = text + (*text == '-' || *text == '+');
    size_t size = scan_digits(p);
    if (size == 0) return fail(error, error_size, "'%.*s' is not a finite number", text, 24);
    p += size;
    // copy sign and digits, then read the exponent, then the unit
    if (p - text >= (int)sizeof q->digits) return fail(error, error_size, "'%.*s...' has too many digits", text, 24);
    memcpy(q->digits, text, (size_t)(p - text));
    if (*p == 'e' || *p == 'E') {
        const char *digits = p + 1 + (p[1] == '-' || p[1] == '+');
        char *end;
        long exponent = isdigit((unsigned char)*digits) ? strtol(p + 1, &end, 10) : LONG_MAX;
        if (exponent < -EXPONENT_MAX || exponent > EXPONENT_MAX)
            return fail(error, error_size, "cannot read the exponent of '%.*s'", text, 24);
        q->exponent = (int)exponent;
        p = end;
    }
    p += strspn(p, " ");
    if (*p == '\0') return true;
    q->bare = false;
    return kn_unit_parse(&q->unit, p, error, error_size);
}

bool kn_unit_same_dimension(const kn_unit *a, const kn_unit *b)
{
    return a->m == b->m && a->kg == b->kg && a->s == b->s && a->rad == b->rad;
}

double kn_quantity_in(const kn_quantity *q, const kn_unit *unit)
{
    // add all powers of ten to the exponent of the number, so that strtod rounds only once
    char number[sizeof q->digits + 16];
    snprintf(number, sizeof number, "%se%d", q->digits, q->exponent + q->unit.ten - unit->ten);
    double value = strtod(number, NULL);
    // multiply by the other factors: the exponent of each is its power in the unit of q minus its power in `unit`
    for (int i = q->unit.gf - unit->gf; i > 0; i--) value *= GF_NEWTON;
    for (int i = q->unit.gf - unit->gf; i < 0; i++) value /= GF_NEWTON;
    for (int i = q->unit.atm - unit->atm; i > 0; i--) value *= ATM_PASCAL;
    for (int i = q->unit.atm - unit->atm; i < 0; i++) value /= ATM_PASCAL;
    for (int i = q->unit.deg - unit->deg; i > 0; i--) value *= DEG_RADIAN;
    for (int i = q->unit.deg - unit->deg; i < 0; i++) value /= DEG_RADIAN;
    return value;
}
