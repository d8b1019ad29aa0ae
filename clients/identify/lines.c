#include "clients/identify/lines.h"
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

// size of the buffer [bytes]; the header of a table is searched only in the first buffer of a file
enum { ROOM = 1 << 18 };

static bool fail(kn_lines *l, const char *why)
{
    snprintf(l->error, sizeof l->error, "%s", why);
    l->at_end = true;
    l->begin = l->end;
    return false;
}

// Write one unit of UTF-16 as UTF-8, at most 3 bytes. Halves of a surrogate pair become '?', since no name or unit
// contains one.
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

// Fill the buffer from a UTF-16 file, as long as a whole chunk fits even at 3 bytes per unit.
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
    // A byte order mark of UTF-16: read the file again from there.
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

// Read the next line. If the unread part of the buffer has no line end, fill the buffer once before taking the rest as
// a line.
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
    if (memchr(line, 0, length)) return fail(l, "a byte 0, expected text");
    l->begin += length_all + (end != NULL);
    while (length > 0 && (line[length - 1] == '\r' || line[length - 1] == '\n')) length--;
    memcpy(l->text, line, length);
    l->text[length] = '\0';
    l->length = length;
    return true;
}
