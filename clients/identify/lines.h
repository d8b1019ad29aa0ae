#ifndef KN_CLIENTS_IDENTIFY_LINES_H
#define KN_CLIENTS_IDENTIFY_LINES_H
// The lines of a text file of any size, in little memory: UTF-8, with or without its mark, Latin-1, or UTF-16, which
// instruments on Windows write; ended by LF, CR LF or CR. What is no text is refused: a line of more than
// KN_LINES_LONGEST characters, a NUL.
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#define KN_LINES_LONGEST 65536

typedef struct kn_lines {
    FILE *in;
    int number; // of the line that was read last, 1..
    char *text; // that line without its end, NUL after it; until the next is read
    size_t length;
    char error[100]; // why there is none any more; empty: the file ends there
    // private
    char *buffer;
    size_t begin, end; // of what is unread in it
    bool filled_once, back_impossible, at_end;
    char ending; // '\n', or '\r' of an old Macintosh
    int wide;    // UTF-16: 1 little end first, 2 big end first; 0: bytes
} kn_lines;

// False and one clause in error: cannot be read, is a folder, is empty.
bool kn_lines_open(kn_lines *l, const char *file);
bool kn_lines_next(kn_lines *l);
bool kn_lines_rewind(kn_lines *l); // to the first line; false once more than the first 256 kB have been read
void kn_lines_close(kn_lines *l);

#endif
