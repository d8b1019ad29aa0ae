#include "clients/viewer/image.h"
#include <errno.h>
#include <png.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

bool kn_image_write_png(const char *path, int width, int height, const uint8_t *rgba, char *error, size_t error_size)
{
    char tmp[4096];
    if (snprintf(tmp, sizeof tmp, "%s.tmp", path) >= (int)sizeof tmp) {
        snprintf(error, error_size, "%.40s...: a path of more than 4000 bytes", path);
        return false;
    }
    FILE *file = fopen(tmp, "wb"); // opened here because libpng would say "fopen failed" and not why
    if (!file) {
        snprintf(error, error_size, "%s: %s", path, strerror(errno));
        return false;
    }
    png_image image = {.version = PNG_IMAGE_VERSION, .width = (png_uint_32)width, .height = (png_uint_32)height,
                       .format = PNG_FORMAT_RGBA};
    bool written = png_image_write_to_stdio(&image, file, 0, rgba, 0, NULL);
    bool closed = fclose(file) == 0;
    if (written && closed && rename(tmp, path) == 0) return true;
    snprintf(error, error_size, "%s: %s", path, written ? strerror(errno) : image.message);
    unlink(tmp);
    return false;
}
