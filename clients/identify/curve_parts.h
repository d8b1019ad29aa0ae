#ifndef KN_CLIENTS_IDENTIFY_CURVE_PARTS_H
#define KN_CLIENTS_IDENTIFY_CURVE_PARTS_H
// The state of one file while it is read, shared by curve.c, curve_creep.c, curve_load.c, curve_relax.c and
// curve_sweep.c. shape_measured.c uses it to find where a second table begins.
#include "clients/identify/curve.h"
#include "clients/identify/readings.h"
#include "clients/identify/roles.h"

typedef struct kn_curve_file {
    kn_sheet sheet;
    const kn_curve_options *opt;
    kn_curve *curve; // [KN_CURVES_MAX]
    int *count;      // number of curves in curve[]
    // values from the notes of the file, or else from the options; NAN: neither a note nor an option gives the value
    double height_m, area_m2, load_n, stress_pa, release_s, begin_s, strain;
    bool constant_area;
} kn_curve_file;

// Read the rows of the file and append the file's curves to f->curve. Return 0, or print an error and return an exit
// code.
int kn_curve_load_creep(kn_curve_file *f);
int kn_curve_load_relax(kn_curve_file *f);
int kn_curve_load_sweep(kn_curve_file *f);

// Read the rows of the columns wanted[], then the values of the notes and options. Return 0, or print an error and
// return an exit code.
int kn_curve_rows(kn_curve_file *f, int count, const int wanted[]);

// Print one line on stdout that begins with the file's name, such as "creep.csv: ...".
__attribute__((format(printf, 2, 3))) void kn_curve_say(const kn_curve_file *f, const char *format, ...);

// Fill `r` with the readings in rows begin..end-1 of the columns `time`, `value`, `other` and `load`. `other` and
// `load` may be -1 for no column. `only`: no other curve needs these columns. If `only` is true and all rows are used,
// the columns are moved into `r`. Otherwise they are copied. Return 0, or print an error and return an exit code.
int kn_curve_readings(kn_curve_file *f, kn_readings *r, int begin, int end, int time, int value, int other, int load,
                      bool only);

// Find the end of the table that begins at row `begin`. The next table begins where time falls back and rises again.
// Return the first row of the next table, or the number of rows of the sheet if there is no next table. `time` is the
// index of the time column.
int kn_curve_range_end(const kn_sheet *s, int time, int begin);

// Remove readings that lack a number, sort the readings by time, and average readings of the same time. Print each
// change on stdout. It is an error if fewer than KN_CURVE_LEAST readings are left or if all their values are equal.
// Return 0, or print an error and return an exit code.
int kn_curve_order(kn_curve_file *f, kn_readings *r, const char *name);

// Append a curve to f->curve and set the curve's name from the file's name and `part`. Return the curve, or print an
// error and return NULL.
kn_curve *kn_curve_add(kn_curve_file *f, kn_curve_kind kind, const char *part);

// Finish the curve `c`: estimate the noise of the readings, thin the readings within each span between two times
// change_s[], and move all arrays of `r` into `c`. `r` is empty afterwards. Return 0, or print an error and return an
// exit code.
int kn_curve_finish(kn_curve_file *f, kn_curve *c, kn_readings *r, int changes, const double *change_s);

// Find the load steps of a creep curve. Each function returns 0, or prints an error and returns an exit code.
// kn_curve_load_column takes the load steps from the column of load or stress beside the strain. The column is
// converted to nominal stress. Readings that belong to no load step get the value NAN.
//
// kn_curve_load_given takes one constant load, which is given by the name of the strain's column (`load_n`; NAN: not
// given), or else by a note or option.
//
// kn_curve_load_release takes the time at which the load was removed from a note or option. That time is more exact
// than the times of the readings before and after the removal.
int kn_curve_load_column(kn_curve_file *f, kn_readings *r, kn_role load_is, kn_curve *c);
int kn_curve_load_given(kn_curve_file *f, const kn_readings *r, bool compliance, double load_n, kn_curve *c);
int kn_curve_load_release(kn_curve_file *f, const kn_readings *r, kn_curve *c);

// If nearly all values are below 0, change the sign of all values and report the change on stdout. Compression is
// positive in a kn_curve, but negative in some files. `name` is the name of the quantity.
void kn_curve_upright(const kn_curve_file *f, int count, double *value, const char *name);

// Report on stdout that the strain in `column`, which has no unit, is taken as a share of the height. The user may have
// meant per cent, since files often give per cent without a unit.
void kn_curve_say_bare(const kn_curve_file *f, int column);

// Return the time at which the load was applied: the value of the note `begin`, or else 0. Without the note, the first
// reading may come later than 0 by more than the duration of the whole curve. In that case return the time of the first
// reading and report the assumption on stdout.
double kn_curve_begin(const kn_curve_file *f, const kn_readings *r);

#endif
