// The text of a table: lines, cells and notes. See table_reader.h.
#include "clients/identify/table_reader.h"
#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

// ---- lines of a text file

// size of the buffer [bytes]; the header of a table is searched only in the first buffer of a file
enum { ROOM = 1 << 18 };

static bool fail(kn_lines *l, const char *why)
{
    snprintf(l->error, sizeof l->error, "%s", why);
    l->at_end = true;
    l->begin = l->end;
    return false;
}

// Write one code unit of UTF-16 as UTF-8, at most 3 bytes. Halves of a surrogate pair become '?'.
static size_t put_wide(char *to, unsigned unit)
{
    if (unit >= 0xd800 && unit < 0xe000) unit = '?';
    if (unit < 0x80) return to[0] = (char)unit, 1;
    if (unit < 0x800) {
        to[0] = (char)(0xc0 | unit >> 6);
        to[1] = (char)(0x80 | (unit & 0x3f));
        return 2;
    }
    to[0] = (char)(0xe0 | unit >> 12);
    to[1] = (char)(0x80 | (unit >> 6 & 0x3f));
    to[2] = (char)(0x80 | (unit & 0x3f));
    return 3;
}

// Fill the buffer from a UTF-16 file. A code unit becomes up to 3 bytes, so read a chunk only while the buffer has room
// for all code units of the chunk.
static void fill_wide(kn_lines *l)
{
    unsigned char raw[8192];
    while (l->end + 3 * sizeof raw / 2 <= ROOM) {
        size_t n = fread(raw, 1, sizeof raw, l->in);
        for (size_t i = 0; i + 1 < n; i += 2)
            l->end += put_wide(l->buffer + l->end,
                               l->wide == 1 ? raw[i] | (unsigned)raw[i + 1] << 8 : raw[i + 1] | (unsigned)raw[i] << 8);
        if (n < sizeof raw) {
            l->at_end = true;
            return;
        }
    }
}

static void fill_bytes(kn_lines *l)
{
    size_t n = fread(l->buffer + l->end, 1, ROOM - l->end, l->in);
    l->at_end = l->end + n < ROOM;
    l->end += n;
}

// Recognise the encoding and the line ending from the first buffer.
static void recognise(kn_lines *l)
{
    const unsigned char *b = (const unsigned char *)l->buffer;
    // The file begins with a byte order mark of UTF-16. Read the file again, from the first byte after the mark.
    if (l->end >= 2 && ((b[0] == 0xff && b[1] == 0xfe) || (b[0] == 0xfe && b[1] == 0xff))) {
        l->wide = b[0] == 0xff ? 1 : 2;
        l->at_end = false;
        l->begin = l->end = 0;
        if (fseek(l->in, 2, SEEK_SET) == 0) fill_wide(l);
    } else if (l->end >= 3 && !memcmp(b, "\xef\xbb\xbf", 3)) {
        l->begin = 3;
    }
    l->ending = memchr(l->buffer, '\n', l->end) || !memchr(l->buffer, '\r', l->end) ? '\n' : '\r';
}

// Move the unread part to the front of the buffer and fill up the rest.
static void fill(kn_lines *l)
{
    if (l->begin > 0) l->back_impossible = true;
    memmove(l->buffer, l->buffer + l->begin, l->end - l->begin);
    l->end -= l->begin;
    l->begin = 0;
    if (l->wide) fill_wide(l);
    else fill_bytes(l);
    if (!l->filled_once) recognise(l);
    l->filled_once = true;
    if (ferror(l->in)) fail(l, strerror(errno));
}

bool kn_lines_open(kn_lines *l, const char *file)
{
    struct stat is;
    memset(l, 0, sizeof *l);
    if (!(l->in = fopen(file, "rb"))) return fail(l, strerror(errno));
    if (fstat(fileno(l->in), &is) == 0 && S_ISDIR(is.st_mode)) return fail(l, "is a folder, expected a file");
    l->buffer = malloc(ROOM);
    l->text = malloc(KN_LINES_LONGEST + 1);
    if (!l->buffer || !l->text) return fail(l, "out of memory");
    fill(l);
    if (*l->error) return false;
    return l->end > l->begin ? true : fail(l, "is empty, expected a table");
}

void kn_lines_close(kn_lines *l)
{
    if (l->in) fclose(l->in);
    free(l->buffer);
    free(l->text);
    l->in = NULL;
    l->buffer = l->text = NULL;
}

bool kn_lines_rewind(kn_lines *l)
{
    if (l->back_impossible || *l->error) return false;
    l->begin = !l->wide && l->end >= 3 && !memcmp(l->buffer, "\xef\xbb\xbf", 3) ? 3 : 0;
    l->number = 0;
    return true;
}

// Read the next line. If the unread part has no line end, fill the buffer once before taking the rest as a line.
bool kn_lines_next(kn_lines *l)
{
    char *end = l->begin < l->end ? memchr(l->buffer + l->begin, l->ending, l->end - l->begin) : NULL;
    if (!end && !l->at_end) {
        fill(l);
        end = memchr(l->buffer + l->begin, l->ending, l->end - l->begin);
    }
    if (l->begin == l->end) return false;
    const char *line = l->buffer + l->begin;
    const size_t length_all = (size_t)((end ? end : l->buffer + l->end) - line);
    size_t length = length_all;
    l->number++;
    if (length > KN_LINES_LONGEST) return fail(l, "a line of more than 65536 characters, expected a table");
    if (memchr(line, 0, length)) return fail(l, "a byte 0, expected text: save it as UTF-8");
    l->begin += length_all + (end != NULL);
    while (length > 0 && (line[length - 1] == '\r' || line[length - 1] == '\n')) length--;
    memcpy(l->text, line, length);
    l->text[length] = '\0';
    return true;
}

// ---- cells of a line

bool kn_text_cell_next(char separator, const char **at, kn_text_cell *c)
{
    if (!*at) return false;
    const char *p = *at + strspn(*at, separator == '\t' ? " " : " \t"), *end;
    c->quoted = *p == '"';
    c->text = p + c->quoted;
    // A quoted cell ends at the quote before the next separator. A quote inside it may be doubled, or the inch sign.
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
    // Strip blanks at the end of the cell and step over the separator. At the end of the line, an empty cell follows a
    // separator other than a blank.
    while (c->length > 0 && isspace((unsigned char)c->text[c->length - 1])) c->length--;
    if (separator == ' ') p += strspn(p, " \t");
    else if (*p) p++;
    else p = NULL;
    *at = p && (separator != ' ' || *p) ? p : NULL;
    return true;
}

kn_text_cell_content kn_text_cell_read(const kn_text_cell *c, char separator, double *value, bool *comma, bool *dot)
{
    static const char *const missing[] = {"-",    "--",  "---",  "nan",  "na",      "n/a",
                                          "#n/a", "#na", "null", "none", "#div/0!", "?"};
    char text[64];
    if (c->length == 0) return KN_CELL_MISSING;
    const bool may = separator != ',' || c->quoted;
    if (c->length >= (int)sizeof text) return KN_CELL_TEXT;
    snprintf(text, sizeof text, "%.*s", c->length, c->text);
    for (size_t i = 0; i < sizeof missing / sizeof *missing; i++)
        if (!strcasecmp(text, missing[i])) return KN_CELL_MISSING;
    // A cell with characters that numbers do not contain is text. Turn a decimal comma into a point for strtod.
    if (strspn(text, "+-0123456789.,eE") != (size_t)c->length || !strpbrk(text, "0123456789")) return KN_CELL_TEXT;
    char *mark = may && !strchr(text, '.') ? strchr(text, ',') : NULL, *end;
    if (mark) *mark = '.', *comma = true;
    else if (strchr(text, '.')) *dot = true;
    *value = strtod(text, &end);
    return *end == '\0' && isfinite(*value) ? KN_CELL_NUMBER : KN_CELL_TEXT;
}

void kn_text_cell_text(char *to, size_t size, const kn_text_cell *c)
{
    size_t n = 0;
    for (int i = 0; i < c->length && n + 1 < size; i++) {
        if (c->quoted && c->text[i] == '"' && i + 1 < c->length && c->text[i + 1] == '"') i++;
        to[n++] = c->text[i];
    }
    to[n] = '\0';
    kn_text_clean(to);
}

// ---- notes in a file

bool kn_note_read(const char *text, int line, kn_note *note)
{
    const char *key = text + strspn(text, "# \t"), *mark = strpbrk(key, ":=");
    if (!mark || mark == key || mark - key >= (int)sizeof note->key) return false;
    const char *value = mark + 1 + strspn(mark + 1, " \t");
    *note = (kn_note){.line = line, .at = (int)(value - text) + 1};
    int n = 0, words = 1;
    // Copy the key in small letters and count its words.
    for (const char *p = key; p < mark; p++) {
        note->key[n++] = (char)tolower((unsigned char)*p);
        words += *p == ' ' && p[1] != ' ' && p + 1 < mark;
    }
    while (n > 0 && isspace((unsigned char)note->key[n - 1])) n--;
    note->key[n] = '\0';
    // spreadsheets fill up lines with separators, so end the value at the first separator
    size_t length = strcspn(value, ";\t");
    while (length > 0 && strchr(" ,", value[length - 1])) length--;
    snprintf(note->value, sizeof note->value, "%.*s", (int)length, value);
    kn_text_clean(note->value);
    return words <= 3 && *note->value;
}
