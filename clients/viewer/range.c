#include "clients/viewer/range.h"
#include "clients/viewer/image.h"
#include "clients/viewer/label.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define AIR 1.04     // size of the image's frame, as a multiple of the surface's sides
#define LEVELS 65534 // number of grey levels for heights; level 0 means that there is no surface
// Height of the highest grey level, as a multiple of the surface's height. The factor is above 1, because dough that is
// pressed bulges above its height at rest.
#define ROOM 1.25

kn_range kn_range_frame(int width, int height, int vertex_count, const float (*rest)[3], const float (*now)[3])
{
    // Find the box around the surface at rest and the present surface. The lowest point at rest lies on the table.
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY}, table = INFINITY;
    for (int v = 0; v < vertex_count; v++) {
        table = fmin(table, rest[v][2]);
        for (int i = 0; i < 3; i++) {
            const double x[2] = {rest[v][i], isfinite(now[v][i]) ? now[v][i] : rest[v][i]};
            low[i] = fmin(low[i], fmin(x[0], x[1]));
            high[i] = fmax(high[i], fmax(x[0], x[1]));
        }
    }
    kn_range r = {.width = width, .height = height, .table_m = table};
    // Round the sizes of a pixel and of a grey level up to 1, 2 or 5 times a power of ten. Then centre the frame on the
    // box.
    r.pixel_m = kn_scale_round(AIR * fmax((high[0] - low[0]) / width, (high[1] - low[1]) / height));
    r.step_m = fmax(kn_scale_round(ROOM * (high[2] - table) / LEVELS), 1e-6);
    r.left_m = 0.5 * (low[0] + high[0]) - 0.5 * (width - 1) * r.pixel_m;
    r.top_m = 0.5 * (low[1] + high[1]) + 0.5 * (height - 1) * r.pixel_m;
    return r;
}

// Return twice the signed area of the triangle a, b, (x, y).
static double cross(const double a[2], const double b[2], double x, double y)
{
    return (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]);
}

static int pixel(double at, int count) { return (int)fmin(fmax(at, 0), count - 1); }

// Write the height of the triangle's plane to every pixel whose middle is inside the triangle.
static void draw_triangle(const kn_range *r, const float *const corner[3], uint16_t *level)
{
    // at: positions of the corners, in columns and rows of pixels. z: heights of the corners, in grey levels.
    double at[3][2], z[3];
    for (int i = 0; i < 3; i++) {
        at[i][0] = (corner[i][0] - r->left_m) / r->pixel_m;
        at[i][1] = (r->top_m - corner[i][1]) / r->pixel_m;
        z[i] = (corner[i][2] - r->table_m) / r->step_m;
    }
    const double area = cross(at[0], at[1], at[2][0], at[2][1]);
    if (!isfinite(area + z[0] + z[1] + z[2]) || area == 0) return;
    // Find the box of pixels around the triangle, within the picture.
    const int first[2] = {pixel(ceil(fmin(at[0][0], fmin(at[1][0], at[2][0]))), r->width),
                          pixel(ceil(fmin(at[0][1], fmin(at[1][1], at[2][1]))), r->height)};
    const int last[2] = {pixel(floor(fmax(at[0][0], fmax(at[1][0], at[2][0]))), r->width),
                         pixel(floor(fmax(at[0][1], fmax(at[1][1], at[2][1]))), r->height)};
    for (int y = first[1]; y <= last[1]; y++) {
        for (int x = first[0]; x <= last[0]; x++) {
            // Compute the barycentric coordinates of the pixel's middle. All are positive inside the triangle.
            const double a = cross(at[1], at[2], x, y) / area, b = cross(at[2], at[0], x, y) / area, c = 1 - a - b;
            // Skip a pixel outside the triangle. A pixel on the common side of two triangles belongs to both triangles.
            if (a < -1e-9 || b < -1e-9 || c < -1e-9) continue;
            const double here = fmin(fmax(1 + a * z[0] + b * z[1] + c * z[2], 1), 1 + LEVELS);
            uint16_t *out = &level[(size_t)y * (size_t)r->width + (size_t)x];
            // Keep the highest level, because a range finder sees the uppermost surface.
            if (lround(here) > *out) *out = (uint16_t)lround(here);
        }
    }
}

// Compute lowest_m and highest_m from the grey levels. Return false if no surface is visible.
static bool find_limits(kn_range *r, const uint16_t *level)
{
    const size_t pixels = (size_t)r->width * (size_t)r->height;
    uint16_t low = 0, high = 0;
    for (size_t i = 0; i < pixels; i++) {
        if (level[i] > high) high = level[i];
        if (level[i] > 0 && (low == 0 || level[i] < low)) low = level[i];
    }
    r->lowest_m = low > 0 ? (low - 1) * r->step_m : 0;
    r->highest_m = high > 0 ? (high - 1) * r->step_m : 0;
    return high > 0;
}

void kn_range_draw(kn_range *r, const float (*now)[3], int triangle_count, const int (*triangle)[3], uint16_t *level)
{
    memset(level, 0, (size_t)r->width * (size_t)r->height * sizeof *level);
    for (int t = 0; t < triangle_count; t++)
        draw_triangle(r, (const float *const[3]){now[triangle[t][0]], now[triangle[t][1]], now[triangle[t][2]]}, level);
    find_limits(r, level);
}

// ---- file

// Indices of the four numbers that the PNG contains as texts. TEXTS: number of all texts. Besides the four numbers, the
// PNG contains three texts for human readers.
enum { STEP, PIXEL, LEFT, TOP, NUMBERS, TEXTS = NUMBERS + 3 };

static const char *const name[NUMBERS] = {"step_mm", "pixel_mm", "left_mm", "top_mm"};

bool kn_range_save(const char *path, const kn_range *r, const char *title, const uint16_t *level, char *error,
                   size_t error_size)
{
    const double value[NUMBERS] = {r->step_m, r->pixel_m, r->left_m, r->top_m};
    char words[NUMBERS][32];
    kn_image_text text[TEXTS] = {
        {"Software", "knead " KN_VERSION},
        {"Title", title},
        {"Description", "Range image from above: 0 means no object, other values: height_mm = step_mm * (value - 1)"}};
    for (int i = 0; i < NUMBERS; i++) {
        snprintf(words[i], sizeof words[i], "%.9g", 1e3 * value[i]);
        text[3 + i] = (kn_image_text){name[i], words[i]};
    }
    return kn_image_write_gray16(path, r->width, r->height, level, r->pixel_m, TEXTS, text, error, error_size);
}

// Return a text in mm as metres; NAN if the text is empty or malformed.
static double number_of(const char *text)
{
    char *end;
    const double value = strtod(text, &end);
    return end != text && !*end && isfinite(value) ? 1e-3 * value : (double)NAN;
}

// Take each number from `given`. If the number is NAN in `given`, take it from the texts of the file. Check the range
// of the number.
static bool take_numbers(const char *path, kn_image_found found[NUMBERS], const kn_range_given *given, kn_range *r,
                         char *error, size_t error_size)
{
    const double told[NUMBERS] = {given->step_m, given->pixel_m, given->left_m, given->top_m};
    double value[NUMBERS];
    for (int i = 0; i < NUMBERS; i++) {
        value[i] = isnan(told[i]) ? number_of(found[i].text) : told[i];
        const bool size = i == STEP || i == PIXEL, good = size ? value[i] > 1e-9 && value[i] < 1 : fabs(value[i]) < 100;
        if (good) continue;
        if (isnan(told[i]) && !*found[i].text)
            snprintf(error, error_size,
                     "%s: has no text %s, expected a range image of knead view --depth, or the option --%.*s", path,
                     name[i],
                     // The name of the option is name[i] without the unit, so print only the letters before the unit.
                     i == STEP || i == LEFT ? 4
                     : i == PIXEL           ? 5
                                            : 3,
                     name[i]);
        else
            snprintf(error, error_size, "%s: %s is %s, expected a %s in mm", path, name[i],
                     isnan(told[i]) ? found[i].text : "out of range", size ? "size above 0" : "place");
        return false;
    }
    r->step_m = value[STEP];
    r->pixel_m = value[PIXEL];
    r->left_m = value[LEFT];
    r->top_m = value[TOP];
    return true;
}

bool kn_range_load(const char *path, const kn_range_given *given, kn_range *r, uint16_t **level, char *error,
                   size_t error_size)
{
    kn_image_found found[NUMBERS];
    double pixel_m;
    for (int i = 0; i < NUMBERS; i++) found[i].key = name[i];
    *r = (kn_range){0};
    if (!kn_image_read_gray16(path, KN_RANGE_MOST, &r->width, &r->height, level, &pixel_m, NUMBERS, found, error,
                              error_size))
        return false;
    // Refuse an image in which no surface is visible.
    const bool told = take_numbers(path, found, given, r, error, error_size);
    if (told && find_limits(r, *level)) return true;
    if (told) snprintf(error, error_size, "%s: every pixel is 0, expected an object", path);
    free(*level);
    *level = NULL;
    return false;
}
