// Read relaxation curves: the stress of a specimen that is held at a strain. See measured_curve.h.
#include "clients/identify/measured_curve_parts.h"
#include "clients/cli/command.h"
#include <math.h>
#include <string.h>

typedef struct relax_columns { // indices of columns of the table; -1: the table lacks the column
    int time, value, strain;
    kn_column_quantity what, strain_is;
} relax_columns;

static int choose_relax(kn_curve_file *f, relax_columns *c)
{
    static const kn_column_quantity values[] = {KN_STRESS, KN_LOAD, KN_MODULUS},
                                    strains[] = {KN_STRAIN, KN_DISPLACEMENT, KN_HEIGHT};
    kn_table_reader *s = &f->table;
    int code = KN_EXIT_OK;
    *c = (relax_columns){.value = -1, .strain = -1};
    c->time = kn_column_find(s, KN_TIME, &code);
    for (int i = 0; i < 3 && c->value < 0 && code == KN_EXIT_OK; i++)
        c->value = kn_column_find(s, c->what = values[i], &code);
    if (code == KN_EXIT_OK) c->strain = kn_column_find_first(s, 3, strains, &c->strain_is, &code);
    if (code != KN_EXIT_OK) return code;
    if (c->time < 0) return kn_curve_refuse_columns(f, "time", "time_s");
    return c->value >= 0 ? KN_EXIT_OK : kn_curve_refuse_columns(f, "stress, load or modulus", "stress_kPa");
}

// If the record begins without load at a strain that is not 0, the strain counts from where the load begins: the gauge
// was not set to 0, or the tool came through the air.
static void count_from_load(const kn_curve_file *f, kn_curve *c)
{
    const double most = kn_largest_magnitude(c->count, c->value), largest = kn_largest_magnitude(c->count, c->other);
    int unloaded = 0;
    while (unloaded < c->count && fabs(c->value[unloaded]) <= 0.02 * most) unloaded++;
    const double zero = unloaded ? c->other[unloaded - 1] : 0;
    if (!unloaded && fabs(c->other[0]) > 0.05 * largest && fabs(c->other[0]) < 0.95 * largest)
        kn_curve_say(f, "the strain is %.4g %% at the first reading: it is taken as it is, since the load acts already",
                     100 * c->other[0]);
    if (unloaded == c->count || fabs(zero) <= 0.05 * largest) return;
    for (int i = 0; i < c->count; i++) c->other[i] -= zero;
    kn_curve_say(f, "the load begins at a strain of %.4g %%, from which the strain is counted", 100 * zero);
}

// Compute the strain from displacement or height. If no note or option gives the initial height, use the first height.
static int to_strain(kn_curve_file *f, kn_curve *c, kn_column_quantity what, int column)
{
    if (what == KN_DISPLACEMENT && kn_curve_need(f, f->height_m, "a displacement", "height", "1 cm") != KN_EXIT_OK)
        return KN_EXIT_USAGE;
    if (what == KN_HEIGHT && !isfinite(f->height_m))
        kn_curve_take_height(f, c, c->other[0], "first reading; a line '# height: 1 cm' sets another height");
    for (int i = 0; i < c->count && what != KN_STRAIN; i++)
        c->other[i] = what == KN_HEIGHT ? 1 - c->other[i] / c->height_m : c->other[i] / c->height_m;
    kn_curve_upright(f, c->count, c->other, kn_column_quantity_name(what));
    kn_curve_from_hencky(f, column, c->count, c->other);
    count_from_load(f, c);
    for (int i = 0; i < c->count; i++)
        if (c->other[i] >= 1 && !f->shear)
            return kn_curve_refuse(f, c->line[i], -1,
                                   "strain of %.3g, more than the whole height, expected less than 1; is it in per "
                                   "cent?",
                                   c->other[i]);
    return KN_EXIT_OK;
}

// Return the held strain: the mean of the later half of the readings within 2 % of the largest strain.
static double held(const kn_curve *c)
{
    double most = 0, sum = 0;
    int n = 0, seen = 0;
    for (int i = 0; i < c->count; i++) most = fmax(most, c->other[i]);
    for (int i = 0; i < c->count; i++) n += c->other[i] >= 0.98 * most;
    for (int i = 0; i < c->count; i++)
        if (c->other[i] >= 0.98 * most && seen++ >= n / 2) sum += c->other[i];
    return n > 0 ? sum / (n - n / 2) : 0;
}

// Return the end of the ramp: the time at which the line through the middle reading and the last reading of the ramp
// reaches the held strain. A ramp of fewer than three readings ends at the first reading with the held strain.
static double ramp_end(const kn_curve *c, int reached)
{
    int middle = reached;
    while (middle > 0 && c->other[middle] > 0.5 * c->strain) middle--;
    const double t = c->time_s[middle], slope = (c->other[reached] - c->other[middle]) / (c->time_s[reached] - t);
    return reached - middle < 3 || !(slope > 0) ? c->time_s[reached] : t + (c->strain - c->other[middle]) / slope;
}

// Keep the readings from the last one without strain up to the end of the hold.
static int keep_hold(kn_curve_file *f, kn_curve *c)
{
    c->strain = held(c);
    if (!(c->strain > 0))
        return kn_curve_refuse(f, c->line[0], -1, "the strain is 0 in all readings, expected a strain that is held");
    int reached = 0, before = 0, end;
    // `reached` is the first reading at the strain, `before` the last one without strain.
    while (reached < c->count && c->other[reached] < 0.99 * c->strain) reached++;
    for (int i = 0; i < reached; i++)
        if (c->other[i] <= 0.002 * c->strain) before = i;
    for (end = reached; end < c->count && c->other[end] > 0.95 * c->strain;) end++;
    c->begin_s = isfinite(f->begin_s) ? f->begin_s : reached > 0 ? ramp_end(c, reached) : kn_curve_begin(f, c);
    kn_curve_say_left_out(f, c->count - end, "after the strain was released");
    kn_curve_say_left_out(f, before, "before the strain");
    c->count = end;
    kn_curve_skip(c, before);
    return KN_EXIT_OK;
}

// Return the time at which the hold begins, for a file without a column of strain. If the stress rises at first, this
// is the time of the largest stress; otherwise it is the result of kn_curve_begin.
static double begin_of_hold(const kn_curve_file *f, const kn_curve *c)
{
    const int peak = kn_curve_peak(c);
    if (isfinite(f->begin_s) || c->value[0] > 0.8 * c->value[peak] || c->count - peak < KN_CURVE_LEAST)
        return kn_curve_begin(f, c);
    kn_curve_say(
        f,
        "the stress rises until %.5g s: the hold is assumed to begin there; a line '# begin: TIME' sets another begin",
        c->time_s[peak]);
    return c->time_s[peak];
}

static int take_strain(kn_curve_file *f, kn_curve *c, kn_column_quantity strain_is, int column)
{
    // If the file has a column of strain, find the hold in it.
    if (c->other) {
        if (isfinite(f->strain)) kn_curve_say(f, "the strain is taken from its column, not as stated");
        int code = to_strain(f, c, strain_is, column);
        return code == KN_EXIT_OK ? keep_hold(f, c) : code;
    }
    // Without a column of strain, the strain comes from a note or an option, and the hold begins at the largest stress.
    if (isfinite(f->strain)) c->strain = f->strain;
    if (c->strain >= 1 && !f->shear)
        return kn_complain(f->table.subcommand, KN_EXIT_USAGE, "%s: strain of %g, expected less than 1, like 10 %%",
                           f->table.file, c->strain);
    c->begin_s = begin_of_hold(f, c);
    int before = 0;
    while (before < c->count && c->time_s[before] < c->begin_s) before++;
    kn_curve_say_left_out(f, before, "before the strain was reached");
    kn_curve_skip(c, before);
    return KN_EXIT_OK;
}

// Compute the stress from load or modulus. If c->constant_area is false, the section grows with the strain.
static int to_stress(kn_curve_file *f, kn_curve *c, kn_column_quantity what, int column)
{
    const bool nominal = what == KN_STRESS && kn_curve_is_nominal(f, column);
    if (nominal && !f->shear)
        kn_curve_say(f, "'%s' is read as the load over the initial section", f->table.column[column].heading.name);
    if (what == KN_LOAD && kn_curve_need(f, f->area_m2, "a load", "area", "1 cm^2") != KN_EXIT_OK) return KN_EXIT_USAGE;
    if (what == KN_LOAD && !(c->strain > 0) && !c->constant_area)
        return kn_curve_refuse(f, 0, -1,
                               "a load without the strain, which is needed for the area, expected a line '# strain: "
                               "10 %%' or '# section: constant', --strain or --constant-area");
    for (int i = 0; i < c->count; i++) {
        const double strain = c->other ? c->other[i] : c->strain;
        // Divide a load by the current area. Multiply a modulus by the strain.
        if (what == KN_LOAD) c->value[i] *= (c->constant_area ? 1 : 1 - strain) / f->area_m2;
        else if (nominal && !c->constant_area && (c->other || c->strain > 0)) c->value[i] *= 1 - strain;
        else if (what == KN_MODULUS && c->strain > 0) c->value[i] *= strain;
    }
    return KN_EXIT_OK;
}

static void say_relax(const kn_curve_file *f, const kn_curve *c, kn_column_quantity what)
{
    char strain[60] = "strain unknown";
    if (c->strain > 0) snprintf(strain, sizeof strain, "strain of %.4g %%", 100 * c->strain);
    kn_curve_say(f, "%s: %d readings of %s, %s%s from %.4g s on, to %.5g s", c->name, c->count,
                 kn_column_quantity_name(what), strain, c->other ? ", with its rise, held" : ", held", c->begin_s,
                 c->time_s[c->count - 1]);
}

int kn_curve_load_relax(kn_curve_file *f)
{
    relax_columns cols;
    kn_curve *c = NULL;
    int code = choose_relax(f, &cols);
    if (code != KN_EXIT_OK) return code;
    int wanted[] = {cols.time, cols.value, cols.strain};
    code = kn_curve_read(f, cols.strain >= 0 ? 3 : 2, wanted);
    if (code != KN_EXIT_OK) return code;
    const int time = *wanted;
    const char *name = kn_column_quantity_name(cols.what);
    const int end = kn_curve_range_end(&f->table, time, 0), rows = f->table.rows;
    if (end < rows)
        return kn_curve_refuse(f, f->table.line[end], time,
                               "time falls, expected one relaxation per file, in the order of time");
    code = kn_curve_add(f, "", false, (kn_curve_rows){0, rows, time, cols.value, cols.strain, -1}, &c);
    if (code == KN_EXIT_OK) code = kn_curve_order(f, c, name);
    if (code == KN_EXIT_OK) kn_curve_upright(f, c->count, c->value, name);
    if (code == KN_EXIT_OK) code = take_strain(f, c, cols.strain_is, cols.strain);
    if (code == KN_EXIT_OK) code = to_stress(f, c, cols.what, cols.value);
    if (code == KN_EXIT_OK) code = kn_curve_order(f, c, name);
    if (code != KN_EXIT_OK) return code;
    say_relax(f, c, cols.what);
    if (cols.strain >= 0 && cols.strain_is == KN_STRAIN) kn_curve_say_bare(f, cols.strain);
    return kn_curve_finish(f, c, 1, &c->begin_s);
}
