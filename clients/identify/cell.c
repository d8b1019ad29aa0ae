#include "clients/identify/cell.h"
#include <ctype.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

bool kn_cell_next(char separator, const char **at, kn_cell *c)
{
    if (!*at) return false;
    const char *p = *at + strspn(*at, separator == '\t' ? " " : " \t"), *end;
    c->quoted = *p == '"';
    c->text = p + c->quoted;
    // A quoted cell ends at the quote before the next separator. A quote inside the cell may be doubled, or may be the
    // inch sign.
    if (c->quoted) {
        for (end = c->text; *end; end++)
            if (*end == '"' && end[1] == '"') end++;
            else if (*end == '"' && (!end[1] || end[1] == separator || isspace((unsigned char)end[1]))) break;
        c->length = (int)(end - c->text);
        p = *end ? end + 1 : end;
        while (*p && *p != separator) p++;
    } else {
        while (*p && *p != separator && !(separator == ' ' && *p == '\t')) p++;
        c->length = (int)(p - c->text);
    }
    // Strip blanks at the end and step over the separator. Only a separator other than a blank leaves an empty cell
    // behind.
    while (c->length > 0 && isspace((unsigned char)c->text[c->length - 1])) c->length--;
    if (separator == ' ') p += strspn(p, " \t");
    else if (*p) p++;
    else p = NULL;
    *at = p && (separator != ' ' || *p) ? p : NULL;
    return true;
}

// Read a plain decimal number faster than strtod. Up to 15 digits are divided by a power of ten up to 1e15. Both
// numbers are exact in double precision, so the division rounds correctly. Return false for all other numbers; the
// caller then uses strtod.
static bool quick_number(const char *p, const char *end, char point, double *value)
{
    static const double ten[] = {1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15};
    const bool minus = *p == '-';
    uint64_t digits = 0;
    int count = 0, after = -1;
    for (p += *p == '-' || *p == '+'; p < end; p++) {
        if (isdigit((unsigned char)*p)) {
            digits = 10 * digits + (uint64_t)(*p - '0');
            count++;
            after += after >= 0;
        } else if (*p == point && after < 0) {
            after = 0;
        } else {
            return false;
        }
        if (count > 15) return false;
    }
    if (count == 0) return false;
    *value = (double)digits / ten[after > 0 ? after : 0];
    if (minus) *value = -*value;
    return true;
}

kn_cell_content kn_cell_read(const kn_cell *c, char separator, double *value, bool *comma, bool *dot)
{
    static const char *const missing[] = {"-",    "--",  "---",  "nan",  "na",      "n/a",
                                          "#n/a", "#na", "null", "none", "#div/0!", "?"};
    char text[64];
    if (c->length == 0) return KN_CELL_MISSING;
    const bool may = separator != ',' || c->quoted;
    // Most cells are plain numbers with a decimal point, so try the fast conversion first.
    if (quick_number(c->text, c->text + c->length, '.', value)) {
        if (memchr(c->text, '.', (size_t)c->length)) *dot = true;
        return KN_CELL_NUMBER;
    }
    if (c->length >= (int)sizeof text) return KN_CELL_TEXT;
    snprintf(text, sizeof text, "%.*s", c->length, c->text);
    for (size_t i = 0; i < sizeof missing / sizeof *missing; i++)
        if (!strcasecmp(text, missing[i])) return KN_CELL_MISSING;
    // A cell with other characters than those of a number is text. A decimal comma is turned into a point for strtod.
    if (strspn(text, "+-0123456789.,eE") != (size_t)c->length || !strpbrk(text, "0123456789")) return KN_CELL_TEXT;
    char *mark = may && !strchr(text, '.') ? strchr(text, ',') : NULL, *end;
    if (mark) *mark = '.', *comma = true;
    else if (strchr(text, '.')) *dot = true;
    *value = strtod(text, &end);
    return *end == '\0' && isfinite(*value) ? KN_CELL_NUMBER : KN_CELL_TEXT;
}

void kn_cell_text(char *to, size_t size, const kn_cell *c)
{
    size_t n = 0;
    for (int i = 0; i < c->length && n + 1 < size; i++) {
        if (c->quoted && c->text[i] == '"' && i + 1 < c->length && c->text[i + 1] == '"') i++;
        to[n++] = (unsigned char)c->text[i] < ' ' || c->text[i] == 0x7f ? '?' : c->text[i];
    }
    to[n] = '\0';
}
