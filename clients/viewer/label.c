#include "clients/viewer/label.h"
#include <cairo.h>
#include <dlfcn.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

// ---- colour scale

// Colours of the viridis scale at nine equal steps.
#define HEX(rgb)                                                                                                       \
    {                                                                                                                  \
        (float)((rgb) >> 16) / 255.0f, (float)((rgb) >> 8 & 255) / 255.0f, (float)((rgb)&255) / 255.0f                 \
    }
const float kn_scale_color[KN_SCALE_COLORS][3] = {HEX(0x440154), HEX(0x472d7b), HEX(0x3b528b),
                                                  HEX(0x2c728e), HEX(0x21918c), HEX(0x28ae80),
                                                  HEX(0x5ec962), HEX(0xaddc30), HEX(0xfde725)};

// Return the smallest value s * 10^n that is at least `most`, where s is one of the `steps` and n is an integer.
static double step_above(double most, int count, const double *steps)
{
    if (!(most > 1e-9)) return 1e-9;
    double ten = pow(10, floor(log10(most))), top = 0;
    // The factor slightly above 1 allows for rounding errors, because 3 * 0.1 is slightly more than 0.3.
    for (int i = 0; i < count && top < most; i++) top = steps[i] * ten * (1 + 1e-12);
    return top;
}

double kn_scale_round(double most) { return step_above(most, 4, (const double[]){1, 2, 5, 10}); }

double kn_scale_top(double most) { return step_above(most, 7, (const double[]){1, 1.5, 2, 3, 5, 7.5, 10}); }

// Interpolate linearly between the two nearest colours.
void kn_scale_at(double share, float srgb[3])
{
    double x = fmin(fmax(share, 0), 1) * (KN_SCALE_COLORS - 1);
    int i = (int)fmin(x, KN_SCALE_COLORS - 2);
    for (int k = 0; k < 3; k++)
        srgb[k] = kn_scale_color[i][k] + (float)(x - i) * (kn_scale_color[i + 1][k] - kn_scale_color[i][k]);
}

// Write the unit with the SI prefix that suits the scale's top into `text`. Return the factor that converts a value to
// this unit.
static double prefix(const kn_scale *s, char text[16])
{
    static const char *const name[] = {"n", "\u00b5", "m", "", "k", "M", "G"};
    if (!*s->unit) return strcpy(text, "%"), 100;
    // The factor slightly above 1 makes 1e-3 m appear as 1 mm in spite of rounding errors.
    int third = (int)fmin(fmax(floor(log10(s->top * 1.000001) / 3), -3), 3);
    snprintf(text, 16, "%s%s", name[third + 3], s->unit);
    return pow(10, -3 * third);
}

void kn_scale_title(const kn_scale *scale, char *text, size_t size)
{
    char unit[16];
    prefix(scale, unit);
    snprintf(text, size, "%s, %s", scale->words, unit);
}

double kn_scale_tick(const kn_scale *scale, int i, char *text, size_t size)
{
    char unit[16];
    // Choose the number of intervals by the first digits of the scale's top, so that the tick marks are round numbers.
    double by = prefix(scale, unit), first = scale->top / pow(10, floor(log10(scale->top * 1.000001)));
    const bool thirds = fabs(first - 1.5) < 1e-6 || fabs(first - 3) < 1e-6 || fabs(first - 6) < 1e-6;
    // Number of intervals between tick marks: 5 if the top begins with 1, 5 or 7.5; 3 if it begins with 1.5 or 3; 4 if
    // it begins with 2.
    const int ticks = thirds ? 3 : first < 1.5 || first > 4.5 ? 5 : 4;
    if (i > ticks) return -1;
    snprintf(text, size, "%.3g", by * scale->top * i / ticks);
    return (double)i / ticks;
}

// ---- text

#define INK 0.11, 0.12, 0.13
// Colour (r, g, b, alpha) of the edge around the letters. The edge keeps the letters legible on any background.
#define HALO 1, 1, 1, 0.8

// Functions of Cairo, loaded with the first label. Cairo brings a dozen libraries, and `knead probe` must neither wait
// for them nor lock them into memory.
// clang-format off
#define FUNCTIONS(X)                                                                                                   \
    X(create) X(destroy) X(fill) X(image_surface_create_for_data) X(move_to) X(rectangle) X(select_font_face)          \
    X(set_font_size) X(set_line_join) X(set_line_width) X(set_source_rgb) X(set_source_rgba) X(status)                 \
    X(status_to_string) X(stroke) X(stroke_preserve) X(surface_destroy) X(surface_finish) X(text_extents) X(text_path)
// clang-format on
#define FIELD(name) __typeof__(cairo_##name) *name;
static struct {
    FUNCTIONS(FIELD)
} cairo;

static bool load(char *error, size_t error_size)
{
    // The library is loaded once and never closed.
    void *library = cairo.create ? NULL : dlopen("libcairo.so.2", RTLD_NOW | RTLD_LOCAL);
    const char *missing = NULL;
    if (cairo.create) return true;
    if (!library) snprintf(error, error_size, "no text on pictures: install the package libcairo2");
    if (!library) return false;
#define LOAD(name)                                                                                                     \
    cairo.name = (__typeof__(cairo.name))dlsym(library, "cairo_" #name);                                               \
    if (!cairo.name) missing = "cairo_" #name;
    FUNCTIONS(LOAD)
    if (!missing) return true;
    cairo.create = NULL;
    snprintf(error, error_size, "no text on pictures: this libcairo.so.2 has no %s", missing);
    return false;
}

// Drawing surface: Cairo context, size of the letters, and size of the picture.
typedef struct sheet {
    cairo_t *to;
    double em, width, height; // size of the letters, and width and height of the picture, pixels
} sheet;

// Copy words as valid UTF-8, which Cairo needs. A file name may hold any bytes, and may be cut off within a letter.
// Each invalid byte becomes a question mark.
static void legible(const char *words, char *out, size_t size)
{
    size_t n = 0;
    while (*words && n + 5 < size) {
        const unsigned char c = (unsigned char)*words;
        // Determine the number of bytes of the letter from the first byte. 0: no letter begins with this byte.
        size_t length = c < 0x80                ? 1
                        : c >= 0xc2 && c < 0xe0 ? 2
                        : c >= 0xe0 && c < 0xf0 ? 3
                        : c >= 0xf0 && c < 0xf5 ? 4
                                                : 0;
        size_t k = 1;
        while (k < length && ((unsigned char)words[k] & 0xc0) == 0x80) k++;
        // Reject overlong forms and surrogates, which are invalid in UTF-8.
        bool whole = length > 0 && k == length && !(c == 0xe0 && (unsigned char)words[1] < 0xa0) &&
                     !(c == 0xed && (unsigned char)words[1] > 0x9f) && !(c == 0xf0 && (unsigned char)words[1] < 0x90) &&
                     !(c == 0xf4 && (unsigned char)words[1] > 0x8f) && c >= 0x20;
        if (whole) memcpy(out + n, words, length);
        else out[n] = '?';
        n += whole ? length : 1;
        words += whole ? length : 1;
    }
    out[n] = '\0';
}

// Draw a text with its edge. `x`: left end of the text if `align` is 0, middle if `align` is 0.5, right end if `align`
// is 1. `y`: baseline of the text.
static void text(const sheet *s, double x, double y, double align, const char *words)
{
    cairo_text_extents_t e;
    cairo.text_extents(s->to, words, &e);
    cairo.move_to(s->to, round(x - align * e.x_advance), round(y));
    cairo.text_path(s->to, words);
    cairo.set_source_rgba(s->to, HALO);
    cairo.set_line_width(s->to, 0.3 * s->em);
    cairo.set_line_join(s->to, CAIRO_LINE_JOIN_ROUND);
    cairo.stroke_preserve(s->to);
    cairo.set_source_rgb(s->to, INK);
    cairo.fill(s->to);
}

static double longest_tick(const sheet *s, const kn_scale *scale)
{
    char number[32];
    double longest = 0;
    for (int i = 0; kn_scale_tick(scale, i, number, sizeof number) >= 0; i++) {
        cairo_text_extents_t e;
        cairo.text_extents(s->to, number, &e);
        longest = fmax(longest, e.x_advance);
    }
    return longest;
}

// Draw the legend: a column of colours, a frame, ticks with numbers, and the title.
static void legend(const sheet *s, const kn_scale *scale)
{
    const double right = s->width - s->em - longest_tick(s, scale) - 0.6 * s->em, wide = 1.1 * s->em;
    const double left = right - wide, top = 3.4 * s->em, tall = fmin(14 * s->em, s->height - top - 2 * s->em);
    char words[100];
    for (int row = 0; row < (int)tall; row++) {
        float c[3];
        kn_scale_at(1 - (row + 0.5) / tall, c);
        cairo.set_source_rgb(s->to, c[0], c[1], c[2]);
        cairo.rectangle(s->to, round(left), round(top) + row, round(wide), 1);
        cairo.fill(s->to);
    }
    cairo.set_source_rgb(s->to, INK);
    cairo.set_line_width(s->to, 1);
    cairo.rectangle(s->to, round(left) - 0.5, round(top) - 0.5, round(wide) + 1, floor(tall) + 1);
    cairo.stroke(s->to);
    double share;
    for (int i = 0; (share = kn_scale_tick(scale, i, words, sizeof words)) >= 0; i++)
        text(s, right + 0.6 * s->em, top + (1 - share) * floor(tall) + 0.36 * s->em, 0, words);
    kn_scale_title(scale, words, sizeof words);
    text(s, s->width - s->em, top - 1.1 * s->em, 1, words);
}

// Convert between RGBA and Cairo's 32-bit pixels 0xAARRGGBB. The same code works in both directions. Alpha is set to
// opaque, because then Cairo's premultiplied colours equal the plain colours.
static void swap(uint8_t *rgba, size_t pixels)
{
    for (size_t i = 0; i < pixels; i++) {
        uint8_t *p = rgba + 4 * i, red = p[0];
        p[0] = p[2], p[2] = red, p[3] = 255;
    }
}

void kn_label_bar(kn_label *label, char words[32], double bar_m, int width, int height)
{
    // Show mm below 1 cm. The limit is 0.0099 m, because 1 cm stored as a float is slightly less than 0.01 m.
    const bool mm = bar_m < 0.0099;
    const float *at = label->bar_at;
    snprintf(words, 32, "%.4g %s", bar_m * (mm ? 1e3 : 1e2), mm ? "mm" : "cm");
    if (at[0] > 0 && at[0] < (float)width && at[1] > 0 && at[1] < (float)height) label->bar = words;
}

bool kn_label_draw(const kn_label *label, int width, int height, uint8_t *rgba, char *error, size_t error_size)
{
    if (!load(error, error_size)) return false;
    swap(rgba, (size_t)width * (size_t)height);
    cairo_surface_t *surface = cairo.image_surface_create_for_data(rgba, CAIRO_FORMAT_RGB24, width, height, 4 * width);
    sheet s = {cairo.create(surface), fmax(10, fmin(height / 34.0, width / 40.0)), width, height};
    cairo.select_font_face(s.to, "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
    cairo.set_font_size(s.to, s.em);
    // room: the picture is wide enough for the caption beside the legend. high: the picture is high enough for the
    // legend.
    const bool room = width > 30 * s.em, high = height > 12 * s.em;
    char caption[300];
    legible(label->caption ? label->caption : "", caption, sizeof caption);
    if (label->scale && high) legend(&s, label->scale);
    if (room || !label->scale) text(&s, s.em, 1.8 * s.em, 0, caption);
    if (label->bar) text(&s, fmax(label->bar_at[0], 2.5 * s.em), label->bar_at[1] + s.em, 0.5, label->bar);
    bool ok = cairo.status(s.to) == CAIRO_STATUS_SUCCESS;
    if (!ok) snprintf(error, error_size, "cairo: %s", cairo.status_to_string(cairo.status(s.to)));
    cairo.destroy(s.to);
    cairo.surface_finish(surface);
    cairo.surface_destroy(surface);
    swap(rgba, (size_t)width * (size_t)height);
    return ok;
}
