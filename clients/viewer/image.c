#include "clients/viewer/image.h"
#include "clients/viewer/beside.h"
#include <png.h>

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
