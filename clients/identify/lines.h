#ifndef KN_CLIENTS_IDENTIFY_LINES_H
#define KN_CLIENTS_IDENTIFY_LINES_H
// The lines of a text file of any size, read in little memory. The text may be UTF-8 with or without a byte order mark,
// Latin-1, or UTF-16, which instruments on Windows write. Lines end with LF, CR LF or CR. A file that contains a NUL
// character or a line of more than KN_LINES_LONGEST characters is no text, so the file is refused.
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#define KN_LINES_LONGEST 65536

typedef struct kn_lines {
    FILE *in;
    int number; // number of the last line read, from 1 on
    char *text; // last line read, without its line end, terminated by NUL; valid until the next line is read
    size_t length;
    char error[100]; // reason why no line could be read; empty: the file has ended
    // private
    char *buffer;
    size_t begin, end; // the unread part of the buffer is buffer[begin..end-1]
    bool filled_once, back_impossible, at_end;
    char ending; // line end: '\n', or '\r' in files of an old Macintosh
    int wide;    // 1: UTF-16 little-endian; 2: UTF-16 big-endian; 0: one byte per character, or UTF-8
} kn_lines;

// Open a file. If the file cannot be read, is a folder or is empty, return false with one clause in l->error.
bool kn_lines_open(kn_lines *l, const char *file);
bool kn_lines_next(kn_lines *l); // read the next line into l->text; return false at the end of the file or on an error
// Go back to the first line. Return false if more than the first 256 kB of the file have been read.
bool kn_lines_rewind(kn_lines *l);
void kn_lines_close(kn_lines *l);

#endif
