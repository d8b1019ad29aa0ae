#include "clients/identify/heading.h"
#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#define GRAVITY 9.80665 // m/s^2, turns a mass into a weight; the same value as in core/scene/units.h

// ---- units

// Units that core/scene/units.h lacks. A scene needs only one spelling of each unit, but measured files use many.
static const struct also {
    const char *text, *si;
    double times, over;
} also[] = {{"-", "1", 1, 1},          {"percent", "1", 1, 100}, {"pct", "1", 1, 100},    {"sec", "s", 1, 1},
            {"seconds", "s", 1, 1},    {"second", "s", 1, 1},    {"min", "s", 60, 1},     {"minutes", "s", 60, 1},
            {"h", "s", 3600, 1},       {"hr", "s", 3600, 1},     {"hours", "s", 3600, 1}, {"kHz", "1/s", 1e3, 1},
            {"mHz", "1/s", 1, 1e3},    {"mPa", "Pa", 1, 1e3},    {"GPa", "Pa", 1e9, 1},   {"kN", "N", 1e3, 1},
            {"uN", "N", 1, 1e6},       {"bar", "Pa", 1e5, 1},    {"dyn", "N", 1, 1e5},    {"dyn/cm^2", "Pa", 1, 10},
            {"1/kPa", "1/Pa", 1, 1e3}, {"1/MPa", "1/Pa", 1, 1e6}};

typedef struct spelling {
    const char *as, *is;
} spelling;

// A longer spelling must come before a shorter one that it begins with.
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

static const spelling name_spellings[] = {{"\xcf\x89", "omega"}, {"\xce\xb4", "delta"},
                                          {"\xce\xb3", "gamma"}, {"\xce\xb5", "epsilon"},
                                          {"\xcf\x83", "sigma"}, {"\xcf\x84", "tau"},
                                          {"\xe2\x80\xb2", "'"}, {"\xe2\x80\xb3", "''"},
                                          {"\xe2\x80\x99", "'"}, {"\xe2\x80\x9d", "''"},
                                          {"\"", "''"},          {"_", " "},
                                          {"\t", " "},           {":", " "},
                                          {"\xce\x94", "delta "}};

// Copy text with the listed spellings replaced, as far as there is room.
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

// Parse a unit with core/scene/units.h. A negative power of ten goes into `over`, which keeps the conversion exact.
static bool measure_of(kn_measure *m, const char *text, char *error, size_t error_size)
{
    kn_unit unit;
    if (!kn_unit_parse(&unit, text, error, error_size)) return false;
    *m = (kn_measure){.dimension = {.m = unit.m, .kg = unit.kg, .s = unit.s, .rad = unit.rad}, .over = 1};
    // powers of ten are exact in double precision up to 1e22
    for (; unit.ten < 0 && m->over < 1e22; unit.ten++) m->over *= 10;
    kn_quantity one = {.digits = "1", .unit = unit};
    m->times = kn_quantity_in(&one, &m->dimension);
    return isfinite(m->times) && m->times > 0;
}

// Normalise a unit: "Pa.s" becomes a product, "cm2" a power.
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

bool kn_measure_parse(kn_measure *m, const char *text, char *error, size_t error_size)
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

bool kn_measure_is(const kn_measure *m, const char *unit)
{
    kn_measure other;
    return measure_of(&other, unit, (char[100]){0}, 100) && kn_unit_same_dimension(&m->dimension, &other.dimension);
}

double kn_measure_si(const kn_measure *m, double number) { return number * m->times / m->over; }

// ---- headings

// Copy without blanks at either end.
static void copy(char *to, size_t size, const char *text, size_t length)
{
    while (length > 0 && isspace((unsigned char)*text)) text++, length--;
    while (length > 0 && isspace((unsigned char)text[length - 1])) length--;
    snprintf(to, size, "%.*s", (int)length, text);
    for (char *p = to; *p; p++)
        // replace control characters, since the text is shown on terminals
        if ((unsigned char)*p < ' ' || *p == 0x7f) *p = '?';
}

// Take the text as the unit of the heading, if it is one.
static bool take_unit(kn_heading *h, const char *text, size_t length)
{
    char unit[KN_HEADING_NAME];
    if (length >= sizeof unit) return false;
    copy(unit, sizeof unit, text, length);
    if (!kn_measure_parse(&h->unit, unit, NULL, 0)) return false;
    snprintf(h->unit_text, sizeof h->unit_text, "%s", unit);
    return h->has_unit = true;
}

// "name (unit)" or "name [unit]": take the last pair of brackets that holds a unit, as in "G(t) [Pa] (mean)".
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

// "name / unit" or "name, unit".
static bool after_mark(kn_heading *h, char *text, char mark)
{
    for (char *at = strchr(text, mark); at; at = strchr(at + 1, mark)) {
        if (at == text || isdigit((unsigned char)at[-1]) || !take_unit(h, at + 1, strlen(at + 1))) continue;
        *at = '\0';
        return true;
    }
    return false;
}

// Read a suffix like _pa, _rad_s or _per_pa as a unit. Small letters stand for capitals, and _ stands for characters
// that a name cannot hold.
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

// Take the longest suffix after an underscore that is a unit. The first word with such a suffix counts: "omega_rad_s",
// "displacement_mm 10 gf".
static bool after_underscore(kn_heading *h, char *text)
{
    for (char *word = text; *word; word += strspn(word, " ")) {
        size_t length = strcspn(word, " ");
        for (char *at = word + 1; length > 0 && at < word + length; at++) {
            if (*at != '_' || !take_suffix(h, at + 1, (size_t)(word + length - at - 1))) continue;
            memmove(at, word + length, strlen(word + length) + 1);
            return true;
        }
        word += length;
    }
    return false;
}

// Take the last word as the unit, as in "Strain %". A word after a number is not taken: "displacement 10 gf" names a
// load.
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

// Make the form of the name that is compared: small letters, single blanks, Greek letters spelt out.
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

// Text in square brackets at the end is meant as a unit, even if it is unknown: "displacement [furlong]".
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
    // Try the notations of a unit from the most to the least explicit.
    const bool known = in_brackets(h, left) || after_mark(h, left, '/') || after_mark(h, left, ',') ||
                       after_underscore(h, left) || last_word(h, left);
    if (!known) unknown_unit(h, left);
    copy(h->name, sizeof h->name, left, strlen(left));
    simplify(h->word, h->name);
}

bool kn_heading_quantity(const char *text, const char *unit, double *value, char *error, size_t error_size)
{
    char number[48], *end;
    kn_measure m;
    text += strspn(text, " ");
    size_t n = strspn(text, "+-0123456789.,eE");
    // an e or E at the end of the number is the first letter of the unit, not an exponent
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
    if (!kn_measure_parse(&m, text + n, error, error_size)) return false;
    if (!strcmp(unit, "N") && kn_measure_is(&m, "kg")) *value *= GRAVITY;
    else if (!kn_measure_is(&m, unit))
        return snprintf(error, error_size, "'%.24s' is not in units of %s", text, unit), false;
    *value = kn_measure_si(&m, *value);
    return true;
}
