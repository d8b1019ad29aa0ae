#include "clients/viewer/range_file.h"
#include "clients/viewer/image.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

// Keys of the PNG's texts: first the four numbers, then three texts for human readers.
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
        {"Description", "Range image from above: 0 means nothing there, else height_mm = step_mm * (value - 1)"}};
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

// Take each number from the caller or else from the file, and check its range.
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
            snprintf(error, error_size, "%s: does not say %s, expected a range image of knead view --depth, or --%.*s",
                     path, name[i],
                     // The option's name is the text's name without its unit, so print only that many letters.
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
    // An image without any surface is useless to every caller.
    const bool told = take_numbers(path, found, given, r, error, error_size);
    if (told && kn_range_look(r, *level)) return true;
    if (told) snprintf(error, error_size, "%s: every pixel is 0, expected an object", path);
    free(*level);
    *level = NULL;
    return false;
}
