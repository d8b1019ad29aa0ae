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
    int *count;
    // Values from notes, else from options; NAN: given by neither
    double height_m, area_m2, load_n, stress_pa, release_s, begin_s, strain;
    bool constant_area;
} kn_curve_file;

// Read the rows and add the file's curves. Return an exit code.
int kn_curve_load_creep(kn_curve_file *f);
int kn_curve_load_relax(kn_curve_file *f);
int kn_curve_load_sweep(kn_curve_file *f);

// Read the rows of these columns, then the values of notes and options. Return an exit code.
int kn_curve_rows(kn_curve_file *f, int count, const int wanted[]);

// Print one line on stdout, "creep.csv: ...".
__attribute__((format(printf, 2, 3))) void kn_curve_say(const kn_curve_file *f, const char *format, ...);

// Fill `r` with the readings of rows begin..end-1 of these columns. `other` and `load` may be -1 for no column. If
// `only` (no other curve needs the columns) and all rows are used, the columns are moved, else copied. Return an exit
// code.
int kn_curve_readings(kn_curve_file *f, kn_readings *r, int begin, int end, int time, int value, int other, int load,
                      bool only);

// Find a second table in which time begins anew. Return its first row, or the number of rows if there is no second
// table. `begin` is the first row of the present table.
int kn_curve_range_end(const kn_sheet *s, int time, int begin);

// Remove readings that lack a number, sort, and average readings of the same time. Report each change. Complain if
// fewer than KN_CURVE_LEAST readings are left or if all their values are equal. Return an exit code.
int kn_curve_order(kn_curve_file *f, kn_readings *r, const char *name);

// Append a curve to f->curve and set its name from the file's name and `part`. Return the curve, or NULL after a
// complaint.
kn_curve *kn_curve_add(kn_curve_file *f, kn_curve_kind kind, const char *part);

// Compute the noise, thin the readings between the times `change_s`, and move all arrays of `r` into the curve. `r` is
// empty afterwards. Return an exit code.
int kn_curve_finish(kn_curve_file *f, kn_curve *c, kn_readings *r, int changes, const double *change_s);

// Find the steps of a creep curve. Each returns an exit code.
// kn_curve_load_column: from the column of load or stress beside the strain. The column is converted to nominal stress.
// Readings that belong to no step get the value NAN.
// kn_curve_load_given: from the load in the name of the column (`load_n`; NAN: none), else from notes or options.
// kn_curve_load_release: the removal of the load, from a note or option. That time is more exact than the times of the
// readings before and after.
int kn_curve_load_column(kn_curve_file *f, kn_readings *r, kn_role load_is, kn_curve *c);
int kn_curve_load_given(kn_curve_file *f, const kn_readings *r, bool compliance, double load_n, kn_curve *c);
int kn_curve_load_release(kn_curve_file *f, const kn_readings *r, kn_curve *c);

// Change the sign of all values if nearly all of them are below 0, and report the change. Compression is positive in a
// curve, but negative in some files.
void kn_curve_upright(const kn_curve_file *f, int count, double *value, const char *name);

// Report that a strain without a unit is taken as a share of the height. Files often give per cent without a unit, too.
void kn_curve_say_bare(const kn_curve_file *f, int column);

// Return the time at which the load was applied: the note `begin`, else 0. If the first reading comes later than the
// length of the whole curve, return the time of the first reading and report that.
double kn_curve_begin(const kn_curve_file *f, const kn_readings *r);

#endif
