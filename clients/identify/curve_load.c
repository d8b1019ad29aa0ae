// Find the loads on a creeping specimen, and the times at which they were applied and removed. See curve.h.
#include "clients/identify/curve_parts.h"
#include "clients/identify/load_steps.h"
#include "clients/identify/onset.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// If the specimen's area is unknown, print an error and return an exit code.
static int need_area(kn_curve_file *f)
{
    if (isfinite(f->area_m2)) return KN_EXIT_OK;
    return kn_sheet_complain(&f->sheet, f->sheet.header_line, 1,
                             "a load without the specimen's area, expected a line "
                             "'# area: 1 cm^2' or --area '1 cm^2'");
}

// Turn the stress into the nominal stress. If the stress falls as the section grows, it is W h/(S0 h0). Divided by 1 -
// strain, such a stress is constant under each load. Set *constant if the stress is nominal already.
static void to_nominal(kn_curve_file *f, kn_readings *r, bool *constant)
{
    *constant = true;
    for (int i = 0; i < r->count; i++)
        if (r->value[i] > 0.95) return; // so large a strain cannot be compression, so leave the stress unchanged
    double *nominal = malloc((size_t)r->count * sizeof *nominal);
    if (!nominal) return;
    for (int i = 0; i < r->count; i++) nominal[i] = r->load[i] / (1 - r->value[i]);
    if (kn_load_steps_flat(r, nominal, r->load)) {
        *constant = f->constant_area;
        memcpy(r->load, nominal, (size_t)r->count * sizeof *nominal);
    }
    free(nominal);
}

// Return the time at which the load changed. The strain is continuous, and only its slope jumps with the load. So the
// load changed where the lines through the readings before and after meet. If noise hides the jump, return the middle
// between the readings.
static double moment(const kn_readings *r, const kn_load_step *s, double noise)
{
    const double *t = r->time_s + s->begin, *x = r->value + s->begin, middle = 0.5 * (s->early_s + s->late_s);
    const int a = s->begin - 1;
    if (a < 1 || s->begin + 2 >= s->end || !isfinite(x[-1]) || !isfinite(x[-2]) || t[-1] != s->early_s) return middle;
    const double before = (x[-1] - x[-2]) / (t[-1] - t[-2]), next = (x[1] - x[0]) / (t[1] - t[0]);
    // after the change the slope of the strain falls, so the slope right after the change is extrapolated from the
    // slopes of the next two intervals
    const double after = 2 * next - (x[2] - x[1]) / (t[2] - t[1]);
    const double jump = after - before, meet = t[0] - (x[0] - x[-1] - before * (t[0] - t[-1])) / jump;
    // The time at which both lines meet is used only if its noise is below a quarter of the time between the readings.
    if (!(4 * noise < 0.25 * fabs(jump) * (s->late_s - s->early_s))) return middle;
    return fmin(fmax(meet, s->early_s), s->late_s);
}

// If no note gives the time of the load, report a strain that begins later than the assumed time of the load. If the
// height is counted from the first reading, the strain is 0 there by definition, so only a begin after the first
// reading is reported.
static void say_begin(const kn_curve_file *f, const kn_readings *r, const kn_curve *c, double noise)
{
    const double begin = c->step[0].time_s, span = r->time_s[r->count - 1] - r->time_s[0];
    const bool from_first = c->height_m > 0 && !isfinite(f->height_m);
    double least_s;
    const double at_s = kn_onset(r->count, r->time_s, r->value, noise, &least_s);
    if (isfinite(f->begin_s) || !(least_s > (from_first ? fmax(begin, r->time_s[0]) : begin) + 1e-3 * span)) return;
    kn_curve_say(f,
                 "the strain begins at %.6g s, but the load is assumed to begin at %.6g s, since the file does not say "
                 "when it was applied: add a line '# begin: %.6g s' or use --late",
                 at_s, begin, at_s);
}

// Convert the plateaus of the recorded load to load steps of the curve.
static int take_steps(kn_curve_file *f, const kn_readings *r, const kn_load_steps *found, double noise, kn_curve *c)
{
    for (int i = 0; i < found->count && c->steps < KN_CURVE_STEPS; i++) {
        const kn_load_step *s = &found->step[i];
        if (s->load == 0 && c->steps == 0) continue; // skip times without load before the first load
        if (s->load < 0)
            return kn_sheet_complain(&f->sheet, r->line[s->begin], 1,
                                     "a load that presses and pulls, %.3g Pa here, expected compression only", s->load);
        if (i == 0) { // no reading comes before the first load, so the readings do not show its time
            const double begin = kn_curve_begin(f, r);
            c->step[c->steps++] = (kn_curve_step){begin, s->load, begin, begin};
            say_begin(f, r, c, noise);
        } else {
            c->step[c->steps++] = (kn_curve_step){moment(r, s, noise), s->load, s->early_s, s->late_s};
        }
    }
    return KN_EXIT_OK;
}

int kn_curve_load_column(kn_curve_file *f, kn_readings *r, kn_role load_is, kn_curve *c)
{
    kn_load_steps found;
    const char *name = kn_role_name(load_is);
    int code = load_is == KN_LOAD ? need_area(f) : KN_EXIT_OK;
    if (code != KN_EXIT_OK) return code;
    kn_curve_upright(f, r->count, r->load, name);
    if (load_is == KN_STRESS) to_nominal(f, r, &c->constant_area);
    for (int i = 0; i < r->count && load_is == KN_LOAD; i++) r->load[i] /= f->area_m2;
    const double noise = kn_curve_noise(r->count, r->time_s, r->value);
    kn_load_steps_find(&found, r);
    if (found.count == 0)
        return kn_sheet_complain(&f->sheet, r->line[0], 1, "the %s changes more than %d times, expected steps", name,
                                 KN_LOAD_STEPS);
    if (found.between)
        kn_curve_say(f, "%d reading%s while the %s changed, left out", found.between, found.between > 1 ? "s" : "",
                     name);
    code = take_steps(f, r, &found, noise, c);
    if (code != KN_EXIT_OK || c->steps > 0) return code;
    return kn_sheet_complain(&f->sheet, r->line[0], 1, "the %s is 0 in all readings, expected a load on the specimen",
                             name);
}

int kn_curve_load_given(kn_curve_file *f, const kn_readings *r, bool compliance, double load_n, kn_curve *c)
{
    double stress_pa = f->stress_pa;
    c->constant_area |= compliance;
    // Compliance under an unknown stress: with 1 Pa the strain equals the compliance in number.
    if (compliance && !isfinite(stress_pa)) stress_pa = 1;
    if (isfinite(load_n) || !isfinite(stress_pa)) {
        if (!isfinite(load_n)) load_n = f->load_n;
        if (!isfinite(load_n))
            return kn_sheet_complain(&f->sheet, f->sheet.header_line, 1,
                                     "no load, expected a column like 'load_gf', a "
                                     "line '# load: 50 gf' or --load 50gf");
        int code = need_area(f);
        if (code != KN_EXIT_OK) return code;
        stress_pa = load_n / f->area_m2;
    }
    const double begin = kn_curve_begin(f, r);
    c->step[c->steps++] = (kn_curve_step){begin, stress_pa, begin, begin};
    say_begin(f, r, c, kn_curve_noise(r->count, r->time_s, r->value));
    return KN_EXIT_OK;
}

// Print the error that the load was removed outside the times of the curve. The message names the note or the option
// that gives the time of the removal.
static int bad_release(const kn_curve_file *f, double from_s, double to_s)
{
    const kn_sheet *s = &f->sheet;
    int n = 0;
    while (n < s->notes && strcmp(s->note[n].key, "release") != 0) n++;
    char text[160];
    snprintf(text, sizeof text, "released at %g s, expected a time between the load, %g s, and the last reading, %g s",
             f->release_s, from_s, to_s);
    if (n < s->notes) return kn_sheet_complain(s, s->note[n].line, s->note[n].at, "%s", text);
    return kn_complain(s->subcommand, KN_EXIT_USAGE, "%s: %s", s->file, text);
}

int kn_curve_load_release(kn_curve_file *f, const kn_readings *r, kn_curve *c)
{
    if (!isfinite(f->release_s)) return KN_EXIT_OK;
    kn_curve_step *last = &c->step[c->steps - 1];
    if (f->release_s <= c->step[0].time_s || f->release_s > r->time_s[r->count - 1])
        return bad_release(f, c->step[0].time_s, r->time_s[r->count - 1]);
    // The recorded load never ends: add the release as a step. Else refine the recorded release, if the given moment
    // lies between the readings around it.
    if (last->stress_pa > 0) {
        if (c->steps == KN_CURVE_STEPS || f->release_s <= last->time_s) return KN_EXIT_OK;
        last = &c->step[c->steps++];
    } else if (f->release_s < last->early_s || f->release_s > last->late_s) {
        kn_curve_say(f, "released at %g s according to the load, not at %g s", last->time_s, f->release_s);
        return KN_EXIT_OK;
    }
    *last = (kn_curve_step){f->release_s, 0, f->release_s, f->release_s};
    return KN_EXIT_OK;
}
