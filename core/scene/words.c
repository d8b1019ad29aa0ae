#include "core/scene/mesh_file.h"

#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Read a whole file. The buffer grows during reading, because a pipe does not tell its size in advance.
static unsigned char *read_all(FILE *file, size_t *size)
{
    unsigned char *bytes = NULL;
    size_t room = 0;
    for (*size = 0; *size <= KN_WORDS_MAX_BYTES && !feof(file) && !ferror(file);) {
        room = room ? 2 * room : 1 << 16;
        unsigned char *more = realloc(bytes, room);
        if (!more) break;
        bytes = more;
        *size += fread(bytes + *size, 1, room - *size, file);
    }
    if (feof(file) && *size <= KN_WORDS_MAX_BYTES) return bytes;
    // set errno for the error message: the file is too large, or memory is short
    if (!ferror(file)) errno = *size > KN_WORDS_MAX_BYTES ? EFBIG : ENOMEM;
    free(bytes);
    return NULL;
}

unsigned char *kn_words_load(const char *path, size_t *size, char *error, size_t error_size)
{
    FILE *file = fopen(path, "rb");
    unsigned char *bytes = file ? read_all(file, size) : NULL;
    if (!bytes) snprintf(error, error_size, "%s:1:1: %s, expected a file of at most 256 MiB", path, strerror(errno));
    if (file) fclose(file);
    return bytes;
}

bool kn_words_complain(kn_words *w, size_t at, const char *format, ...)
{
    char what[512], byte[40] = "";
    int line = 1, col = 1;
    // in a text file, count the lines up to the byte at `at`
    for (size_t i = 0; i < at && i < w->size && !w->binary; i++) {
        col = w->bytes[i] == '\n' ? 1 : col + 1;
        line += w->bytes[i] == '\n';
    }
    if (w->binary) snprintf(byte, sizeof byte, "byte %zu: ", at);
    va_list args;
    va_start(args, format);
    vsnprintf(what, sizeof what, format, args);
    va_end(args);
    snprintf(w->error, w->error_size, "%s:%d:%d: %s%s", w->name, line, col, byte, what);
    return false;
}

static bool is_space(unsigned char c) { return c == ' ' || c == '\n' || c == '\t' || c == '\r'; }

size_t kn_words_next(kn_words *w, char text[KN_WORD_MAX])
{
    while (w->at < w->size && is_space(w->bytes[w->at])) w->at++;
    w->begun = w->at;
    // cut a word that is too long for the buffer, but return the length of the whole word
    while (w->at < w->size && !is_space(w->bytes[w->at])) w->at++;
    size_t length = w->at - w->begun, kept = length < KN_WORD_MAX ? length : KN_WORD_MAX - 1;
    memcpy(text, w->bytes + w->begun, kept);
    text[kept] = '\0';
    return length;
}

// Report that the file ends too early.
static bool ended(kn_words *w, const char *what)
{
    return kn_words_complain(w, w->size, "the file ends within %s, expected %s", w->section, what);
}

// Copy the next bytes of a binary file to `value`.
static bool raw(kn_words *w, void *value, size_t bytes, const char *what)
{
    w->begun = w->at;
    if (w->size - w->at < bytes) return ended(w, what);
    memcpy(value, w->bytes + w->at, bytes);
    w->at += bytes;
    return true;
}

// Read an integer that is written as text. It may have at most 18 digits, so that it fits a long.
static bool written_integer(kn_words *w, long *value, const char *what)
{
    char text[KN_WORD_MAX];
    if (kn_words_next(w, text) == 0) return ended(w, what);
    const char *digits = text + (*text == '-');
    size_t count = strspn(digits, "0123456789");
    if (count == 0 || count > 18 || digits[count] != '\0')
        return kn_words_complain(w, w->begun, "not a whole number, expected %s", what);
    *value = strtol(text, NULL, 10);
    return true;
}

// Read an integer of 4 or 8 bytes from a binary file.
static bool raw_integer(kn_words *w, kn_width width, long *value, const char *what)
{
    int32_t narrow = 0;
    int64_t wide = 0;
    if (!raw(w, width == KN_WIDTH_INT ? (void *)&narrow : (void *)&wide, (size_t)width, what)) return false;
    *value = width == KN_WIDTH_INT ? (long)narrow : (long)wide;
    return true;
}

bool kn_words_integer(kn_words *w, kn_width width, long least, long most, long *value, const char *what)
{
    if (!(w->binary ? raw_integer(w, width, value, what) : written_integer(w, value, what))) return false;
    if (*value >= least && *value <= most) return true;
    if (most == LONG_MAX) return kn_words_complain(w, w->begun, "%ld, expected %s, at least %ld", *value, what, least);
    return kn_words_complain(w, w->begun, "%ld, expected %s, %ld to %ld", *value, what, least, most);
}

bool kn_words_real(kn_words *w, double *value)
{
    char text[KN_WORD_MAX], *end = text;
    if (w->binary) {
        if (!raw(w, value, sizeof *value, "a coordinate")) return false;
    } else {
        size_t length = kn_words_next(w, text);
        if (length == 0) return ended(w, "a coordinate");
        // a word that is not a number, or is longer than KN_WORD_MAX - 1 characters, counts as NaN
        *value = length < KN_WORD_MAX ? strtod(text, &end) : NAN;
        if (end == text || *end != '\0') *value = NAN;
    }
    return isfinite(*value) || kn_words_complain(w, w->begun, "not a finite number, expected a coordinate");
}

bool kn_words_room(kn_words *w, long count, size_t each, const char *what)
{
    // divide instead of multiplying, because count * each might overflow
    size_t left = (w->size - w->at) / each;
    if (count >= 0 && (size_t)count <= left) return true;
    return kn_words_complain(w, w->begun, "%ld %s are declared, but the file has room for %zu at most", count, what,
                             left);
}

bool kn_words_line_end(kn_words *w)
{
    if (!w->binary) return true;
    // skip one line end, "\n" or "\r\n", and no more: the binary data behind it may begin with the code of white space
    if (w->at < w->size && w->bytes[w->at] == '\r') w->at++;
    if (w->at < w->size && w->bytes[w->at++] == '\n') return true;
    return kn_words_complain(w, w->at, "expected the end of the line here");
}

bool kn_words_section_end(kn_words *w)
{
    // the end of "$Nodes" is "$EndNodes"
    char text[KN_WORD_MAX], end[KN_WORD_MAX];
    snprintf(end, sizeof end, "$End%s", w->section + 1);
    if (kn_words_next(w, text) > 0 && strcmp(text, end) == 0) return true;
    return kn_words_complain(w, w->begun, "expected %s after the declared items", end);
}
