#ifndef KN_CLIENTS_IDENTIFY_MEASURED_CURVE_PARTS_H
#define KN_CLIENTS_IDENTIFY_MEASURED_CURVE_PARTS_H
// The steps that turn the readings of a table (table_reader.h) into a finished curve (measured_curve.h). A table holds
// the readings as the file has them. In a curve they are cleaned and thinned to as many as a fit needs. Arrays
// of a kn_curve that are NULL are skipped, but kn_curve_merge and kn_curve_thin need weight[].
#include "clients/identify/measured_curve.h"
#include "clients/identify/table_reader.h"

// ---- the arrays of a curve (measured_series.c)

// Remove readings that lack a number. Set *first_line to the line number of the first removed reading. Return the
// number of removed readings.
int kn_curve_compact(kn_curve *c, int *first_line);

// Sort the readings by time_s; equal ones keep their order. Return false if memory runs out.
bool kn_curve_sort(kn_curve *c);

// Replace readings of the same time and load by their mean. The weight of the mean is the number of these readings. If
// the value jumps at one time by at least a quarter of the value's range, both readings are kept, since the file then
// records the value before and after the jump. Return the number of removed readings.
int kn_curve_merge(kn_curve *c);

// Remove the first `count` readings.
void kn_curve_skip(kn_curve *c, int count);

// Thin the readings to about `most` readings if there are more than 4/3 `most`. The rising times change_s[changes]
// divide the readings into pieces. Within a piece, neighbouring readings are averaged if the ratio of their times since
// the start of the piece is below a limit. Each piece has its own limit. Each mean is placed at the mean time of its
// readings. The mean of a bent curve is corrected by the curvature through the neighbouring means. Return false if
// memory runs out.
bool kn_curve_thin(kn_curve *c, int most, int changes, const double *change_s);

// Set the noise of the curve from its value[], or in a sweep from the logarithms of both moduli.
void kn_curve_take_noise(kn_curve *c);

// Return when the load changed, between early_s and late_s: the strain is continuous, so the lines through the readings
// before and after the change meet there. If noise hides the jump of the slope, return the middle. begin, end: readings
// after the change (reading_noise.c).
double kn_slope_jump(const kn_curve *c, int begin, int end, double early_s, double late_s, double noise);

// Return the largest magnitude of the numbers; NAN is ignored.
double kn_largest_magnitude(int count, const double *value);

// ---- one file while it is read (measured_curve.c)

typedef struct kn_curve_file {
    kn_table_reader table;
    const kn_curve_options *opt;
    kn_curve_kind kind;
    kn_curve *curve; // [KN_CURVES_MAX]
    int *count;      // number of curves in curve[]
    // values from the notes of the file; without a note, from the options; NAN: neither gives the value
    double height_m, area_m2, load_n, stress_pa, release_s, begin_s, strain;
    bool constant_area, shear;
    const char *unsaid; // name of a column that may be of shear, to be told; NULL: none
} kn_curve_file;

// The rows begin..end-1 of the table, which become one curve, and the indices of the columns that fill the curve's
// arrays. Index -1: no column.
typedef struct kn_curve_rows {
    int begin, end, time, value, other, load;
} kn_curve_rows;

// Read creep curves (creep_curve.c) or a relaxation (relaxation_curve.c): append the file's curves to f->curve. Return 0,
// or print an error and return an exit code.
int kn_curve_load_creep(kn_curve_file *f);
int kn_curve_load_relax(kn_curve_file *f);

// Read the rows of the columns wanted[], then the values of the notes and options. wanted[0] is a column of time or
// frequency. If the table has several clocks, set wanted[0] to the one that begins with the load, and report it. Find
// whether the curve is of shear. Return 0, or print an error and return an exit code.
int kn_curve_read(kn_curve_file *f, int count, int wanted[]);

// Return the first row after row `begin` at which time falls, where another interval begins, or the number of rows.
// `time`: index of the column of time.
int kn_curve_range_end(const kn_table_reader *s, int time, int begin);

// Append a curve to f->curve, name the curve after the file and `part`, and fill its arrays from the table. If the
// curve takes all rows and `shared` is false, the table's arrays are moved into the curve. Otherwise the table's arrays
// are copied. Return 0, or print an error and return an exit code.
int kn_curve_add(kn_curve_file *f, const char *part, bool shared, kn_curve_rows rows, kn_curve **curve);

// Remove readings that lack a number, sort a sweep, and average readings of the same time. Print each change on stdout.
// It is an error if fewer than KN_CURVE_LEAST readings are left or if all their values are equal. Return 0, or print an
// error and return an exit code.
int kn_curve_order(kn_curve_file *f, kn_curve *c, const char *name);

// Finish the curve: estimate the noise of the readings, and thin the readings within each span between two times
// change_s[]. Return 0, or print an error and return an exit code.
int kn_curve_finish(kn_curve_file *f, kn_curve *c, int changes, const double *change_s);

// If nearly all values are below 0, change the sign of all values and report the change on stdout. Compression is
// positive in a kn_curve, but some files write it as negative. `name` is the name of the quantity.
void kn_curve_upright(const kn_curve_file *f, int count, double *value, const char *name);

// Return the time at which the load was applied: the value of the note `begin`. Without a note, time usually counts
// from the load, so return 0. But if the time of the first reading exceeds the duration of the whole curve, return the
// time of the first reading and report this on stdout.
double kn_curve_begin(const kn_curve_file *f, const kn_curve *c);

// Print an error and return an exit code if neither a note nor an option gives a value of the specimen, `key`, such as
// "height", which `what` needs. Otherwise return 0.
int kn_curve_need(const kn_curve_file *f, double value, const char *what, const char *key, const char *example);

// Set the initial height of the specimen and report its source on stdout.
void kn_curve_take_height(const kn_curve_file *f, kn_curve *c, double height_m, const char *source);

// Turn a strain into the change of the height over the initial one if the name of its column says that it is the
// logarithm of the height.
void kn_curve_from_hencky(const kn_curve_file *f, int column, int count, double *strain);

// Return whether the name of a column of stress says that it is the load over the initial section.
bool kn_curve_is_nominal(const kn_curve_file *f, int column);

// Print one line on stdout that begins with the file's name, such as "creep.csv: ...".
#define kn_curve_say(f, ...) ((void)(printf("%s: ", (f)->table.file), printf(__VA_ARGS__), putchar('\n')))

// Report on stdout that `count` readings were left out, if there are any. The text `which` follows the number.
void kn_curve_say_left_out(const kn_curve_file *f, int count, const char *which);

// Report on stdout that the strain in `column`, which has no unit, is taken as a share of the height. The user may have
// meant per cent, since files often give per cent without a unit.
void kn_curve_say_bare(const kn_curve_file *f, int column);

// Print an error at the note `key`, or for the option of that name, and return an exit code. The text follows "key of
// ".
__attribute__((format(printf, 3, 4))) int kn_curve_refuse_note(const kn_curve_file *f, const char *key,
                                                               const char *format, ...);

// Return a clause for a refusal if the names of columns (kn_column_unknown) hold a torque or an angle, or "".
const char *kn_curve_turned(const char *names);

// Print that the table has no column of `quantity`, with the columns that were not recognised. `example` is the name of
// such a column. Return an exit code.
int kn_curve_refuse_columns(const kn_curve_file *f, const char *quantity, const char *example);

// Print an error at the cell of `column` in a line of the file and return an exit code. line 0: the line of names;
// column -1: the start of the line.
#define kn_curve_refuse(f, line, column, ...)                                                                          \
    kn_table_reader_complain(&(f)->table, (line) ? (line) : (f)->table.header_line,                                    \
                             (column) < 0 ? 1 : kn_table_reader_at(&(f)->table, line, column), __VA_ARGS__)

#endif
