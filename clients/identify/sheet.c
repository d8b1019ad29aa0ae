#include "clients/identify/sheet.h"
#include "clients/identify/cell.h"
#include "clients/identify/header.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include <ctype.h>
#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

int kn_sheet_complain(const kn_sheet *s, int line, int at, const char *format, ...)
{
    char text[800];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    return kn_complain(s->subcommand, KN_EXIT_USAGE, "%s:%d:%d: %s", s->file, line, at, text);
}

// Read the file once more, up to the line. Positions are not stored, since a file may have ten million rows.
int kn_sheet_at(const kn_sheet *s, int line, int column)
{
    struct stat is;
    kn_lines l;
    kn_cell c;
    int at = 1, index = 0;
    if (stat(s->file, &is) != 0 || !S_ISREG(is.st_mode) || !kn_lines_open(&l, s->file)) return at;
    while (l.number < line && kn_lines_next(&l)) continue;
    for (const char *cell = l.text; l.number == line && kn_cell_next(s->of_rows, &cell, &c); index++)
        if (index == s->column[column].index) at = (int)(c.text - l.text) + 1;
    kn_lines_close(&l);
    return at;
}

void kn_sheet_close(kn_sheet *s)
{
    for (int c = 0; c < s->columns; c++) free(s->column[c].value);
    free(s->line);
    kn_lines_close(&s->lines);
    s->columns = s->rows = 0;
    s->line = NULL;
}

// ---- notes

static void take_note(kn_sheet *s)
{
    kn_note note;
    if (s->notes < KN_SHEET_NOTES && kn_note_read(s->lines.text, s->lines.number, &note)) s->note[s->notes++] = note;
}

// If two notes have the same key, their values must agree.
int kn_sheet_note_take(const kn_sheet *s, const char *key, const char *unit, double *value)
{
    char error[120];
    const kn_note *first = NULL;
    for (int i = 0; i < s->notes; i++) {
        const kn_note *n = &s->note[i];
        const double before = *value;
        if (strcmp(n->key, key) != 0) continue;
        if (!kn_heading_quantity(n->value, unit, value, error, sizeof error))
            return kn_sheet_complain(s, n->line, n->at, "%s: %s", key, error);
        if (first && *value != before)
            return kn_sheet_complain(s, n->line, n->at, "%s of %s here, but of %s in line %d, expected one value", key,
                                     n->value, first->value, first->line);
        first = n;
    }
    return KN_EXIT_OK;
}

// ---- names and units

// Read the names. If blanks separate the cells, "Time (s)" is one name: a bracket is joined to the name before it.
static bool take_names(kn_sheet *s, const char *line)
{
    kn_cell c;
    char text[KN_HEADING_NAME];
    const char *begin = line + strspn(line, line[strspn(line, " ")] == '#' ? " #" : " ");
    int index = 0;
    for (const char *at = begin; kn_cell_next(s->separator, &at, &c); index++) {
        kn_cell_text(text, sizeof text, &c);
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

// Read a row of units below the names. A unit that a name already has is kept.
static void take_units(kn_sheet *s, const char *line)
{
    kn_cell c;
    int index = 0;
    for (const char *at = line; index < s->columns && kn_cell_next(s->separator, &at, &c); index++) {
        kn_heading *h = &s->column[index].heading;
        if (c.length == 0 || h->has_unit) continue;
        if (strchr("([", *c.text) && c.length > 2) c.text++, c.length -= 2;
        kn_cell_text(h->unit_text, sizeof h->unit_text, &c);
        h->has_unit = kn_measure_parse(&h->unit, h->unit_text, NULL, 0);
    }
}

// Return whether the name contains the word. A name in --units means every column without a unit that has this word in
// its name.
static bool has_word(const char *name, const char *word)
{
    const size_t length = strlen(word);
    for (const char *at = name; (at = strstr(at, word)); at++)
        if ((at == name || at[-1] == ' ') && (!at[length] || at[length] == ' ')) return true;
    return false;
}

// Give the unit to all columns that contain the word and have no unit. Return false if no column contains the word.
static bool give_unit(kn_sheet *s, const char *word, const kn_measure *unit, const char *unit_text)
{
    bool any = false;
    for (int c = 0; c < s->columns; c++) {
        kn_heading *h = &s->column[c].heading;
        if (!has_word(h->word, word)) continue;
        any = true;
        if (h->has_unit) continue;
        h->has_unit = true;
        h->unit = *unit;
        snprintf(h->unit_text, sizeof h->unit_text, "%s", unit_text);
    }
    return any;
}

// Read the list of --units, "time=s,modulus=Pa".
static int take_given(kn_sheet *s, const char *units)
{
    for (const char *at = units; at && *at;) {
        char item[KN_HEADING_NAME], error[100];
        kn_heading named;
        kn_measure m;
        // Each item is a name and a unit with '=' between.
        const size_t length = strcspn(at, ",");
        snprintf(item, sizeof item, "%.*s", (int)length, at);
        at += length + (at[length] == ',');
        char *mark = strrchr(item, '=');
        if (!mark || mark == item)
            return kn_complain(s->subcommand, KN_EXIT_USAGE, "--units %s: expected e.g. time=s,modulus=Pa", units);
        *mark = '\0';
        kn_heading_read(&named, item);
        if (!kn_measure_parse(&m, mark + 1, error, sizeof error))
            return kn_complain(s->subcommand, KN_EXIT_USAGE, "--units %s: %s", units, error);
        if (give_unit(s, named.word, &m, mark + 1)) continue;
        return kn_sheet_complain(s, s->header_line, 1, "no column '%s', expected a name of this line in --units", item);
    }
    return KN_EXIT_OK;
}

// Say why no table was found.
static int no_table(const kn_sheet *s, const kn_header *header)
{
    if (*s->lines.error) return kn_sheet_complain(s, s->lines.number ? s->lines.number : 1, 1, "%s", s->lines.error);
    if (header->names)
        return kn_sheet_complain(s, header->names, 1, "names without numbers below them, expected rows of numbers");
    return kn_sheet_complain(s, 1, 1,
                             "no table, expected a line of names like time_s,height_mm and rows of numbers below it");
}

int kn_sheet_open(kn_sheet *s, const char *file, const char *units, const char *subcommand)
{
    kn_header header;
    memset(s, 0, sizeof *s);
    s->file = file;
    s->subcommand = subcommand;
    if (!kn_lines_open(&s->lines, file)) return kn_complain(subcommand, KN_EXIT_USAGE, "%s: %s", file, s->lines.error);
    if (!kn_header_find(&header, &s->lines)) return no_table(s, &header);
    if (!kn_lines_rewind(&s->lines))
        return kn_sheet_complain(s, 1, 1, "no numbers in the first 256 kB, expected a table");
    s->header_line = header.names;
    // The header was found by reading ahead. Now read from the first line again and take names, units and notes.
    s->separator = header.separator;
    s->of_rows = header.of_rows;
    while (s->lines.number < (header.units ? header.units : header.names) && kn_lines_next(&s->lines)) {
        const char *line = s->lines.text;
        if (s->lines.number == header.names && !take_names(s, line))
            return kn_sheet_complain(s, header.names, 1, "more than %d columns, expected fewer", KN_SHEET_COLUMNS);
        else if (s->lines.number == header.units) take_units(s, line);
        else if (line[strspn(line, " \t")] == '#') take_note(s);
    }
    return take_given(s, units);
}

// ---- rows

// Make room for one more row in all wanted columns. Double the room each time.
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

// Print the error that a cell holds text in place of a number, and return an exit code. The text is an error since the
// names were not repeated below it.
static int bad_text(const kn_sheet *s)
{
    const char *text = s->strange.text;
    if (s->strange.lines > 1)
        return kn_sheet_complain(s, s->strange.line, 1,
                                 "'%s' and more text, expected one table in a file: remove the others", text);
    const bool thousands = strchr(text, ',') && strchr(text, '.');
    return kn_sheet_complain(
        s, s->strange.line, s->strange.at, "'%s' for %s, expected a number%s", text, s->strange.name,
        thousands ? " without separators of thousands" : ", or nothing where a reading is missing");
}

// Remember the first text found in place of a number. Count the lines with such text and without any number.
static void set_aside(kn_sheet *s, const kn_sheet_column *column, const kn_cell *c, bool numbers)
{
    s->strange.lines += !numbers;
    if (s->strange.name) return;
    s->strange.line = s->lines.number;
    s->strange.at = (int)(c->text - s->lines.text) + 1;
    s->strange.name = column->heading.name;
    kn_cell_text(s->strange.text, sizeof s->strange.text, c);
}

// Return whether the row filter `only` excludes the row.
static bool is_other(kn_sheet *s, int index, const kn_cell *c)
{
    char text[KN_HEADING_NAME];
    if (!s->only.text || index != s->column[s->only.column].index) return false;
    kn_cell_text(text, sizeof text, c);
    const bool other = strcmp(text, s->only.text) != 0;
    s->only.left_out += other;
    return other;
}

// Read one row. slot[i] is the column of cell i, or -1. `cells` is the number of names. A line with text in place of a
// number is remembered. The text becomes an error if another row follows.
static int take_row(kn_sheet *s, int cells, const int slot[])
{
    kn_cell c, bad = {0};
    int index = 0, numbers = 0;
    const kn_sheet_column *of_bad = NULL;
    const char *line = s->lines.text;
    for (const char *at = line; kn_cell_next(s->of_rows, &at, &c); index++) {
        // Cells of columns that were not asked for may hold anything. Empty cells beyond the last name are ignored.
        double value = NAN;
        if (index >= cells && c.length == 0) continue;
        if (index >= cells)
            return kn_sheet_complain(s, s->lines.number, (int)(c.text - line) + 1,
                                     "more cells than the %d names, expected as many%s", cells,
                                     s->of_rows == ',' ? " (are these decimal commas?)" : "");
        if (is_other(s, index, &c)) return KN_EXIT_OK;
        if (slot[index] < 0) continue;
        kn_sheet_column *column = &s->column[slot[index]];
        const kn_cell_content is = kn_cell_read(&c, s->of_rows, &value, &s->commas, &s->points);
        numbers += is == KN_CELL_NUMBER;
        if (is == KN_CELL_TEXT && !of_bad) of_bad = column, bad = c;
        if (is == KN_CELL_NUMBER && column->heading.has_unit) value = kn_measure_si(&column->heading.unit, value);
        if (is == KN_CELL_NUMBER && fabs(value) > KN_SHEET_MOST)
            return kn_sheet_complain(s, s->lines.number, (int)(c.text - line) + 1,
                                     "%g in SI units, expected at most %g", value, KN_SHEET_MOST);
        column->value[s->rows] = is == KN_CELL_NUMBER ? value : NAN;
    }
    for (; index < cells; index++) // if the row has too few cells, the absent cells count as missing readings
        if (slot[index] >= 0) s->column[slot[index]].value[s->rows] = NAN;
    if (of_bad) set_aside(s, of_bad, &bad, numbers > 0);
    // skip a row with text in place of a number, or without any number in the requested columns
    if (of_bad || numbers == 0) return KN_EXIT_OK;
    if (s->strange.name) return bad_text(s);
    s->line[s->rows++] = s->lines.number;
    if (s->commas && s->points)
        return kn_sheet_complain(s, s->lines.number, 1,
                                 "decimal points and decimal commas in one file, expected one of them");
    return KN_EXIT_OK;
}

// Return whether the line repeats the names, as instruments write them above each of their intervals.
static bool is_repeated(const kn_sheet *s, const char *line)
{
    kn_cell c;
    int index = 0, same = 0;
    for (const char *at = line; index < s->columns && kn_cell_next(s->separator, &at, &c); index++) {
        char text[KN_HEADING_NAME];
        kn_heading h;
        kn_cell_text(text, sizeof text, &c);
        kn_heading_read(&h, text);
        same += *h.word && !strcmp(h.word, s->column[index].heading.word);
    }
    return same >= 2 && 2 * same >= s->columns;
}

// Return whether a line is not a row and can be skipped: repeated names, units below them, a note or an empty line.
static bool is_skipped(kn_sheet *s, bool *repeated)
{
    const char *text = s->lines.text + strspn(s->lines.text, " \t");
    if (text[strspn(text, " \t,;")] == '\0') return true;
    if (*text == '#' && strncasecmp(text, "#N", 2) != 0) {
        take_note(s);
        return true;
    }
    // only a line that begins with a letter or a quote can repeat the names, since a row begins with a digit
    const bool below = *repeated, words = isalpha((unsigned char)*text) || *text == '"';
    *repeated = words && is_repeated(s, text);
    // The names are repeated, so the text before them was the heading of the instrument's next interval.
    if (*repeated) s->strange.lines = 0, s->strange.name = NULL;
    return *repeated || (below && kn_header_is_units(text, s->separator));
}

int kn_sheet_read(kn_sheet *s, int count, const int wanted[])
{
    int slot[KN_SHEET_COLUMNS], code = KN_EXIT_OK;
    const int cells = s->columns ? s->column[s->columns - 1].index + 1 : 0;
    bool repeated = false;
    // Map the cells of a row to the wanted columns.
    for (int i = 0; i < KN_SHEET_COLUMNS; i++) slot[i] = -1;
    for (int i = 0; i < count; i++) slot[s->column[wanted[i]].index] = wanted[i];
    while (code == KN_EXIT_OK && kn_lines_next(&s->lines)) {
        if (is_skipped(s, &repeated)) continue;
        if ((int64_t)(s->rows + 1) * count > KN_SHEET_CELLS)
            return kn_sheet_complain(s, s->lines.number, 1,
                                     "more than %d rows of %d columns, expected fewer: thin it, "
                                     "e.g. awk 'NR < 9 || NR %% 10 == 0'",
                                     s->rows, count);
        // Read the row into the next free place.
        if (!grow(s, count, wanted)) return kn_complain(s->subcommand, KN_EXIT_DEVICE, "%s: out of memory", s->file);
        code = take_row(s, cells, slot);
    }
    if (code == KN_EXIT_OK && *s->lines.error) return kn_sheet_complain(s, s->lines.number, 1, "%s", s->lines.error);
    if (code == KN_EXIT_OK && s->strange.name) return bad_text(s);
    if (code == KN_EXIT_OK && s->rows == 0 && s->only.left_out > 0)
        return kn_sheet_complain(s, s->header_line, s->column[s->only.column].at,
                                 "%d rows, all of another %s than '%s', expected rows of it", s->only.left_out,
                                 s->column[s->only.column].heading.name, s->only.text);
    if (code == KN_EXIT_OK && s->rows == 0)
        return kn_sheet_complain(s, s->header_line, 1, "no numbers below %s, expected rows of them",
                                 s->column[wanted[0]].heading.name);
    return code;
}
