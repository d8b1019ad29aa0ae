#include "clients/viewer/image.h"
#include "clients/viewer/beside.h"
#include <errno.h>
#include <math.h>
#include <png.h>
#include <setjmp.h>
#include <stdlib.h>
#include <string.h>

bool kn_image_write_png(const char *path, int width, int height, const uint8_t *rgba, char *error, size_t error_size)
{
    kn_beside out;
    if (!kn_beside_open(&out, path, error, error_size)) return false;
    png_image image = {.version = PNG_IMAGE_VERSION,
                       .width = (png_uint_32)width,
                       .height = (png_uint_32)height,
                       .format = PNG_FORMAT_RGBA};
    if (png_image_write_to_stdio(&image, out.file, 0, rgba, 0, NULL)) return kn_beside_keep(&out, error, error_size);
    snprintf(error, error_size, "%s: %s", path, image.message);
    kn_beside_drop(&out);
    return false;
}

// State of one use of libpng: the place to jump to if libpng fails, and the error message.
typedef struct complaint {
    jmp_buf leave;
    char words[200];
} complaint;

// Error callback of libpng, which must not return.
static void give_up(png_structp png, png_const_charp words)
{
    complaint *c = png_get_error_ptr(png);
    snprintf(c->words, sizeof c->words, "%s", words);
    longjmp(c->leave, 1);
}

// Warning callback of libpng, which ignores all warnings.
static void stay_calm(png_structp png, png_const_charp words) { (void)png, (void)words; }

static void write_gray16(png_structp png, png_infop info, FILE *file, int width, int height, const uint16_t *level,
                         double pixel_m, int text_count, const kn_image_text *text)
{
    // Store the number of pixels per metre, so that other programs can measure in the picture.
    const png_uint_32 per_m = pixel_m > 0 && 1 / pixel_m < 1e9 ? (png_uint_32)lround(1 / pixel_m) : 0;
    png_init_io(png, file);
    png_set_IHDR(png, info, (png_uint_32)width, (png_uint_32)height, 16, PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    if (per_m > 0) png_set_pHYs(png, info, per_m, per_m, PNG_RESOLUTION_METER);
    for (int i = 0; i < text_count; i++)
        png_set_text(png, info,
                     &(png_text){.compression = PNG_TEXT_COMPRESSION_NONE,
                                 .key = (char *)(uintptr_t)text[i].key,
                                 .text = (char *)(uintptr_t)text[i].text},
                     1);
    png_write_info(png, info);
#if __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
    png_set_swap(png); // swap the bytes, because PNG is big-endian
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
    // The variable is volatile, because it is changed between setjmp and longjmp.
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

// ---- reading

// Return whether every chunk lies within the file. The file position is just after the signature, both before and after
// the call. Without this check, libpng would allocate and clear as many bytes as the header of a text chunk claims,
// before reading the chunk. So a file of 156 bytes could take 2 GB of memory and 13 s.
static bool chunks_fit(FILE *file)
{
    png_byte head[8];
    off_t at = sizeof head, end;
    bool fit = fseeko(file, 0, SEEK_END) == 0 && (end = ftello(file)) > 0;
    for (bool last = false; fit && !last; last = memcmp(head + 4, "IEND", 4) == 0) {
        fit = fseeko(file, at, SEEK_SET) == 0 && fread(head, 1, sizeof head, file) == sizeof head;
        // A chunk takes 12 bytes besides its data: length, type and checksum.
        if (fit) at += 12 + (off_t)png_get_uint_32(head);
        fit = fit && at <= end;
    }
    return fseeko(file, sizeof head, SEEK_SET) == 0 && fit;
}

// Return whether the picture has the wanted format and size. If not, put the reason in `words`.
static bool fits(png_structp png, png_infop info, int most, char *words, size_t size)
{
    const unsigned wide = png_get_image_width(png, info), high = png_get_image_height(png, info);
    const int depth = png_get_bit_depth(png, info), type = png_get_color_type(png, info);
    if (depth != 16 || type != PNG_COLOR_TYPE_GRAY)
        snprintf(words, size, "%d bits of %s, expected 16 bits of grey", depth,
                 type == PNG_COLOR_TYPE_GRAY      ? "grey"
                 : type == PNG_COLOR_TYPE_PALETTE ? "a palette"
                                                  : "colour");
    else if (wide > (unsigned)most || high > (unsigned)most)
        snprintf(words, size, "%u x %u pixels, expected at most %d on a side", wide, high, most);
    else return true;
    return false;
}

// Copy the texts of the wanted keys.
static void find_texts(png_structp png, png_infop info, int count, kn_image_found *text)
{
    png_textp there;
    const int all = png_get_text(png, info, &there, NULL);
    for (int i = 0; i < count; i++) {
        text[i].text[0] = '\0';
        for (int k = 0; k < all; k++)
            if (!strcmp(there[k].key, text[i].key)) snprintf(text[i].text, sizeof text[i].text, "%s", there[k].text);
    }
}

// Read the picture. If libpng fails, it jumps to the caller, who then frees *level.
static bool read_gray16(png_structp png, png_infop info, FILE *file, int most, int *width, int *height,
                        uint16_t **level, char *words, size_t size)
{
    png_init_io(png, file);
    png_set_sig_bytes(png, 8);
    png_read_info(png, info);
    if (!fits(png, info, most, words, size)) return false;
    *width = (int)png_get_image_width(png, info);
    *height = (int)png_get_image_height(png, info);
    *level = malloc((size_t)*width * (size_t)*height * sizeof **level);
    if (!*level) return snprintf(words, size, "out of memory"), false;
#if __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
    png_set_swap(png);
#endif
    // Interlaced files are read in several passes over the same rows.
    const int passes = png_set_interlace_handling(png);
    png_read_update_info(png, info);
    for (int pass = 0; pass < passes; pass++)
        for (int y = 0; y < *height; y++) png_read_row(png, (png_bytep)(*level + (size_t)y * (size_t)*width), NULL);
    png_read_end(png, info);
    return true;
}

bool kn_image_read_gray16(const char *path, int most, int *width, int *height, uint16_t **level, double *pixel_m,
                          int text_count, kn_image_found *text, char *error, size_t error_size)
{
    complaint c = {.words = "out of memory"};
    png_byte head[8] = {0};
    FILE *file = fopen(path, "rb");
    *level = NULL;
    errno = file ? 0 : errno;
    const bool whole = file && fread(head, 1, sizeof head, file) == sizeof head;
    if (!whole || png_sig_cmp(head, 0, sizeof head) != 0) {
        snprintf(error, error_size, "%s: %s", path, errno ? strerror(errno) : "is not a PNG, expected a range image");
        if (file) fclose(file);
        return false;
    }
    if (!chunks_fit(file)) {
        snprintf(error, error_size, "%s: is cut short or damaged, expected a whole PNG", path);
        fclose(file);
        return false;
    }
    png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &c, give_up, stay_calm);
    png_infop info = png ? png_create_info_struct(png) : NULL;
    volatile bool read = false;
    if (info && setjmp(c.leave) == 0)
        read = read_gray16(png, info, file, most, width, height, level, c.words, sizeof c.words);
    if (read) {
        const png_uint_32 per_m = png_get_pixels_per_meter(png, info);
        *pixel_m = per_m > 0 ? 1.0 / per_m : 0;
        find_texts(png, info, text_count, text);
    } else {
        snprintf(error, error_size, "%s: %s", path, c.words);
        free(*level);
        *level = NULL;
    }
    png_destroy_read_struct(&png, &info, NULL);
    fclose(file);
    return read;
}
