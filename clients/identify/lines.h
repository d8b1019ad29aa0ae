#ifndef KN_CLIENTS_IDENTIFY_LINES_H
#define KN_CLIENTS_IDENTIFY_LINES_H
// The lines of a text file of any size, read in little memory. The text may be UTF-8 with or without a byte order mark,
// Latin-1, or UTF-16, which instruments on Windows write. Lines end with LF, CR LF or CR. A file with a NUL or with a
// line of more than KN_LINES_LONGEST characters is refused, since it is no text.
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#define KN_LINES_LONGEST 65536

typedef struct kn_lines {
    FILE *in;
    int number; // number of the last line read, 1..
    char *text; // the last line without its line end, terminated by NUL; valid until the next read
    size_t length;
    char error[100]; // why no line could be read; empty: the file has ended
    // private
    char *buffer;
    size_t begin, end; // the unread part of the buffer
    bool filled_once, back_impossible, at_end;
    char ending; // line end: '\n', or '\r' in files of an old Macintosh
    int wide;    // UTF-16: 1 little endian, 2 big endian; 0: bytes
} kn_lines;

// Open a file. Return false with one clause in error if it cannot be read, is a folder or is empty.
bool kn_lines_open(kn_lines *l, const char *file);
bool kn_lines_next(kn_lines *l);
bool kn_lines_rewind(kn_lines *l); // go back to the first line; false if more than the first 256 kB have been read
void kn_lines_close(kn_lines *l);

#endif
