#include "clients/hand/tool_path.h"
#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Duration of the rest after a withdrawal. The fast recovery of the object takes less time.
static const double rest_s = 1.0;
// Speeds and times of the last part of the way down, see add_landing.
static const double landing_m = 1e-3, landing_s = 1.0, settling_s = 0.2, flushing_m_s = 5e-4;

double kn_tool_path_distance(const double a[3], const double b[3])
{
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2]));
}

// Append a piece that starts when the previous one ends. The piece begins and ends at the point `from`; the caller may
// then set another end point.
static kn_tool_path_piece *add(kn_tool_path *path, kn_tool_path_piece_kind kind, const char *name,
                               const kn_tool_path_point *from, double duration_s)
{
    kn_tool_path_piece *p = &path->piece[path->count++];
    *p = (kn_tool_path_piece){.kind = kind, .name = name, .from = *from, .to = *from};
    p->start_s = path->duration_s;
    p->duration_s = duration_s;
    path->duration_s += duration_s;
    return p;
}

// Append a LINE piece. On a short line, the ramps keep their duration and the speed is lower, so the acceleration never
// exceeds speed / ramp.
static void add_line(kn_tool_path *path, const char *name, const kn_tool_path_point *from, const kn_tool_path_point *to,
                     double speed_m_s)
{
    double way_m = kn_tool_path_distance(from->position_m, to->position_m);
    double cruise_s = fmax(0.0, way_m / speed_m_s - KN_TOOL_PATH_RAMP_S);
    add(path, KN_TOOL_PATH_PIECE_LINE, name, from, way_m > 0.0 ? cruise_s + 2.0 * KN_TOOL_PATH_RAMP_S : 0.0)->to = *to;
}

// Allocate a path with room for `count` pieces, as one block of memory.
static kn_tool_path *create(int pieces)
{
    kn_tool_path *path = calloc(1, sizeof *path + (size_t)pieces * sizeof(kn_tool_path_piece));
    if (path) path->piece = (kn_tool_path_piece *)(path + 1);
    return path;
}

void kn_tool_path_destroy(kn_tool_path *path) { free(path); }

static kn_tool_path_point at_height(double z_m)
{
    return (kn_tool_path_point){.position_m = {0, 0, z_m}, .orientation_wxyz = {1, 0, 0, 0}};
}

// Return the argument `value` if it is positive, and the argument `otherwise` if not.
static double or_default(double value, double otherwise) { return value > 0.0 ? value : otherwise; }
static double hold_of(const kn_tool_path_def *def) { return def->hold_s < 0.0 ? 4.0 : def->hold_s; }

// Return the point in the air where a path begins and ends.
static kn_tool_path_point above(const kn_tool_path_def *def)
{
    return at_height(def->touch_z_m + or_default(def->clear_m, 0.02));
}

// Append the way down through the air until the tool rests on the object, and return the final point. The tool must
// touch at less than 0.1 mm/s, because dough is as hard as a wall until it flows: in the first ms of contact, the force
// on a plate is about 2 N per mm/s of the plate's speed. kneadd's tool is some um away from the path, so the path must
// be slow even before it reaches the object.
static kn_tool_path_point add_landing(kn_tool_path *path, const kn_tool_path_def *def)
{
    // Go fast to 1 mm above the object, take one second for the last millimetre, then stand for settling_s.
    kn_tool_path_point air = above(def), near = at_height(def->touch_z_m + landing_m),
                       touch = at_height(def->touch_z_m);
    add_line(path, "approach", &air, &near, KN_TOOL_PATH_AIR_M_S);
    add(path, KN_TOOL_PATH_PIECE_CURVE, "touch", &near, landing_s)->to = touch;
    add(path, KN_TOOL_PATH_PIECE_STAND, "touch", &touch, settling_s);
    // On an uneven top, sink slowly until the flat tool rests on everything under it.
    if (def->uneven_m > 0.0) {
        kn_tool_path_point flush = at_height(def->touch_z_m - def->uneven_m);
        add_line(path, "flush", &touch, &flush, flushing_m_s);
        touch = flush;
    }
    return touch;
}

kn_tool_path *kn_tool_path_press(const kn_tool_path_def *def)
{
    kn_tool_path *path = create(8);
    if (!path) return NULL;
    double speed_m_s = or_default(def->speed_m_s, 0.01);
    kn_tool_path_point air = above(def), touch = add_landing(path, def);
    kn_tool_path_point bottom = at_height(def->touch_z_m - or_default(def->depth_m, 0.01));
    add_line(path, "press", &touch, &bottom, speed_m_s);
    add(path, KN_TOOL_PATH_PIECE_STAND, "hold", &bottom, hold_of(def));
    path->hold_end_s = path->duration_s;
    add_line(path, "withdraw", &bottom, &air, speed_m_s);
    add(path, KN_TOOL_PATH_PIECE_STAND, "rest", &air, rest_s);
    return path;
}

kn_tool_path *kn_tool_path_poke(const kn_tool_path_def *def)
{
    kn_tool_path *path = create(3);
    if (!path) return NULL;
    double speed_m_s = or_default(def->speed_m_s, 0.05);
    kn_tool_path_point air = above(def), bottom = at_height(def->touch_z_m - or_default(def->depth_m, 0.003));
    add_line(path, "poke", &air, &bottom, speed_m_s);
    add_line(path, "withdraw", &bottom, &air, speed_m_s);
    add(path, KN_TOOL_PATH_PIECE_STAND, "rest", &air, rest_s);
    return path;
}

kn_tool_path *kn_tool_path_sine(const kn_tool_path_def *def)
{
    kn_tool_path *path = create(7);
    if (!path) return NULL;
    // Swing a whole number of periods, at least one, so that the sine ends at rest.
    double frequency_hz = or_default(def->frequency_hz, KN_TOOL_PATH_SWING_HZ),
           periods = fmax(1.0, round(hold_of(def) * frequency_hz));
    kn_tool_path_point air = above(def), touch = add_landing(path, def);
    kn_tool_path_piece *swing = add(path, KN_TOOL_PATH_PIECE_SINE, "swing", &touch, periods / frequency_hz);
    swing->to = at_height(def->touch_z_m - or_default(def->depth_m, KN_TOOL_PATH_SWING_M));
    swing->periods = periods;
    add_line(path, "withdraw", &touch, &air, KN_TOOL_PATH_AIR_M_S);
    add(path, KN_TOOL_PATH_PIECE_STAND, "rest", &air, rest_s);
    return path;
}

// The velocity at a point is the difference of the positions of its two neighbours, divided by the difference of their
// times (Catmull and Rom). At both ends of the path the velocity is 0.
kn_tool_path *kn_tool_path_through(int count, const double time_s[], kn_tool_path_point point[])
{
    kn_tool_path *path = create(count - 1);
    if (!path) return NULL;
    for (int n = 0; n < count; n++)
        for (int i = 0; i < 3; i++)
            point[n].velocity_m_s[i] =
                n == 0 || n == count - 1
                    ? 0.0
                    : (point[n + 1].position_m[i] - point[n - 1].position_m[i]) / (time_s[n + 1] - time_s[n - 1]);
    // Join the points by Hermite curves.
    for (int n = 0; n + 1 < count; n++)
        add(path, KN_TOOL_PATH_PIECE_CURVE, "path", &point[n], time_s[n + 1] - time_s[n])->to = point[n + 1];
    return path;
}

void kn_tool_path_retreat(kn_tool_path *path, kn_tool_path_piece piece[4], const kn_tool_path_point *from, double z_m,
                          const kn_tool_path_point *to)
{
    *path = (kn_tool_path){.piece = piece};
    // If the tool brakes evenly from its present velocity to rest, it moves by half of velocity times braking time.
    kn_tool_path_point still = *from, up;
    for (int i = 0; i < 3; i++) still.position_m[i] += 0.5 * KN_TOOL_PATH_RAMP_S * from->velocity_m_s[i];
    memset(still.velocity_m_s, 0, sizeof still.velocity_m_s);
    // The lift never goes down, even if the tool is above z_m already.
    up = still;
    up.position_m[2] = fmax(z_m, still.position_m[2]);
    add(path, KN_TOOL_PATH_PIECE_CURVE, "stop", from, KN_TOOL_PATH_RAMP_S)->to = still;
    add_line(path, "lift", &still, &up, KN_TOOL_PATH_AIR_M_S);
    add_line(path, "return", &up, to, KN_TOOL_PATH_AIR_M_S);
    add(path, KN_TOOL_PATH_PIECE_STAND, "wait", to, 0.0);
}

// Compute the fraction (0..1) of a LINE that the tool has covered at time t, and the rate of change of this fraction
// [1/s]. Over time, the rate has the shape of a trapezoid with the area 1.
static void trapezoid(double t, double duration_s, double *share, double *rate)
{
    double r = KN_TOOL_PATH_RAMP_S, peak = 1.0 / (duration_s - r), left = duration_s - t;
    if (t < r) *share = 0.5 * peak * t * t / r, *rate = peak * t / r;
    else if (left < r) *share = 1.0 - 0.5 * peak * left * left / r, *rate = peak * left / r;
    else *share = peak * (t - 0.5 * r), *rate = peak;
}

// Evaluate the cubic Hermite curve of a piece at time t. h: the Hermite base functions of u; g = dh/du: their
// derivatives. u runs from 0 to 1 along the piece.
static void curve(const kn_tool_path_piece *p, double t, kn_tool_path_point *out)
{
    double d = p->duration_s, u = t / d;
    double h00 = (1 + 2 * u) * (1 - u) * (1 - u), h10 = u * (1 - u) * (1 - u);
    double h01 = u * u * (3 - 2 * u), h11 = u * u * (u - 1);
    double g00 = 6 * u * (u - 1), g10 = (1 - u) * (1 - 3 * u), g11 = u * (3 * u - 2);
    for (int i = 0; i < 3; i++) {
        double a = p->from.position_m[i], va = p->from.velocity_m_s[i];
        double b = p->to.position_m[i], vb = p->to.velocity_m_s[i];
        out->position_m[i] = h00 * a + h10 * d * va + h01 * b + h11 * d * vb;
        out->velocity_m_s[i] = g00 * (a - b) / d + g10 * va + g11 * vb;
    }
}

// Interpolate the quaternion linearly and normalise it. The sign of the end quaternion is chosen so that the tool turns
// the short way round.
static void turn(const kn_tool_path_piece *p, double u, double q[4])
{
    const double *a = p->from.orientation_wxyz, *b = p->to.orientation_wxyz;
    double same = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] < 0.0 ? -1.0 : 1.0, n = 0.0;
    for (int i = 0; i < 4; i++) q[i] = (1 - u) * a[i] + u * same * b[i], n += q[i] * q[i];
    for (int i = 0; i < 4; i++) q[i] /= sqrt(n);
}

const kn_tool_path_piece *kn_tool_path_at(const kn_tool_path *path, double t_s, kn_tool_path_point *out)
{
    // Bisect for the last piece that starts at or before t_s.
    int low = 0, high = path->count - 1;
    while (low < high) {
        int middle = (low + high + 1) / 2;
        if (path->piece[middle].start_s <= t_s) low = middle;
        else high = middle - 1;
    }
    // Outside the path the tool rests at the path's first or last point, so clamp the time into the piece.
    const kn_tool_path_piece *p = &path->piece[low];
    double t = fmin(fmax(t_s - p->start_s, 0.0), p->duration_s), share = 0.0, rate = 0.0;
    *out = p->from;
    memset(out->velocity_m_s, 0, sizeof out->velocity_m_s);
    if (p->kind == KN_TOOL_PATH_PIECE_STAND || p->duration_s == 0.0) return p;
    turn(p, t / p->duration_s, out->orientation_wxyz);
    if (p->kind == KN_TOOL_PATH_PIECE_CURVE) {
        curve(p, t, out);
        return p;
    }
    // LINE and SINE both move along a straight line. They differ in the fraction of the line that the tool has covered
    // at time t.
    if (p->kind == KN_TOOL_PATH_PIECE_LINE) {
        trapezoid(t, p->duration_s, &share, &rate);
    } else {
        double w = 2.0 * M_PI * p->periods / p->duration_s;
        share = 0.5 * (1.0 - cos(w * t)), rate = 0.5 * w * sin(w * t);
    }
    for (int i = 0; i < 3; i++) {
        double way_m = p->to.position_m[i] - p->from.position_m[i];
        out->position_m[i] += share * way_m;
        out->velocity_m_s[i] = rate * way_m;
    }
    return p;
}

// Reader of paths from CSV files; see tool_path.h. Rows are parsed and checked one by one, so that every error message
// can name the line and column.

// kneadd refuses poses outside this workspace, and poses that move faster than this speed.
static const double workspace_m = 1.0;
static const double speed_max_m_s = 5.0;

// Present position in the CSV file, for error messages.
typedef struct reader {
    const char *file;
    int line;
    char *error;
    size_t error_size;
} reader;

// Write `file:line:column: ...` to error. Return false.
__attribute__((format(printf, 3, 4))) static bool complain(const reader *r, int column, const char *format, ...)
{
    int n = snprintf(r->error, r->error_size, "%s:%d:%d: ", r->file, r->line, column);
    va_list args;
    va_start(args, format);
    if (n >= 0 && (size_t)n < r->error_size) vsnprintf(r->error + n, r->error_size - (size_t)n, format, args);
    va_end(args);
    return false;
}

// Read the fields of one line into value[], and the column where field i begins into column[i].
static bool read_row(const reader *r, const char *line, int fields, double value[8], int column[8])
{
    const char *at = line;
    for (int i = 0; i < fields; i++) {
        column[i] = (int)(at - line) + 1;
        if (!*at && i > 0) return complain(r, column[i], "%d fields, expected %d", i, fields);
        char *end;
        value[i] = strtod(at, &end);
        if (end == at || !isfinite(value[i])) return complain(r, column[i], "expected a finite number");
        while (*end == ' ' || *end == '\t') end++;
        if (*end && *end != ',') return complain(r, (int)(end - line) + 1, "expected a comma after the number");
        if (*end == ',' && i == fields - 1) return complain(r, (int)(end - line) + 1, "more than %d fields", fields);
        at = *end ? end + 1 : end;
    }
    return true;
}

// Rows of the CSV file that have been read so far.
typedef struct rows {
    int count, room;
    double *time_s;
    kn_tool_path_point *point;
} rows;

// Make room for one more row of the CSV file. Return false when memory is short.
static bool grow(rows *all)
{
    if (all->count < all->room) return true;
    int room = all->room ? 2 * all->room : 1024;
    double *time_s = realloc(all->time_s, (size_t)room * sizeof *time_s);
    if (time_s) all->time_s = time_s;
    kn_tool_path_point *point = realloc(all->point, (size_t)room * sizeof *point);
    if (point) all->point = point;
    if (!time_s || !point) return false;
    all->room = room;
    return true;
}

// Check one row and append it. Check that its position is in the workspace, that its quaternion has unit length, and
// that its time and speed fit to the row before.
static bool take_row(const reader *r, rows *all, int fields, const double value[8], const int column[8])
{
    kn_tool_path_point p = {.orientation_wxyz = {1, 0, 0, 0}};
    double length = 0.0;
    memcpy(p.position_m, value + 1, sizeof p.position_m);
    if (kn_tool_path_distance(p.position_m, (const double[3]){0}) > workspace_m)
        return complain(r, column[1], "further than %g m from the origin, expected coordinates in metres", workspace_m);
    // Normalise the quaternion. In a file with few digits, its length may be off by 0.001.
    for (int i = 4; i < fields; i++) length += value[i] * value[i];
    if (fields == 8 && fabs(sqrt(length) - 1.0) > 1e-3)
        return complain(r, column[4], "quaternion of length %.4g, expected 1 within 0.001", sqrt(length));
    for (int i = 4; i < fields; i++) p.orientation_wxyz[i - 4] = value[i] / sqrt(length);
    if (all->count > 0) {
        double span_s = value[0] - all->time_s[all->count - 1];
        double way_m = kn_tool_path_distance(p.position_m, all->point[all->count - 1].position_m);
        if (span_s <= 0.0) return complain(r, column[0], "time does not increase");
        if (value[0] - all->time_s[0] > KN_TOOL_PATH_LONGEST_S)
            return complain(r, column[0], "more than a day after the first row");
        if (way_m > speed_max_m_s * span_s)
            return complain(r, column[1], "%.3g m/s since the previous row, expected at most %g", way_m / span_s,
                            speed_max_m_s);
    }
    if (!grow(all)) return complain(r, 1, "out of memory");
    all->time_s[all->count] = value[0];
    all->point[all->count++] = p;
    return true;
}

// Read the header and all rows. Empty lines are skipped.
static bool read_rows(reader *r, FILE *in, rows *all)
{
    static const char *const headers[] = {"time_s,x_m,y_m,z_m", "time_s,x_m,y_m,z_m,qw,qx,qy,qz"};
    char *line = NULL;
    size_t room = 0;
    int fields = 0;
    bool ok = true;
    double value[8];
    int column[8];
    for (r->line = 1; ok && getline(&line, &room, in) > 0; r->line++) {
        size_t length = strcspn(line, "\r\n");
        line[length] = 0;
        if (r->line == 1) {
            // The header states whether the rows have 4 or 8 fields.
            fields = !strcmp(line, headers[0]) ? 4 : !strcmp(line, headers[1]) ? 8 : 0;
            if (!fields) ok = complain(r, 1, "expected the header `%s` or `%s`", headers[0], headers[1]);
        } else if (length > 0) {
            ok = read_row(r, line, fields, value, column) && take_row(r, all, fields, value, column);
        }
    }
    free(line);
    if (ok && all->count < 2) ok = complain(r, 1, "%d rows, expected at least 2", all->count);
    return ok;
}

kn_tool_path *kn_tool_path_load(const char *file, char *error, size_t error_size)
{
    reader r = {.file = file, .line = 1, .error = error, .error_size = error_size};
    FILE *in = fopen(file, "r");
    if (!in) {
        snprintf(error, error_size, "%s: %s", file, strerror(errno));
        return NULL;
    }
    rows all = {0};
    kn_tool_path *path = NULL;
    if (read_rows(&r, in, &all)) {
        path = kn_tool_path_through(all.count, all.time_s, all.point);
        if (!path) complain(&r, 1, "out of memory");
    }
    fclose(in);
    free(all.time_s);
    free(all.point);
    return path;
}
