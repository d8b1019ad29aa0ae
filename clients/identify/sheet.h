#ifndef KN_CLIENTS_IDENTIFY_SHEET_H
#define KN_CLIENTS_IDENTIFY_SHEET_H
// A table of columns of numbers, read from a text file as instruments and spreadsheets write it. Each column has a name
// and a unit. Each row remembers its line number in the file.
//
//     notes, anything                        before the table; skipped
//     # load: 50 gf                          a note (note.h), which is read anywhere in the file
//     time [s];height [mm];status            names with units (heading.h), or names alone and
//     s;mm;                                  units in a row of their own below them
//     0,3;9,96;M-                            a row; a column that is not requested may hold any text
//
// Cells are separated by tabs, semicolons, commas or blanks: the first separator in this order that the line of names
// contains. Decimal commas are read if the separator is not a comma, and in quoted cells like "0,5". A reading is
// missing if its cell is empty, -, nan, NA or #N/A. Instruments repeat the names and units above each interval of a
// measurement. Repeated names, the units below them and the text above them are skipped.
//
// Every function that can fail returns 0, or prints an error of one line and returns an exit code.
#include "clients/identify/heading.h"
#include "clients/identify/lines.h"
#include "clients/identify/note.h"

#define KN_SHEET_COLUMNS 128
#define KN_SHEET_NOTES 32
#define KN_SHEET_CELLS (1 << 26) // largest number of cells in memory (512 MB); a larger table is refused
// largest magnitude of a number in SI units, far beyond any measurement; sums and quotients of such numbers stay finite
#define KN_SHEET_MOST 1e30

typedef struct kn_sheet_column {
    kn_heading heading;
    int at;        // position of the column's name in the line of names, in characters from 1 on
    int index;     // index of the column's cell in a row, from 0 on
    double *value; // [rows] numbers of the column in SI units; NAN: missing; NULL: the column was not requested
} kn_sheet_column;

typedef struct kn_sheet {
    const char *file, *subcommand;
    int columns, rows;
    kn_sheet_column column[KN_SHEET_COLUMNS];
    int *line; // [rows] line number of each row in the file
    int notes; // number of notes
    kn_note note[KN_SHEET_NOTES];
    int header_line; // line number of the line of names
    bool commas;     // numbers with decimal commas were found
    // Filter for a table with rows of several tools: only rows whose cell in the column `column` equals `text` are
    // read. If `text` is NULL, all rows are read.
    struct {
        const char *text;
        int column;   // the column that holds the text
        int left_out; // number of rows that were not read, since their cell differs from `text`
    } only;
    // private
    kn_lines lines;
    // separator: separator in the line of names; of_rows: separator in the rows, which may be another one
    char separator, of_rows;
    int room;    // number of rows for which memory is allocated
    bool points; // numbers with decimal points were found
    // The first text found in place of a number. The text is an error unless the line of names is repeated below it.
    struct {
        // lines: number of lines with text in place of a number and without any number; line, at: line number of the
        // first text, and its position in that line
        int lines, line, at;
        char text[32];
        const char *name; // name of the column that holds the text; NULL: no text was found in place of a number
    } strange;
} kn_sheet;

// Open the file and read it up to the line of names. `units` gives the units of columns whose names have no unit, such
// as "time=s,modulus=Pa"; NULL: not given. `subcommand` is named in error messages.
int kn_sheet_open(kn_sheet *s, const char *file, const char *units, const char *subcommand);

// Read the columns wanted[] of all rows. A cell of these columns that is not a number is an error. If only some rows
// are to be read, set s->only before this call.
int kn_sheet_read(kn_sheet *s, int count, const int wanted[]);

// Set *value to the value of the note `key`, converted to SI. The value must have the dimension of `unit`. `key` is in
// small letters. If the sheet has no note with this key, *value is unchanged.
int kn_sheet_note_take(const kn_sheet *s, const char *key, const char *unit, double *value);

// Return the position of a column's cell in a line of the file, in characters from 1 on. Return 1 if the file cannot be
// read a second time, as with a pipe.
int kn_sheet_at(const kn_sheet *s, int line, int column);

// Print an error as "file:line:at: message" and return an exit code.
__attribute__((format(printf, 4, 5))) int kn_sheet_complain(const kn_sheet *s, int line, int at, const char *format,
                                                            ...);
void kn_sheet_close(kn_sheet *s);

#endif
