#include "clients/identify/roles.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

// The names of each quantity in small letters (heading.h), preferred names first. A name that begins with a blank, "
// time", also matches as part of a longer name, "test time".
static const char *const names[KN_ROLE_COUNT][14] = {
    [KN_TIME] = {"total time", "test time", "time (sequence)", "elapsed time", "run time", "time", "t", "zeit",
                 // the time of the whole test is preferred to the time within a step or interval
                 "step time", "interval time", " time"},
    [KN_HEIGHT] = {"height", "h", "gap", "thickness", "sample height", "l", " height", " gap", " thickness"},
    [KN_DISPLACEMENT] = {"displacement", "disp", "deformation", "deflection", "compression", "indentation", "stroke",
                         "extension", "distance", "travel", "d", " displacement", " deformation", " distance"},
    [KN_STRAIN] = {"strain", "compressive strain", "engineering strain", "shear strain", "gamma", "epsilon",
                   "deformation", "compression", "x", " strain"},
    [KN_COMPLIANCE] = {"compliance", "creep compliance", "j", "j(t)", "d(t)", " compliance"},
    [KN_LOAD] = {"load", "force", "weight", "f", "w", "compressive force", "kraft", " load", " force"},
    [KN_STRESS] = {"stress", "shear stress", "compressive stress", "sigma", "tau", "pressure", "p", " stress"},
    [KN_MODULUS] = {"modulus", "relaxation modulus", "g(t)", "e(t)", "g", "e", "complex modulus", "shear modulus",
                    "|g*|", "|e*|", "g*", "e*", "dynamic modulus", " relaxation modulus"},
    [KN_FREQUENCY] = {"frequency", "freq", "f", "angular frequency", "omega", "w", "ang. frequency", " frequency"},
    [KN_STORAGE] = {"g'", "e'", "storage modulus", "storage", "gp", "elastic modulus", "shear storage modulus",
                    " storage modulus"},
    [KN_LOSS] = {"g''", "e''", "loss modulus", "loss", "gpp", "viscous modulus", "shear loss modulus",
                 "shear modulus (viscous component)", " loss modulus"},
    [KN_TANGENT] = {"tan delta", "tan(delta)", "tandelta", "tan d", "loss tangent", "loss factor", "damping factor",
                    "tan(d)"},
    [KN_PHASE] = {"phase angle", "delta", "phase", "phase shift", "phase shift angle", "phase lag", " phase angle"}};

static const struct kind {
    const char *name, *unit;
} kinds[KN_ROLE_COUNT] = {
#define X(role, name, unit) {name, unit},
    KN_ROLES(X)
#undef X
};

const char *kn_role_name(kn_role role) { return kinds[role].name; }

// Return whether the unit fits the role. A load may be in grams or kilograms, which mean gf and kgf. A frequency may be
// in rad/s.
static bool fits(const kn_heading *h, kn_role role)
{
    if (kn_measure_is(&h->unit, kinds[role].unit)) return true;
    if (role == KN_LOAD) return kn_measure_is(&h->unit, "kg");
    if (role == KN_PHASE) return kn_measure_is(&h->unit, "1");
    return role == KN_FREQUENCY && kn_measure_is(&h->unit, "rad/s");
}

// Convert grams-force to newtons and rad/s to Hz in the heading. A second call changes nothing.
static void convert(kn_heading *h, kn_role role)
{
    const bool angular =
        kn_measure_is(&h->unit, "rad/s") || strstr(h->word, "ang") || strstr(h->word, "omega") || !strcmp(h->word, "w");
    if (role == KN_LOAD && kn_measure_is(&h->unit, "kg")) {
        h->unit.times *= 9.80665;
        kn_measure newton;
        if (kn_measure_parse(&newton, "N", NULL, 0)) h->unit.dimension = newton.dimension;
    } else if (role == KN_FREQUENCY && angular && strcmp(h->unit_text, "Hz") != 0) {
        h->unit.over *= 2 * M_PI;
        h->unit.dimension.rad = 0;
        snprintf(h->unit_text, sizeof h->unit_text, "Hz");
    }
}

static bool ends_with(const char *text, const char *end)
{
    const size_t n = strlen(text), m = strlen(end);
    return n > m && !strcmp(text + n - m, end);
}

// Return whether the column has this name, or contains it if the name begins with a blank. A strain rate is not a
// strain.
static bool is_called(const kn_heading *h, const char *name)
{
    if (*name != ' ') return !strcmp(h->word, name);
    if (!strcmp(h->word, name + 1)) return true;
    const char *rest = h->word + strlen(name + 1);
    return !ends_with(h->word, " rate") &&
           (ends_with(h->word, name) || (!strncmp(h->word, name + 1, strlen(name + 1)) && *rest == ' '));
}

// Quantities that need no unit.
static const bool may_be_bare[KN_ROLE_COUNT] = {[KN_STRAIN] = true, [KN_TANGENT] = true};

static bool is_it(const kn_heading *h, kn_role role)
{
    return h->has_unit ? fits(h, role) : may_be_bare[role] && !*h->unit_text;
}

// Return whether the quantity in the column is certain: the column has a unit, or its name is the quantity's own word
// or letter. A column named x without a unit may hold anything.
static bool is_sure(const kn_heading *h, kn_role role)
{
    const bool letter = role == KN_STRAIN && (!strcmp(h->word, "gamma") || !strcmp(h->word, "epsilon"));
    return h->has_unit || letter || strstr(h->word, kinds[role].name);
}

// Return a second column with exactly the same name and dimension as `column`, or -1. An uncertain second column does
// not count if `column` is certain. If there are two columns, the intended one is unknown.
static int twin(const kn_sheet *s, kn_role role, const char *name, int column)
{
    const bool sure = is_sure(&s->column[column].heading, role);
    for (int c = column + 1; *name != ' ' && c < s->columns; c++) {
        const kn_heading *h = &s->column[c].heading;
        if (is_called(h, name) && is_it(h, role) && (is_sure(h, role) || !sure)) return c;
    }
    return -1;
}

bool kn_role_is_sure(const kn_sheet *s, kn_role role, int column) { return is_sure(&s->column[column].heading, role); }

int kn_role_find(kn_sheet *s, kn_role role, int *code)
{
    int other = -1; // a column that has the name of the quantity, but a wrong unit or no unit
    bool sure = false;
    // If the quantity is certain in any column, uncertain columns are ignored.
    for (int c = 0; c < s->columns; c++)
        for (int n = 0; n < 14 && names[role][n]; n++) {
            const kn_heading *h = &s->column[c].heading;
            sure |= is_called(h, names[role][n]) && is_it(h, role) && is_sure(h, role);
        }
    // Preferred names come first. The first match of name and unit is taken, unless it has a twin.
    for (int n = 0; n < 14 && names[role][n]; n++)
        for (int c = 0; c < s->columns; c++) {
            kn_heading *h = &s->column[c].heading;
            if (!is_called(h, names[role][n]) || (sure && is_it(h, role) && !is_sure(h, role))) continue;
            if (is_it(h, role)) {
                const int again = twin(s, role, names[role][n], c);
                if (again >= 0 && code)
                    *code = kn_sheet_complain(s, s->header_line, s->column[again].at,
                                              "a second column of %s, '%s', expected one: remove the other",
                                              kinds[role].name, s->column[again].heading.name);
                if (again >= 0 && code) return -1;
                convert(h, role);
                return c;
            }
            // a name other than the own word of the quantity may mean something else
            const bool its_own = !strcmp(names[role][n], kinds[role].name);
            if (other < 0 && *names[role][n] != ' ' && (its_own || !h->has_unit)) other = c;
        }
    // No column fits. Say what is wrong with the unit of the column that has the name.
    if (other < 0 || !code) return -1;
    const kn_heading *h = &s->column[other].heading;
    if (!h->has_unit && *h->unit_text)
        *code = kn_sheet_complain(s, s->header_line, s->column[other].at,
                                  "%s: the unit '%s' is unknown, expected one of %s, e.g. %s", h->name, h->unit_text,
                                  kinds[role].name, kinds[role].unit);
    else if (h->has_unit)
        *code = kn_sheet_complain(s, s->header_line, s->column[other].at, "%s in '%s', expected a %s, e.g. in %s",
                                  h->name, h->unit_text, kinds[role].name, kinds[role].unit);
    else
        *code = kn_sheet_complain(s, s->header_line, s->column[other].at,
                                  "%s has no unit, expected one, e.g. '%s [%s]', or --units '%s=%s'", h->name, h->name,
                                  kinds[role].unit, h->word, kinds[role].unit);
    return -1;
}

int kn_role_find_first(kn_sheet *s, int count, const kn_role *roles, kn_role *role, int *code)
{
    int bare = -1;
    kn_role bare_is = *roles;
    for (int i = 0; i < count; i++) {
        // the column that is not sure is kept as a fallback
        if (bare >= 0 && kn_role_find(s, roles[i], NULL) < 0) continue;
        const int column = kn_role_find(s, *role = roles[i], code);
        if (*code != KN_EXIT_OK) return -1;
        if (column >= 0 && kn_role_is_sure(s, *role, column)) return column;
        if (column >= 0) bare = column, bare_is = *role;
    }
    *role = bare_is;
    return bare;
}

// Find a load within a name: "10 gf", "0.1N", "W = 10 gf".
static bool load_in(const char *name, double *load_n)
{
    char error[100], text[KN_HEADING_NAME];
    for (const char *at = name; (at = strpbrk(at, "0123456789")); at += strspn(at, "0123456789.,")) {
        const size_t number = strspn(at, "0123456789.,"), blanks = strspn(at + number, " ");
        size_t end = number + blanks;
        while (isalpha((unsigned char)at[end])) end++;
        snprintf(text, sizeof text, "%.*s", (int)end, at);
        if (kn_heading_quantity(text, "N", load_n, error, sizeof error) && *load_n > 0) return true;
    }
    return false;
}

int kn_role_find_loads(const kn_sheet *s, int most, int column[], double load_n[])
{
    int count = 0;
    for (int c = 0; c < s->columns && count < most; c++) {
        const kn_heading *h = &s->column[c].heading;
        if (!load_in(h->name, &load_n[count])) continue;
        if (h->has_unit ? !kn_measure_is(&h->unit, "m") && !kn_measure_is(&h->unit, "1") : *h->unit_text != '\0')
            continue;
        column[count++] = c;
    }
    return count;
}
