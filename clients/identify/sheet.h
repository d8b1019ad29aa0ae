#ifndef KN_CLIENTS_IDENTIFY_SHEET_H
#define KN_CLIENTS_IDENTIFY_SHEET_H
// A table of columns of numbers, read from a text file as instruments and spreadsheets write it. Each column has a name
// and a unit. Each row remembers its line number in the file.
//
//     notes, anything                        before the table; skipped
//     # load: 50 gf                          a note that is read, also below and within the table
//     time [s];height [mm];status            names with units (heading.h), or names alone and
//     s;mm;                                  units in a row of their own below them
//     0,3;9,96;M-                            rows; a column that nobody wants may hold anything
//
// Cells are separated by tabs, semicolons, commas or blanks: the first separator in this order that the line of names
// contains. Decimal commas are read if the separator is not a comma, and in quoted cells like "0,5". A reading is
// missing if its cell is empty, -, nan, NA or #N/A. Instruments repeat the names and units above each of their
// intervals. Repeated names, their units and the text before them are skipped.
//
// Every function that can fail prints one line of complaint and returns an exit code.
#include "clients/identify/heading.h"
#include "clients/identify/lines.h"
#include "clients/identify/note.h"

#define KN_SHEET_COLUMNS 128
#define KN_SHEET_NOTES 32
#define KN_SHEET_CELLS (1 << 26) // numbers in memory, 512 MB; a larger table is refused
// largest magnitude of a number in SI, far beyond any bench; sums and quotients of such numbers stay finite
#define KN_SHEET_MOST 1e30

typedef struct kn_sheet_column {
    kn_heading heading;
    int at;        // position of the name in its line, in characters, 1..
    int index;     // index of the column's cell in a row, 0..
    double *value; // one per row, SI; NAN: missing; NULL: column not asked for
} kn_sheet_column;

typedef struct kn_sheet {
    const char *file, *subcommand;
    int columns, rows;
    kn_sheet_column column[KN_SHEET_COLUMNS];
    int *line; // line number of each row
    int notes;
    kn_note note[KN_SHEET_NOTES];
    int header_line;
    bool commas; // decimal commas were found
    // Row filter for a table with rows of several tools: only rows whose cell in `column` equals `text` are read.
    // `text` NULL: all rows are read.
    struct {
        const char *text;
        int column;   // the column that holds the text
        int left_out; // number of rows with another text
    } only;
    // private
    kn_lines lines;
    // separator: of the line of names; of_rows: of the rows, which may differ
    char separator, of_rows;
    int room;
    bool points; // decimal points were found
    // Text found in place of a number. The text is an error unless the line of names is repeated below it.
    struct {
        int lines, line, at; // lines: number of lines with such text and without any number
        char text[32];
        const char *name; // name of the column; NULL: no such text so far
    } strange;
} kn_sheet;

// Open the file and read up to the names. units: "time=s,modulus=Pa", for columns whose names have no unit; NULL: none.
int kn_sheet_open(kn_sheet *s, const char *file, const char *units, const char *subcommand);

// Read the remaining rows of the columns wanted[]. A cell of these columns that is not a number is an error. Set `only`
// before this call, or not at all.
int kn_sheet_read(kn_sheet *s, int count, const int wanted[]);

// Read the value of a note, SI, in the dimension of `unit`. If there is no such note, *value is unchanged. `key` is in
// small letters.
int kn_sheet_note_take(const kn_sheet *s, const char *key, const char *unit, double *value);

// Return the position of a column's cell in a line, in characters, from 1 on. Return 1 if the file cannot be read a
// second time, as with a pipe.
int kn_sheet_at(const kn_sheet *s, int line, int column);

// Complain as "file:line:at: what is wrong".
__attribute__((format(printf, 4, 5))) int kn_sheet_complain(const kn_sheet *s, int line, int at, const char *format,
                                                            ...);
void kn_sheet_close(kn_sheet *s);

#endif
