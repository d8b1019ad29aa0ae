#include "clients/identify/measured_curve_parts.h"
#include "clients/cli/commands.h"
#include "clients/cli/command.h"
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

void kn_curve_free(kn_curve *c)
{
    free(c->time_s);
    free(c->value);
    free(c->other);
    free(c->load);
    free(c->weight);
    free(c->line);
    memset(c, 0, sizeof *c);
}

// ---- messages about a file

void kn_curve_say_left_out(const kn_curve_file *f, int count, const char *which)
{
    if (count > 0) kn_curve_say(f, "%d reading%s %s, left out", count, count > 1 ? "s" : "", which);
}

int kn_curve_refuse_note(const kn_curve_file *f, const char *key, const char *format, ...)
{
    char text[200];
    va_list args;
    const kn_table_reader *s = &f->table;
    int n = 0;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    while (n < s->notes && strcmp(s->note[n].key, key) != 0) n++;
    if (n < s->notes) return kn_table_reader_complain(s, s->note[n].line, s->note[n].at, "%s of %s", key, text);
    return kn_complain(s->subcommand, KN_EXIT_USAGE, "%s: --%s of %s", s->file, key, text);
}

const char *kn_curve_turned(const char *names)
{
    static const char *const words[] = {"torque", "drehmoment", "deflection angle", "auslenk", "'moment"};
    for (size_t i = 0; i < sizeof words / sizeof *words; i++)
        if (strcasestr(names, words[i]))
            return "; a torque or a deflection angle depends on the instrument's geometry: export shear stress and "
                   "shear strain";
    return "";
}

int kn_curve_refuse_columns(const kn_curve_file *f, const char *quantity, const char *example)
{
    char unknown[400];
    kn_column_unknown(&f->table, unknown, sizeof unknown);
    return kn_curve_refuse(f, 0, -1, "no column of %s, expected one, e.g. '%s'%s%s%s%s", quantity, example,
                           kn_curve_turned(unknown), *unknown ? "; not known: " : "", unknown,
                           *unknown ? ", and --column 'NAME=QUANTITY' says what a column holds" : "");
}

static int short_of_memory(const kn_curve_file *f)
{
    return kn_complain(f->table.subcommand, KN_EXIT_DEVICE, "%s: out of memory", f->table.file);
}

int kn_curve_need(const kn_curve_file *f, double value, const char *what, const char *key, const char *example)
{
    if (isfinite(value)) return KN_EXIT_OK;
    return kn_curve_refuse(f, 0, -1, "%s without the specimen's %s, expected a line '# %s: %s' or --%s '%s'", what, key,
                           key, example, key, example);
}

void kn_curve_take_height(const kn_curve_file *f, kn_curve *c, double height_m, const char *source)
{
    c->height_m = height_m;
    kn_curve_say(f, "initial height %.5g mm, from the %s", 1e3 * height_m, source);
}

// ---- readings of a curve

// Copy `count` items of `size` bytes. NULL always means out of memory.
static void *copy(const void *from, int count, size_t size)
{
    void *to = malloc((size_t)(count > 0 ? count : 1) * size);
    if (to) memcpy(to, from, (size_t)count * size);
    return to;
}

// Fill the arrays of a curve from the given rows and columns of the table.
static int take_rows(kn_curve_file *f, kn_curve *c, bool shared, const kn_curve_rows *rows)
{
    kn_table_reader *s = &f->table;
    const int column[] = {rows->time, rows->value, rows->other, rows->load};
    double **const to[] = {&c->time_s, &c->value, &c->other, &c->load};
    const bool move = !shared && rows->begin == 0 && rows->end == s->rows;
    bool ok = true;
    c->count = rows->end - rows->begin;
    for (int i = 0; i < 4 && ok; i++) {
        if (column[i] < 0) continue;
        double **from = &s->column[column[i]].value;
        *to[i] = move ? *from : copy(*from + rows->begin, c->count, sizeof **from);
        if (move) *from = NULL;
        ok = *to[i];
    }
    c->line = move ? s->line : ok ? copy(s->line + rows->begin, c->count, sizeof *s->line) : NULL;
    if (move) s->line = NULL;
    c->weight = malloc((size_t)(c->count > 0 ? c->count : 1) * sizeof *c->weight);
    for (int i = 0; c->weight && i < c->count; i++) c->weight[i] = 1;
    return ok && c->line && c->weight ? KN_EXIT_OK : short_of_memory(f);
}

int kn_curve_range_end(const kn_table_reader *s, int time, int begin)
{
    double before = -INFINITY;
    for (int i = begin; i < s->rows; i++) {
        const double t = s->column[time].value[i];
        if (t < before) return i;
        if (isfinite(t)) before = t;
    }
    return s->rows;
}

// Print an error and return an exit code if there are too few readings, or if the value never changes.
static int check_enough(const kn_curve_file *f, const kn_curve *c, const char *name)
{
    if (c->count < KN_CURVE_LEAST)
        return kn_curve_refuse(f, c->count ? c->line[0] : 0, -1, "%d usable reading%s of %s, expected at least %d",
                               c->count, c->count == 1 ? "" : "s", name, KN_CURVE_LEAST);
    int i = 1;
    while (i < c->count && c->value[i] == c->value[0]) i++;
    if (i < c->count) return KN_EXIT_OK;
    return kn_curve_refuse(f, c->line[0], -1, "%s is %g in all readings, expected one that changes", name, c->value[0]);
}

// Check the numbers that were computed from cells, such as a strain. If a number is too large, print an error and
// return an exit code. The table has already checked the numbers in the cells themselves.
static int check_sane(const kn_curve_file *f, const kn_curve *c)
{
    const double *const all[] = {c->time_s, c->value, c->other, c->load};
    for (int i = 0; i < c->count; i++)
        for (int k = 0; k < 4; k++)
            if (all[k] && fabs(all[k][i]) > KN_TABLE_MOST)
                return kn_curve_refuse(f, c->line[i], -1, "%g in SI units, expected at most %g", all[k][i],
                                       KN_TABLE_MOST);
    return KN_EXIT_OK;
}

int kn_curve_order(kn_curve_file *f, kn_curve *c, const char *name)
{
    const int sane = check_sane(f, c);
    if (sane != KN_EXIT_OK) return sane;
    int line = 0, out = kn_curve_compact(c, &line);
    if (out > 0)
        kn_curve_say(f, "%d reading%s of %s missing, left out; the first in line %d", out, out > 1 ? "s" : "", name,
                     line);
    // time rises in a curve, but a sweep may fall in frequency, which is stored in time_s
    if (f->kind == KN_CURVE_SWEEP && !kn_curve_sort(c)) return short_of_memory(f);
    int merged = kn_curve_merge(c);
    if (merged > 0)
        kn_curve_say(f, "%d reading%s the %s of another: averaged", merged, merged > 1 ? "s have" : " has",
                     f->kind == KN_CURVE_SWEEP ? "frequency" : "time");
    return check_enough(f, c, name);
}

void kn_curve_upright(const kn_curve_file *f, int count, double *value, const char *name)
{
    // Change the signs only if the sum of the negative values is far more than that of the positive values.
    double below = 0, above = 0;
    for (int i = 0; i < count; i++) *(value[i] < 0 ? &below : &above) += fabs(value[i]);
    if (!(below > 20 * above)) return;
    for (int i = 0; i < count; i++) value[i] = -value[i];
    kn_curve_say(f, "%s is negative, as in a file where compression is negative: its sign is changed", name);
}

void kn_curve_say_bare(const kn_curve_file *f, int column)
{
    const kn_heading *h = &f->table.column[column].heading;
    if (h->has_unit) return;
    kn_curve_say(
        f, "'%s' has no unit and is read as a fraction of the height (0.05 is 5 %%); for per cent, name it '%s [%%]'",
        h->name, h->name);
}

double kn_curve_begin(const kn_curve_file *f, const kn_curve *c)
{
    if (isfinite(f->begin_s)) return f->begin_s;
    const double first = c->time_s[0], span = c->time_s[c->count - 1] - first;
    // time counts from the load, and the first reading came a little before or after the load
    if (f->kind == KN_CURVE_RELAX && first <= span && first > 3 * (c->time_s[1] - first))
        kn_curve_say(f,
                     "the hold is assumed to begin at 0 s, %.5g s before the first reading: '# begin: TIME' sets "
                     "another begin",
                     first);
    if (first <= span) return 0;
    kn_curve_say(f,
                 "time does not begin near 0: it is counted from the first reading, %.6g s; "
                 "a line '# begin: TIME' sets another begin",
                 first);
    return first;
}

// ---- curves: name, arrays, noise

// Name the curve after its file (without folder and ending) and after `part`, its part of the file.
static void name_curve(kn_curve *c, const char *file, const char *part)
{
    const char *base = strrchr(file, '/') ? strrchr(file, '/') + 1 : file, *dot = strrchr(base, '.');
    const int length = dot && dot > base ? (int)(dot - base) : (int)strlen(base);
    snprintf(c->name, sizeof c->name, "%.*s%s%s", length > 40 ? 40 : length, base, *part ? " " : "", part);
    for (char *p = c->name; *p; p++)
        if ((unsigned char)*p < ' ') *p = ' ';
}

int kn_curve_add(kn_curve_file *f, const char *part, bool shared, kn_curve_rows rows, kn_curve **curve)
{
    if (*f->count == KN_CURVES_MAX)
        return kn_complain(f->table.subcommand, KN_EXIT_USAGE, "%s: more than %d curves, expected fewer", f->table.file,
                           KN_CURVES_MAX);
    kn_curve *c = *curve = &f->curve[(*f->count)++];
    *c = (kn_curve){.kind = f->kind, .file = f->table.file, .constant_area = f->constant_area};
    if (isfinite(f->height_m)) c->height_m = f->height_m;
    if (isfinite(f->area_m2)) c->area_m2 = f->area_m2;
    name_curve(c, f->table.file, part);
    return take_rows(f, c, shared, &rows);
}

// Turn a curve of shear into one of compression.
static void from_shear(const kn_curve_file *f, kn_curve *c)
{
    const double root = sqrt(3), young = 2 * (1 + (f->opt->poisson > 0 ? f->opt->poisson : 0.5));
    const bool moduli = c->kind == KN_CURVE_SWEEP || (c->kind == KN_CURVE_RELAX && !(c->strain > 0));
    // a compliance whose stress is unknown is the strain under 1 Pa
    const double value = moduli                      ? young
                         : c->kind == KN_CURVE_RELAX ? root
                                                     : (c->unknown_stress ? 1 : root) / young,
                 other = moduli ? young : root / young;
    for (int i = 0; i < c->count; i++) {
        c->value[i] *= value;
        if (c->other) c->other[i] *= other;
    }
    for (int i = 0; i < c->steps && !c->unknown_stress; i++) c->step[i].stress_pa *= root;
    c->strain *= root / young;
    c->young = young;
    kn_curve_say(f, "%s is of shear, and is read as compression: E = %.4g G%s; --compression if it is not of shear",
                 c->name, young, f->opt->poisson > 0 ? "" : ", as of a material that keeps its volume (--poisson)");
}

int kn_curve_finish(kn_curve_file *f, kn_curve *c, int changes, const double *change_s)
{
    const int before = c->count;
    if (f->shear) from_shear(f, c);
    if (f->unsaid)
        kn_curve_say(f,
                     "'%s' does not say whether it is of shear: read as of compression; --shear reads it as of shear",
                     f->unsaid);
    f->unsaid = NULL; // once a file
    // The noise of single readings is estimated before thinning.
    kn_curve_take_noise(c);
    if (!kn_curve_thin(c, KN_CURVE_READINGS, changes, change_s)) return short_of_memory(f);
    free(c->load); // the load is now stored as the load steps of the curve
    c->load = NULL;
    if (c->count < before)
        kn_curve_say(f, "%s: %d readings thinned to %d means, denser after a change of load", c->name, before,
                     c->count);
    return KN_EXIT_OK;
}

// ---- meanings of a column's name

void kn_curve_from_hencky(const kn_curve_file *f, int column, int count, double *strain)
{
    const kn_heading *h = &f->table.column[column].heading;
    if (f->shear || !(strstr(h->word, "hencky") || strstr(h->word, "true strain") || strstr(h->word, "logarithmic")))
        return;
    for (int i = 0; i < count; i++) strain[i] = 1 - exp(-strain[i]);
    kn_curve_say(f, "'%s' is the logarithm of the height: read as the change of the height over the initial one",
                 h->name);
}

bool kn_curve_is_nominal(const kn_curve_file *f, int column)
{
    const char *word = f->table.column[column].heading.word;
    return strstr(word, "nominal") || strstr(word, "engineering");
}

// ---- sweeps: storage and loss modulus over frequency

// Indices of columns of the table; -1: the table lacks the column. `modulus`, `tangent` and `phase` are looked up only
// if the table lacks G' or G''.
typedef struct sweep_columns {
    int frequency, storage, loss, modulus, tangent, phase;
} sweep_columns;

static bool is_whole(const sweep_columns *c) { return c->storage >= 0 && c->loss >= 0; }

static int choose_sweep(kn_curve_file *f, sweep_columns *c)
{
    kn_table_reader *s = &f->table;
    int code = KN_EXIT_OK;
    *c = (sweep_columns){-1, -1, -1, -1, -1, -1};
    c->frequency = kn_column_find(s, KN_FREQUENCY, &code);
    if (code == KN_EXIT_OK) c->storage = kn_column_find(s, KN_STORAGE, &code);
    if (code == KN_EXIT_OK) c->loss = kn_column_find(s, KN_LOSS, &code);
    if (code == KN_EXIT_OK && c->storage < 0) c->modulus = kn_column_find(s, KN_MODULUS, &code);
    if (code == KN_EXIT_OK && !is_whole(c)) c->tangent = kn_column_find(s, KN_TANGENT, &code);
    if (code == KN_EXIT_OK && !is_whole(c) && c->tangent < 0) c->phase = kn_column_find(s, KN_PHASE, &code);
    if (code != KN_EXIT_OK) return code;
    if (c->frequency < 0) return kn_curve_refuse_columns(f, "frequency", "omega [rad/s]");
    if (is_whole(c) || ((c->storage >= 0 || c->modulus >= 0) && (c->tangent >= 0 || c->phase >= 0))) return KN_EXIT_OK;
    return kn_curve_refuse_columns(f, "storage and loss modulus, or |G*| and tan delta or phase angle",
                                   "G' [Pa];G'' [Pa]");
}

// Check that the phase angle is between 0 and 90 degrees. Beyond 90 degrees the computed moduli would be negative, and
// a later error would name moduli that are not in the file.
static int check_phase(kn_curve_file *f, const kn_curve *c)
{
    const double right = acos(-1.0) / 2;
    for (int i = 0; i < c->count; i++)
        if (c->other[i] <= 0 || c->other[i] >= right * (1 - 1e-9))
            return kn_curve_refuse(f, c->line[i], -1, "phase angle of %.6g deg, expected one between 0 and 90",
                                   90 * c->other[i] / right);
    return KN_EXIT_OK;
}

// Compute G' and G'' from |G*| or G' with tan delta or the phase angle.
static void to_parts(kn_curve *c, const sweep_columns *cols)
{
    for (int i = 0; i < c->count; i++) {
        const double tangent = cols->tangent >= 0 ? c->other[i] : tan(c->other[i]);
        if (cols->storage < 0) c->value[i] /= sqrt(1 + tangent * tangent);
        c->other[i] = c->value[i] * tangent;
    }
}

static int check_sweep(kn_curve_file *f, const kn_curve *c)
{
    for (int i = 0; i < c->count; i++) {
        if (!(c->time_s[i] > 0))
            return kn_curve_refuse(f, c->line[i], -1, "frequency of %g Hz, expected one above 0", c->time_s[i]);
        if (!(c->value[i] > 0 && c->other[i] > 0 && isfinite(c->value[i]) && isfinite(c->other[i])))
            return kn_curve_refuse(f, c->line[i], -1,
                                   "storage modulus %g Pa and loss modulus %g Pa, expected both above 0", c->value[i],
                                   c->other[i]);
    }
    return KN_EXIT_OK;
}

static int load_sweep(kn_curve_file *f)
{
    sweep_columns cols;
    kn_curve *c = NULL;
    int code = choose_sweep(f, &cols);
    if (code != KN_EXIT_OK) return code;
    // The first column holds G' or |G*|. The second column holds G'', tan delta or the phase angle.
    const int first = cols.storage >= 0 ? cols.storage : cols.modulus;
    const int second = is_whole(&cols) ? cols.loss : cols.tangent >= 0 ? cols.tangent : cols.phase;
    code = kn_curve_read(f, 3, (int[]){cols.frequency, first, second});
    if (code == KN_EXIT_OK)
        code = kn_curve_add(f, "", false, (kn_curve_rows){0, f->table.rows, cols.frequency, first, second, -1}, &c);
    if (code == KN_EXIT_OK && cols.phase >= 0) code = check_phase(f, c);
    if (code == KN_EXIT_OK && !is_whole(&cols)) to_parts(c, &cols);
    if (code == KN_EXIT_OK) code = kn_curve_order(f, c, "the modulus");
    if (code == KN_EXIT_OK) code = check_sweep(f, c);
    if (code != KN_EXIT_OK) return code;
    kn_curve_say(f, "%s: %d frequencies, %.4g to %.4g Hz", c->name, c->count, c->time_s[0], c->time_s[c->count - 1]);
    return kn_curve_finish(f, c, 0, NULL);
}

// ---- presses: force and depth of a tool over time

// Turn a height into a depth, and make the depth rise while the force does.
static int to_depth(kn_curve_file *f, kn_curve *c, kn_column_quantity what)
{
    const double first = c->other[0];
    const int peak = kn_curve_peak(c);
    const bool falls = c->other[peak] < first;
    if (c->other[peak] > first && what == KN_HEIGHT)
        return kn_curve_refuse(f, c->line[peak], -1,
                               "the height rises as the force does, expected one that falls, or a column named depth");
    for (int i = 0; i < c->count && falls; i++) c->other[i] = what == KN_HEIGHT ? first - c->other[i] : -c->other[i];
    if (falls && what != KN_HEIGHT)
        kn_curve_say(f, "the displacement falls as the force rises: its sign is changed, downwards is positive");
    return KN_EXIT_OK;
}

// Return the force above which a reading of a press is more than noise.
static double touching_n(const kn_curve *c)
{
    const double most = kn_curve_largest(c);
    return fmax(0.01 * most, fmin(4 * c->noise, 0.1 * most));
}

int kn_curve_touch(const kn_curve *c)
{
    const double least_n = touching_n(c), *v = c->value;
    for (int i = 0; i + 2 < c->count; i++)
        if (v[i] > least_n && v[i + 1] > least_n && v[i + 2] > least_n) return i;
    return kn_curve_peak(c);
}

// Leave out most of the readings before and after the touch. The tenth of the press that stays on either side shows the
// place of touch. Refuse a press whose way down is not recorded, or that takes too long for a lattice.
static int cut_air(kn_curve_file *f, kn_curve *c)
{
    const double most = kn_curve_largest(c);
    const int peak = kn_curve_peak(c);
    int before = 0, after = 0;
    double sum = 0, deepest = -INFINITY;
    if (!(most > 0)) return kn_curve_refuse(f, c->line[0], -1, "no force above 0, expected a press");
    c->noise = kn_curve_noise(c->count, c->time_s, c->value);
    const int first = kn_curve_touch(c);
    int last = c->count - 1;
    while (last > first && !(fabs(c->value[last]) > touching_n(c) && fabs(c->value[last - 1]) > touching_n(c))) last--;
    // near the touch the force may already rise
    for (int i = 0; i < first / 2; i++) sum += c->value[i] / (first / 2);
    for (int i = 0; i < c->count; i++) deepest = fmax(deepest, c->other[i]);
    if (!(c->other[peak] - c->other[first] > 0.3 * (deepest - c->other[first])))
        return kn_curve_refuse(
            f, c->line[0], -1,
            "the way down is missing: the tool is at %.4g mm when the force begins and at %.4g mm at the "
            "largest force, expected a press from its begin",
            1e3 * c->other[first], 1e3 * c->other[peak]);
    const double took_s = c->time_s[last] - c->time_s[first], most_s = 1000;
    if (took_s > most_s)
        return kn_curve_refuse(f, c->line[last], -1,
                               "a press of %.4g s, expected at most %g s; is the unit of time right?", took_s, most_s);
    if (first > 8 && fabs(sum) > 0.01 * most && fabs(sum) > 3 * c->noise / sqrt(first / 2))
        kn_curve_say(f, "long before the touch the force is %.2g N on average, not 0: the gauge was not zeroed well",
                     sum);
    for (int i = 0; i < c->count; i++) {
        before += c->time_s[i] < c->time_s[first] - 0.1 * took_s;
        after += c->time_s[i] > c->time_s[last] + 0.1 * took_s;
    }
    kn_curve_say_left_out(f, before, "long before the touch");
    kn_curve_say_left_out(f, after, "long after the touch");
    c->count -= after;
    kn_curve_skip(c, before);
    return check_enough(f, c, "the force near the touch");
}

static int load_press(kn_curve_file *f)
{
    static const kn_column_quantity depths[] = {KN_DISPLACEMENT, KN_HEIGHT};
    kn_table_reader *s = &f->table;
    kn_column_quantity what = KN_DISPLACEMENT;
    kn_curve *c = NULL;
    int code = KN_EXIT_OK, load = -1, depth = -1;
    int time = kn_column_find(s, KN_TIME, &code);
    if (code == KN_EXIT_OK) load = kn_column_find(s, KN_LOAD, &code);
    if (code == KN_EXIT_OK) depth = kn_column_find_first(s, 2, depths, &what, &code);
    if (code != KN_EXIT_OK) return code;
    if (time < 0 || load < 0 || depth < 0)
        return kn_curve_refuse_columns(f, time < 0 ? "time" : load < 0 ? "force" : "depth", "time_s,force_N,depth_mm");
    int wanted[] = {time, load, depth};
    code = kn_curve_read(f, 3, wanted);
    if (code != KN_EXIT_OK) return code;
    time = *wanted;
    const int end = kn_curve_range_end(s, time, 0);
    if (end < s->rows)
        return kn_curve_refuse(f, s->line[end], time, "time falls, expected one press per file, in the order of time");
    code = kn_curve_add(f, "", false, (kn_curve_rows){0, s->rows, time, load, depth, -1}, &c);
    if (code == KN_EXIT_OK) code = kn_curve_order(f, c, "the force");
    if (code != KN_EXIT_OK) return code;
    kn_curve_upright(f, c->count, c->value, "the force");
    code = to_depth(f, c, what);
    if (code != KN_EXIT_OK) return code;
    for (int n = 0; n < s->notes; n++)
        if (!strcmp(s->note[n].key, "tool")) snprintf(c->tool, sizeof c->tool, "%s", s->note[n].value);
    code = cut_air(f, c);
    if (code != KN_EXIT_OK) return code;
    // The readings change their course at the touch and where the tool reaches its deepest place and leaves it.
    double low = c->other[0], high = low;
    for (int i = 0; i < c->count; i++) low = fmin(low, c->other[i]), high = fmax(high, c->other[i]);
    int first = 0, last = c->count - 1, changes = 0;
    while (c->other[first] < high - 0.01 * (high - low)) first++;
    while (c->other[last] < high - 0.01 * (high - low)) last--;
    double change_s[3];
    const int at[3] = {kn_curve_touch(c), first, last};
    for (int i = 0; i < 3; i++)
        if (changes == 0 || c->time_s[at[i]] > change_s[changes - 1]) change_s[changes++] = c->time_s[at[i]];
    kn_curve_say(f, "%s: %d readings in %.4g s, force up to %.4g N, depth from %.4g to %.4g mm", c->name, c->count,
                 c->time_s[c->count - 1] - c->time_s[0], kn_curve_largest(c), 1e3 * low, 1e3 * high);
    return kn_curve_finish(f, c, changes, change_s);
}

// ---- loading one file

// Read the notes. An option applies to all files. A note in a file overrides the option of the same name.
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
        // Take the value of the note. If there is no note, take the value of the option. A note's value must be from
        // 1e-15 to 1e15.
        *notes[i].value = NAN;
        code = kn_table_reader_note(&f->table, notes[i].key, notes[i].unit, notes[i].value);
        const double value = *notes[i].value;
        if (code == KN_EXIT_OK && (value < 1e-15 || value > 1e15))
            code = kn_curve_refuse_note(f, notes[i].key, "%g in SI units, expected above 0 and at most 1e15", value);
        if (isnan(*notes[i].value)) *notes[i].value = notes[i].option > 0 ? notes[i].option : NAN;
    }
    f->begin_s = NAN;
    if (code == KN_EXIT_OK) code = kn_table_reader_note(&f->table, "begin", "s", &f->begin_s);
    f->constant_area = o->constant_area;
    // The note "section: constant" has the effect of the option --constant-area.
    for (int n = 0; n < f->table.notes; n++)
        f->constant_area |= !strcmp(f->table.note[n].key, "section") && !strcmp(f->table.note[n].value, "constant");
    return code;
}

// Return the clock whose first time is nearest to 0. The time since each point does not rise. Except in creep, whose
// recovery may have a clock of its own, a clock must not start again.
static int clock_of(const kn_curve_file *f, int count, const int clock[])
{
    int best = -1;
    double best_s = INFINITY;
    for (int i = 0; i < count; i++) {
        const double *t = f->table.column[clock[i]].value;
        int rises = 0, falls = 0, first = 0;
        while (first + 1 < f->table.rows && isnan(t[first])) first++;
        for (int k = first + 1; k < f->table.rows; k++) rises += t[k] > t[k - 1], falls += t[k] < t[k - 1];
        if (2 * rises < f->table.rows || (falls && f->kind != KN_CURVE_CREEP) || !(fabs(t[first]) < best_s)) continue;
        best = clock[i];
        best_s = fabs(t[first]);
    }
    if (best < 0) return clock[0];
    kn_curve_say(f, "of %d clocks, '%s' is used: its first time, %.4g s, is nearest to 0", count,
                 f->table.column[best].heading.name, best_s);
    return best;
}

// Find whether the columns say that the curve is of shear. If they do not say of what it is, but a rheometer may have
// written them, keep the name of such a column, to be told.
static bool is_shear(kn_curve_file *f, int count, const int wanted[])
{
    const char *unsaid = NULL;
    for (int i = f->kind != KN_CURVE_SWEEP; i < count && !f->opt->compression; i++) {
        const kn_heading *h = &f->table.column[wanted[i]].heading;
        if (kn_heading_shear(h)) return true;
        const char *w = h->word; // a letter such as G' or J, a modulus, a compliance
        const bool letter = strchr("gj", *w) && strlen(w) < 6 && !kn_column_unit_is(&h->unit, "m");
        if (letter || !strcmp(w, "tau") || !strcmp(w, "stress") || strstr(w, "modul") || strstr(w, "compliance"))
            unsaid = h->name;
    }
    // If the columns do not say it, another column of the table may.
    for (int c = 0; c < f->table.columns && unsaid && !f->opt->compression; c++)
        if (kn_heading_shear(&f->table.column[c].heading)) return true;
    f->unsaid = f->opt->shear ? NULL : unsaid;
    return f->opt->shear;
}

int kn_curve_read(kn_curve_file *f, int count, int wanted[])
{
    int all[KN_CURVES_MAX + 16], clock[8], code = KN_EXIT_OK;
    const int clocks = f->kind == KN_CURVE_SWEEP ? 0 : kn_column_find_clocks(&f->table, 8, clock, &code);
    memcpy(all, wanted, (size_t)count * sizeof *all);
    for (int i = 1; i < clocks; i++) all[count + i - 1] = clock[i];
    // read the rows, then the notes, since notes may be above or below the table
    if (code == KN_EXIT_OK) code = kn_table_reader_read(&f->table, count + (clocks > 1 ? clocks - 1 : 0), all);
    if (code != KN_EXIT_OK) return code;
    if (clocks > 1) wanted[0] = clock_of(f, clocks, clock);
    code = take_notes(f);
    if (code != KN_EXIT_OK) return code;
    if (f->kind != KN_CURVE_PRESS) f->shear = is_shear(f, count, wanted);
    f->constant_area |= f->shear;
    for (int i = 0; i < count && f->shear; i++)
        if (strstr(f->table.column[wanted[i]].heading.word, "normal"))
            return kn_curve_refuse(f, 0, -1, "'%s' is no load of shear, expected a shear stress",
                                   f->table.column[wanted[i]].heading.name);
    return code;
}

// The gap of a rheometer is no measured height if the curve is of shear.
static void hide_gaps(kn_curve_file *f)
{
    bool shear = f->opt->shear;
    for (int c = 0; c < f->table.columns; c++) shear |= kn_heading_shear(&f->table.column[c].heading);
    for (int c = 0; c < f->table.columns && shear && !f->opt->compression; c++) {
        kn_heading *h = &f->table.column[c].heading;
        if (!h->role && (strstr(h->word, "gap") || strstr(h->word, "spalt"))) h->role = -1;
    }
}

int kn_curve_load(kn_curve curve[KN_CURVES_MAX], int *count, kn_curve_kind kind, const char *file,
                  const kn_curve_options *options)
{
    static int (*const load[])(kn_curve_file * f) = {kn_curve_load_creep, kn_curve_load_relax, load_sweep, load_press};
    kn_curve_file *f = malloc(sizeof *f);
    if (!f) return kn_complain(options->subcommand, KN_EXIT_DEVICE, "%s: out of memory", file);
    // Open the table and let the loader for this kind of curve read it.
    *f = (kn_curve_file){.opt = options, .kind = kind, .curve = curve, .count = count};
    const int before = *count;
    int code = kn_table_reader_open(&f->table, file, options->units, options->roles, options->subcommand);
    hide_gaps(f);
    if (code == KN_EXIT_OK) code = load[kind](f);
    if (code == KN_EXIT_OK && f->table.statistics > 0)
        kn_curve_say(f, "%d row%s of statistics, left out", f->table.statistics, f->table.statistics > 1 ? "s" : "");
    if (code == KN_EXIT_OK && f->table.commas) kn_curve_say(f, "the numbers have decimal commas");
    // After an error, free the curves that were added from this file.
    while (code != KN_EXIT_OK && *count > before) kn_curve_free(&curve[--*count]);
    kn_table_reader_close(&f->table);
    free(f);
    return code;
}
