#ifndef KN_CLIENTS_IDENTIFY_SHEET_H
#define KN_CLIENTS_IDENTIFY_SHEET_H
// A table out of a text file as instruments and spreadsheets write it: columns of numbers with names and units, and the
// number of each row's line.
//
//     notes, anything                        before the table; skipped
//     # load: 50 gf                          a note that is read, also below and within the table
//     time [s];height [mm];status            names with units (heading.h), or names alone and
//     s;mm;                                  units in a row of their own below them
//     0,3;9,96;M-                            rows; a column that nobody wants may hold anything
//
// Separated by tabs, semicolons, commas or blanks, whichever the names have, in that order; a decimal comma where the
// separator is none, and in "0,5". A reading is missing where its cell is empty, -, nan, NA or #N/A. Names that come
// again, with their units, as above an instrument's next interval, are skipped, and so is text before them.
//
// Every function that can fail does so after one line of complaint, with an exit code.
#include "clients/identify/heading.h"
#include "clients/identify/lines.h"
#include "clients/identify/note.h"

#define KN_SHEET_COLUMNS 128
#define KN_SHEET_NOTES 32
#define KN_SHEET_CELLS (1 << 26) // numbers in memory, 512 MB; more is refused
#define KN_SHEET_MOST 1e30 // of a number in SI, far beyond anything on a bench; sums and quotients of such are numbers

typedef struct kn_sheet_column {
    kn_heading heading;
    int at;        // where its name stands: the character of that line, 1..
    int index;     // cell of a row, 0..
    double *value; // of each row, SI; NAN: missing; NULL: not asked for
} kn_sheet_column;

typedef struct kn_sheet {
    const char *file, *subcommand;
    int columns, rows;
    kn_sheet_column column[KN_SHEET_COLUMNS];
    int *line; // of each row
    int notes;
    kn_note note[KN_SHEET_NOTES];
    int header_line;
    bool commas; // were decimal ones
    struct {     // rows of a table of several things; NULL: all
        const char *text;
        int column;   // in which it stands
        int left_out; // rows with another text
    } only;
    // private
    kn_lines lines;
    char separator, of_rows;
    int room;
    bool points;             // were decimal ones
    struct {                 // text in a number's place, until it is known whether the names come again below it
        int lines, line, at; // lines: without any number
        char text[32];
        const char *name; // of the column; NULL: nothing is strange
    } strange;
} kn_sheet;

// Up to the names. units: "time=s,modulus=Pa", for columns whose names have none; NULL: none.
int kn_sheet_open(kn_sheet *s, const char *file, const char *units, const char *subcommand);

// The rest: rows of the columns wanted[]. A cell of them that is no number is an error. `only` is set before it, or not
// at all.
int kn_sheet_read(kn_sheet *s, int count, const int wanted[]);

// The value of a note, SI, in the dimension of unit; *value is left alone where there is none. Keys in small letters.
int kn_sheet_note_take(const kn_sheet *s, const char *key, const char *unit, double *value);

// Where a column's cell begins in a line: the character, 1..; 1 where the file cannot be read again, as a pipe.
int kn_sheet_at(const kn_sheet *s, int line, int column);

// file:line:at: what is wrong
__attribute__((format(printf, 4, 5))) int kn_sheet_complain(const kn_sheet *s, int line, int at, const char *format,
                                                            ...);
void kn_sheet_close(kn_sheet *s);

#endif
