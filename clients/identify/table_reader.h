#ifndef KN_CLIENTS_IDENTIFY_TABLE_READER_H
#define KN_CLIENTS_IDENTIFY_TABLE_READER_H
// A table of columns of numbers, read from a text file as instruments and spreadsheets write it. Each column has a name
// and a unit. Each row remembers its line number in the file.
//
//     notes, anything                        before the table; skipped
//     # load: 50 gf                          a note, which is read anywhere in the file
//     time [s];height [mm];status            names with units (kn_heading_read), or names alone and
//     s;mm;                                  units in a row of their own below them
//     0,3;9,96;M-                            a row; a column that is not requested may hold any text
//
// The names are in the last line of words before the first row of numbers, or above it if it holds units. A comment
// such as "# time height" (numpy) holds them only if no other line can. Shorter rows lack readings at their end. If all
// rows are shorter, or if blanks separate, they may be shifted against the names: the file is refused.
//
// Cells are separated by tabs, semicolons, commas or blanks: the first separator in this order that the line of names
// contains. Decimal commas are read if the separator is not a comma, and in quoted cells like "0,5". A reading is
// missing if its cell is empty, -, nan, NA or #N/A. Names and units that an instrument repeats above each interval, the
// text above them and rows of statistics are skipped.
#include "core/scene/units.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

// ---- the lines of a text file of any size, read in little memory (text_table.c)
//
// The text may be UTF-8 with or without a byte order mark, Latin-1, or UTF-16, which instruments on Windows write.
// Lines end with LF, CR LF or CR. A file that contains a NUL character or a line of more than KN_LINES_LONGEST
// characters is no text, so the file is refused.

#define KN_LINES_LONGEST 65536

typedef struct kn_lines {
    FILE *in;
    int number;      // number of the last line read, from 1 on
    char *text;      // last line read, without its line end, terminated by NUL; valid until the next line is read
    char error[100]; // reason why no line could be read; empty: the file has ended
    // the next fields are private to text_table.c
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

// ---- the cells of one line, and the numbers in the cells (text_table.c)

typedef struct kn_text_cell {
    const char *text; // points into the line of the table, past blanks and an opening quote; not terminated by NUL
    int length;
    bool quoted;
} kn_text_cell;

typedef enum kn_text_cell_content { KN_CELL_NUMBER, KN_CELL_MISSING, KN_CELL_TEXT } kn_text_cell_content;

// Read the cell at *at. Move *at to the next cell, or set *at to NULL after the last cell. Return false at the end of
// the line. The separator ' ' stands for any number of blanks or tabs. If a line ends with any other separator, an
// empty cell follows that separator.
bool kn_text_cell_next(char separator, const char **at, kn_text_cell *cell);

// Read the number in a cell. Set *comma if the number has a decimal comma, and *point if it has a decimal point. If the
// separator is a comma, a comma is a decimal comma only in a quoted cell.
kn_text_cell_content kn_text_cell_read(const kn_text_cell *cell, char separator, double *value, bool *comma,
                                       bool *point);

// Copy the cell's text to `to`, shortened to `size` bytes. Doubled quotes within quotes become one quote. Control
// characters become '?'.
void kn_text_cell_text(char *to, size_t size, const kn_text_cell *cell);

// A note: a line in a file of measurements that applies to the whole table, such as "# load: 50 gf" or "# load = 50
// gf".
typedef struct kn_note {
    char key[32], value[64]; // for example key "load" and value "50 gf"; the key is in small letters
    int line, at;            // line number of the value, and position of its first character in that line, from 1
} kn_note;

// Read a note. Return false if the line is not a note. A key has at most three words, so that a sentence with a colon
// is not taken for a note.
bool kn_note_read(const char *text, int line, kn_note *note);

// ---- the name of a column and its unit (column_quantity.c)
//
// Parse the name and unit above a column of numbers, and quantities in notes, in the spellings of instruments and
// people:
//
//     time_s   time (s)   time [s]   t / s   Time, s   Strain %   displacement_mm 10 gf   ω [rad/s]   G' (kPa)
//
// The known units are those of core/scene/units.h, and min, h, sec, %, percent, kHz, mPa, GPa, kN, uN, bar and dyn. The
// unit `-` or `1` means that the quantity has no dimension. Powers may be written with ², ^2 or 2, products with ·, .
// or *, and micro as µ. After an underscore a unit may be in small letters, since _pa can only mean Pa.

#define KN_HEADING_NAME 80

// A unit. A number in this unit is number * times / over in SI units. Two factors are kept, since 5/1000 is exactly
// 0.005 but 5 * 0.001 need not be.
typedef struct kn_column_unit {
    kn_unit dimension; // of this struct, only the powers of m, kg, s and rad are used
    double times, over;
} kn_column_unit;

typedef struct kn_heading {
    char name[KN_HEADING_NAME]; // name as written in the file, without the unit
    // the name in a form for comparison: small letters, single blanks between words, Greek letters spelt out, primes
    // as '
    char word[KN_HEADING_NAME];
    char unit_text[KN_HEADING_NAME]; // unit as written in the file; empty: the heading has no unit
    bool has_unit;
    kn_column_unit unit;
    int role; // 1 + the quantity that --column gives the column; 0: its name says what it holds
} kn_heading;

// Parse a unit. If the unit is unknown, return false and write one clause to `error`, which may be NULL.
bool kn_column_unit_parse(kn_column_unit *m, const char *text, char *error, size_t error_size);
// Return whether `m` has the dimension of `unit`, such as "Pa"; "1" means no dimension.
bool kn_column_unit_is(const kn_column_unit *m, const char *unit);
double kn_column_unit_si(const kn_column_unit *m, double number); // return a number in the unit `m` converted to SI

void kn_heading_read(kn_heading *h, const char *text); // parse a heading; the name is always set and may be empty

// Read a quantity like "50 gf", "0,5 cm", "10 %" or "1 min" and convert it to SI. The quantity must have the dimension
// of `unit`. A number without a unit is accepted only if `unit` is "1". If `unit` is "N", a mass is read as its weight:
// "50 g" is 50 gf. On failure return false with one clause in `error`.
bool kn_heading_quantity(const char *text, const char *unit, double *value, char *error, size_t error_size);

// Replace control characters by '?', since names and notes are shown on terminals.
void kn_text_clean(char *text);

// ---- the table
//
// Every function that can fail returns 0, or prints an error of one line and returns an exit code.

#define KN_TABLE_COLUMNS 128
#define KN_TABLE_NOTES 32
#define KN_TABLE_CELLS (1 << 26) // largest number of cells in memory (512 MB); a larger table is refused
// largest magnitude of a number in SI units, far beyond any measurement; sums and quotients of such numbers stay finite
#define KN_TABLE_MOST 1e30

typedef struct kn_table_column {
    kn_heading heading;
    int at;        // position of the column's name in the line of names, counted in characters, starting at 1
    int index;     // index of the column's cell in a row, from 0 on
    double *value; // [rows] numbers of the column in SI units; NAN: missing; NULL: the column was not requested
} kn_table_column;

typedef struct kn_table_reader {
    const char *file, *subcommand;
    int columns, rows;
    kn_table_column column[KN_TABLE_COLUMNS];
    int *line; // [rows] line number of each row in the file
    int notes; // number of notes
    kn_note note[KN_TABLE_NOTES];
    // lines that hold the names and the units, counted from 1; 0: there is no such line
    int header_line, units_line;
    bool commas;    // numbers with decimal commas were found
    int statistics; // number of rows that were left out, since they hold means or other statistics
    // Filter for a table with rows of several tools: only rows whose cell in the column `column` equals `text` are
    // read. If `text` is NULL, all rows are read.
    struct {
        const char *text;
        int column;   // the column that holds the text
        int left_out; // number of rows that were not read, since their cell differs from `text`
    } only;
    // the next fields are private to table_reader.c
    kn_lines lines;
    // of_rows: separator in the rows; separator: separator in the line of names. The two may differ.
    char separator, of_rows;
    int room;        // number of rows for which memory is allocated
    int longest;     // number of cells of the longest row
    bool points;     // numbers with decimal points were found
    bool decimal;    // a comma was found that can be no thousands separator
    int other_table; // line that repeats most of the names, but not all, or with other units; 0: none
    char names_text[4096], units_text[4096]; // the lines of names and units
    // The first text found in place of a number. If the line of names is repeated below the text, the text is no error.
    struct {
        // lines: number of lines with text in place of a number and without any number; line, at: line number of the
        // first text, and its position in that line
        int lines, line, at;
        char text[32];
        const char *name; // name of the column in which the text was found; NULL: no text was found
    } strange;
} kn_table_reader;

// Open the file and read it up to the line of names. `units` gives the units of columns whose names have no unit, such
// as "time=s,modulus=Pa", and `roles` says what columns hold, such as "Crosshead=displacement"; NULL: not given.
// `subcommand` is named in error messages.
int kn_table_reader_open(kn_table_reader *s, const char *file, const char *units, const char *roles,
                         const char *subcommand);

// Read the columns wanted[] of all rows. A cell of these columns that is not a number is an error. If only some rows
// are to be read, set s->only before this call.
int kn_table_reader_read(kn_table_reader *s, int count, const int wanted[]);

// Set *value to the value of the note `key`, converted to SI. The value must have the dimension of `unit`. `key` is in
// small letters. If the table has no note with this key, *value is unchanged.
int kn_table_reader_note(const kn_table_reader *s, const char *key, const char *unit, double *value);

// Return the position of a column's cell in a line of the file, in characters from 1 on. Return 1 if the file cannot be
// read a second time, as with a pipe.
int kn_table_reader_at(const kn_table_reader *s, int line, int column);

// Print an error as "file:line:at: message" and return an exit code.
__attribute__((format(printf, 4, 5))) int kn_table_reader_complain(const kn_table_reader *s, int line, int at,
                                                                   const char *format, ...);
void kn_table_reader_close(kn_table_reader *s);

// ---- the quantity of a column (column_quantity.c)
//
// The physical quantity of a column (time, height, load ...) is found from its name, in the spellings of instruments,
// and from its unit.

typedef enum kn_column_quantity {
    KN_TIME,
    KN_HEIGHT,
    KN_DISPLACEMENT,
    KN_STRAIN,
    KN_COMPLIANCE,
    KN_LOAD,
    KN_STRESS,
    KN_MODULUS,
    KN_FREQUENCY,
    KN_STORAGE,
    KN_LOSS,
    KN_TANGENT,
    KN_PHASE
} kn_column_quantity;

// return the name of a quantity, such as "time", "height" or "storage modulus"
const char *kn_column_quantity_name(kn_column_quantity quantity);

bool kn_heading_shear(const kn_heading *heading); // return whether the name says shear, in English or German

// Give a column the quantity whose name, or first word of the name, is `role`. Return false if there is none.
bool kn_column_role(kn_heading *heading, const char *role);

// Return the index of the column that holds a quantity, or -1. If two columns match equally well, or if the only
// matching column has no unit or a unit of another dimension, print an error and set *code to an exit code. If `code`
// is NULL, print nothing.
int kn_column_find(kn_table_reader *s, kn_column_quantity quantity, int *code);

// Return the column of the first of `count` quantities for which the table has a column, and set *found to that
// quantity. If there is no column, return -1. On an error print the error, set *code to an exit code and return -1.
// *code must be KN_EXIT_OK before the call.
int kn_column_find_first(kn_table_reader *s, int count, const kn_column_quantity *wanted, kn_column_quantity *found,
                         int *code);

// Find all columns of time, since some instruments write several clocks. Store at most `most` of them in column[], the
// preferred one first, and return their number.
int kn_column_find_clocks(kn_table_reader *s, int most, int column[], int *code);

// List the names of the columns that are of no known quantity, in quotes.
void kn_column_unknown(const kn_table_reader *s, char *text, size_t size);

// Find several columns of one quantity that are headed by their loads, such as "10 gf [mm]" or "displacement_mm 10 gf".
// Store the index of each column in column[] and its load in load_n[]. Return the number of columns, at most `most`.
int kn_column_find_loads(const kn_table_reader *s, int most, int column[], double load_n[]);

#endif
