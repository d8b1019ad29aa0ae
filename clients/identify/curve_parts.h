#ifndef KN_CLIENTS_IDENTIFY_CURVE_PARTS_H
#define KN_CLIENTS_IDENTIFY_CURVE_PARTS_H
// What curve.c, curve_creep.c, curve_load.c, curve_relax.c and curve_sweep.c share of one file that is being read.
// shape_measured.c asks it where a second table begins.
#include "clients/identify/curve.h"
#include "clients/identify/readings.h"
#include "clients/identify/roles.h"

typedef struct kn_curve_file {
    kn_sheet sheet;
    const kn_curve_options *opt;
    kn_curve *curve; // [KN_CURVES_MAX]
    int *count;
    double height_m, area_m2, load_n, stress_pa, release_s, begin_s, strain; // notes, else options; NAN: neither
    bool constant_area;
} kn_curve_file;

// Each reads the rows and adds its curves; an exit code.
int kn_curve_load_creep(kn_curve_file *f);
int kn_curve_load_relax(kn_curve_file *f);
int kn_curve_load_sweep(kn_curve_file *f);

// The rows of these columns, and then what the notes and options say. An exit code.
int kn_curve_rows(kn_curve_file *f, int count, const int wanted[]);

// One line on stdout, "creep.csv: ...".
__attribute__((format(printf, 2, 3))) void kn_curve_say(const kn_curve_file *f, const char *format, ...);

// Readings of rows begin..end-1 of these columns (other, load: -1 for none): taken over where they are the whole of
// columns that nobody else needs, else copied. An exit code.
int kn_curve_readings(kn_curve_file *f, kn_readings *r, int begin, int end, int time, int value, int other, int load,
                      bool only);

// Past the rows from `begin` on in which time rises, if it then begins anew; else all rows.
int kn_curve_range_end(const kn_sheet *s, int time, int begin);

// Gaps out, order, one reading per time; each said. Then at least KN_CURVE_LEAST of them and not all the same.
int kn_curve_order(kn_curve_file *f, kn_readings *r, const char *name);

// The next curve of the list, with its name; after a complaint NULL.
kn_curve *kn_curve_add(kn_curve_file *f, kn_curve_kind kind, const char *part);

// Noise, thinning between the changes, and over into the curve, which then owns what r had. r is empty afterwards.
int kn_curve_finish(kn_curve_file *f, kn_curve *c, kn_readings *r, int changes, const double *change_s);

// The steps of a creep curve: from a column beside its strain, whose load becomes the nominal stress, with NAN where the
// value is that of no step; from notes, options or a column's name (load_n, NAN: no name); and the release, by whoever
// says it, who knows it better than two readings around it. Exit codes.
int kn_curve_load_column(kn_curve_file *f, kn_readings *r, kn_role load_is, kn_curve *c);
int kn_curve_load_given(kn_curve_file *f, const kn_readings *r, bool compliance, double load_n, kn_curve *c);
int kn_curve_load_release(kn_curve_file *f, const kn_readings *r, kn_curve *c);

// Changes the sign of all where nearly all of them are below 0 (compression is positive here), and says so.
void kn_curve_upright(const kn_curve_file *f, int count, double *value, const char *name);

// A strain without a unit is a share of the height; that is said, since per cent are as often written so.
void kn_curve_say_bare(const kn_curve_file *f, int column);

// Where time counts from if readings begin at the load: 0, or their first time where that is far from 0.
double kn_curve_begin(const kn_curve_file *f, const kn_readings *r);

#endif
