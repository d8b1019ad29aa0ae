#include "clients/identify/sheet.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include <ctype.h>
#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

int kn_sheet_complain(const kn_sheet *s, int line, int at, const char *format, ...)
{
    char text[800];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    return kn_complain(s->subcommand, KN_EXIT_USAGE, "%s:%d:%d: %s", s->file, line, at, text);
}

void kn_sheet_close(kn_sheet *s)
{
    for (int c = 0; c < s->columns; c++) free(s->column[c].value);
    free(s->line);
    kn_lines_close(&s->lines);
    s->columns = s->rows = 0;
    s->line = NULL;
}

// ---- cells

typedef struct cell {
    const char *text; // of its line: without blanks and quotes around it
    int length;
    bool quoted;
} cell;

// The cell that begins at *at, which is moved to the next one; false at the line's end. *at NULL: no further one.
static bool next_cell(char separator, const char **at, cell *c)
{
    if (!*at) return false;
    const char *p = *at + strspn(*at, separator == '\t' ? " " : " \t"), *end;
    c->quoted = *p == '"';
    c->text = p + c->quoted;
    if (c->quoted) { // up to the quote before the next separator: within it one may be doubled, or the sign of inches
        for (end = c->text; *end; end++)
            if (*end == '"' && end[1] == '"')
                end++;
            else if (*end == '"' && (!end[1] || end[1] == separator || isspace((unsigned char)end[1])))
                break;
        c->length = (int)(end - c->text);
        p = *end ? end + 1 : end;
        while (*p && *p != separator) p++;
    } else {
        while (*p && *p != separator && !(separator == ' ' && *p == '\t')) p++;
        c->length = (int)(p - c->text);
    }
    while (c->length > 0 && isspace((unsigned char)c->text[c->length - 1])) c->length--;
    if (separator == ' ')
        p += strspn(p, " \t");
    else if (*p)
        p++;
    else
        p = NULL;
    *at = p && (separator != ' ' || *p) ? p : NULL;
    return true;
}

// 5e22 and 15 digits: what one multiplication or division of doubles gives rounded as it should be; the rest is
// strtod's.
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

typedef enum content { NUMBER, MISSING, TEXT } content;

static content read_cell(const cell *c, char separator, double *value, bool *comma, bool *dot)
{
    static const char *const missing[] = {"-",    "--",  "---",  "nan",  "na",      "n/a",
                                          "#n/a", "#na", "null", "none", "#div/0!", "?"};
    char text[64];
    if (c->length == 0) return MISSING;
    const bool may = separator != ',' || c->quoted;
    if (quick_number(c->text, c->text + c->length, '.', value)) {
        if (memchr(c->text, '.', (size_t)c->length)) *dot = true;
        return NUMBER;
    }
    if (c->length >= (int)sizeof text) return TEXT;
    snprintf(text, sizeof text, "%.*s", c->length, c->text);
    for (size_t i = 0; i < sizeof missing / sizeof *missing; i++)
        if (!strcasecmp(text, missing[i])) return MISSING;
    if (strspn(text, "+-0123456789.,eE") != (size_t)c->length || !strpbrk(text, "0123456789")) return TEXT;
    char *mark = may && !strchr(text, '.') ? strchr(text, ',') : NULL, *end;
    if (mark)
        *mark = '.', *comma = true;
    else if (strchr(text, '.'))
        *dot = true;
    *value = strtod(text, &end);
    return *end == '\0' && isfinite(*value) ? NUMBER : TEXT;
}

// ---- notes

// "# load: 50 gf", "# load = 50 gf": up to three words before the mark, so that a sentence with a colon is none.
static bool read_note(const char *text, int line, kn_sheet_note *note)
{
    const char *key = text + strspn(text, "# \t"), *mark = strpbrk(key, ":=");
    if (!mark || mark == key || mark - key >= (int)sizeof note->key) return false;
    const char *value = mark + 1 + strspn(mark + 1, " \t");
    *note = (kn_sheet_note){.line = line, .at = (int)(value - text) + 1};
    int n = 0, words = 1;
    for (const char *p = key; p < mark; p++) {
        note->key[n++] = (char)tolower((unsigned char)*p);
        words += *p == ' ' && p[1] != ' ' && p + 1 < mark;
    }
    while (n > 0 && isspace((unsigned char)note->key[n - 1])) n--;
    note->key[n] = '\0';
    size_t length = strcspn(value, ";\t"); // a spreadsheet fills its lines up with separators
    while (length > 0 && strchr(" ,", value[length - 1])) length--;
    snprintf(note->value, sizeof note->value, "%.*s", (int)length, value);
    return words <= 3 && *note->value;
}

static void take_note(kn_sheet *s)
{
    kn_sheet_note note;
    if (s->notes < KN_SHEET_NOTES && read_note(s->lines.text, s->lines.number, &note)) s->note[s->notes++] = note;
}

int kn_sheet_note_take(const kn_sheet *s, const char *key, const char *unit, double *value)
{
    char error[120];
    for (int i = 0; i < s->notes; i++) {
        if (strcmp(s->note[i].key, key) != 0) continue;
        if (!kn_heading_quantity(s->note[i].value, unit, value, error, sizeof error))
            return kn_sheet_complain(s, s->note[i].line, s->note[i].at, "%s: %s", key, error);
    }
    return KN_EXIT_OK;
}

// ---- where the table begins

static char separator_of(const char *line)
{
    return strchr(line, '\t') ? '\t' : strchr(line, ';') ? ';' : strchr(line, ',') ? ',' : ' ';
}

typedef struct census { // of a line
    int cells, numbers, missing;
} census;

static census count_cells(const char *line, char separator)
{
    census n = {0};
    cell c;
    double value;
    bool ignored;
    for (const char *at = line; next_cell(separator, &at, &c); n.cells++) {
        content is = read_cell(&c, separator, &value, &ignored, &ignored);
        n.numbers += is == NUMBER;
        n.missing += is == MISSING;
    }
    return n;
}

typedef struct search {
    int header, commented; // lines that may hold the names; 0: none yet
    char separator, commented_separator;
    int cells, commented_cells;
    int data; // the first line of numbers
} search;

// Whether the line is a row of numbers below such names: most of it are, and it has no more cells than they.
static bool is_row(const char *line, char separator, int cells)
{
    census n = count_cells(line, separator);
    return n.numbers > 0 && 2 * (n.numbers + n.missing) >= n.cells && n.cells - n.missing <= cells;
}

static void look_at(search *found, const kn_lines *l)
{
    const char *line = l->text + strspn(l->text, " \t");
    kn_sheet_note note;
    const bool comment = *line == '#';
    if (comment) line += strspn(line, "# \t");
    if (!*line || (comment && read_note(l->text, 0, &note))) return;
    const char separator = separator_of(line);
    const census n = count_cells(line, separator);
    if (!comment && ((found->header && is_row(line, found->separator, found->cells)) ||
                     (found->commented && is_row(line, found->commented_separator, found->commented_cells)))) {
        found->data = l->number;
        return;
    }
    if (n.numbers > 0 || n.cells - n.missing < 2) return;
    if (comment) {
        found->commented = l->number;
        found->commented_separator = separator;
        found->commented_cells = n.cells;
    } else {
        found->header = l->number;
        found->separator = separator;
        found->cells = n.cells;
    }
}

// Whether the line holds units alone, one for each name: s;mm;N
static bool is_units(const char *line, char separator)
{
    int units = 0, others = 0;
    cell c;
    for (const char *at = line; next_cell(separator, &at, &c);) {
        char text[KN_HEADING_NAME];
        kn_measure m;
        if (c.length == 0) continue;
        if (strchr("([", *c.text) && c.length > 2) c.text++, c.length -= 2;
        snprintf(text, sizeof text, "%.*s", c.length, c.text);
        if (kn_measure_parse(&m, text, NULL, 0))
            units++;
        else
            others++;
    }
    return units > 0 && units >= others;
}

static int no_table(const kn_sheet *s, const search *found)
{
    if (*s->lines.error) return kn_sheet_complain(s, s->lines.number ? s->lines.number : 1, 1, "%s", s->lines.error);
    if (found->header || found->commented)
        return kn_sheet_complain(s, found->header ? found->header : found->commented, 1,
                                 "names without numbers below them, expected rows of numbers");
    return kn_sheet_complain(s, 1, 1,
                             "no table, expected a line of names like time_s,height_mm and rows of numbers below it");
}

// The names are in the last line of words before the numbers, or in the one before that, if the last has units alone.
static int find_header(kn_sheet *s, int *names, int *units)
{
    search found = {0}, before = {0};
    while (!found.data && kn_lines_next(&s->lines)) {
        const search was = found;
        look_at(&found, &s->lines);
        if (found.header != was.header) before = was;
        if (found.header != was.header && is_units(s->lines.text, found.separator)) *units = found.header;
    }
    if (!found.data) return no_table(s, &found);
    *names = found.header ? found.header : found.commented;
    s->separator = found.header ? found.separator : found.commented_separator;
    if (*units == found.header && before.header > 0 && *units > 0) {
        *names = before.header;
        s->separator = before.separator;
    } else {
        *units = 0;
    }
    return KN_EXIT_OK;
}

// ---- names and units

static void unquote(char *to, size_t size, const cell *c)
{
    size_t n = 0;
    for (int i = 0; i < c->length && n + 1 < size; i++) {
        if (c->quoted && c->text[i] == '"' && i + 1 < c->length && c->text[i + 1] == '"') i++;
        to[n++] = c->text[i];
    }
    to[n] = '\0';
}

// Where blanks separate, "Time (s)" is one name.
static bool take_names(kn_sheet *s, const char *line)
{
    cell c;
    char text[KN_HEADING_NAME];
    const char *begin = line + strspn(line, " \t#");
    int index = 0;
    for (const char *at = begin; next_cell(s->separator, &at, &c); index++) {
        unquote(text, sizeof text, &c);
        kn_sheet_column *last = s->columns ? &s->column[s->columns - 1] : NULL;
        if (s->separator == ' ' && last && (*text == '(' || *text == '[')) {
            char whole[KN_HEADING_NAME];
            snprintf(whole, sizeof whole, "%.50s %.24s", last->heading.name, text);
            kn_heading_read(&last->heading, whole);
            index--;
            continue;
        }
        if (s->columns == KN_SHEET_COLUMNS) return false;
        s->column[s->columns] = (kn_sheet_column){.at = (int)(c.text - line) + 1, .index = index};
        kn_heading_read(&s->column[s->columns++].heading, text);
    }
    return true;
}

static void take_units(kn_sheet *s, const char *line)
{
    cell c;
    int index = 0;
    for (const char *at = line; index < s->columns && next_cell(s->separator, &at, &c); index++) {
        kn_heading *h = &s->column[index].heading;
        if (c.length == 0 || h->has_unit) continue;
        if (strchr("([", *c.text) && c.length > 2) c.text++, c.length -= 2;
        unquote(h->unit_text, sizeof h->unit_text, &c);
        h->has_unit = kn_measure_parse(&h->unit, h->unit_text, NULL, 0);
    }
}

// A name of --units means each column that has no unit and this word in its name.
static bool has_word(const char *name, const char *word)
{
    const size_t length = strlen(word);
    for (const char *at = name; (at = strstr(at, word)); at++)
        if ((at == name || at[-1] == ' ') && (!at[length] || at[length] == ' ')) return true;
    return false;
}

static int take_given(kn_sheet *s, const char *units)
{
    for (const char *at = units; at && *at;) {
        char item[KN_HEADING_NAME], error[100];
        kn_heading named;
        kn_measure m;
        size_t length = strcspn(at, ",");
        snprintf(item, sizeof item, "%.*s", (int)length, at);
        at += length + (at[length] == ',');
        char *mark = strrchr(item, '=');
        if (!mark || mark == item)
            return kn_complain(s->subcommand, KN_EXIT_USAGE, "--units %s: expected e.g. time=s,modulus=Pa", units);
        *mark = '\0';
        kn_heading_read(&named, item);
        if (!kn_measure_parse(&m, mark + 1, error, sizeof error))
            return kn_complain(s->subcommand, KN_EXIT_USAGE, "--units %s: %s", units, error);
        bool any = false;
        for (int c = 0; c < s->columns; c++) {
            kn_heading *h = &s->column[c].heading;
            if (!has_word(h->word, named.word)) continue;
            any = true;
            if (h->has_unit) continue;
            h->has_unit = true;
            h->unit = m;
            snprintf(h->unit_text, sizeof h->unit_text, "%s", mark + 1);
        }
        if (!any)
            return kn_sheet_complain(s, s->header_line, 1, "no column '%s', expected a name of this line in --units",
                                     item);
    }
    return KN_EXIT_OK;
}

int kn_sheet_open(kn_sheet *s, const char *file, const char *units, const char *subcommand)
{
    int names = 0, unit_line = 0;
    memset(s, 0, sizeof *s);
    s->file = file;
    s->subcommand = subcommand;
    if (!kn_lines_open(&s->lines, file)) return kn_complain(subcommand, KN_EXIT_USAGE, "%s: %s", file, s->lines.error);
    int code = find_header(s, &names, &unit_line);
    if (code != KN_EXIT_OK) return code;
    if (!kn_lines_rewind(&s->lines))
        return kn_sheet_complain(s, 1, 1, "no numbers in the first megabyte, expected a table");
    s->header_line = names;
    while (s->lines.number < (unit_line ? unit_line : names) && kn_lines_next(&s->lines)) {
        const char *line = s->lines.text;
        if (s->lines.number == names && !take_names(s, line))
            return kn_sheet_complain(s, names, 1, "more than %d columns, expected fewer", KN_SHEET_COLUMNS);
        else if (s->lines.number == unit_line)
            take_units(s, line);
        else if (line[strspn(line, " \t")] == '#')
            take_note(s);
    }
    return take_given(s, units);
}

// ---- rows

static bool grow(kn_sheet *s, int count, const int wanted[])
{
    if (s->rows < s->room) return true;
    int room = s->room ? 2 * s->room : 1024;
    int *line = realloc(s->line, (size_t)room * sizeof *line);
    if (line) s->line = line;
    bool ok = line;
    for (int i = 0; i < count; i++) {
        kn_sheet_column *c = &s->column[wanted[i]];
        double *value = realloc(c->value, (size_t)room * sizeof *value);
        if (value) c->value = value;
        ok &= value != NULL;
    }
    if (ok) s->room = room;
    return ok;
}

static int bad_cell(const kn_sheet *s, const kn_sheet_column *column, const cell *c)
{
    char text[32];
    snprintf(text, sizeof text, "%.*s", c->length, c->text);
    for (char *p = text; *p; p++)
        if ((unsigned char)*p < ' ') *p = '?';
    const bool commas = strchr(text, ',') && strchr(text, '.');
    return kn_sheet_complain(s, s->lines.number, (int)(c->text - s->lines.text) + 1, "'%s' for %s, expected a number%s",
                             text, column->heading.name,
                             commas ? " without separators of thousands" : ", or nothing where a reading is missing");
}

// slot[index of a cell]: the column that it belongs to, or -1. cells: how many names there are.
static int take_row(kn_sheet *s, int cells, const int slot[])
{
    cell c;
    int index = 0;
    const char *line = s->lines.text;
    for (const char *at = line; next_cell(s->separator, &at, &c); index++) {
        double value;
        if (index >= cells) {
            if (c.length == 0) continue;
            return kn_sheet_complain(s, s->lines.number, (int)(c.text - line) + 1,
                                     "more cells than the %d names, expected "
                                     "as many%s",
                                     cells, s->separator == ',' ? " (are these decimal commas?)" : "");
        }
        if (slot[index] < 0) continue;
        kn_sheet_column *column = &s->column[slot[index]];
        switch (read_cell(&c, s->separator, &value, &s->commas, &s->points)) {
        case NUMBER:
            column->value[s->rows] = column->heading.has_unit ? kn_measure_si(&column->heading.unit, value) : value;
            break;
        case MISSING:
            column->value[s->rows] = NAN;
            break;
        case TEXT:
            return bad_cell(s, column, &c);
        }
    }
    for (; index < cells; index++) // a short row: what it lacks is missing
        if (slot[index] >= 0) s->column[slot[index]].value[s->rows] = NAN;
    s->line[s->rows++] = s->lines.number;
    if (s->commas && s->points)
        return kn_sheet_complain(s, s->lines.number, 1,
                                 "decimal points and decimal commas in one file, expected one of them");
    return KN_EXIT_OK;
}

// The names once more, as instruments write them above each of their intervals, or units.
static bool is_repeated(const kn_sheet *s, const char *line)
{
    cell c;
    int index = 0, same = 0;
    for (const char *at = line; index < s->columns && next_cell(s->separator, &at, &c); index++) {
        char text[KN_HEADING_NAME];
        kn_heading h;
        unquote(text, sizeof text, &c);
        kn_heading_read(&h, text);
        same += *h.word && !strcmp(h.word, s->column[index].heading.word);
    }
    return same >= 2 && 2 * same >= s->columns;
}

int kn_sheet_read(kn_sheet *s, int count, const int wanted[])
{
    int slot[KN_SHEET_COLUMNS], code = KN_EXIT_OK, cells = 0;
    for (int i = 0; i < KN_SHEET_COLUMNS; i++) slot[i] = -1;
    for (int i = 0; i < count; i++) slot[s->column[wanted[i]].index] = wanted[i];
    if (s->columns) cells = s->column[s->columns - 1].index + 1;
    bool repeated = false;
    while (code == KN_EXIT_OK && kn_lines_next(&s->lines)) {
        const char *text = s->lines.text + strspn(s->lines.text, " \t");
        if (text[strspn(text, " \t,;")] == '\0') continue;
        if (*text == '#' && strncasecmp(text, "#N", 2) != 0) {
            take_note(s);
            continue;
        }
        if (isalpha((unsigned char)*text) || *text == '"') { // rarely: most rows begin with a digit
            if ((repeated && is_units(text, s->separator)) || (repeated = is_repeated(s, text))) continue;
        }
        repeated = false;
        if ((int64_t)(s->rows + 1) * count > KN_SHEET_CELLS)
            return kn_sheet_complain(s, s->lines.number, 1,
                                     "more than %d rows of %d columns, expected fewer: thin it, "
                                     "e.g. awk 'NR < 9 || NR %% 10 == 0'",
                                     s->rows, count);
        if (!grow(s, count, wanted)) return kn_complain(s->subcommand, KN_EXIT_DEVICE, "%s: out of memory", s->file);
        code = take_row(s, cells, slot);
    }
    if (code == KN_EXIT_OK && *s->lines.error) code = kn_sheet_complain(s, s->lines.number, 1, "%s", s->lines.error);
    return code;
}
