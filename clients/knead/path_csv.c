// Reader of paths from CSV files; see path.h. Rows are parsed and checked one by one, so that every error message can
// name the line and column.
#include "clients/knead/path.h"
#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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
    kn_path_point *point;
} rows;

// Make room for one more row of the CSV file. Return false when memory is short.
static bool grow(rows *all)
{
    if (all->count < all->room) return true;
    int room = all->room ? 2 * all->room : 1024;
    double *time_s = realloc(all->time_s, (size_t)room * sizeof *time_s);
    if (time_s) all->time_s = time_s;
    kn_path_point *point = realloc(all->point, (size_t)room * sizeof *point);
    if (point) all->point = point;
    if (!time_s || !point) return false;
    all->room = room;
    return true;
}

// Check one row against the workspace, the unit length of its quaternion and the row before, and append it.
static bool take_row(const reader *r, rows *all, int fields, const double value[8], const int column[8])
{
    kn_path_point p = {.orientation_wxyz = {1, 0, 0, 0}};
    double length = 0.0;
    memcpy(p.position_m, value + 1, sizeof p.position_m);
    if (kn_path_distance(p.position_m, (const double[3]){0}) > workspace_m)
        return complain(r, column[1], "further than %g m from the origin, expected coordinates in metres", workspace_m);
    // Normalise the quaternion. A file with few digits may be off by 0.001.
    for (int i = 4; i < fields; i++) length += value[i] * value[i];
    if (fields == 8 && fabs(sqrt(length) - 1.0) > 1e-3)
        return complain(r, column[4], "quaternion of length %.4g, expected 1 within 0.001", sqrt(length));
    for (int i = 4; i < fields; i++) p.orientation_wxyz[i - 4] = value[i] / sqrt(length);
    if (all->count > 0) {
        double span_s = value[0] - all->time_s[all->count - 1];
        double way_m = kn_path_distance(p.position_m, all->point[all->count - 1].position_m);
        if (span_s <= 0.0) return complain(r, column[0], "time does not increase");
        if (value[0] - all->time_s[0] > KN_PATH_LONGEST_S)
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

kn_path *kn_path_load(const char *file, char *error, size_t error_size)
{
    reader r = {.file = file, .line = 1, .error = error, .error_size = error_size};
    FILE *in = fopen(file, "r");
    if (!in) {
        snprintf(error, error_size, "%s: %s", file, strerror(errno));
        return NULL;
    }
    rows all = {0};
    kn_path *path = NULL;
    if (read_rows(&r, in, &all)) {
        path = kn_path_through(all.count, all.time_s, all.point);
        if (!path) complain(&r, 1, "out of memory");
    }
    fclose(in);
    free(all.time_s);
    free(all.point);
    return path;
}
