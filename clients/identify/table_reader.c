#include "clients/identify/table_reader.h"
#include "clients/cli/commands.h"
#include "clients/cli/command.h"
#include <ctype.h>
#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

int kn_table_reader_complain(const kn_table_reader *s, int line, int at, const char *format, ...)
{
    char text[800];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    return kn_complain(s->subcommand, KN_EXIT_USAGE, "%s:%d:%d: %s", s->file, line, at, text);
}

// Find the position by reading the file once more, up to the line. They are not stored, since a file may be large.
int kn_table_reader_at(const kn_table_reader *s, int line, int column)
{
    struct stat is;
    kn_lines l;
    kn_text_cell c;
    int at = 1, index = 0;
    if (stat(s->file, &is) != 0 || !S_ISREG(is.st_mode) || !kn_lines_open(&l, s->file)) return at;
    while (l.number < line && kn_lines_next(&l)) continue;
    for (const char *cell = l.text; l.number == line && kn_text_cell_next(s->of_rows, &cell, &c); index++)
        if (index == s->column[column].index) at = (int)(c.text - l.text) + 1;
    kn_lines_close(&l);
    return at;
}

void kn_table_reader_close(kn_table_reader *s)
{
    for (int c = 0; c < s->columns; c++) free(s->column[c].value);
    free(s->line);
    kn_lines_close(&s->lines);
    s->columns = s->rows = 0;
    s->line = NULL;
}

// ---- notes in a file

static void take_note(kn_table_reader *s)
{
    kn_note note;
    if (s->notes < KN_TABLE_NOTES && kn_note_read(s->lines.text, s->lines.number, &note)) s->note[s->notes++] = note;
}

// If several notes have this key, their values must agree.
int kn_table_reader_note(const kn_table_reader *s, const char *key, const char *unit, double *value)
{
    char error[120];
    const kn_note *first = NULL;
    for (int i = 0; i < s->notes; i++) {
        const kn_note *n = &s->note[i];
        const double before = *value;
        if (strcmp(n->key, key) != 0) continue;
        if (!kn_heading_quantity(n->value, unit, value, error, sizeof error))
            return kn_table_reader_complain(s, n->line, n->at, "%s: %s", key, error);
        if (first && *value != before)
            return kn_table_reader_complain(s, n->line, n->at,
                                            "%s of %s here, but of %s in line %d, expected one value", key, n->value,
                                            first->value, first->line);
        first = n;
    }
    return KN_EXIT_OK;
}

// ---- finding the start of the table

static char separator_of(const char *line)
{
    return strchr(line, '\t') ? '\t' : strchr(line, ';') ? ';' : strchr(line, ',') ? ',' : ' ';
}

typedef struct census { // numbers of cells of each kind in one line of the file
    int cells, numbers, missing;
    bool first; // whether the first cell is a number
} census;

static census count_cells(const char *line, char separator)
{
    census n = {0};
    kn_text_cell c;
    double value;
    bool ignored;
    for (const char *at = line; kn_text_cell_next(separator, &at, &c); n.cells++) {
        kn_text_cell_content is = kn_text_cell_read(&c, separator, &value, &ignored, &ignored);
        n.numbers += is == KN_CELL_NUMBER;
        n.first |= n.cells == 0 && is == KN_CELL_NUMBER;
        n.missing += is == KN_CELL_MISSING;
    }
    return n;
}

typedef struct candidate { // a line of words that may hold the names of the columns
    int line, cells;       // line: number of the line, 0: no such line so far; cells: number of its cells
    int units;             // number of the line of units below it; 0: none
    char separator;
} candidate;

// State of the search for the start of the table.
typedef struct search {
    // plain: last line of words without a comment sign; commented: last line of words with a comment sign
    candidate plain, commented;
    int data;     // line number of the first row of numbers; 0: not found so far
    char of_rows; // separator of the first row of numbers
} search;

// Return whether the line is a row of numbers below a line of names with `cells` cells. In a row, at least half of the
// cells are numbers or missing, or three are numbers and there is a cell for each name; and there are no more cells
// than names. A line with a word and one number, such as "Diameter;25", stands before tables and is no row.
static bool is_row(const char *line, char separator, int cells)
{
    census n = count_cells(line, separator);
    if (n.numbers == 0 || (n.numbers == 1 && !n.first && n.cells > 1 && n.missing == 0)) return false;
    const bool mostly = 2 * (n.numbers + n.missing) >= n.cells || (n.numbers >= 3 && n.cells == cells);
    return mostly && n.cells - n.missing <= cells;
}

// Return the separator of the cells if the line is a row below these names, or 0 if the line is no row.
static char row_separator(const char *line, const candidate *names)
{
    if (!names->line) return 0;
    if (is_row(line, names->separator, names->cells)) return names->separator;
    return count_cells(line, ' ').numbers > 1 && is_row(line, ' ', names->cells) ? ' ' : 0;
}

// Read the unit in a cell below a name. Brackets around the unit are dropped. Return whether the unit is known.
static bool unit_in(kn_text_cell *c, char text[KN_HEADING_NAME], kn_column_unit *unit)
{
    if (c->length > 2 && strchr("([", *c->text)) c->text++, c->length -= 2;
    kn_text_cell_text(text, KN_HEADING_NAME, c);
    return kn_column_unit_parse(unit, text, NULL, 0);
}

// Return whether a line holds the units of the columns, such as "s;mm;N": at least half of its cells must be known
// units, or all must be in square brackets.
static bool is_units(const char *line, char separator)
{
    int units = 0, others = 0, open = 0;
    kn_text_cell c;
    for (const char *at = line; kn_text_cell_next(separator, &at, &c);) {
        char text[KN_HEADING_NAME];
        kn_column_unit unit;
        if (c.length == 0 || (c.length == 2 && !strncmp(c.text, "[]", 2))) continue;
        open += *c.text != '[';
        if (unit_in(&c, text, &unit)) units++;
        else others++;
    }
    return units > 0 && (units >= others || open == 0);
}

// Return the line without what stands before its first cell. A tab at the begin ends an empty cell, if tabs separate.
static const char *cells_of(const char *line, bool *comment)
{
    const char *text = line + strspn(line, " \t");
    *comment = *text == '#';
    if (*comment) return text + strspn(text, "# \t");
    return strchr(text, '\t') ? line + strspn(line, " ") : text;
}

// Look at one line of the file. A row of numbers ends the search. A line of words becomes the new candidate for the
// names, or is the line of units of the last one.
static void look_at(search *found, const kn_lines *l)
{
    bool comment;
    const char *line = cells_of(l->text, &comment);
    kn_note note;
    if (!line[strspn(line, " \t;,")] || (comment && kn_note_read(l->text, 0, &note))) return;
    // Try the line as a row below the plain candidate first, then as a row below the commented candidate.
    const char separator = separator_of(line);
    const census n = count_cells(line, separator);
    char of_rows = row_separator(line, &found->plain);
    if (!of_rows) of_rows = row_separator(line, &found->commented);
    candidate *to = comment ? &found->commented : &found->plain;
    if (!comment && of_rows) {
        found->data = l->number;
        found->of_rows = of_rows;
    } else if (to->line && !to->units && !comment && is_units(line, separator)) {
        to->units = l->number;
    } else if (n.numbers == 0 && n.cells - n.missing >= 2) {
        // a line of words with at least two cells may be the names
        *to = (candidate){l->number, n.cells, 0, separator};
    }
}

// Find the lines of names and units and the separators. Return false if no numbers follow a line of names. In that case
// s->header_line is the number of the line that could have held the names, or 0.
static bool find_table(kn_table_reader *s)
{
    search found = {0};
    while (!found.data && kn_lines_next(&s->lines)) look_at(&found, &s->lines);
    const candidate *names = found.plain.line ? &found.plain : &found.commented;
    s->header_line = names->line;
    s->units_line = names->units;
    s->separator = names->separator;
    s->of_rows = found.of_rows;
    return found.data > 0;
}

// ---- names and units of the columns

// Read the names. If blanks separate the cells, "Time (s)" is one name: a bracket is joined to the word before it.
static bool take_names(kn_table_reader *s, const char *line)
{
    kn_text_cell c;
    char text[KN_HEADING_NAME];
    bool comment;
    const char *begin = cells_of(line, &comment);
    int index = 0;
    for (const char *at = begin; kn_text_cell_next(s->separator, &at, &c); index++) {
        kn_text_cell_text(text, sizeof text, &c);
        kn_table_column *last = s->columns ? &s->column[s->columns - 1] : NULL;
        if (s->separator == ' ' && last && (*text == '(' || *text == '[')) {
            char whole[KN_HEADING_NAME];
            snprintf(whole, sizeof whole, "%.50s %.24s", last->heading.name, text);
            kn_heading_read(&last->heading, whole);
            index--;
            continue;
        }
        if (s->columns == KN_TABLE_COLUMNS) return false;
        s->column[s->columns] = (kn_table_column){.at = (int)(c.text - line) + 1, .index = index};
        kn_heading_read(&s->column[s->columns++].heading, text);
    }
    return true;
}

// Read a row of units below the names. A column keeps the unit that its name contains.
static void take_units(kn_table_reader *s, const char *line)
{
    kn_text_cell c;
    int index = 0;
    for (const char *at = line; index < s->columns && kn_text_cell_next(s->separator, &at, &c); index++) {
        kn_heading *h = &s->column[index].heading;
        if (c.length > 0 && !h->has_unit) h->has_unit = unit_in(&c, h->unit_text, &h->unit);
    }
}

// Return whether the name of a column contains the word. A word in --units stands for every such column without a unit.
static bool has_word(const char *name, const char *word)
{
    const size_t length = strlen(word);
    for (const char *at = name; (at = strstr(at, word)); at++)
        if ((at == name || at[-1] == ' ') && (!at[length] || at[length] == ' ')) return true;
    return false;
}

// Read the list of --units, "time=s,modulus=Pa": units of all columns that have the word in their name and no unit. Or
// read that of --column, "Crosshead=displacement".
static int take_list(kn_table_reader *s, const char *list, bool roles)
{
    const char *option = roles ? "column" : "units";
    for (const char *at = list; at && *at;) {
        char item[KN_HEADING_NAME], error[100];
        kn_heading named, scratch = {0};
        kn_column_unit m;
        const size_t length = strcspn(at, ",");
        snprintf(item, sizeof item, "%.*s", (int)length, at);
        at += length + (at[length] == ',');
        char *mark = strrchr(item, '=');
        if (!mark || mark == item)
            return kn_complain(s->subcommand, KN_EXIT_USAGE, "--%s %s: expected e.g. %s", option, list,
                               roles ? "Crosshead=displacement" : "time=s,modulus=Pa");
        *mark = '\0';
        mark += strspn(mark + 1, " ");
        kn_heading_read(&named, item);
        if (roles && !kn_column_role(&scratch, mark + 1))
            return kn_complain(s->subcommand, KN_EXIT_USAGE,
                               "--column %s: '%s' is no quantity, expected time, height, displacement, strain, "
                               "compliance, load, stress, modulus, frequency, storage, loss, tan or phase",
                               list, mark + 1);
        if (!roles && !kn_column_unit_parse(&m, mark + 1, error, sizeof error))
            return kn_complain(s->subcommand, KN_EXIT_USAGE, "--units %s: %s", list, error);
        int found = 0;
        for (int c = 0; c < s->columns; c++) {
            kn_heading *h = &s->column[c].heading;
            if (roles ? strcmp(h->word, named.word) != 0 : !has_word(h->word, named.word)) continue;
            found++;
            if (roles) kn_column_role(h, mark + 1);
            if (roles || h->has_unit) continue;
            h->has_unit = true;
            h->unit = m;
            snprintf(h->unit_text, sizeof h->unit_text, "%s", mark + 1);
        }
        if (roles && found > 1)
            return kn_table_reader_complain(s, s->header_line, 1, "%d columns are named '%s', expected one", found,
                                            item);
        if (found == 0)
            return kn_table_reader_complain(s, s->header_line, 1,
                                            "no column '%s', expected a name of this line in --%s", item, option);
    }
    return KN_EXIT_OK;
}

// Report why no table was found.
static int no_table(const kn_table_reader *s)
{
    if (*s->lines.error)
        return kn_table_reader_complain(s, s->lines.number ? s->lines.number : 1, 1, "%s", s->lines.error);
    return kn_table_reader_complain(
        s, s->header_line ? s->header_line : 1, 1,
        s->header_line ? "names without numbers below them, expected rows of numbers, with as many cells as names"
                       : "no table, expected a line of names like time_s,height_mm and rows of numbers below it");
}

int kn_table_reader_open(kn_table_reader *s, const char *file, const char *units, const char *roles,
                         const char *subcommand)
{
    memset(s, 0, sizeof *s);
    s->file = file;
    s->subcommand = subcommand;
    if (!kn_lines_open(&s->lines, file)) return kn_complain(subcommand, KN_EXIT_USAGE, "%s: %s", file, s->lines.error);
    if (!find_table(s)) return no_table(s);
    if (!kn_lines_rewind(&s->lines))
        return kn_table_reader_complain(s, 1, 1, "no numbers in the first 256 kB, expected a table");
    // The header was found by reading ahead. Go back to the first line, then take names, units and notes.
    const int last = s->units_line ? s->units_line : s->header_line;
    while (s->lines.number < last && kn_lines_next(&s->lines)) {
        const char *line = s->lines.text;
        if (s->lines.number == s->header_line) snprintf(s->names_text, sizeof s->names_text, "%s", line);
        if (s->lines.number == s->units_line) snprintf(s->units_text, sizeof s->units_text, "%s", line);
        if (s->lines.number == s->header_line && !take_names(s, line))
            return kn_table_reader_complain(s, s->header_line, 1, "more than %d columns, expected fewer",
                                            KN_TABLE_COLUMNS);
        else if (s->lines.number == s->units_line) take_units(s, line);
        else if (line[strspn(line, " \t")] == '#') take_note(s);
    }
    const int code = take_list(s, roles, true);
    return code == KN_EXIT_OK ? take_list(s, units, false) : code;
}

// ---- rows of numbers

// Make room for one more row in all wanted columns. When the room is used up, double it.
static bool grow(kn_table_reader *s, int count, const int wanted[])
{
    if (s->rows < s->room) return true;
    int room = s->room ? 2 * s->room : 1024;
    int *line = realloc(s->line, (size_t)room * sizeof *line);
    if (line) s->line = line;
    bool ok = line;
    for (int i = 0; i < count; i++) {
        kn_table_column *c = &s->column[wanted[i]];
        double *value = realloc(c->value, (size_t)room * sizeof *value);
        if (value) c->value = value;
        ok &= value != NULL;
    }
    if (ok) s->room = room;
    return ok;
}

// Report text in place of numbers, and return an exit code. Text above repeated names is not an error, since it is the
// heading of the next interval.
static int bad_text(const kn_table_reader *s)
{
    const char *text = s->strange.text;
    if (s->strange.lines > 1)
        return kn_table_reader_complain(
            s, s->strange.line, 1,
            "'%s' and more text in place of numbers, expected one table in a file: remove other tables", text);
    const bool thousands = strchr(text, ',') && strchr(text, '.');
    return kn_table_reader_complain(
        s, s->strange.line, s->strange.at, "'%s' for %s, expected a number%s", text, s->strange.name,
        thousands ? " without thousands separators" : ", or nothing where a reading is missing");
}

// Remember the first text found in place of a number. Count the lines that hold such text and no number.
static void set_aside(kn_table_reader *s, const kn_table_column *column, const kn_text_cell *c, bool numbers)
{
    s->strange.lines += !numbers;
    if (s->strange.name) return;
    s->strange.line = s->lines.number;
    s->strange.at = (int)(c->text - s->lines.text) + 1;
    s->strange.name = column->heading.name;
    kn_text_cell_text(s->strange.text, sizeof s->strange.text, c);
}

// Return whether this cell excludes its row by the filter s->only. Count the excluded rows.
static bool is_other(kn_table_reader *s, int index, const kn_text_cell *c)
{
    char text[KN_HEADING_NAME];
    if (!s->only.text || index != s->column[s->only.column].index) return false;
    kn_text_cell_text(text, sizeof text, c);
    const bool other = strcmp(text, s->only.text) != 0;
    s->only.left_out += other;
    return other;
}

// Return whether a row holds a statistic of the column, such as a mean: the first word of its first cell says so.
static bool is_statistic(const char *line, char separator)
{
    static const char words[] =
        " mean average avg std stdev sd s.d standard min minimum max maximum median variance cv "
        "coefficient mittelwert mittel standardabweichung stabw ";
    kn_text_cell c = {0};
    char word[32] = " ";
    int n = 1;
    for (const char *at = line; kn_text_cell_next(separator, &at, &c) && c.length == 0;) continue;
    for (int i = 0; i < c.length && n < 30 && (isalpha((unsigned char)c.text[i]) || (c.text[i] == '.' && i == 1)); i++)
        word[n++] = (char)tolower((unsigned char)c.text[i]);
    word[n] = ' ';
    return n > 1 && strstr(words, word);
}

// Return whether a mark in a number can be no thousands separator: it stands behind a lone 0, or not before three
// digits at the end.
static bool is_decimal(const kn_text_cell *c, char mark)
{
    const char *at = memchr(c->text, mark, (size_t)c->length);
    if (!at || at == c->text) return at;
    return c->text + c->length - at != 4 || (at[-1] == '0' && (at - 1 == c->text || !isdigit((unsigned char)at[-2])));
}

// Read one row. slot[i] is the column of cell i, or -1. `cells` is the number of names. If a requested cell holds text
// in place of a number, skip the row and remember the text. The text becomes an error if another row follows.
static int take_row(kn_table_reader *s, int cells, const int slot[])
{
    kn_text_cell c, bad = {0};
    int index = 0, numbers = 0;
    const kn_table_column *of_bad = NULL;
    const char *line = s->lines.text;
    for (const char *at = line; kn_text_cell_next(s->of_rows, &at, &c); index++) {
        // Cells of columns that were not requested may hold anything. Empty cells beyond the last name are ignored.
        double value = NAN;
        if (index >= cells && c.length == 0) continue;
        if (index >= cells)
            return kn_table_reader_complain(s, s->lines.number, (int)(c.text - line) + 1,
                                            "more cells than the %d names, expected as many%s", cells,
                                            s->of_rows == ',' ? " (are these decimal commas?)" : "");
        if (is_other(s, index, &c)) return KN_EXIT_OK;
        if (slot[index] < 0) continue;
        kn_table_column *column = &s->column[slot[index]];
        const kn_text_cell_content is = kn_text_cell_read(&c, s->of_rows, &value, &s->commas, &s->points);
        numbers += is == KN_CELL_NUMBER;
        if (is == KN_CELL_TEXT && !of_bad) of_bad = column, bad = c;
        if (is == KN_CELL_NUMBER) s->decimal |= is_decimal(&c, ',') || is_decimal(&c, '.');
        if (is == KN_CELL_NUMBER && column->heading.has_unit) value = kn_column_unit_si(&column->heading.unit, value);
        if (is == KN_CELL_NUMBER && fabs(value) > KN_TABLE_MOST)
            return kn_table_reader_complain(s, s->lines.number, (int)(c.text - line) + 1,
                                            "%g in SI units, expected at most %g", value, KN_TABLE_MOST);
        column->value[s->rows] = is == KN_CELL_NUMBER ? value : NAN;
    }
    if (index > s->longest) s->longest = index;
    if (s->of_rows == ' ' && index < cells && numbers > 0 && index > 1)
        return kn_table_reader_complain(
            s, s->lines.number, 1,
            "%d cells below %d names, and blanks do not show which is missing: write nan in "
            "its place",
            index, cells);
    for (; index < cells; index++) // if the row has too few cells, treat the absent cells as missing readings
        if (slot[index] >= 0) s->column[slot[index]].value[s->rows] = NAN;
    if (of_bad) set_aside(s, of_bad, &bad, numbers > 0);
    // skip the row if a requested cell holds text, or if no requested cell holds a number
    if (of_bad || numbers == 0) return KN_EXIT_OK;
    if (s->strange.name) return bad_text(s);
    s->line[s->rows++] = s->lines.number;
    if (s->commas && s->points)
        return kn_table_reader_complain(s, s->lines.number, 1,
                                        "decimal points and decimal commas in one file, expected one of them");
    return KN_EXIT_OK;
}

// Return whether two lines are equal but for separators and blanks at their ends.
static bool is_same_line(const char *a, const char *b)
{
    size_t n = strlen(a), m = strlen(b);
    while (n > 0 && strchr(" \t,;", a[n - 1])) n--;
    while (m > 0 && strchr(" \t,;", b[m - 1])) m--;
    return n == m && !memcmp(a, b, n);
}

// Return whether the line repeats the names of the columns. Some instruments write these names again above each
// interval of a measurement.
static bool is_repeated(kn_table_reader *s, const char *line)
{
    kn_text_cell c;
    int index = 0, same = 0;
    for (const char *at = line; index < s->columns && kn_text_cell_next(s->separator, &at, &c); index++) {
        char text[KN_HEADING_NAME];
        kn_heading h;
        kn_text_cell_text(text, sizeof text, &c);
        kn_heading_read(&h, text);
        same += *h.word && !strcmp(h.word, s->column[index].heading.word);
    }
    if (same < 2 || 2 * same < s->columns) return false;
    if (!s->other_table && !is_same_line(line, s->names_text)) s->other_table = s->lines.number;
    return true;
}

// Return whether a line is no row and can be skipped: repeated names, units below them, a note, a statistic.
static bool is_skipped(kn_table_reader *s, bool *repeated)
{
    const char *text = s->lines.text + strspn(s->lines.text, " \t");
    if (text[strspn(text, " \t,;")] == '\0') return true;
    if (*text == '#' && strncasecmp(text, "#N", 2) != 0) {
        take_note(s);
        return true;
    }
    const bool below = *repeated, words = isalpha((unsigned char)*text) || *text == '"';
    *repeated = words && is_repeated(s, s->lines.text);
    // The names are repeated, so the text above them was the heading of the instrument's next interval and is no error.
    if (*repeated) s->strange.lines = 0, s->strange.name = NULL;
    // "Interval and data points:;2;20" holds numbers, but is no row
    kn_text_cell c;
    const char *at = text;
    const bool label = words && kn_text_cell_next(s->separator, &at, &c) && c.length > 0 && c.text[c.length - 1] == ':';
    const bool units = below && count_cells(text, s->separator).numbers == 0 && is_units(text, s->separator);
    if (units && !s->other_table && s->units_line && !is_same_line(s->lines.text, s->units_text))
        s->other_table = s->lines.number;
    const bool statistic = !*repeated && !units && is_statistic(text, s->of_rows);
    s->statistics += statistic;
    return *repeated || label || units || statistic;
}

int kn_table_reader_read(kn_table_reader *s, int count, const int wanted[])
{
    int slot[KN_TABLE_COLUMNS], code = KN_EXIT_OK;
    int last = s->columns;
    while (last > 1 && !*s->column[last - 1].heading.name) last--;
    const int cells = last ? s->column[last - 1].index + 1 : 0;
    bool repeated = false;
    // slot[i]: the wanted column to which cell i of a row belongs
    for (int i = 0; i < KN_TABLE_COLUMNS; i++) slot[i] = -1;
    for (int i = 0; i < count; i++) slot[s->column[wanted[i]].index] = wanted[i];
    while (code == KN_EXIT_OK && kn_lines_next(&s->lines)) {
        if (is_skipped(s, &repeated)) continue;
        if ((int64_t)(s->rows + 1) * count > KN_TABLE_CELLS)
            return kn_table_reader_complain(s, s->lines.number, 1,
                                            "more than %d rows of %d columns, expected fewer: thin the file, "
                                            "e.g. awk 'NR < 9 || NR %% 10 == 0'",
                                            s->rows, count);
        // Read the row into the next free place.
        if (!grow(s, count, wanted)) return kn_complain(s->subcommand, KN_EXIT_DEVICE, "%s: out of memory", s->file);
        code = take_row(s, cells, slot);
        if (code == KN_EXIT_OK && s->other_table)
            return kn_table_reader_complain(s, s->other_table, 1,
                                            "a second table with other columns or units, expected one table in a file: "
                                            "remove the other");
    }
    if (code == KN_EXIT_OK && *s->lines.error)
        return kn_table_reader_complain(s, s->lines.number, 1, "%s", s->lines.error);
    if (code == KN_EXIT_OK && s->strange.name) return bad_text(s);
    // semicolons separate where a comma is the decimal mark, and a point stands before thousands
    if (code == KN_EXIT_OK && s->rows > 0 && !s->decimal && (s->commas || (s->points && s->of_rows == ';')))
        return kn_table_reader_complain(s, s->line[0], 1,
                                        "every %s stands before three digits, as a thousands separator does: write "
                                        "decimal points, and not three digits behind all of them",
                                        s->commas ? "comma" : "point");
    if (code == KN_EXIT_OK && s->rows > 0 && s->longest < cells)
        return kn_table_reader_complain(s, s->line[0], 1,
                                        "no row has more than %d cells below %d names, so the cells may be shifted "
                                        "against the names, expected as many",
                                        s->longest, cells);
    if (code == KN_EXIT_OK && s->rows == 0 && s->only.left_out > 0)
        return kn_table_reader_complain(s, s->header_line, s->column[s->only.column].at,
                                        "none of the %d rows has the %s '%s', expected rows with it", s->only.left_out,
                                        s->column[s->only.column].heading.name, s->only.text);
    if (code == KN_EXIT_OK && s->rows == 0)
        return kn_table_reader_complain(s, s->header_line, 1, "no numbers below the name %s, expected rows of numbers",
                                        s->column[wanted[0]].heading.name);
    return code;
}
