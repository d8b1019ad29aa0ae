// Read the measurements of `knead identify shape` from files.
#include "clients/identify/measured_curve_parts.h"
#include "clients/cli/commands.h"
#include "clients/cli/command.h"
#include "clients/hand/tool_height.h"
#include "clients/shape/shape_command.h"
#include "core/algebra/algebra.h"
#include "core/solve/tool.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char me[] = "identify shape";
// width of the margin around the outline of the tool; the margin is treated as hidden, too
static const double beside_m = 1e-3;

// ---- the area hidden by the tool

// Compute the box around the tool, as seen from above.
static void plan_of(const kn_probe_def *def, const double turn_wxyz[4], double low_m[2], double high_m[2])
{
    kn_shape shape = {0};
    double unit[4], r[3][3];
    if (def->shape == KN_PROBE_PLATE) {
        for (int k = 0; k < 2; k++) low_m[k] = -0.5 * def->size_m[k], high_m[k] = 0.5 * def->size_m[k];
        return;
    }
    kn_tool_shape(def, &shape);
    kn_turn_unit(turn_wxyz, unit);
    kn_turn_matrix(unit, r);
    for (int k = 0; k < 2; k++) { // x axis and y axis of the scene, in the tool's frame
        const double right[3] = {r[k][0], r[k][1], r[k][2]}, left[3] = {-r[k][0], -r[k][1], -r[k][2]};
        high_m[k] = kn_shape_support(&shape, right);
        low_m[k] = -kn_shape_support(&shape, left);
    }
}

// Return the area that the pressing tool hides at the time time_s. A tool above the top of the object at rest hides
// nothing.
static kn_hidden_area hidden_at(const kn_press *p, const kn_scene *scene, double time_s)
{
    kn_hidden_area box = {{0}, {0}};
    double extent_m[3];
    const int64_t tick = kn_press_tick(p, time_s);
    const kn_probe_input *in = &p->input[tick * p->probes + p->probe];
    const kn_probe_def *def = &scene->model.probe[p->probe];
    kn_model_def_extent(&scene->model, extent_m);
    if (!in->attached || in->position_m[2] - kn_tool_height_m(def) > extent_m[2] + 1e-4) return box;
    plan_of(def, in->orientation_wxyz, box.low_m, box.high_m);
    for (int k = 0; k < 2; k++) {
        box.low_m[k] += in->position_m[k] - beside_m;
        box.high_m[k] += in->position_m[k] + beside_m;
    }
    return box;
}

// ---- measured surfaces

// Load one range image, check its place against the object, and report it.
static int take_image(kn_measurement *m, const kn_shape_options *o, const kn_candidate *c, int number)
{
    char error[400];
    kn_range range;
    uint16_t *level;
    if (!kn_range_load(o->depth[number], &o->given, &range, &level, error, sizeof error))
        return kn_complain(me, KN_EXIT_USAGE, "%s", error);
    const kn_hidden_area hidden = hidden_at(&m->press, c->scene, m->moment_s[number]);
    kn_surface_residual *r = &m->surface[number];
    if (!kn_surface_residual_image(r, &range, level, &c->surface, &hidden, error, sizeof error))
        return kn_complain(me, KN_EXIT_USAGE, "%s: %s", o->depth[number], error);
    m->surfaces++;
    printf("%-10s %s, %d x %d pixels of %.3g mm, at %.3f s: %d patches of %.3g mm, %d of %d rays of the outline; "
           "noise %.2g mm\n",
           number ? "" : "shape", o->depth[number], range.width, range.height, 1e3 * range.pixel_m, m->moment_s[number],
           r->patches, 1e3 * r->side * range.pixel_m, r->rays, KN_SURFACE_RAYS, 1e3 * r->noise_m);
    return KN_EXIT_OK;
}

// Return the column of this name. The column must have a unit with the dimension of `unit`. On an error print the error
// and return -1.
static int named(const kn_table_reader *s, const char *name, const char *unit)
{
    for (int i = 0; i < s->columns; i++) {
        const kn_heading *h = &s->column[i].heading;
        if (strcmp(h->word, name) != 0) continue;
        if (h->has_unit && kn_column_unit_is(&h->unit, unit)) return i;
        kn_table_reader_complain(s, s->header_line, s->column[i].at,
                                 "column '%s' has %s, expected a length like %s [mm]", h->name,
                                 h->has_unit ? "another unit" : "no unit", name);
        return -1;
    }
    kn_table_reader_complain(s, s->header_line, 1, "no column %s, expected x, y and z with their units", name);
    return -1;
}

// Read the points of a file. missing: number of points left out because at least one of their coordinates is missing.
static int read_points(kn_table_reader *s, const char *file, double (**point_m)[3], int *count, int *missing,
                       int *first_line)
{
    int wanted[3], code = kn_table_reader_open(s, file, NULL, NULL, me);
    for (int k = 0; code == KN_EXIT_OK && k < 3; k++)
        if ((wanted[k] = named(s, (const char *const[]){"x", "y", "z"}[k], "m")) < 0) code = KN_EXIT_USAGE;
    if (code == KN_EXIT_OK) code = kn_table_reader_read(s, 3, wanted);
    if (code == KN_EXIT_OK && !(*point_m = calloc((size_t)s->rows + 1, sizeof **point_m)))
        code = kn_complain(me, KN_EXIT_INTERNAL, "out of memory");
    for (int i = 0; code == KN_EXIT_OK && i < s->rows; i++) {
        bool whole = true;
        for (int k = 0; k < 3; k++) {
            (*point_m)[*count][k] = s->column[wanted[k]].value[i];
            whole &= !isnan((*point_m)[*count][k]);
        }
        if (!whole && (*missing)++ == 0) *first_line = s->line[i];
        *count += whole;
    }
    return code;
}

// Read the points of the surface, leave out what the tool hides, and report them.
static int take_points(kn_measurement *m, const kn_shape_options *o, const kn_candidate *c, int number)
{
    char error[400];
    kn_table_reader s;
    double(*point_m)[3] = NULL;
    int rows = 0, missing = 0, line = 0, code = read_points(&s, o->points, &point_m, &rows, &missing, &line);
    kn_table_reader_close(&s);
    if (code != KN_EXIT_OK) {
        free(point_m);
        return code;
    }
    const kn_hidden_area hidden = hidden_at(&m->press, c->scene, m->moment_s[number]);
    kn_surface_residual *r = &m->surface[number];
    char lacking[100] = "";
    if (missing > 0)
        snprintf(lacking, sizeof lacking, "left out: %d point%s without all coordinates, the first in line %d", missing,
                 missing > 1 ? "s" : "", line);
    if (!kn_surface_residual_points(r, rows, point_m, &c->surface, &hidden, error, sizeof error))
        return kn_complain(me, KN_EXIT_USAGE, "%s: %s%s%s", o->points, error, missing > 0 ? "; " : "", lacking);
    m->surfaces++;
    printf("%-10s %s, at %.3f s: %d of %d points\n", number ? "" : "shape", o->points, m->moment_s[number], r->points,
           rows);
    if (missing > 0) printf("           %s\n", lacking);
    return KN_EXIT_OK;
}

// ---- measured force

// Rank how likely a column is the force of the press. Highest: contact_fz_n of Knead's own tables; next: a column
// called force or load; next: a column whose name contains one of these words; lowest: any other column in a unit of
// force. Return 0 without a unit of force.
static int rank_of(const kn_heading *h)
{
    if (!h->has_unit || !kn_column_unit_is(&h->unit, "N")) return 0;
    if (strstr(h->word, "contact") && strstr(h->word, "fz")) return 4;
    if (!strcmp(h->word, "force") || !strcmp(h->word, "contact force") || !strcmp(h->word, "load")) return 3;
    return strstr(h->word, "force") || strstr(h->word, "load") ? 2 : 1;
}

// Return the column of the force. On an error print the error and return -1. It is an error if several columns have the
// highest rank: the force along z cannot be chosen by its name, since the z axis of a sensor may have any direction.
static int force_of(const kn_table_reader *s)
{
    char names[300] = "";
    int best = -1, most = 0, several = 0;
    for (int i = 0; i < s->columns; i++)
        if (rank_of(&s->column[i].heading) > most) best = i, most = rank_of(&s->column[i].heading);
    for (int i = 0; i < s->columns && best >= 0; i++) {
        if (rank_of(&s->column[i].heading) != most) continue;
        const size_t n = strlen(names);
        snprintf(names + n, sizeof names - n, "%s'%.60s'", several++ ? ", " : "", s->column[i].heading.name);
    }
    if (best < 0)
        kn_table_reader_complain(s, s->header_line, 1,
                                 "no column of force with its unit, expected e.g. time [s], force [N]");
    if (several < 2) return best;
    kn_table_reader_complain(
        s, s->header_line, s->column[best].at,
        "%s: %d columns of a force, expected one: the contact force along z, or a column named force", names, several);
    return -1;
}

// Return the first column in a unit of time, or -1.
static int time_of(const kn_table_reader *s)
{
    for (int i = 0; i < s->columns; i++)
        if (s->column[i].heading.has_unit && kn_column_unit_is(&s->column[i].heading.unit, "s")) return i;
    return -1;
}

// If the table has rows of several probes, as Knead's own tables do, read only the rows of this probe.
static void choose_rows(kn_table_reader *s, const char *probe)
{
    for (int i = 0; i < s->columns; i++)
        if (!strcmp(s->column[i].heading.word, "probe")) s->only.text = probe, s->only.column = i;
}

// Allocate room for readings. Return false if memory runs out.
static bool make_room(kn_force_residual *f, int64_t readings)
{
    f->time_s = calloc((size_t)readings + 1, sizeof *f->time_s);
    f->force_n = calloc((size_t)readings + 1, sizeof *f->force_n);
    return f->time_s && f->force_n;
}

// Read time and force from a file. `told` receives the names of the columns and of the probe, for the report.
static int read_force(kn_table_reader *s, kn_force_residual *f, const char *file, const char *probe,
                      char told[2 * KN_HEADING_NAME + 100])
{
    int code = kn_table_reader_open(s, file, NULL, NULL, me);
    if (code != KN_EXIT_OK) return code;
    const int wanted[2] = {time_of(s), force_of(s)};
    if (wanted[1] < 0) return KN_EXIT_USAGE;
    if (wanted[0] < 0)
        return kn_table_reader_complain(s, s->header_line, 1,
                                        "no column of time with its unit, expected e.g. time [s], force [N]");
    choose_rows(s, probe);
    if ((code = kn_table_reader_read(s, 2, wanted)) != KN_EXIT_OK) return code;
    // a second table in the file would be another press, so it is refused
    const int end = kn_curve_range_end(s, wanted[0], 0);
    if (end < s->rows)
        return kn_table_reader_complain(s, s->line[end], kn_table_reader_at(s, s->line[end], wanted[0]),
                                        "time falls, expected one press per file, in the order of time");
    snprintf(told, 2 * KN_HEADING_NAME + 100, ", '%s' over '%s'%s%.40s", s->column[wanted[1]].heading.name,
             s->column[wanted[0]].heading.name, s->only.text ? " of " : "", s->only.text ? s->only.text : "");
    if (!make_room(f, s->rows)) return kn_complain(me, KN_EXIT_INTERNAL, "out of memory");
    for (int i = 0; i < s->rows; i++) {
        const double time_s = s->column[wanted[0]].value[i], force_n = s->column[wanted[1]].value[i];
        if (isnan(time_s) || isnan(force_n)) continue; // the time or the force is missing, so skip the reading
        f->time_s[f->count] = time_s;
        s->line[f->count] = s->line[i];
        f->force_n[f->count++] = force_n;
    }
    return KN_EXIT_OK;
}

// Collect the forces of the log. Ticks without a force are skipped.
static int logged_force(kn_force_residual *f, const kn_press *p)
{
    if (!make_room(f, p->ticks)) return kn_complain(me, KN_EXIT_INTERNAL, "out of memory");
    for (int64_t t = 0; t < p->ticks; t++) {
        if (isnan(p->logged_n[t])) continue;
        f->time_s[f->count] = p->time_s[t];
        f->force_n[f->count++] = p->logged_n[t];
    }
    return KN_EXIT_OK;
}

static void print_force(const kn_force_residual *p, const char *file, const char *told)
{
    printf("force      %s%s: %d readings in %d spans, up to %.4g N%s; noise %.2g N\n", file, told, p->count, p->spans,
           p->most_n, p->turned ? ", where compression is negative" : "", p->noise_n);
    if (p->outliers > 0)
        printf("           outliers left out: %d, the first of them %.4g N at %.4g s\n", p->outliers, p->outlier_n,
               p->outlier_s);
}

// Read the force from a file or from the log, sort it into spans, and report it.
static int take_force(kn_measurement *m, const kn_shape_options *o, const kn_candidate *c)
{
    char error[300], told[2 * KN_HEADING_NAME + 100] = "";
    const char *file = o->force ? o->force : o->log;
    kn_force_residual *f = &m->force;
    int code;
    if (o->force) {
        kn_table_reader s;
        code = read_force(&s, f, file, c->scene->model.probe[m->press.probe].name, told);
        kn_table_reader_close(&s);
        for (int i = 0; i < f->count; i++) f->time_s[i] -= o->force_begin_s;
    } else code = logged_force(f, &m->press);
    if (code != KN_EXIT_OK || (f->count == 0 && !o->force)) { // the log has no forces, so only its poses are used
        kn_force_residual_free(f);
        return code;
    }
    if (!kn_force_residual_make(f, &m->press, error, sizeof error))
        return kn_complain(me, KN_EXIT_USAGE, "%s: %s", file, error);
    m->has_force = true;
    print_force(f, file, told);
    return KN_EXIT_OK;
}

// ---- all measurements of the press

// Make the press, and find the time at which each surface was measured.
static int take_press(kn_measurement *m, const kn_shape_options *o, const kn_candidate *c)
{
    char error[600];
    const bool ok = o->log ? kn_press_log(&m->press, c->scene, &o->press, o->log, error, sizeof error)
                           : kn_press_path(&m->press, c->scene, &o->press, error, sizeof error);
    if (!ok) return kn_complain(me, KN_EXIT_USAGE, "%s", error);
    for (int i = 0; i < o->depths + (o->points != NULL); i++) {
        double *at_s = &m->moment_s[i];
        *at_s = o->at_s[i] == KN_SHAPE_HOLD ? m->press.hold_end_s : fmin(o->at_s[i], m->press.end_s);
        if (isfinite(o->at_s[i]) && o->at_s[i] > m->press.end_s)
            return kn_complain(me, KN_EXIT_USAGE, "--at %g: the press ends at %.3f s", o->at_s[i], m->press.end_s);
    }
    return KN_EXIT_OK;
}

int kn_shape_measured(kn_measurement *m, const kn_shape_options *o, const kn_candidate *c)
{
    *m = (kn_measurement){.align = o->align};
    int code = take_press(m, o, c);
    for (int i = 0; code == KN_EXIT_OK && i < o->depths; i++) code = take_image(m, o, c, i);
    if (code == KN_EXIT_OK && o->points) code = take_points(m, o, c, o->depths);
    if (code == KN_EXIT_OK && (o->force || o->log)) code = take_force(m, o, c);
    if (code == KN_EXIT_OK) kn_measurement_close(m);
    else kn_measurement_free(m);
    return code;
}
