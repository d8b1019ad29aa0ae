// Read creep curves: the strain of a specimen under loads that are applied and removed. See curve.h.
#include "clients/identify/curve_parts.h"
#include "clients/knead/bench.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct columns { // indices of columns of the sheet; -1: the sheet has no such column
    int time, load, value;
    kn_role what, load_is;
    int loads, of_load[KN_CURVES_MAX]; // columns of a wide file, which has one column of values for each load
    double load_n[KN_CURVES_MAX];
} columns;

// Choose the column of the strain, or of a quantity to compute it from. A column of strain is preferred, since the
// instrument has computed it from the true size of the specimen.
static int choose_value(kn_curve_file *f, columns *c)
{
    static const kn_role roles[] = {KN_STRAIN, KN_DISPLACEMENT, KN_HEIGHT, KN_COMPLIANCE};
    int code = KN_EXIT_OK;
    c->value = kn_role_find_first(&f->sheet, 4, roles, &c->what, &code);
    if (c->value >= 0 || code != KN_EXIT_OK) return code;
    return kn_sheet_complain(&f->sheet, f->sheet.header_line, 1,
                             "no column of height, displacement, strain or compliance, expected one, e.g. 'height_mm'");
}

// Choose the column of the load. A compliance needs no load. A column of stress is preferred to one of load, since a
// stress needs no area.
static int choose_load(kn_curve_file *f, columns *c)
{
    int code = KN_EXIT_OK;
    c->load = -1;
    if (c->what == KN_COMPLIANCE) return KN_EXIT_OK;
    c->load_is = KN_STRESS;
    c->load = kn_role_find(&f->sheet, KN_STRESS, &code);
    if (c->load >= 0 || code != KN_EXIT_OK) return code;
    c->load_is = KN_LOAD;
    c->load = kn_role_find(&f->sheet, KN_LOAD, &code);
    return code;
}

// Choose the columns of time, strain and load.
static int choose(kn_curve_file *f, columns *c)
{
    int code = KN_EXIT_OK;
    c->time = kn_role_find(&f->sheet, KN_TIME, &code);
    if (code != KN_EXIT_OK) return code;
    if (c->time < 0)
        return kn_sheet_complain(&f->sheet, f->sheet.header_line, 1, "no time, expected a column like 'time_s'");
    c->loads = kn_role_find_loads(&f->sheet, KN_CURVES_MAX, c->of_load, c->load_n);
    // A wide file has one column per load. All these columns hold the same quantity as the first one.
    if (c->loads == 0) return (code = choose_value(f, c)) == KN_EXIT_OK ? choose_load(f, c) : code;
    const kn_heading *h = &f->sheet.column[c->of_load[0]].heading;
    c->what = h->has_unit && kn_measure_is(&h->unit, "m") ? KN_DISPLACEMENT : KN_STRAIN;
    if (c->what == KN_DISPLACEMENT && (strstr(h->word, "height") || strstr(h->word, "gap"))) c->what = KN_HEIGHT;
    c->load = c->value = -1;
    return KN_EXIT_OK;
}

// ---- readings -> strain

// Count the first readings with less than 2 % of the largest load, which were taken before the load was applied.
static int before_load(const kn_readings *r)
{
    double most = 0;
    int n = 0;
    for (int i = 0; r->load && i < r->count; i++) most = fmax(most, fabs(r->load[i]));
    while (r->load && n < r->count && fabs(r->load[n]) <= 0.02 * most) n++;
    return n < r->count ? n : 0;
}

static double mean(const double *value, int count)
{
    double sum = 0;
    for (int i = 0; i < count; i++) sum += value[i];
    return sum / count;
}

// Compute the strain from the height. If no note or option gives the initial height, it is the mean of the readings
// before the load, else the first reading.
static int height_to_strain(kn_curve_file *f, kn_readings *r, int unloaded, int column, kn_curve *c)
{
    for (int i = 0; i < r->count; i++)
        if (r->value[i] <= 0)
            return kn_sheet_complain(&f->sheet, r->line[i], kn_sheet_at(&f->sheet, r->line[i], column),
                                     "height of %g m, expected one above 0", r->value[i]);
    if (!isfinite(f->height_m)) {
        c->height_m = unloaded ? mean(r->value, unloaded) : r->value[0];
        kn_curve_say(f, "initial height %.5g mm, from the %s", 1e3 * c->height_m,
                     unloaded ? "readings before the load"
                              : "first reading; a line '# height: 1 cm' sets another height");
    }
    for (int i = 0; i < r->count; i++) r->value[i] = 1 - r->value[i] / c->height_m;
    if (mean(r->value, r->count) < 0)
        return kn_sheet_complain(&f->sheet, r->line[0], 1,
                                 "the height grows under the load or exceeds the initial height, expected compression");
    return KN_EXIT_OK;
}

static int displacement_to_strain(kn_curve_file *f, kn_readings *r, kn_role what)
{
    if (what == KN_DISPLACEMENT) {
        if (!isfinite(f->height_m))
            return kn_sheet_complain(&f->sheet, f->sheet.header_line, 1,
                                     "a displacement without the specimen's height, expected a line '# height: 1 cm' "
                                     "or --height '1 cm'");
        for (int i = 0; i < r->count; i++) r->value[i] /= f->height_m;
    }
    return KN_EXIT_OK;
}

// Compute the strain from the quantity of the column, counted from the readings before the load.
static int to_strain(kn_curve_file *f, kn_readings *r, kn_role what, int column, kn_curve *c)
{
    const int unloaded = before_load(r);
    if (what == KN_HEIGHT) return height_to_strain(f, r, unloaded, column, c);
    int code = displacement_to_strain(f, r, what);
    if (code != KN_EXIT_OK) return code;
    const double zero = unloaded ? mean(r->value, unloaded) : 0;
    for (int i = 0; i < r->count; i++) r->value[i] -= zero;
    kn_curve_upright(f, r->count, r->value, kn_role_name(what));
    if (unloaded && zero != 0) kn_curve_say(f, "%s is counted from its mean before the load", kn_role_name(what));
    if (what == KN_COMPLIANCE && isfinite(f->stress_pa))
        for (int i = 0; i < r->count; i++) r->value[i] *= f->stress_pa;
    return KN_EXIT_OK;
}

// If a strain is 1 or more, print an error and return an exit code. Under a constant nominal stress, as in shear, any
// strain is possible, so there is no check.
static int check_strain(kn_curve_file *f, const kn_readings *r, int column, const kn_curve *c)
{
    for (int i = 0; i < r->count && !c->constant_area; i++)
        if (r->value[i] >= 1)
            return kn_sheet_complain(
                &f->sheet, r->line[i], kn_sheet_at(&f->sheet, r->line[i], column),
                "strain of %.3g, more than the whole height, expected less than 1; is the height right?", r->value[i]);
    return KN_EXIT_OK;
}

// ---- a curve

// Report readings, stress and release of a curve.
static void say_steps(const kn_curve_file *f, const kn_curve *c, const kn_readings *r, kn_role what)
{
    const kn_curve_step *last = &c->step[c->steps - 1];
    char until[80] = "never taken off";
    if (last->stress_pa == 0 && last->late_s > last->early_s)
        snprintf(until, sizeof until, "taken off at %.5g s, between readings at %.5g and %.5g s", last->time_s,
                 last->early_s, last->late_s);
    else if (last->stress_pa == 0) snprintf(until, sizeof until, "taken off at %.5g s", last->time_s);
    char stress[40];
    if (what == KN_COMPLIANCE && c->step[0].stress_pa == 1) snprintf(stress, sizeof stress, "stress unknown");
    else snprintf(stress, sizeof stress, "%.4g kPa of nominal stress", 1e-3 * c->step[0].stress_pa);
    kn_curve_say(f, "%s: %d readings of %s, %s%s, %s", c->name, r->count, kn_role_name(what), stress,
                 c->steps > 1 + (last->stress_pa == 0) ? ", in steps" : "", until);
}

// Shift the times so that the first load is applied at time 0. Readings before the first load, and readings without a
// value, are removed.
static int begin_at_load(kn_curve_file *f, kn_readings *r, kn_curve *c, const char *name)
{
    const double begin = c->step[0].time_s;
    int line = 0, early = 0;
    kn_readings_compact(r, &line);
    while (early < r->count &&
           (r->time_s[early] < begin || (r->load && r->load[early] == 0 && r->time_s[early] <= begin)))
        early++;
    kn_readings_skip(r, early);
    if (early > 0) kn_curve_say(f, "%d reading%s before the load, left out", early, early > 1 ? "s" : "");
    for (int i = 0; i < r->count; i++) r->time_s[i] -= begin;
    for (int i = 0; i < c->steps; i++) {
        c->step[i].time_s -= begin;
        c->step[i].early_s -= begin;
        c->step[i].late_s -= begin;
    }
    return kn_curve_order(f, r, name);
}

// Make one curve of the readings: order, strain, steps of the load, time from the load on, noise and thinning.
static int add_curve(kn_curve_file *f, const columns *cols, int column, kn_readings *r, double load_n, const char *part)
{
    const char *name = kn_role_name(cols->what);
    kn_curve *c = kn_curve_add(f, KN_CURVE_CREEP, part);
    int code = c ? kn_curve_order(f, r, name) : KN_EXIT_USAGE;
    if (code == KN_EXIT_OK) code = to_strain(f, r, cols->what, column, c);
    if (code == KN_EXIT_OK)
        code = r->load ? kn_curve_load_column(f, r, cols->load_is, c)
                       : kn_curve_load_given(f, r, cols->what == KN_COMPLIANCE, load_n, c);
    if (code == KN_EXIT_OK) code = kn_curve_load_release(f, r, c);
    if (code == KN_EXIT_OK) code = begin_at_load(f, r, c, name);
    if (code == KN_EXIT_OK) code = check_strain(f, r, column, c);
    if (code != KN_EXIT_OK) return code;
    say_steps(f, c, r, cols->what);
    double changes[KN_CURVE_STEPS];
    // a reading at exactly the time of a load step belongs to the time before the step
    for (int i = 0; i < c->steps; i++) changes[i] = i ? nextafter(c->step[i].time_s, INFINITY) : c->step[i].time_s;
    return kn_curve_finish(f, c, r, c->steps, changes);
}

// Add one curve per column of a wide file.
static int add_wide(kn_curve_file *f, const columns *c)
{
    int code = KN_EXIT_OK;
    for (int i = 0; i < c->loads && code == KN_EXIT_OK; i++) {
        char part[32];
        kn_readings r = {0};
        snprintf(part, sizeof part, "%.4g gf", c->load_n[i] / KN_GF_N);
        code = kn_curve_readings(f, &r, 0, f->sheet.rows, c->time, c->of_load[i], -1, -1, false);
        if (code == KN_EXIT_OK) code = add_curve(f, c, c->of_load[i], &r, c->load_n[i], part);
        kn_readings_free(&r);
    }
    return code;
}

// Return the column whose value separates one curve from the next: the load, or the stress if there is no load. The
// load is preferred, since a stress may fall within a curve as the section grows.
static int key_of(kn_curve_file *f, const columns *c)
{
    if (c->load < 0 || c->load_is == KN_LOAD) return c->load;
    const int load = kn_role_find(&f->sheet, KN_LOAD, NULL);
    return load >= 0 ? load : c->load;
}

// Return the largest magnitude in rows begin..end-1 of a column; 0 without a column.
static double largest(const kn_sheet *s, int column, int begin, int end)
{
    double most = 0;
    for (int i = begin; column >= 0 && i < end; i++) most = fmax(most, fabs(s->column[column].value[i]));
    return most;
}

static double last_time(const double *t, int begin, int end)
{
    double last = 0;
    for (int i = begin; i < end; i++)
        if (isfinite(t[i])) last = t[i];
    return last;
}

// Join recoveries to their curves. Instruments write a recovery as a new interval without load, whose time begins at 0
// again. The times of this interval are shifted so that they continue those of the interval before.
static void join_recoveries(const kn_curve_file *f, const columns *c, int key)
{
    const kn_sheet *s = &f->sheet;
    double *t = s->column[c->time].value;
    for (int begin = 0, end; (end = kn_curve_range_end(s, c->time, begin)) < s->rows;) {
        const int next = kn_curve_range_end(s, c->time, end);
        const double from = last_time(t, begin, end);
        if (largest(s, key, end, next) < 0.02 * largest(s, key, begin, end) && from > 0 && t[end] >= 0) {
            kn_curve_say(f, "time restarts in line %d without load: read as the recovery, which begins at %.5g s",
                         s->line[end], from);
            for (int i = end; i < next; i++) t[i] += from;
        } else {
            begin = end;
        }
    }
}

static void name_part(const kn_sheet *s, int key, int begin, int end, char part[32])
{
    const bool stress = kn_measure_is(&s->column[key].heading.unit, "Pa");
    snprintf(part, 32, "%.4g %s", largest(s, key, begin, end) / (stress ? 1e3 : KN_GF_N), stress ? "kPa" : "gf");
}

// Return whether time falls because of a separator of thousands: in a file with decimal commas, 1,002 after 999 is read
// as 1.002.
static bool is_thousand(const kn_curve_file *f, double last, double next)
{
    return f->sheet.commas && 1000 * next >= last && 1000 * next < 1.1 * last;
}

// Print the error that a second table has the same load as the table before, and return an exit code.
static int refuse_second(const kn_curve_file *f, const columns *c, int begin, int end)
{
    const kn_sheet *s = &f->sheet;
    const double *t = s->column[c->time].value;
    if (is_thousand(f, last_time(t, begin, end), t[end]))
        return kn_sheet_complain(
            s, s->line[end], kn_sheet_at(s, s->line[end], c->time),
            "time restarts where it reaches a thousand, expected numbers without thousands separators");
    return kn_sheet_complain(
        s, s->line[end], kn_sheet_at(s, s->line[end], c->time),
        "time restarts, as in a second table, expected one rising time, or another load from here on");
}

// Add one curve per range of rising time. Each range must have another load than the one before it.
static int add_long(kn_curve_file *f, const columns *c, int key)
{
    const kn_sheet *s = &f->sheet;
    int code = KN_EXIT_OK;
    for (int begin = 0, end; begin < s->rows && code == KN_EXIT_OK; begin = end) {
        end = kn_curve_range_end(s, c->time, begin);
        // A single range may move its columns into the curve instead of copying them.
        const bool only = begin == 0 && end == s->rows;
        const double here = largest(s, key, begin, end),
                     next = largest(s, key, end, kn_curve_range_end(s, c->time, end));
        char part[32] = "";
        kn_readings r = {0};
        if (end < s->rows && (key < 0 || fabs(next - here) <= 0.01 * here)) return refuse_second(f, c, begin, end);
        if (!only && key >= 0) name_part(s, key, begin, end, part);
        code = kn_curve_readings(f, &r, begin, end, c->time, c->value, -1, c->load, only);
        if (code == KN_EXIT_OK) code = add_curve(f, c, c->value, &r, NAN, part);
        kn_readings_free(&r);
    }
    return code;
}

static bool has_numbers(const kn_sheet *s, int column)
{
    for (int i = 0; i < s->rows; i++)
        if (isfinite(s->column[column].value[i])) return true;
    return false;
}

// Report which column is used if two columns give the same quantity in different forms.
static void say_unused(kn_curve_file *f, const columns *c)
{
    static const kn_role values[] = {KN_STRAIN, KN_DISPLACEMENT, KN_HEIGHT, KN_COMPLIANCE},
                         loads[] = {KN_STRESS, KN_LOAD};
    for (int i = 0; i < 4 && c->value >= 0; i++) {
        const int other = values[i] == c->what ? -1 : kn_role_find(&f->sheet, values[i], NULL);
        if (other < 0 || other == c->value) continue;
        if (kn_role_is_sure(&f->sheet, values[i], other))
            kn_curve_say(f, "the column of %s is used, not that of %s", kn_role_name(c->what), kn_role_name(values[i]));
        else
            kn_curve_say(f, "the column of %s is used, not '%s', which has no unit", kn_role_name(c->what),
                         f->sheet.column[other].heading.name);
    }
    for (int i = 0; i < 2 && c->load >= 0; i++) {
        const int other = loads[i] == c->load_is ? -1 : kn_role_find(&f->sheet, loads[i], NULL);
        if (other >= 0 && other != c->load)
            kn_curve_say(f, "the column of %s is used, not that of %s", kn_role_name(c->load_is),
                         kn_role_name(loads[i]));
    }
    for (int i = 0; i < f->sheet.notes && c->load >= 0; i++)
        if (!strcmp(f->sheet.note[i].key, "load") || !strcmp(f->sheet.note[i].key, "stress"))
            kn_curve_say(f, "the column of %s is used, not what line %d says", kn_role_name(c->load_is),
                         f->sheet.note[i].line);
}

int kn_curve_load_creep(kn_curve_file *f)
{
    columns c = {0};
    int wanted[KN_CURVES_MAX + 4], n = 0, code = choose(f, &c);
    if (code != KN_EXIT_OK) return code;
    // Read the columns that are needed: time, strain or several strains, load, and the key.
    int key = c.loads ? -1 : key_of(f, &c);
    wanted[n++] = c.time;
    for (int i = 0; i < c.loads; i++) wanted[n++] = c.of_load[i];
    if (c.value >= 0) wanted[n++] = c.value;
    if (c.load >= 0) wanted[n++] = c.load;
    if (key >= 0 && key != c.load) wanted[n++] = key;
    code = kn_curve_rows(f, n, wanted);
    if (code != KN_EXIT_OK) return code;
    // the load column has a name but no numbers, so ignore it
    if (c.load >= 0 && !has_numbers(&f->sheet, c.load)) c.load = key = -1;
    if (c.loads) return add_wide(f, &c);
    if (key >= 0) join_recoveries(f, &c, key);
    code = add_long(f, &c, key);
    if (code == KN_EXIT_OK) say_unused(f, &c);
    if (code == KN_EXIT_OK && c.what == KN_STRAIN) kn_curve_say_bare(f, c.value);
    return code;
}
