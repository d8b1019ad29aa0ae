// Read creep curves: the strain of a specimen under loads that are applied and removed. See measured_curve.h.
#include "clients/identify/measured_curve_parts.h"
#include "clients/rheometer/rheometer.h"
#include "clients/cli/commands.h"
#include "clients/cli/command.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

// ---- load steps: a step is a span of time in which a recorded load stays near one value

enum { LOAD_STEPS = 32 };

typedef struct load_step {
    double load; // mean load of the step; a mean below 2 % of the largest load is set to 0
    // The step began between the reading at early_s and the reading at late_s. If early_s = late_s, the start of the
    // step is known exactly.
    double early_s, late_s;
    int begin, end; // the readings begin..end-1 belong to the step
} load_step;

typedef struct load_steps {
    int count; // number of steps; 0: the load has more than LOAD_STEPS steps
    load_step step[LOAD_STEPS];
    int between; // number of readings that belong to no step, since the load changes there; their values are set to NAN
} load_steps;

// Limits as shares of the largest load, above the noise of a load cell and below the change when a weight is added:
// loads closer than `near_load` count as one load, loads below `zero_load` as no load.
static const double near_load = 0.04, zero_load = 0.02;

// Return the end of the plateau of the load that begins at the reading `begin`, and set *mean to the mean load of the
// plateau. A single reading off the plateau does not end it.
static int plateau(int count, const double *load, int begin, double tolerance, double *mean)
{
    double sum = 0;
    int n = 0, i = begin;
    for (; i < count; i++) {
        const bool here = n == 0 || fabs(load[i] - sum / n) <= tolerance;
        if (!here && !(i + 1 < count && fabs(load[i + 1] - sum / n) <= tolerance)) break;
        if (here) sum += load[i], n++;
    }
    *mean = sum / n;
    return i;
}

// Return whether the next reading confirms the load of reading i. The first and the last one need no confirmation.
static bool confirmed(int count, const double *load, int i, double tolerance)
{
    return i == 0 || i + 1 == count || fabs(load[i + 1] - load[i]) <= tolerance;
}

// Find the steps. A new step begins where the load changes by more than 4 % of the largest load, if the next reading
// confirms the new load.
static void find_steps(load_steps *s, kn_curve *c)
{
    const double most = kn_largest_magnitude(c->count, c->load), tolerance = near_load * most;
    *s = (load_steps){0};
    for (int i = 0; i < c->count;) {
        // If the next reading does not confirm the load of a reading, the reading belongs to no step.
        if (!confirmed(c->count, c->load, i, tolerance)) {
            c->value[i++] = NAN;
            s->between++;
            continue;
        }
        if (s->count == LOAD_STEPS) {
            s->count = 0;
            return;
        }
        load_step *step = &s->step[s->count++];
        step->begin = i;
        step->end = i = plateau(c->count, c->load, i, tolerance, &step->load);
        // Readings off the plateau of their step belong to no step.
        for (int k = step->begin; k < step->end; k++) {
            if (fabs(c->load[k] - step->load) <= tolerance) continue;
            c->value[k] = NAN;
            s->between++;
        }
        step->late_s = c->time_s[step->begin];
        step->early_s = s->count > 1 ? c->time_s[step[-1].end - 1] : step->late_s;
        if (fabs(step->load) <= zero_load * most) step->load = 0;
        for (int k = step->begin; k < step->end; k++) c->load[k] = step->load;
    }
}

// ---- the loads of a creep curve

// Add the first load at the time that a note gives, or at an assumed time (kn_curve_begin). The readings do not show
// this time. Without a note, warn if the strain begins later than the load. If the height is counted from the first
// reading, the strain of this reading is 0 by definition. In that case, warn only if the strain begins after the first
// reading.
static void add_first_load(const kn_curve_file *f, kn_curve *c, double stress_pa, double noise)
{
    const double begin = kn_curve_begin(f, c), span = c->time_s[c->count - 1] - c->time_s[0];
    const bool from_first = c->height_m > 0 && !isfinite(f->height_m);
    double least_s;
    c->step[c->steps++] = (kn_curve_step){begin, stress_pa, begin, begin};
    const double at_s = kn_strain_onset(c->count, c->time_s, c->value, noise, &least_s);
    if (isfinite(f->begin_s) || !(least_s > (from_first ? fmax(begin, c->time_s[0]) : begin) + 1e-3 * span)) return;
    kn_curve_say(f,
                 "the strain begins at %.6g s, but the load is assumed to begin at %.6g s: "
                 "add a line '# begin: %.6g s' that states when the load was applied, or use --late",
                 at_s, begin, at_s);
}

// Convert the plateaus of the recorded load to load steps of the curve.
static int take_steps(kn_curve_file *f, kn_curve *c, const load_steps *found, double noise)
{
    for (int i = 0; i < found->count && c->steps < KN_CURVE_STEPS; i++) {
        const load_step *s = &found->step[i];
        if (s->load == 0 && c->steps == 0) continue; // skip the time without load before the first load
        if (s->load < 0)
            return kn_curve_refuse(f, c->line[s->begin], -1,
                                   "a load that presses and pulls, nominal stress %.3g Pa, expected compression only",
                                   s->load);
        if (i == 0) {
            add_first_load(f, c, s->load, noise);
            continue;
        }
        const kn_curve_step next = {kn_slope_jump(c, s->begin, s->end, s->early_s, s->late_s, noise), s->load,
                                    s->early_s, s->late_s};
        // A load that ended before the specimen's load began did not act on the specimen: the next one is the first.
        if (c->steps == 1 && next.time_s <= c->step[0].time_s && next.stress_pa > 0)
            c->step[0].stress_pa = next.stress_pa;
        else if (c->steps == 1 && next.time_s <= c->step[0].time_s) c->steps = 0;
        else c->step[c->steps++] = next;
    }
    return KN_EXIT_OK;
}

// Take the load steps from the recorded column of load or stress, which is converted to nominal stress. Readings that
// belong to no load step get the value NAN.
static int take_recorded_load(kn_curve_file *f, kn_curve *c, kn_column_quantity load_is, int column)
{
    load_steps found;
    const char *name = kn_column_quantity_name(load_is);
    if (load_is == KN_LOAD && kn_curve_need(f, f->area_m2, "a load", "area", "1 cm^2") != KN_EXIT_OK)
        return KN_EXIT_USAGE;
    kn_curve_upright(f, c->count, c->load, name);
    // a recorded stress acts on the present section, unless its name says that it is the load over the initial one
    const bool nominal = kn_curve_is_nominal(f, column);
    if (load_is == KN_STRESS) c->constant_area |= !nominal;
    if (load_is == KN_STRESS && !f->shear)
        kn_curve_say(f, "'%s' is read as the load over the %s section", f->table.column[column].heading.name,
                     nominal ? "initial" : "present");
    for (int i = 0; i < c->count && load_is == KN_LOAD; i++) c->load[i] /= f->area_m2;
    const double noise = kn_curve_noise(c->count, c->time_s, c->value);
    find_steps(&found, c);
    if (found.count == 0)
        return kn_curve_refuse(f, c->line[0], -1, "the %s changes more than %d times, expected steps", name,
                               LOAD_STEPS);
    char while_it_changed[60];
    snprintf(while_it_changed, sizeof while_it_changed, "while the %s changed", name);
    kn_curve_say_left_out(f, found.between, while_it_changed);
    const int code = take_steps(f, c, &found, noise);
    if (code != KN_EXIT_OK || c->steps > 0) return code;
    return kn_curve_refuse(f, c->line[0], -1, "the %s is 0 in all readings, expected a load on the specimen", name);
}

// Add one constant load. `load_n` is the load in the name of the strain's column. If `load_n` is NAN, a note or an
// option gives the load or the stress.
static int take_given_load(kn_curve_file *f, kn_curve *c, bool compliance, double load_n)
{
    double stress_pa = f->stress_pa;
    c->constant_area |= compliance;
    // If the stress of a compliance is unknown, assume 1 Pa. The strain is then as large as the compliance in 1/Pa.
    c->unknown_stress = compliance && !isfinite(stress_pa) && !isfinite(load_n) && !isfinite(f->load_n);
    if (compliance && !isfinite(stress_pa)) stress_pa = 1;
    if (isfinite(load_n) || !isfinite(stress_pa)) {
        if (!isfinite(load_n)) load_n = f->load_n;
        if (!isfinite(load_n)) {
            char unknown[400];
            kn_column_unknown(&f->table, unknown, sizeof unknown);
            return kn_curve_refuse(f, 0, -1,
                                   "no load, expected a column like 'load_gf', a line '# load: 50 gf' or --load 50gf%s",
                                   kn_curve_turned(unknown));
        }
        if (kn_curve_need(f, f->area_m2, "a load", "area", "1 cm^2") != KN_EXIT_OK) return KN_EXIT_USAGE;
        stress_pa = load_n / f->area_m2;
    }
    add_first_load(f, c, stress_pa, kn_curve_noise(c->count, c->time_s, c->value));
    return KN_EXIT_OK;
}

// If a note or an option gives the time at which the load was removed, use this time. It is more exact than the times
// of the readings before and after the removal.
static int take_release(kn_curve_file *f, kn_curve *c)
{
    if (!isfinite(f->release_s)) return KN_EXIT_OK;
    kn_curve_step *last = &c->step[c->steps - 1];
    if (f->release_s <= c->step[0].time_s || f->release_s > c->time_s[c->count - 1])
        return kn_curve_refuse_note(f, "release",
                                    "%g s, expected a time between the load, %g s, and the last reading, %g s",
                                    f->release_s, c->step[0].time_s, c->time_s[c->count - 1]);
    // If the recorded load never ends, add its removal as a step. If the recorded load ends, the last reading under
    // load and the first reading without load enclose the removal. If the given time is between them, it becomes the
    // time of the removal.
    if (last->stress_pa > 0) {
        if (c->steps == KN_CURVE_STEPS || f->release_s <= last->time_s) return KN_EXIT_OK;
        last = &c->step[c->steps++];
    } else if (f->release_s < last->early_s || f->release_s > last->late_s) {
        kn_curve_say(f, "the column of load shows the release at %g s, so the noted time of %g s is not used",
                     last->time_s, f->release_s);
        return KN_EXIT_OK;
    }
    *last = (kn_curve_step){f->release_s, 0, f->release_s, f->release_s};
    return KN_EXIT_OK;
}

// ---- the columns of a creep table

static const kn_column_quantity values[] = {KN_STRAIN, KN_DISPLACEMENT, KN_COMPLIANCE, KN_HEIGHT},
                                loads[] = {KN_STRESS, KN_LOAD};

typedef struct columns { // indices of columns of the table; -1: the table lacks the column
    int time, load, value;
    kn_column_quantity what, load_is;
    int loads, of_load[KN_CURVES_MAX]; // columns of a wide file, which has one column of values for each load
    double load_n[KN_CURVES_MAX];
} columns;

// Choose the column of the strain, or of a quantity to compute it from. A column of strain is preferred, since the
// instrument has computed the strain from the true size of the specimen. Then choose the column of the load, which a
// compliance does not need. A column of stress is preferred to one of load, since a stress needs no area.
static int choose_single(kn_curve_file *f, columns *c)
{
    int code = KN_EXIT_OK;
    c->load = -1;
    c->value = kn_column_find_first(&f->table, 4, values, &c->what, &code);
    if (code != KN_EXIT_OK) return code;
    if (c->value < 0) return kn_curve_refuse_columns(f, "height, displacement, strain or compliance", "height_mm");
    // a compliance needs no load, but its stress shows when the load was taken off
    for (int i = 0; i < (c->what == KN_COMPLIANCE ? 1 : 2) && c->load < 0 && code == KN_EXIT_OK; i++)
        c->load = kn_column_find(&f->table, c->load_is = loads[i], &code);
    return code;
}

// Choose the columns of time, strain and load.
static int choose(kn_curve_file *f, columns *c)
{
    int code = KN_EXIT_OK;
    c->time = kn_column_find(&f->table, KN_TIME, &code);
    if (code != KN_EXIT_OK) return code;
    if (c->time < 0) return kn_curve_refuse_columns(f, "time", "time_s");
    // a load in the name of a column counts only if no column holds the load: "Displacement (10 N load cell)"
    if (kn_column_find(&f->table, KN_LOAD, NULL) < 0 && kn_column_find(&f->table, KN_STRESS, NULL) < 0)
        c->loads = kn_column_find_loads(&f->table, KN_CURVES_MAX, c->of_load, c->load_n);
    if (c->loads == 0) return choose_single(f, c);
    // A wide file has one column of values for each load. All these columns hold the quantity of the first one.
    const kn_heading *h = &f->table.column[c->of_load[0]].heading;
    c->what = h->has_unit && kn_column_unit_is(&h->unit, "m") ? KN_DISPLACEMENT : KN_STRAIN;
    if (c->what == KN_DISPLACEMENT && (strstr(h->word, "height") || strstr(h->word, "gap"))) c->what = KN_HEIGHT;
    c->load = c->value = -1;
    return KN_EXIT_OK;
}

// ---- from readings to strains

// Count the readings before the load was applied: the first readings with less than 2 % of the largest load.
static int before_load(const kn_curve *c)
{
    if (!c->load) return 0;
    const double most = kn_largest_magnitude(c->count, c->load);
    int n = 0;
    while (n < c->count && fabs(c->load[n]) <= 0.02 * most) n++;
    return n < c->count ? n : 0;
}

static double mean(const double *value, int count)
{
    double sum = 0;
    for (int i = 0; i < count; i++) sum += value[i];
    return sum / count;
}

// Compute the strain from the height. The initial height comes from a note or an option. If neither gives it, the
// initial height is the mean height before the load, or the first height if no reading was taken before the load.
static int height_to_strain(kn_curve_file *f, kn_curve *c, int unloaded, int column)
{
    for (int i = 0; i < c->count; i++)
        if (c->value[i] <= 0)
            return kn_curve_refuse(f, c->line[i], column, "height of %g m, expected one above 0", c->value[i]);
    if (!isfinite(f->height_m))
        kn_curve_take_height(f, c, unloaded ? mean(c->value, unloaded) : c->value[0],
                             unloaded ? "readings before the load"
                                      : "first reading; a line '# height: 1 cm' sets another height");
    for (int i = 0; i < c->count; i++) c->value[i] = 1 - c->value[i] / c->height_m;
    if (mean(c->value, c->count) >= 0) return KN_EXIT_OK;
    return kn_curve_refuse(f, c->line[0], -1,
                           "the height grows under the load or exceeds the initial height, expected compression");
}

// Compute the strain from the column's quantity (height, displacement, strain or compliance). A displacement, a strain
// and a compliance are counted from their mean before the load.
static int to_strain(kn_curve_file *f, kn_curve *c, kn_column_quantity what, int column)
{
    const int unloaded = before_load(c);
    if (what == KN_HEIGHT) return height_to_strain(f, c, unloaded, column);
    if (what == KN_DISPLACEMENT && kn_curve_need(f, f->height_m, "a displacement", "height", "1 cm") != KN_EXIT_OK)
        return KN_EXIT_USAGE;
    for (int i = 0; i < c->count && what == KN_DISPLACEMENT; i++) c->value[i] /= f->height_m;
    const double zero = unloaded ? mean(c->value, unloaded) : 0;
    for (int i = 0; i < c->count; i++) c->value[i] -= zero;
    kn_curve_upright(f, c->count, c->value, kn_column_quantity_name(what));
    if (unloaded && zero != 0)
        kn_curve_say(f, "%s is counted from its mean before the load", kn_column_quantity_name(what));
    const double stress_pa = isfinite(f->stress_pa) ? f->stress_pa
                             : c->load              ? kn_largest_magnitude(c->count, c->load)
                                                    : 1;
    for (int i = 0; i < c->count && what == KN_COMPLIANCE; i++) c->value[i] *= stress_pa;
    if (what == KN_STRAIN) kn_curve_from_hencky(f, column, c->count, c->value);
    return KN_EXIT_OK;
}

// If a strain is 1 or more, print an error and return an exit code. Under a constant nominal stress, as in shear, any
// strain is possible, so there is no check.
static int check_strain(kn_curve_file *f, const kn_curve *c, int column)
{
    for (int i = 0; i < c->count && !c->constant_area; i++)
        if (c->value[i] >= 1)
            return kn_curve_refuse(f, c->line[i], column,
                                   "strain of %.3g, more than the whole height, expected less than 1; is the height "
                                   "right, or the strain in per cent?",
                                   c->value[i]);
    return KN_EXIT_OK;
}

// ---- creep curves from a table

// Report the number of readings, the stress and the time of the release of a curve.
static void say_steps(const kn_curve_file *f, const kn_curve *c, kn_column_quantity what)
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
    kn_curve_say(f, "%s: %d readings of %s, %s%s, %s", c->name, c->count, kn_column_quantity_name(what), stress,
                 c->steps > 1 + (last->stress_pa == 0) ? ", in steps" : "", until);
}

// Shift the times so that the first load is applied at time 0. Readings before the first load, and readings without a
// value, are removed.
static int begin_at_load(kn_curve_file *f, kn_curve *c, const char *name)
{
    const double begin = c->step[0].time_s;
    int line = 0, early = 0;
    kn_curve_compact(c, &line);
    while (early < c->count &&
           (c->time_s[early] < begin || (c->load && c->load[early] == 0 && c->time_s[early] <= begin)))
        early++;
    kn_curve_skip(c, early);
    kn_curve_say_left_out(f, early, "before the load");
    for (int i = 0; i < c->count; i++) c->time_s[i] -= begin;
    for (int i = 0; i < c->steps; i++) {
        c->step[i].time_s -= begin;
        c->step[i].early_s -= begin;
        c->step[i].late_s -= begin;
    }
    return kn_curve_order(f, c, name);
}

// Add one curve from these rows: compute the strain, find the load steps, count time from the first load, estimate the
// noise, and thin the readings.
static int add_curve(kn_curve_file *f, const columns *cols, kn_curve_rows rows, double load_n, const char *part)
{
    const char *name = kn_column_quantity_name(cols->what);
    kn_curve *c = NULL;
    int code = kn_curve_add(f, part, cols->loads > 0, rows, &c);
    if (code == KN_EXIT_OK) code = kn_curve_order(f, c, name);
    if (code == KN_EXIT_OK) code = to_strain(f, c, cols->what, rows.value);
    if (code == KN_EXIT_OK)
        code = c->load ? take_recorded_load(f, c, cols->load_is, rows.load)
                       : take_given_load(f, c, cols->what == KN_COMPLIANCE, load_n);
    if (code == KN_EXIT_OK) code = take_release(f, c);
    if (code == KN_EXIT_OK) code = begin_at_load(f, c, name);
    if (code == KN_EXIT_OK) code = check_strain(f, c, rows.value);
    if (code != KN_EXIT_OK) return code;
    say_steps(f, c, cols->what);
    double changes[KN_CURVE_STEPS];
    // a reading at exactly the time of a load step belongs to the time before the step
    for (int i = 0; i < c->steps; i++) changes[i] = i ? nextafter(c->step[i].time_s, INFINITY) : c->step[i].time_s;
    return kn_curve_finish(f, c, c->steps, changes);
}

// Add one curve for each column of values of a wide file.
static int add_wide(kn_curve_file *f, const columns *c)
{
    int code = KN_EXIT_OK;
    const int end = kn_curve_range_end(&f->table, c->time, 0);
    if (end < f->table.rows)
        return kn_curve_refuse(f, f->table.line[end], c->time, "time falls, expected rows in the order of time");
    for (int i = 0; i < c->loads && code == KN_EXIT_OK; i++) {
        char part[32];
        snprintf(part, sizeof part, "%.4g gf", c->load_n[i] / KN_GF_N);
        code = add_curve(f, c, (kn_curve_rows){0, f->table.rows, c->time, c->of_load[i], -1, -1}, c->load_n[i], part);
    }
    return code;
}

// Return the key column, whose values tell the curves of a file apart: the load, or the stress if there is no load. The
// load is preferred, since the stress may fall within a curve as the section grows.
static int key_of(kn_curve_file *f, const columns *c)
{
    if (c->load < 0 || c->load_is == KN_LOAD || kn_heading_shear(&f->table.column[c->load].heading)) return c->load;
    const int load = kn_column_find(&f->table, KN_LOAD, NULL);
    const char *word = load < 0 ? "" : f->table.column[load].heading.word;
    return load < 0 || strstr(word, "normal") || strstr(word, "axial") ? c->load : load;
}

// Return the largest magnitude in the rows begin..end-1 of a column. Return 0 if `column` is -1.
static double largest(const kn_table_reader *s, int column, int begin, int end)
{
    return column < 0 ? 0 : kn_largest_magnitude(end - begin, s->column[column].value + begin);
}

// Join each recovery to its curve. Instruments write a recovery as a new interval without load, whose time begins at 0
// again. Shift the times of this interval so that they continue the times of the interval before.
static void join_recoveries(const kn_curve_file *f, const columns *c, int key)
{
    const kn_table_reader *s = &f->table;
    double *t = s->column[c->time].value;
    for (int begin = 0, end; (end = kn_curve_range_end(s, c->time, begin)) < s->rows;) {
        const int next = kn_curve_range_end(s, c->time, end);
        double from = 0;
        for (int i = begin; i < end; i++) from = isfinite(t[i]) ? t[i] : from;
        if (largest(s, key, end, next) < 0.02 * largest(s, key, begin, end) && from > 0 && t[end] >= 0) {
            kn_curve_say(f, "time falls in line %d, without load: read as the recovery, which begins at %.5g s",
                         s->line[end], from);
            for (int i = end; i < next; i++) t[i] += from;
        } else {
            begin = end;
        }
    }
}

// Add one curve for each range of rows in which time rises. The load of a range must differ from the load of the range
// before it.
static int add_long(kn_curve_file *f, const columns *c, int key)
{
    const kn_table_reader *s = &f->table;
    const int rows = s->rows;
    int code = KN_EXIT_OK;
    for (int begin = 0, end; begin < rows && code == KN_EXIT_OK; begin = end) {
        end = kn_curve_range_end(s, c->time, begin);
        const double here = largest(s, key, begin, end),
                     next = largest(s, key, end, kn_curve_range_end(s, c->time, end));
        char part[32] = "";
        if (key >= 0 && end < rows && here < 0.02 * next) {
            kn_curve_say_left_out(f, end - begin, "before the load");
            continue;
        }
        if (end < rows && (key < 0 || fabs(next - here) <= 0.01 * here))
            return kn_curve_refuse(f, s->line[end], c->time,
                                   "time falls%s, expected time that rises, or another load from here on",
                                   s->commas ? " (a thousands separator?)" : "");
        // The curves of a file are named after their loads.
        const bool stress = key >= 0 && kn_column_unit_is(&s->column[key].heading.unit, "Pa");
        if (key >= 0 && (begin > 0 || end < rows))
            snprintf(part, sizeof part, "%.4g %s", here / (stress ? 1e3 : KN_GF_N), stress ? "kPa" : "gf");
        code = add_curve(f, c, (kn_curve_rows){begin, end, c->time, c->value, -1, c->load}, NAN, part);
    }
    return code;
}

static bool has_numbers(const kn_table_reader *s, int column)
{
    for (int i = 0; i < s->rows; i++)
        if (isfinite(s->column[column].value[i])) return true;
    return false;
}

int kn_curve_load_creep(kn_curve_file *f)
{
    columns c = {0};
    int wanted[KN_CURVES_MAX + 4], n = 0, code = choose(f, &c);
    if (code != KN_EXIT_OK) return code;
    // Read the columns that are needed: time, one or several columns of values, the load, and the key column that tells
    // the curves apart.
    int key = c.loads ? -1 : key_of(f, &c);
    wanted[n++] = c.time;
    for (int i = 0; i < c.loads; i++) wanted[n++] = c.of_load[i];
    if (c.value >= 0) wanted[n++] = c.value;
    if (c.load >= 0) wanted[n++] = c.load;
    if (key >= 0 && key != c.load) wanted[n++] = key;
    code = kn_curve_read(f, n, wanted);
    if (code != KN_EXIT_OK) return code;
    c.time = *wanted;
    // ignore a load column that has a name but no numbers
    if (c.load >= 0 && !has_numbers(&f->table, c.load)) c.load = key = -1;
    if (c.loads) return add_wide(f, &c);
    if (key >= 0) join_recoveries(f, &c, key);
    code = add_long(f, &c, key);
    for (int i = 0; i < 4 && code == KN_EXIT_OK; i++)
        if (values[i] != c.what && kn_column_find(&f->table, values[i], NULL) >= 0)
            kn_curve_say(f, "the column of %s is used, not that of %s", kn_column_quantity_name(c.what),
                         kn_column_quantity_name(values[i]));
    if (code == KN_EXIT_OK && c.what == KN_STRAIN) kn_curve_say_bare(f, c.value);
    return code;
}
