#include "clients/viewer/beside.h"
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

bool kn_beside_open(kn_beside *b, const char *path, char *error, size_t error_size)
{
    struct stat there;
    *b = (kn_beside){.path = path};
    // Call lstat, not stat, so that a symbolic link is refused and not followed.
    if (lstat(path, &there) == 0 && !S_ISREG(there.st_mode)) {
        snprintf(error, error_size, "%s: is no regular file, expected a file that may be replaced", path);
        return false;
    }
    if (snprintf(b->tmp, sizeof b->tmp, "%s.XXXXXX", path) >= (int)sizeof b->tmp) {
        snprintf(error, error_size, "%.40s...: a path of more than 4000 bytes", path);
        return false;
    }
    // The new file is in the same folder, because a rename is atomic only within one file system.
    int fd = mkostemp(b->tmp, O_CLOEXEC);
    b->file = fd >= 0 ? fdopen(fd, "wb") : NULL;
    if (b->file) {
        mode_t mask = umask(0);
        umask(mask);
        fchmod(fd, 0666 & ~mask); // set the usual permissions by the umask, because mkostemp created the file with 0600
        return true;
    }
    snprintf(error, error_size, "%s: %s", path, strerror(errno));
    if (fd >= 0) {
        close(fd);
        unlink(b->tmp);
    }
    return false;
}

bool kn_beside_keep(kn_beside *b, char *error, size_t error_size)
{
    // Check both the writes and the close, because a full disk may cause an error only at the close.
    const bool written = !ferror(b->file), closed = fclose(b->file) == 0;
    b->file = NULL;
    if (written && closed && rename(b->tmp, b->path) == 0) return true;
    snprintf(error, error_size, "%s: %s", b->path, strerror(errno));
    unlink(b->tmp);
    return false;
}

void kn_beside_drop(kn_beside *b)
{
    if (b->file) fclose(b->file);
    b->file = NULL;
    unlink(b->tmp);
}
