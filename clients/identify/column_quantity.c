#include "clients/identify/table_reader.h"
#include "clients/cli/commands.h"
#include "clients/cli/command.h"
#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define GRAVITY 9.80665 // m/s^2, turns a mass into a weight; the same value as in core/scene/units.h

// ---- units of columns

// Units that core/scene/units.h does not know. A scene file needs only one spelling of each unit; measured files use
// many spellings.
static const struct also {
    const char *text, *si;
    double times, over;
} also[] = {{"-", "1", 1, 1},           {"percent", "1", 1, 100}, {"pct", "1", 1, 100},    {"sec", "s", 1, 1},
            {"seconds", "s", 1, 1},     {"second", "s", 1, 1},    {"min", "s", 60, 1},     {"minutes", "s", 60, 1},
            {"rad/sec", "rad/s", 1, 1}, {"1/sec", "1/s", 1, 1},   {"1/min", "1/s", 1, 60}, {"mrad", "rad", 1, 1e3},
            {"h", "s", 3600, 1},        {"hr", "s", 3600, 1},     {"hours", "s", 3600, 1}, {"kHz", "1/s", 1e3, 1},
            {"mHz", "1/s", 1, 1e3},     {"mPa", "Pa", 1, 1e3},    {"GPa", "Pa", 1e9, 1},   {"kN", "N", 1e3, 1},
            {"uN", "N", 1, 1e6},        {"bar", "Pa", 1e5, 1},    {"dyn", "N", 1, 1e5},    {"dyn/cm^2", "Pa", 1, 10},
            {"1/kPa", "1/Pa", 1, 1e3},  {"1/MPa", "1/Pa", 1, 1e6}};

typedef struct spelling {
    const char *as, *is;
} spelling;

// Spellings of unit signs in UTF-8 and, in the last rows, in Latin-1. The first spelling that matches the text is used.
static const spelling unit_spellings[] = {{"\xc2\xb5", "u"},
                                          {"\xce\xbc", "u"},
                                          {"\xc2\xb2", "^2"},
                                          {"\xc2\xb3", "^3"},
                                          {"\xe2\x81\xbb\xc2\xb9", "^-1"},
                                          {"\xe2\x81\xbb\xc2\xb2", "^-2"},
                                          {"\xc2\xb7", "*"},
                                          {"\xe2\x8b\x85", "*"},
                                          {"\xc2\xb0", "deg"},
                                          {"\xb5", "u"},
                                          {"\xb2", "^2"},
                                          {"\xb0", "deg"}};

static const spelling name_spellings[] = {{"\xcf\x89", "omega"},
                                          {"\xce\xb4", "delta"},
                                          {"\xce\xb3", "gamma"},
                                          {"\xce\xb5", "epsilon"},
                                          {"\xcf\x83", "sigma"},
                                          {"\xcf\x84", "tau"},
                                          {"\xe2\x80\xb2", "'"},
                                          {"\xe2\x80\xb3", "''"},
                                          {"\xe2\x80\x99", "'"},
                                          {"\xe2\x80\x9d", "''"},
                                          {"\"", "''"},
                                          {"_", " "},
                                          {"\t", " "},
                                          {":", " "},
                                          {"\xce\x94", "delta "},
                                          {"\xc3\xa4", "ae"},
                                          {"\xc3\xb6", "oe"},
                                          {"\xc3\xbc", "ue"},
                                          {"\xc3\x96", "oe"},
                                          {"\xe4", "ae"},
                                          {"\xf6", "oe"},
                                          {"\xfc", "ue"},
                                          {"\xd6", "oe"}};

// Copy a text and replace the spellings that are in the list. Stop before `to` overflows.
static void respell(char *to, size_t size, const char *text, const spelling *list, size_t count)
{
    size_t n = 0;
    while (*text && n + 8 < size) {
        size_t i = 0;
        while (i < count && strncmp(text, list[i].as, strlen(list[i].as)) != 0) i++;
        if (i < count) {
            text += strlen(list[i].as);
            n += (size_t)sprintf(to + n, "%s", list[i].is);
        } else {
            to[n++] = *text++;
        }
    }
    to[n] = '\0';
}

// Parse a unit with core/scene/units.h. A negative power of ten becomes the divisor `over`, since a factor like 0.001
// is not exact in floating point.
static bool measure_of(kn_column_unit *m, const char *text, char *error, size_t error_size)
{
    kn_unit unit;
    if (!kn_unit_parse(&unit, text, error, error_size)) return false;
    *m = (kn_column_unit){.dimension = {.m = unit.m, .kg = unit.kg, .s = unit.s, .rad = unit.rad}, .over = 1};
    // powers of ten are exact in double precision up to 1e22
    for (; unit.ten < 0 && m->over < 1e22; unit.ten++) m->over *= 10;
    kn_quantity one = {.digits = "1", .unit = unit};
    m->times = kn_quantity_in(&one, &m->dimension);
    return isfinite(m->times) && m->times > 0;
}

// Write a unit in the notation of core/scene/units.h: "Pa.s" becomes "Pa*s", and "cm2" becomes "cm^2".
static void tidy(char *to, size_t size, const char *text)
{
    char plain[KN_HEADING_NAME];
    size_t n = 0;
    respell(plain, sizeof plain, text, unit_spellings, sizeof unit_spellings / sizeof *unit_spellings);
    for (const char *p = plain; *p && n + 3 < size; p++) {
        const bool after_letter = p > plain && isalpha((unsigned char)p[-1]);
        if (*p == '.' && after_letter && isalpha((unsigned char)p[1])) to[n++] = '*';
        else {
            if (isdigit((unsigned char)*p) && after_letter) to[n++] = '^';
            to[n++] = *p;
        }
    }
    while (n > 0 && to[n - 1] == ' ') n--;
    to[n] = '\0';
}

bool kn_column_unit_parse(kn_column_unit *m, const char *text, char *error, size_t error_size)
{
    char clean[KN_HEADING_NAME], unsaid[100];
    tidy(clean, sizeof clean, text + strspn(text, " "));
    if (!error) error = unsaid, error_size = sizeof unsaid;
    for (size_t i = 0; i < sizeof also / sizeof *also; i++) {
        if (strcmp(clean, also[i].text) != 0) continue;
        measure_of(m, also[i].si, error, error_size);
        m->times = also[i].times;
        m->over = also[i].over;
        return true;
    }
    return measure_of(m, clean, error, error_size);
}

bool kn_column_unit_is(const kn_column_unit *m, const char *unit)
{
    kn_column_unit other;
    return measure_of(&other, unit, (char[100]){0}, 100) && kn_unit_same_dimension(&m->dimension, &other.dimension);
}

double kn_column_unit_si(const kn_column_unit *m, double number) { return number * m->times / m->over; }

// ---- headings of columns: name and unit

void kn_text_clean(char *text)
{
    for (char *p = text; *p; p++)
        if ((unsigned char)*p < ' ' || *p == 0x7f) *p = '?';
}

// Copy a text without blanks at either end. Control characters become '?'.
static void copy(char *to, size_t size, const char *text, size_t length)
{
    while (length > 0 && isspace((unsigned char)*text)) text++, length--;
    while (length > 0 && isspace((unsigned char)text[length - 1])) length--;
    snprintf(to, size, "%.*s", (int)length, text);
    kn_text_clean(to);
}

// Set the unit of the heading from a text. Return false if the text is no unit.
static bool take_unit(kn_heading *h, const char *text, size_t length)
{
    char unit[KN_HEADING_NAME];
    if (length >= sizeof unit) return false;
    copy(unit, sizeof unit, text, length);
    if (!kn_column_unit_parse(&h->unit, unit, NULL, 0)) return false;
    snprintf(h->unit_text, sizeof h->unit_text, "%s", unit);
    return h->has_unit = true;
}

// Read a heading like "name (unit)" or "name [unit]". The unit is the text in the last brackets that hold a unit:
// in "G(t) [Pa] (mean)" the unit is Pa.
static bool in_brackets(kn_heading *h, char *text)
{
    for (char *open = text + strlen(text); open-- > text;) {
        if (*open != '(' && *open != '[') continue;
        const char *close = strchr(open, *open == '(' ? ')' : ']');
        if (!close || !take_unit(h, open + 1, (size_t)(close - open - 1))) continue;
        memmove(open, close + 1, strlen(close + 1) + 1);
        size_t n = strlen(text);
        while (n > 0 && strchr(" /,", text[n - 1])) text[--n] = '\0';
        return true;
    }
    return false;
}

// Read a heading like "name / unit" or "name, unit".
static bool after_mark(kn_heading *h, char *text, char mark)
{
    for (char *at = strchr(text, mark); at; at = strchr(at + 1, mark)) {
        if (at == text || isdigit((unsigned char)at[-1]) || !take_unit(h, at + 1, strlen(at + 1))) continue;
        *at = '\0';
        return true;
    }
    return false;
}

// Read a suffix like _pa, _rad_s or _per_pa as the unit Pa, rad/s or 1/Pa. Small letters may stand for capitals.
static bool take_suffix(kn_heading *h, const char *suffix, size_t length)
{
    static const spelling small[] = {{"pa", "Pa"}, {"kpa", "kPa"}, {"mpa", "MPa"}, {"gpa", "GPa"},
                                     {"n", "N"},   {"mn", "mN"},   {"hz", "Hz"},   {"khz", "kHz"}};
    char unit[KN_HEADING_NAME] = "", part[KN_HEADING_NAME];
    if (length >= 24) return false;
    for (size_t at = 0; at <= length;) {
        size_t n = at;
        while (n < length && suffix[n] != '_') n++;
        copy(part, sizeof part, suffix + at, n - at);
        for (size_t i = 0; i < sizeof small / sizeof *small; i++)
            if (!strcmp(part, small[i].as)) snprintf(part, sizeof part, "%s", small[i].is);
        const bool per = !strcmp(part, "per");
        snprintf(unit + strlen(unit), sizeof unit - strlen(unit), "%s%.20s",
                 at && !per && *unit && !strstr(unit, "1/") ? "/" : "", per ? *unit ? "" : "1/" : part);
        at = n + 1;
    }
    return take_unit(h, unit, strlen(unit));
}

// Take the longest text after an underscore that is a unit. Blanks also separate words, and the words are tried from
// left to right: "omega_rad_s" gives rad/s, and "displacement_mm 10 gf" gives mm.
static bool after_underscore(kn_heading *h, char *text)
{
    for (char *word = text; *word; word += strspn(word, " ")) {
        size_t length = strcspn(word, " ");
        for (char *at = word + 1; length > 0 && at < word + length; at++) {
            if (*at != '_' || at[1 + strspn(at + 1, "0123456789")] == '\0' || // "strain_1" is the first of several
                !take_suffix(h, at + 1, (size_t)(word + length - at - 1)))
                continue;
            memmove(at, word + length, strlen(word + length) + 1);
            return true;
        }
        word += length;
    }
    return false;
}

// Read a heading like "name in unit" or "% name".
static bool around_name(kn_heading *h, char *text)
{
    char *in = strstr(text, " in ");
    const size_t length = *text == '%' ? 1 : !strncmp(text, "percent ", 8) ? 7 : 0;
    if (in && take_unit(h, in + 4, strlen(in + 4))) return *in = '\0', true;
    if (!length || !text[length] || !take_unit(h, text, length)) return false;
    memmove(text, text + length, strlen(text + length) + 1);
    return true;
}

// A factor in the name, such as "Stress (x10^3)", belongs to a unit that is not known.
static void take_factor(kn_heading *h, char *text)
{
    static const char *const signs[] = {"x10", "x 10", "\303\22710", "\303\227 10", "*10"};
    char *at = NULL, unit[KN_HEADING_NAME];
    for (int i = 0; i < 5 && !at; i++) at = strstr(text, signs[i]);
    if (!at || at == text || !strchr(" ([", at[-1])) return;
    at -= at[-1] != ' ';
    snprintf(unit, sizeof unit, "%.30s %.40s", at, h->unit_text);
    copy(h->unit_text, sizeof h->unit_text, unit, strlen(unit));
    h->has_unit = false;
    *at = '\0';
}

// Read the last word as the unit, as in "Strain %". A last word that follows a number is not the unit of the column:
// "displacement 10 gf" names a load.
static bool last_word(kn_heading *h, char *text)
{
    char *at = strrchr(text, ' ');
    if (!at || at == text || isdigit((unsigned char)at[1]) || !strcmp(at + 1, "-")) return false;
    char *before = at;
    while (before > text && before[-1] != ' ') before--;
    if (isdigit((unsigned char)*before) || !take_unit(h, at + 1, strlen(at + 1))) return false;
    *at = '\0';
    return true;
}

// Write a name in the form in which names are compared: small letters, single blanks, Greek letters spelt out.
static void simplify(char word[KN_HEADING_NAME], const char *name)
{
    char spelt[KN_HEADING_NAME];
    size_t n = 0;
    respell(spelt, sizeof spelt, name, name_spellings, sizeof name_spellings / sizeof *name_spellings);
    for (const char *p = spelt; *p; p++) {
        if (*p == ' ' && (n == 0 || word[n - 1] == ' ')) continue;
        if (*p == '.' && !isdigit((unsigned char)p[1])) continue;
        word[n++] = (char)tolower((unsigned char)*p);
    }
    while (n > 0 && word[n - 1] == ' ') n--;
    word[n] = '\0';
}

// Take text in square brackets at the end of the heading as its unit, even if this unit is unknown.
static void unknown_unit(kn_heading *h, char *text)
{
    const size_t n = strlen(text);
    char *open = strrchr(text, '[');
    if (!open || open == text || text[n - 1] != ']' || open + 2 == text + n) return;
    copy(h->unit_text, sizeof h->unit_text, open + 1, (size_t)(text + n - 2 - open));
    *open = '\0';
}

void kn_heading_read(kn_heading *h, const char *text)
{
    char left[KN_HEADING_NAME];
    memset(h, 0, sizeof *h);
    copy(left, sizeof left, text, strlen(text));
    // Try the notations of a unit one after the other, the most explicit one first.
    const bool known = in_brackets(h, left) || around_name(h, left) || after_mark(h, left, '/') ||
                       after_mark(h, left, ',') || after_underscore(h, left) || last_word(h, left);
    if (!known) unknown_unit(h, left);
    take_factor(h, left);
    copy(h->name, sizeof h->name, left, strlen(left));
    simplify(h->word, h->name);
}

bool kn_heading_quantity(const char *text, const char *unit, double *value, char *error, size_t error_size)
{
    char number[48], *end;
    kn_column_unit m;
    text += strspn(text, " ");
    size_t n = strspn(text, "+-0123456789.,eE");
    // an e or E at the end of the digits is the first letter of the unit, not an exponent
    while (n > 0 && (text[n - 1] == 'e' || text[n - 1] == 'E')) n--;
    snprintf(number, sizeof number, "%.*s", (int)n, text);
    if (strchr(number, ',') && !strchr(number, '.')) *strchr(number, ',') = '.';
    *value = strtod(number, &end);
    const bool bare = !text[n + strspn(text + n, " ")];
    if (n == 0 || n >= sizeof number || *end || !isfinite(*value))
        return snprintf(error, error_size, "'%.24s' is no quantity, expected a number with a unit, like 1 %s", text,
                        unit),
               false;
    if (bare && strcmp(unit, "1") != 0)
        return snprintf(error, error_size, "'%.24s' has no unit, expected e.g. %.20s %s", text, number, unit), false;
    if (bare) return true;
    if (!kn_column_unit_parse(&m, text + n, error, error_size)) return false;
    if (!strcmp(unit, "N") && kn_column_unit_is(&m, "kg")) *value *= GRAVITY;
    else if (!kn_column_unit_is(&m, unit))
        return snprintf(error, error_size, "'%.24s' is not in units of %s", text, unit), false;
    *value = kn_column_unit_si(&m, *value);
    return true;
}

// ---- the quantity of a column

// Each row: the name of a quantity, its SI unit, and the names that a column of this quantity may have, in small
// letters, in English and German, preferred names first. A column name with a blank in front, such as " time", also
// matches the first or last words of a longer name, such as "test time".
enum { NAME, UNIT, COLUMNS };
static const char *const quantities[][24] = {
    [KN_TIME] = {"time", "s", "total time", "test time", "time (sequence)", "elapsed time", "run time", "time", "t",
                 "zeit", "pruefzeit", "step time", "interval time", " time", " zeit"},
    [KN_HEIGHT] = {"height", "m", "height", "h", "gap", "thickness", "l", "hoehe", "spalt", "dicke", "messspalt",
                   " height", " gap", " thickness", " hoehe"},
    [KN_DISPLACEMENT] = {"displacement", "m",          "displacement",  "disp",
                         "deformation",  "deflection", "compression",   "indentation",
                         "depth",        "stroke",     "extension",     "distance",
                         "travel",       "d",          "weg",           "standardweg",
                         "traversenweg", "verformung", "eindringtiefe", " displacement",
                         " deformation", " distance",  " extension"},
    [KN_STRAIN] = {"strain", "1", "strain", "shear strain", "gamma", "epsilon", "dehnung", "stauchung", "scherung",
                   "scherdeformation", "scherdehnung", "compressive strain (displacement)", "deformation",
                   "compression", "verformung", " strain", " dehnung"},
    [KN_COMPLIANCE] = {"compliance", "1/Pa", "compliance", "creep compliance", "j", "j(t)", "d(t)", "nachgiebigkeit",
                       "kriechnachgiebigkeit", " compliance", " nachgiebigkeit"},
    [KN_LOAD] = {"load", "N", "load", "force", "weight", "f", "w", "kraft", "standardkraft", "pruefkraft", " load",
                 " force", " kraft"},
    [KN_STRESS] = {"stress", "Pa", "stress", "shear stress", "compressive stress", "sigma", "tau", "pressure", "p",
                   "spannung", "schubspannung", "scherspannung", "druckspannung", " stress", " spannung"},
    [KN_MODULUS] = {"modulus",
                    "Pa",
                    "modulus",
                    "relaxation modulus",
                    "g(t)",
                    "e(t)",
                    "g",
                    "e",
                    "complex modulus",
                    "shear modulus",
                    "|g*|",
                    "|e*|",
                    "g*",
                    "e*",
                    "dynamic modulus",
                    "relaxationsmodul",
                    "schubmodul",
                    "komplexer schubmodul",
                    "complex shear modulus",
                    " relaxation modulus"},
    [KN_FREQUENCY] = {"frequency", "1/s", "frequency", "freq", "f", "omega", "w", "frequenz", "kreisfrequenz",
                      "winkelfrequenz", " frequency", " kreisfrequenz"},
    [KN_STORAGE] = {"storage modulus", "Pa", "g'", "e'", "storage modulus", "storage", "gp", "elastic modulus",
                    "shear modulus (elastic component)", "speichermodul", " storage modulus"},
    [KN_LOSS] = {"loss modulus", "Pa", "g''", "e''", "loss modulus", "loss", "gpp", "viscous modulus",
                 "shear modulus (viscous component)", "verlustmodul", " loss modulus"},
    [KN_TANGENT] = {"tan delta", "1", "tan delta", "tan(delta)", "tandelta", "tan d", "loss tangent", "loss factor",
                    "damping factor", "tan(d)", "verlustfaktor", "daempfungsfaktor"},
    [KN_PHASE] = {"phase angle", "rad", "phase angle", "delta", "phase", "phase shift", "phase shift angle",
                  "phase lag", "phasenwinkel", "phasenverschiebung", "phasenverschiebungswinkel", " phase angle"}};
enum { QUANTITIES = sizeof quantities / sizeof *quantities };

const char *kn_column_quantity_name(kn_column_quantity q) { return quantities[q][NAME]; }

bool kn_heading_shear(const kn_heading *h)
{
    const char *push = strstr(h->word, "schub"); // but "Vorschub" is a feed
    return strstr(h->word, "shear") || strstr(h->word, "scher") || (push && (push == h->word || push[-1] == ' '));
}

bool kn_column_role(kn_heading *h, const char *role)
{
    const size_t length = strlen(role);
    for (int q = 0; q < QUANTITIES; q++) {
        const char *name = quantities[q][NAME];
        if (!length || strncmp(name, role, length) != 0 || (name[length] && name[length] != ' ')) continue;
        h->role = q + 1;
        return true;
    }
    return false;
}

// Return whether the unit in the heading suits the quantity. A load may also be in grams or kilograms, which mean gf
// and kgf. A frequency may be in rad/s, and a phase angle may be a plain number.
static bool fits(const kn_heading *h, kn_column_quantity q)
{
    if (kn_column_unit_is(&h->unit, quantities[q][UNIT])) return true;
    if (q == KN_LOAD) return kn_column_unit_is(&h->unit, "kg");
    if (q == KN_PHASE) return kn_column_unit_is(&h->unit, "1");
    return q == KN_FREQUENCY && kn_column_unit_is(&h->unit, "rad/s");
}

// Convert the unit in the heading from grams-force to newtons, and from rad/s to Hz. A second call changes nothing.
static void convert(kn_heading *h, kn_column_quantity q)
{
    const bool angular = kn_column_unit_is(&h->unit, "rad/s") || strstr(h->word, "ang") || strstr(h->word, "omega") ||
                         strstr(h->word, "kreis") || strstr(h->word, "winkel") || !strcmp(h->word, "w");
    if (q == KN_LOAD && kn_column_unit_is(&h->unit, "kg")) {
        h->unit.times *= GRAVITY;
        kn_column_unit newton;
        if (kn_column_unit_parse(&newton, "N", NULL, 0)) h->unit.dimension = newton.dimension;
    } else if (q == KN_FREQUENCY && angular && strcmp(h->unit_text, "Hz") != 0) {
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

// Return whether the column has this name. A name with a blank in front also matches the first or last words of a
// longer column name. But it does not match a rate, as a "strain rate" is not a strain, nor a computed time, such as
// the "relaxation time" of a sweep.
static bool is_called(const kn_heading *h, const char *name)
{
    if (*name != ' ') return !strcmp(h->word, name);
    if (!strcmp(h->word, name + 1)) return true;
    const char *rest = h->word + strlen(name + 1);
    return !strstr(h->word, " rate") && !strstr(h->word, "relaxation time") && !strstr(h->word, "retardation time") &&
           (ends_with(h->word, name) || (!strncmp(h->word, name + 1, strlen(name + 1)) && *rest == ' '));
}

// Return whether the unit in the heading suits the quantity, or is absent where none is needed: by tan delta, and by a
// strain whose name cannot be that of a displacement.
static bool is_it(const kn_heading *h, kn_column_quantity q)
{
    if (h->has_unit || *h->unit_text) return h->has_unit && fits(h, q);
    for (const char *const *n = quantities[KN_DISPLACEMENT] + COLUMNS; q == KN_STRAIN && *n && !h->role; n++)
        if (!strcmp(h->word, *n)) return false;
    return q == KN_STRAIN || q == KN_TANGENT;
}

// Return the first column from `column` on that has the name and a suitable unit, or -1. *other: the first one without
// a suitable unit, if this can be no other quantity.
static int named(const kn_table_reader *s, kn_column_quantity q, const char *name, int column, int *other)
{
    for (int c = column; c < s->columns; c++) {
        const kn_heading *h = &s->column[c].heading;
        if (h->role ? h->role != (int)q + 1 : !is_called(h, name)) continue;
        if (is_it(h, q)) return c;
        const bool its_own = h->role || !strcmp(name, quantities[q][NAME]);
        const bool bare = !h->has_unit && !*h->unit_text;
        if (*other < 0 && (*name != ' ' ? its_own || !h->has_unit : bare)) *other = c;
    }
    return -1;
}

int kn_column_find(kn_table_reader *s, kn_column_quantity q, int *code)
{
    const char *its_name = quantities[q][NAME], *its_unit = quantities[q][UNIT];
    int other = -1, ignored = 0;
    for (const char *const *n = quantities[q] + COLUMNS; *n; n++) {
        const int column = named(s, q, *n, 0, &other), again = named(s, q, *n, column + 1, &ignored);
        if (column < 0) continue;
        convert(&s->column[column].heading, q);
        if (!code || again < 0 || q == KN_TIME) return column;
        const char *first = s->column[column].heading.name, *second = s->column[again].heading.name;
        const bool alike = !strcmp(first, second); // then --column cannot name one of them
        *code = kn_table_reader_complain(
            s, s->header_line, s->column[again].at, "a second column of %s, '%s'%s%s%s%s%s", its_name, second,
            alike ? ", expected one: remove the other" : " besides '", alike ? "" : first,
            alike ? "" : "': --column 'NAME=", alike ? "" : its_name, alike ? "" : "' says which");
        return -1;
    }
    if (other < 0 || !code) return -1;
    // No column has a suitable unit. Report what is wrong with the unit of the column that has the name.
    const kn_heading *h = &s->column[other].heading;
    const int at = s->column[other].at;
    if (!h->has_unit && *h->unit_text)
        *code = kn_table_reader_complain(s, s->header_line, at,
                                         "%s: the unit '%s' is unknown, expected a unit of %s, e.g. %s", h->name,
                                         h->unit_text, its_name, its_unit);
    else if (h->has_unit)
        *code = kn_table_reader_complain(s, s->header_line, at, "%s in '%s', expected a %s, e.g. in %s", h->name,
                                         h->unit_text, its_name, its_unit);
    else
        *code = kn_table_reader_complain(s, s->header_line, at,
                                         "%s has no unit, expected one, e.g. '%s [%s]', or --units '%s=%s'", h->name,
                                         h->name, its_unit, h->word, its_unit);
    return -1;
}

int kn_column_find_first(kn_table_reader *s, int count, const kn_column_quantity *wanted, kn_column_quantity *q,
                         int *code)
{
    for (int i = 0; i < count; i++)
        if (kn_column_find(s, *q = wanted[i], NULL) >= 0) return kn_column_find(s, *q, code);
    for (int i = 0; i < count && *code == KN_EXIT_OK; i++) kn_column_find(s, wanted[i], code);
    return -1;
}

int kn_column_find_clocks(kn_table_reader *s, int most, int column[], int *code)
{
    int count = 0;
    const int first = kn_column_find(s, KN_TIME, code);
    if (first >= 0) column[count++] = first;
    for (int c = 0; c < s->columns && count > 0 && count < most; c++) {
        const kn_heading *h = &s->column[c].heading;
        bool clock = h->role == KN_TIME + 1;
        for (const char *const *n = quantities[KN_TIME] + COLUMNS; *n && !h->role; n++) clock |= is_called(h, *n);
        if (clock && c != first && is_it(h, KN_TIME) && !s->column[first].heading.role) column[count++] = c;
    }
    return count;
}

void kn_column_unknown(const kn_table_reader *s, char *text, size_t size)
{
    size_t n = 0;
    *text = '\0';
    for (int c = 0; c < s->columns && n < size; c++) {
        const kn_heading *h = &s->column[c].heading;
        bool known = h->role || !*h->name;
        for (int q = 0; q < QUANTITIES; q++)
            for (const char *const *name = quantities[q] + COLUMNS; *name; name++) known |= is_called(h, *name);
        if (!known) n += (size_t)snprintf(text + n, size - n, "%s'%.40s'", n ? ", " : "", h->name);
    }
}

// Find a load in the name of a column, such as "10 gf", "0.1N" or "W = 10 gf".
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

int kn_column_find_loads(const kn_table_reader *s, int most, int column[], double load_n[])
{
    int count = 0;
    for (int c = 0; c < s->columns && count < most; c++) {
        const kn_heading *h = &s->column[c].heading;
        if (!load_in(h->name, &load_n[count])) continue;
        if (h->has_unit ? !kn_column_unit_is(&h->unit, "m") && !kn_column_unit_is(&h->unit, "1")
                        : *h->unit_text != '\0')
            continue;
        column[count++] = c;
    }
    return count;
}
