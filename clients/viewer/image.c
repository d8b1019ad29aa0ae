#include "clients/viewer/image.h"
#include <errno.h>
#include <png.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

// A file of a name nobody has, in the folder of path, with the rights that fopen would give it; NULL and one sentence.
static FILE *open_beside(const char *path, char *tmp, size_t tmp_size, char *error, size_t error_size)
{
    struct stat there;
    if (lstat(path, &there) == 0 && !S_ISREG(there.st_mode)) {
        snprintf(error, error_size, "%s: is no regular file, expected a file that may be replaced", path);
        return NULL;
    }
    if (snprintf(tmp, tmp_size, "%s.XXXXXX", path) >= (int)tmp_size) {
        snprintf(error, error_size, "%.40s...: a path of more than 4000 bytes", path);
        return NULL;
    }
    int fd = mkstemp(tmp);
    FILE *file = fd >= 0 ? fdopen(fd, "wb") : NULL; // opened here because libpng would say "fopen failed" and not why
    if (file) {
        mode_t mask = umask(0);
        umask(mask);
        fchmod(fd, 0666 & ~mask); // mkstemp's 0600 is for secrets
        return file;
    }
    snprintf(error, error_size, "%s: %s", path, strerror(errno));
    if (fd >= 0) {
        close(fd);
        unlink(tmp);
    }
    return NULL;
}

bool kn_image_write_png(const char *path, int width, int height, const uint8_t *rgba, char *error, size_t error_size)
{
    char tmp[4096];
    FILE *file = open_beside(path, tmp, sizeof tmp, error, error_size);
    if (!file) return false;
    png_image image = {.version = PNG_IMAGE_VERSION, .width = (png_uint_32)width, .height = (png_uint_32)height,
                       .format = PNG_FORMAT_RGBA};
    bool written = png_image_write_to_stdio(&image, file, 0, rgba, 0, NULL);
    bool closed = fclose(file) == 0;
    if (written && closed && rename(tmp, path) == 0) return true;
    snprintf(error, error_size, "%s: %s", path, written ? strerror(errno) : image.message);
    unlink(tmp);
    return false;
}
