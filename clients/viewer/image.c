#include "clients/viewer/image.h"
#include "clients/viewer/beside.h"
#include <math.h>
#include <png.h>
#include <setjmp.h>

bool kn_image_write_png(const char *path, int width, int height, const uint8_t *rgba, char *error, size_t error_size)
{
    kn_beside out;
    if (!kn_beside_open(&out, path, error, error_size)) return false;
    png_image image = {.version = PNG_IMAGE_VERSION, .width = (png_uint_32)width, .height = (png_uint_32)height,
                       .format = PNG_FORMAT_RGBA};
    if (png_image_write_to_stdio(&image, out.file, 0, rgba, 0, NULL)) return kn_beside_keep(&out, error, error_size);
    snprintf(error, error_size, "%s: %s", path, image.message);
    kn_beside_drop(&out);
    return false;
}

typedef struct complaint {
    jmp_buf leave;
    char words[200];
} complaint;

static void give_up(png_structp png, png_const_charp words)
{
    complaint *c = png_get_error_ptr(png);
    snprintf(c->words, sizeof c->words, "%s", words);
    longjmp(c->leave, 1);
}

static void stay_calm(png_structp png, png_const_charp words) { (void)png, (void)words; } // a warning

static void write_gray16(png_structp png, png_infop info, FILE *file, int width, int height, const uint16_t *level,
                         double pixel_m, int text_count, const kn_image_text *text)
{
    const png_uint_32 per_m = pixel_m > 0 && 1 / pixel_m < 1e9 ? (png_uint_32)lround(1 / pixel_m) : 0;
    png_init_io(png, file);
    png_set_IHDR(png, info, (png_uint_32)width, (png_uint_32)height, 16, PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    if (per_m > 0) png_set_pHYs(png, info, per_m, per_m, PNG_RESOLUTION_METER);
    for (int i = 0; i < text_count; i++)
        png_set_text(png, info,
                     &(png_text){.compression = PNG_TEXT_COMPRESSION_NONE, .key = (char *)(uintptr_t)text[i].key,
                                 .text = (char *)(uintptr_t)text[i].text}, 1);
    png_write_info(png, info);
#if __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
    png_set_swap(png); // a PNG is big-endian
#endif
    for (int y = 0; y < height; y++) png_write_row(png, (png_const_bytep)(level + (size_t)y * (size_t)width));
    png_write_end(png, info);
}

bool kn_image_write_gray16(const char *path, int width, int height, const uint16_t *level, double pixel_m,
                           int text_count, const kn_image_text *text, char *error, size_t error_size)
{
    kn_beside out;
    complaint c = {.words = "out of memory"};
    if (!kn_beside_open(&out, path, error, error_size)) return false;
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &c, give_up, stay_calm);
    png_infop info = png ? png_create_info_struct(png) : NULL;
    volatile bool written = false;
    if (info && setjmp(c.leave) == 0) {
        write_gray16(png, info, out.file, width, height, level, pixel_m, text_count, text);
        written = true;
    }
    png_destroy_write_struct(&png, &info);
    if (written) return kn_beside_keep(&out, error, error_size);
    snprintf(error, error_size, "%s: %s", path, c.words);
    kn_beside_drop(&out);
    return false;
}
