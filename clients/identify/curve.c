#include "clients/identify/curve.h"
#include "clients/identify/curve_parts.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include "core/algebra.h"
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void kn_curve_free(kn_curve *c)
{
    free(c->time_s);
    free(c->value);
    free(c->other);
    free(c->weight);
    free(c->line);
    memset(c, 0, sizeof *c);
}

void kn_curve_say(const kn_curve_file *f, const char *format, ...)
{
    va_list args;
    printf("%s: ", f->sheet.file);
    va_start(args, format);
    vprintf(format, args);
    va_end(args);
    putchar('\n');
}

// ---- noise

// largest number of triples of neighbouring readings from which the noise is estimated; so many triples suffice for a
// file of ten million readings, and are sorted quickly
enum { SAMPLES = 100000 };

static double largest(int count, const double *value)
{
    double most = 0;
    for (int i = 0; i < count; i++) most = fmax(most, fabs(value[i]));
    return most;
}

// Return the smallest difference between two unequal neighbouring readings, which is one step of the gauge.
static double gauge(int count, const double *value)
{
    double least = INFINITY;
    for (int i = 1; i < count; i++)
        if (value[i] != value[i - 1]) least = fmin(least, fabs(value[i] - value[i - 1]));
    return isfinite(least) ? least : 0;
}

static double share(const double *weight, int i) { return weight ? 1 / weight[i] : 1; }

// Return the distance of the middle value from the line through its two neighbours. Independent noise of variance 1
// gives this distance the variance 1 + a^2 + b^2, so the distance is divided by its root.
static double bend(const double *t, const double *y, const double *weight)
{
    const double span = t[2] - t[0];
    if (!(span > 0)) return NAN;
    const double b = (t[1] - t[0]) / span, a = 1 - b;
    return fabs(y[1] - a * y[0] - b * y[2]) /
           sqrt(share(weight, 1) + a * a * share(weight, 0) + b * b * share(weight, 2));
}

// Return the noise as kn_curve_noise does. `weight`: number of readings in each mean; NULL: one reading in each.
static double noise_of(int count, const double *time_s, const double *value, const double *weight)
{
    // median of |x| if x is normally distributed with standard deviation 1
    static const double median_of_normal = 0.674489750196082;
    const double floor = 1e-6 * largest(count, value);
    const int step = count / SAMPLES + 1;
    double *sizes = malloc((size_t)(count > 2 ? count / step + 1 : 1) * sizeof *sizes), noise = 0;
    int n = 0, same = 0, pairs = 0;
    for (int i = 0; sizes && i + 2 < count; i += step) {
        const double size = bend(time_s + i, value + i, weight ? weight + i : NULL);
        same += value[i] == value[i + 1];
        pairs++;
        if (isfinite(size)) sizes[n++] = size;
    }
    // A coarse gauge repeats its readings. The noise of such readings is the standard deviation of rounding.
    if (2 * same > pairs) {
        noise = gauge(count, value) / sqrt(12);
    } else if (n > 0) {
        qsort(sizes, (size_t)n, sizeof *sizes, kn_ascending);
        noise = 0.5 * (sizes[(n - 1) / 2] + sizes[n / 2]) / median_of_normal;
    }
    free(sizes);
    return fmax(noise, floor > 0 ? floor : 1e-300);
}

double kn_curve_noise(int count, const double *time_s, const double *value)
{
    return noise_of(count, time_s, value, NULL);
}

// ---- readings

// Copy a column. An empty one still gets memory, so that NULL means out of memory.
static bool copy(double **to, const double *from, int count)
{
    *to = malloc((size_t)(count > 0 ? count : 1) * sizeof **to);
    if (*to) memcpy(*to, from, (size_t)count * sizeof **to);
    return *to;
}

// Take rows begin..end-1 of a column: move the whole column if nobody else needs it, else copy.
static bool take(kn_sheet *s, int column, int begin, int end, bool only, double **to)
{
    if (column < 0) return true;
    double **from = &s->column[column].value;
    if (!only) return copy(to, *from + begin, end - begin);
    *to = *from;
    *from = NULL;
    return true;
}

int kn_curve_readings(kn_curve_file *f, kn_readings *r, int begin, int end, int time, int value, int other, int load,
                      bool only)
{
    kn_sheet *s = &f->sheet;
    only &= begin == 0 && end == s->rows;
    *r = (kn_readings){.count = end - begin};
    bool ok = take(s, time, begin, end, only, &r->time_s) && take(s, value, begin, end, only, &r->value) &&
              take(s, other, begin, end, only, &r->other) && take(s, load, begin, end, only, &r->load);
    if (only) {
        r->line = s->line;
        s->line = NULL;
    } else if (ok) {
        r->line = malloc((size_t)(r->count > 0 ? r->count : 1) * sizeof *r->line);
        if (r->line) memcpy(r->line, s->line + begin, (size_t)r->count * sizeof *r->line);
    }
    if (ok && r->line) return KN_EXIT_OK;
    kn_readings_free(r);
    return kn_complain(s->subcommand, KN_EXIT_DEVICE, "%s: out of memory", s->file);
}

// a series of fewer than FEW successive rows counts as single rows out of place, not as a new table
enum { FEW = 3 };

// Return whether the time between row i and the next row is longer than `longer_s`.
static bool strides(const kn_sheet *s, const double *t, int i, double longer_s)
{
    int next = i + 1;
    while (next < s->rows && isnan(t[next])) next++;
    return next < s->rows && t[next] - t[i] > longer_s;
}

// Count the rows from `at` on in which time rises, up to KN_CURVE_LEAST. Return 0 if one or two rows are only out of
// place. In that case one of the first FEW rows continues the old time: it is at most three old steps after `last`, the
// largest time so far, and the next row follows within ten old steps. Longer steps belong to another table.
static int rows_anew(const kn_sheet *s, const double *t, int at, double last, double step)
{
    double before = t[at];
    int rows = 0;
    for (int i = at; i < s->rows && rows < KN_CURVE_LEAST; i++) {
        if (isnan(t[i])) continue;
        if (t[i] < before) break;
        if (rows < FEW && t[i] >= last && t[i] <= last + 3 * step && !strides(s, t, i, 10 * step)) return 0;
        before = t[i];
        rows++;
    }
    return rows;
}

int kn_curve_range_end(const kn_sheet *s, int time, int begin)
{
    const double *t = s->column[time].value;
    double first = NAN, last = NAN, step = 0, before = NAN;
    // number of rows at which time falls; in a disordered file time falls often, and may rise in three successive rows
    // by chance
    int falls = 0;
    for (int i = begin; i < s->rows; i++) {
        if (isnan(t[i])) continue;
        if (isnan(first)) first = last = before = t[i];
        if (t[i] > last) step = t[i] - last;
        // A second table begins if time falls back into the first half of its range and then rises for enough rows. If
        // time fell before, the file may be in disorder, so more rows must rise.
        if (t[i] < before) {
            if (i - begin >= KN_CURVE_LEAST && i - begin >= 4 * falls && t[i] <= 0.5 * (last + first) &&
                rows_anew(s, t, i, last, step) >= (falls ? KN_CURVE_LEAST : FEW))
                return i;
            falls++;
        }
        last = fmax(last, t[i]);
        before = t[i];
    }
    return s->rows;
}

// Print an error and return an exit code if there are too few readings, or if the value never changes.
static int check_enough(kn_curve_file *f, const kn_readings *r, const char *name)
{
    const kn_sheet *s = &f->sheet;
    if (r->count < KN_CURVE_LEAST)
        return kn_sheet_complain(s, r->count ? r->line[0] : s->header_line, 1,
                                 "%d usable reading%s of %s, expected at least %d", r->count, r->count == 1 ? "" : "s",
                                 name, KN_CURVE_LEAST);
    int i = 1;
    while (i < r->count && r->value[i] == r->value[0]) i++;
    if (i == r->count)
        return kn_sheet_complain(s, r->line[0], 1, "%s is %g in all readings, expected one that changes", name,
                                 r->value[0]);
    return KN_EXIT_OK;
}

// If a number that was computed from cells is out of range, print an error and return an exit code. The sheet has
// already checked the numbers in the cells themselves.
static int check_sane(kn_curve_file *f, const kn_readings *r)
{
    const double *const all[] = {r->time_s, r->value, r->other, r->load};
    for (int i = 0; i < r->count; i++)
        for (int k = 0; k < 4; k++)
            if (all[k] && fabs(all[k][i]) > KN_SHEET_MOST)
                return kn_sheet_complain(&f->sheet, r->line[i], 1, "%g in SI units, expected at most %g", all[k][i],
                                         KN_SHEET_MOST);
    return KN_EXIT_OK;
}

int kn_curve_order(kn_curve_file *f, kn_readings *r, const char *name)
{
    const int sane = check_sane(f, r);
    if (sane != KN_EXIT_OK) return sane;
    int line = 0, out = kn_readings_compact(r, &line);
    if (out > 0)
        kn_curve_say(f, "%d reading%s of %s missing, left out; the first in line %d", out, out > 1 ? "s" : "", name,
                     line);
    // The readings of a sweep are sorted by frequency, which is stored in time_s.
    const char *along = *f->count && f->curve[*f->count - 1].kind == KN_CURVE_SWEEP ? "frequency" : "time";
    int moved = kn_readings_sort(r);
    if (moved > 0) kn_curve_say(f, "the rows are not in the order of %s: %d moved", along, moved);
    int merged = moved < 0 ? -1 : kn_readings_merge(r);
    if (merged < 0) return kn_complain(f->sheet.subcommand, KN_EXIT_DEVICE, "%s: out of memory", f->sheet.file);
    if (merged > 0)
        kn_curve_say(f, "%d reading%s the %s of another: averaged", merged, merged > 1 ? "s have" : " has", along);
    return check_enough(f, r, name);
}

void kn_curve_upright(const kn_curve_file *f, int count, double *value, const char *name)
{
    // The signs are changed only if the sum of the negative values is twenty times the sum of the positive values.
    double below = 0, above = 0;
    for (int i = 0; i < count; i++) *(value[i] < 0 ? &below : &above) += fabs(value[i]);
    if (!(below > 20 * above)) return;
    for (int i = 0; i < count; i++) value[i] = -value[i];
    kn_curve_say(f, "%s is negative, as in a file where compression is negative: its sign is changed", name);
}

void kn_curve_say_bare(const kn_curve_file *f, int column)
{
    if (column < 0 || f->sheet.column[column].heading.has_unit) return;
    const char *name = f->sheet.column[column].heading.name;
    kn_curve_say(
        f, "'%s' has no unit and is read as a fraction of the height (0.05 is 5 %%); for per cent, name it '%s [%%]'",
        name, name);
}

double kn_curve_begin(const kn_curve_file *f, const kn_readings *r)
{
    if (isfinite(f->begin_s)) return f->begin_s;
    const double first = r->time_s[0], span = r->time_s[r->count - 1] - first;
    if (first <= span) return 0; // readings may also begin before the load
    kn_curve_say(f,
                 "time does not begin near 0: it is counted from the first reading, %.6g s; a line '# begin: TIME' "
                 "sets another begin",
                 first);
    return first;
}

// ---- curves

// Name the curve after its file without folder and ending, and after the part of the file.
static void name_curve(kn_curve *c, const char *file, const char *part)
{
    const char *base = strrchr(file, '/') ? strrchr(file, '/') + 1 : file, *dot = strrchr(base, '.');
    const int length = dot && dot > base ? (int)(dot - base) : (int)strlen(base);
    snprintf(c->name, sizeof c->name, "%.*s%s%s", length > 40 ? 40 : length, base, *part ? " " : "", part);
    for (char *p = c->name; *p; p++)
        if ((unsigned char)*p < ' ') *p = ' ';
}

kn_curve *kn_curve_add(kn_curve_file *f, kn_curve_kind kind, const char *part)
{
    if (*f->count == KN_CURVES_MAX) {
        kn_complain(f->sheet.subcommand, KN_EXIT_USAGE, "%s: more than %d curves, expected fewer", f->sheet.file,
                    KN_CURVES_MAX);
        return NULL;
    }
    kn_curve *c = &f->curve[(*f->count)++];
    *c = (kn_curve){.kind = kind, .file = f->sheet.file, .constant_area = f->constant_area};
    if (isfinite(f->height_m)) c->height_m = f->height_m;
    if (isfinite(f->area_m2)) c->area_m2 = f->area_m2;
    name_curve(c, f->sheet.file, part);
    return c;
}

// Return the noise of the logarithms of both moduli together.
static double noise_of_sweep(const kn_readings *r)
{
    double *log_hz = malloc(3 * (size_t)r->count * sizeof *log_hz);
    if (!log_hz) return 1e-6;
    double *storage = log_hz + r->count, *loss = storage + r->count;
    for (int i = 0; i < r->count; i++) {
        log_hz[i] = log(r->time_s[i]);
        storage[i] = log(r->value[i]);
        loss[i] = log(r->other[i]);
    }
    const double first = noise_of(r->count, log_hz, storage, r->weight),
                 second = noise_of(r->count, log_hz, loss, r->weight);
    free(log_hz);
    return hypot(first, second) / sqrt(2);
}

int kn_curve_finish(kn_curve_file *f, kn_curve *c, kn_readings *r, int changes, const double *change_s)
{
    const int before = r->count;
    // The noise of single readings is estimated before thinning.
    c->noise = c->kind == KN_CURVE_SWEEP ? noise_of_sweep(r) : noise_of(r->count, r->time_s, r->value, r->weight);
    const bool ok = kn_readings_thin(r, KN_CURVE_READINGS, changes, change_s);
    // The curve takes over the arrays. The load column is no longer needed.
    c->count = r->count;
    c->time_s = r->time_s;
    c->value = r->value;
    c->other = r->other;
    c->weight = r->weight;
    c->line = r->line;
    free(r->load);
    memset(r, 0, sizeof *r);
    if (!ok) return kn_complain(f->sheet.subcommand, KN_EXIT_DEVICE, "%s: out of memory", f->sheet.file);
    if (c->count < before)
        kn_curve_say(f, "%s: %d readings thinned to %d means, denser after a change of load", c->name, before,
                     c->count);
    return KN_EXIT_OK;
}

// ---- one file

static double given(double option) { return option > 0 ? option : NAN; }

static int bad_note(const kn_curve_file *f, const char *key)
{
    const kn_sheet *s = &f->sheet;
    int n = 0;
    while (strcmp(s->note[n].key, key) != 0) n++;
    return kn_sheet_complain(s, s->note[n].line, s->note[n].at, "%s of %s, expected one above 0, 1e15 at most", key,
                             s->note[n].value);
}

// Read the notes. The notes of a file override the options, which apply to all files.
static int take_notes(kn_curve_file *f)
{
    const kn_curve_options *o = f->opt;
    const struct {
        const char *key, *unit;
        double *value, option;
    } notes[] = {{"height", "m", &f->height_m, o->height_m},    {"area", "m^2", &f->area_m2, o->area_m2},
                 {"load", "N", &f->load_n, o->load_n},          {"stress", "Pa", &f->stress_pa, o->stress_pa},
                 {"release", "s", &f->release_s, o->release_s}, {"strain", "1", &f->strain, o->strain}};
    int code = KN_EXIT_OK;
    for (size_t i = 0; i < sizeof notes / sizeof *notes && code == KN_EXIT_OK; i++) {
        // A note overrides the option. A value must be from 1e-15 to 1e15.
        *notes[i].value = NAN;
        code = kn_sheet_note_take(&f->sheet, notes[i].key, notes[i].unit, notes[i].value);
        const double value = *notes[i].value;
        if (code == KN_EXIT_OK && (value < 1e-15 || value > 1e15)) code = bad_note(f, notes[i].key);
        if (isnan(*notes[i].value)) *notes[i].value = given(notes[i].option);
    }
    f->begin_s = NAN;
    if (code == KN_EXIT_OK) code = kn_sheet_note_take(&f->sheet, "begin", "s", &f->begin_s);
    f->constant_area = o->constant_area;
    // The note "section: constant" works like --constant-area.
    for (int n = 0; n < f->sheet.notes; n++)
        f->constant_area |= !strcmp(f->sheet.note[n].key, "section") && !strcmp(f->sheet.note[n].value, "constant");
    return code;
}

// Notes may be above or below the table, so they are read after all rows.
int kn_curve_rows(kn_curve_file *f, int count, const int wanted[])
{
    int code = kn_sheet_read(&f->sheet, count, wanted);
    return code == KN_EXIT_OK ? take_notes(f) : code;
}

int kn_curve_load(kn_curve curve[KN_CURVES_MAX], int *count, kn_curve_kind kind, const char *file,
                  const kn_curve_options *options)
{
    static int (*const load[])(kn_curve_file * f) = {kn_curve_load_creep, kn_curve_load_relax, kn_curve_load_sweep};
    kn_curve_file *f = malloc(sizeof *f);
    if (!f) return kn_complain(options->subcommand, KN_EXIT_DEVICE, "%s: out of memory", file);
    // Open the sheet and let the loader of this kind read it.
    *f = (kn_curve_file){.opt = options, .curve = curve, .count = count};
    const int before = *count;
    int code = kn_sheet_open(&f->sheet, file, options->units, options->subcommand);
    if (code == KN_EXIT_OK) code = load[kind](f);
    if (code == KN_EXIT_OK && f->sheet.commas) kn_curve_say(f, "the numbers have decimal commas");
    // After an error, free the curves that were added from this file.
    while (code != KN_EXIT_OK && *count > before) kn_curve_free(&curve[--*count]);
    kn_sheet_close(&f->sheet);
    free(f);
    return code;
}
