// Read relaxation curves: the stress of a specimen that is held at a strain. See curve.h.
#include "clients/identify/curve_parts.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include <math.h>
#include <stdio.h>

typedef struct columns { // indices of columns of the sheet; -1: the sheet has no such column
    int time, value, strain;
    kn_role what, strain_is;
} columns;

static int choose(kn_curve_file *f, columns *c)
{
    static const kn_role values[] = {KN_STRESS, KN_LOAD, KN_MODULUS},
                         strains[] = {KN_STRAIN, KN_DISPLACEMENT, KN_HEIGHT};
    kn_sheet *s = &f->sheet;
    int code = KN_EXIT_OK;
    *c = (columns){.value = -1, .strain = -1};
    c->time = kn_role_find(s, KN_TIME, &code);
    for (int i = 0; i < 3 && c->value < 0 && code == KN_EXIT_OK; i++)
        c->value = kn_role_find(s, c->what = values[i], &code);
    if (code == KN_EXIT_OK) c->strain = kn_role_find_first(s, 3, strains, &c->strain_is, &code);
    if (code != KN_EXIT_OK) return code;
    if (c->time < 0) return kn_sheet_complain(s, s->header_line, 1, "no time, expected a column like 'time_s'");
    if (c->value >= 0) return KN_EXIT_OK;
    return kn_sheet_complain(s, s->header_line, 1,
                             "no column of stress, load or modulus, expected one, e.g. 'stress_kPa'");
}

// ---- strain

// Compute the strain from displacement or height. Without a note, the first height is the initial one.
static int to_strain(kn_curve_file *f, kn_readings *r, kn_role what, kn_curve *c)
{
    if (what != KN_STRAIN && !isfinite(f->height_m)) {
        if (what == KN_DISPLACEMENT)
            return kn_sheet_complain(&f->sheet, f->sheet.header_line, 1,
                                     "a displacement without the specimen's height, "
                                     "expected a line '# height: 1 cm' or --height '1 cm'");
        c->height_m = r->other[0];
        kn_curve_say(f, "initial height %.5g mm, from the first reading; a line '# height: 1 cm' sets another height",
                     1e3 * c->height_m);
    }
    for (int i = 0; i < r->count && what != KN_STRAIN; i++)
        r->other[i] = what == KN_HEIGHT ? 1 - r->other[i] / c->height_m : r->other[i] / c->height_m;
    kn_curve_upright(f, r->count, r->other, kn_role_name(what));
    for (int i = 0; i < r->count; i++)
        if (r->other[i] >= 1)
            return kn_sheet_complain(&f->sheet, r->line[i], 1,
                                     "strain of %.3g, more than the whole height, expected less "
                                     "than 1",
                                     r->other[i]);
    return KN_EXIT_OK;
}

// Return the held strain: the mean of the later half of the readings within 2 % of the largest strain.
static double held(const kn_readings *r)
{
    double most = 0, sum = 0;
    int n = 0, seen = 0;
    for (int i = 0; i < r->count; i++) most = fmax(most, r->other[i]);
    for (int i = 0; i < r->count; i++) n += r->other[i] >= 0.98 * most;
    for (int i = 0; i < r->count; i++)
        if (r->other[i] >= 0.98 * most && seen++ >= n / 2) sum += r->other[i];
    return n > 0 ? sum / (n - n / 2) : 0;
}

// Return the end of the ramp: the time at which the line through the middle reading and the last reading of the ramp
// reaches the held strain. A ramp of fewer than three readings ends at the first reading with the held strain.
static double ramp_end(const kn_readings *r, int reached, double strain)
{
    int middle = reached;
    while (middle > 0 && r->other[middle] > 0.5 * strain) middle--;
    const double t = r->time_s[middle], slope = (r->other[reached] - r->other[middle]) / (r->time_s[reached] - t);
    return reached - middle < 3 || !(slope > 0) ? r->time_s[reached] : t + (strain - r->other[middle]) / slope;
}

// Keep the readings from the last one without strain to the end of the hold.
static int keep_hold(kn_curve_file *f, kn_readings *r, kn_curve *c)
{
    c->strain = held(r);
    if (!(c->strain > 0))
        return kn_sheet_complain(&f->sheet, r->line[0], 1,
                                 "the strain is 0 in all readings, expected a strain that is held");
    int reached = 0, before = 0, end;
    // `reached` is the first reading at the strain, `before` the last one without strain, `end` the first one after the
    // hold.
    while (reached < r->count && r->other[reached] < 0.99 * c->strain) reached++;
    for (int i = 0; i < reached; i++)
        if (r->other[i] <= 0.002 * c->strain) before = i;
    for (end = reached; end < r->count && r->other[end] > 0.95 * c->strain;) end++;
    c->begin_s = isfinite(f->begin_s) ? f->begin_s
                 : reached > 0        ? ramp_end(r, reached, c->strain)
                                      : kn_curve_begin(f, r);
    if (end < r->count)
        kn_curve_say(f, "%d reading%s after the strain was released, left out", r->count - end,
                     r->count - end > 1 ? "s" : "");
    if (before > 0) kn_curve_say(f, "%d reading%s before the strain, left out", before, before > 1 ? "s" : "");
    r->count = end;
    kn_readings_skip(r, before);
    return KN_EXIT_OK;
}

// Return the time at which the hold begins if the file has no column of strain: the time of the largest stress, if the
// stress rises up to that reading.
static double begin_of_hold(const kn_curve_file *f, const kn_readings *r)
{
    int peak = 0;
    for (int i = 0; i < r->count; i++)
        if (r->value[i] > r->value[peak]) peak = i;
    if (isfinite(f->begin_s) || r->value[0] > 0.8 * r->value[peak] || r->count - peak < KN_CURVE_LEAST)
        return kn_curve_begin(f, r);
    kn_curve_say(
        f,
        "the stress rises until %.5g s: the hold is assumed to begin there; a line '# begin: TIME' sets another begin",
        r->time_s[peak]);
    return r->time_s[peak];
}

static int take_strain(kn_curve_file *f, kn_readings *r, const columns *cols, kn_curve *c)
{
    // The file has a column of strain: find the hold in it.
    if (r->other) {
        int code = to_strain(f, r, cols->strain_is, c);
        return code == KN_EXIT_OK ? keep_hold(f, r, c) : code;
    }
    // The file has no column of strain, so the strain comes from a note or option, and the hold begins at the largest
    // stress.
    if (isfinite(f->strain)) c->strain = f->strain;
    if (c->strain >= 1)
        return kn_complain(f->sheet.subcommand, KN_EXIT_USAGE, "%s: strain of %g, expected less than 1, like 10 %%",
                           f->sheet.file, c->strain);
    c->begin_s = begin_of_hold(f, r);
    int before = 0;
    while (before < r->count && r->time_s[before] < c->begin_s) before++;
    if (before > 0)
        kn_curve_say(f, "%d reading%s before the strain was reached, left out", before, before > 1 ? "s" : "");
    kn_readings_skip(r, before);
    return KN_EXIT_OK;
}

// ---- stress

static double strain_of(const kn_readings *r, const kn_curve *c, int i) { return r->other ? r->other[i] : c->strain; }

// Compute the stress from load or modulus. The section grows with the strain unless it is constant.
static int to_stress(kn_curve_file *f, kn_readings *r, kn_role what, kn_curve *c)
{
    if (what == KN_LOAD && !isfinite(f->area_m2))
        return kn_sheet_complain(&f->sheet, f->sheet.header_line, 1,
                                 "a load without the specimen's area, expected a line "
                                 "'# area: 1 cm^2' or --area '1 cm^2'");
    if (what == KN_LOAD && !(c->strain > 0) && !c->constant_area)
        return kn_sheet_complain(&f->sheet, f->sheet.header_line, 1,
                                 "a load without the strain, which is needed for the area, expected a line '# strain: "
                                 "10 %%' or '# section: constant', --strain or --constant-area");
    for (int i = 0; i < r->count; i++) {
        // Stress is the load over the current area; a modulus times the strain is a stress.
        if (what == KN_LOAD) r->value[i] *= (c->constant_area ? 1 : 1 - strain_of(r, c, i)) / f->area_m2;
        else if (what == KN_MODULUS && c->strain > 0) r->value[i] *= strain_of(r, c, i);
    }
    return KN_EXIT_OK;
}

static void say(const kn_curve_file *f, const kn_curve *c, const kn_readings *r, kn_role what)
{
    char strain[60] = "strain unknown";
    if (c->strain > 0) snprintf(strain, sizeof strain, "strain of %.4g %%", 100 * c->strain);
    kn_curve_say(f, "%s: %d readings of %s, %s%s from %.4g s on, to %.5g s", c->name, r->count, kn_role_name(what),
                 strain, r->other ? " and the rise to it, held" : ", held", c->begin_s, r->time_s[r->count - 1]);
}

int kn_curve_load_relax(kn_curve_file *f)
{
    columns cols;
    kn_readings r = {0};
    int code = choose(f, &cols);
    if (code == KN_EXIT_OK)
        code = kn_curve_rows(f, cols.strain >= 0 ? 3 : 2, (int[]){cols.time, cols.value, cols.strain});
    const int end = code == KN_EXIT_OK ? kn_curve_range_end(&f->sheet, cols.time, 0) : 0;
    if (code == KN_EXIT_OK && end < f->sheet.rows)
        code = kn_sheet_complain(&f->sheet, f->sheet.line[end], kn_sheet_at(&f->sheet, f->sheet.line[end], cols.time),
                                 "time restarts, expected one relaxation per file");
    if (code == KN_EXIT_OK)
        code = kn_curve_readings(f, &r, 0, f->sheet.rows, cols.time, cols.value, cols.strain, -1, true);
    kn_curve *c = code == KN_EXIT_OK ? kn_curve_add(f, KN_CURVE_RELAX, "") : NULL;
    if (code == KN_EXIT_OK && !c) code = KN_EXIT_USAGE;
    if (code == KN_EXIT_OK) code = kn_curve_order(f, &r, kn_role_name(cols.what));
    if (code == KN_EXIT_OK) kn_curve_upright(f, r.count, r.value, kn_role_name(cols.what));
    if (code == KN_EXIT_OK) code = take_strain(f, &r, &cols, c);
    if (code == KN_EXIT_OK) code = to_stress(f, &r, cols.what, c);
    if (code == KN_EXIT_OK) code = kn_curve_order(f, &r, kn_role_name(cols.what));
    if (code == KN_EXIT_OK) {
        say(f, c, &r, cols.what);
        if (cols.strain_is == KN_STRAIN) kn_curve_say_bare(f, cols.strain);
        code = kn_curve_finish(f, c, &r, 1, &c->begin_s);
    }
    kn_readings_free(&r);
    return code;
}
