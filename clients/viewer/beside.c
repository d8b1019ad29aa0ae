#include "clients/viewer/beside.h"
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

// Set the name of the new file: `path`, a dot and six letters. Return false if this name is too long.
static bool name(kn_beside *b, const char *path)
{
    *b = (kn_beside){.path = path};
    return snprintf(b->tmp, sizeof b->tmp, "%s.XXXXXX", path) < (int)sizeof b->tmp;
}

// Create the new file with these permissions. On failure return false with the reason in errno.
static bool create(kn_beside *b, mode_t mode)
{
    // The new file is in the folder of `path`, because a rename is atomic only within one file system.
    int fd = mkostemp(b->tmp, O_CLOEXEC);
    b->file = fd >= 0 ? fdopen(fd, "wb") : NULL;
    if (b->file) {
        fchmod(fd, mode); // mkostemp has created the file with the permissions 0600
        return true;
    }
    const int why = errno;
    if (fd >= 0) {
        close(fd);
        unlink(b->tmp);
    }
    errno = why;
    return false;
}

// Create the new file without a name; kn_beside_keep gives the file its name. So nothing is left of the file if this
// process is killed. Return false if the file system does not support unnamed files.
static bool create_unnamed(kn_beside *b, mode_t mode)
{
    char folder[sizeof b->tmp];
    snprintf(folder, sizeof folder, "%s", b->path);
    char *slash = strrchr(folder, '/');
    if (slash) slash[slash == folder] = '\0';
    const int fd =
        access("/proc/self/fd", X_OK) == 0 ? open(slash ? folder : ".", O_TMPFILE | O_WRONLY | O_CLOEXEC, 0600) : -1;
    if (fd < 0) return false;
    b->file = fdopen(fd, "wb");
    if (!b->file) return close(fd), false;
    fchmod(fd, mode);
    b->unnamed = true;
    return true;
}

// Give the unnamed file a name that no other file in its folder has. On failure return false with the reason in errno.
static bool give_name(kn_beside *b)
{
    char source[40];
    snprintf(source, sizeof source, "/proc/self/fd/%d", fileno(b->file));
    for (int i = 0; i < 1000; i++) {
        snprintf(b->tmp + strlen(b->tmp) - 6, 7, "%06u", (unsigned)(getpid() + i) % 1000000);
        b->unnamed = linkat(AT_FDCWD, source, AT_FDCWD, b->tmp, AT_SYMLINK_FOLLOW) != 0;
        if (!b->unnamed || errno != EEXIST) break;
    }
    return !b->unnamed;
}

// Return the permissions that the umask of this process allows for a new file.
static mode_t usual_mode(void)
{
    const mode_t mask = umask(0);
    umask(mask);
    return 0666 & ~mask;
}

bool kn_beside_open(kn_beside *b, const char *path, char *error, size_t error_size)
{
    struct stat there;
    // Call lstat, not stat, so that a symbolic link is refused and not followed.
    if (lstat(path, &there) == 0 && !S_ISREG(there.st_mode))
        snprintf(error, error_size, "%s: is no regular file, expected a file that may be replaced", path);
    else if (!name(b, path)) snprintf(error, error_size, "%.40s...: a path of more than 4000 bytes", path);
    else if (!create(b, usual_mode())) snprintf(error, error_size, "%s: %s", path, strerror(errno));
    else return true;
    return false;
}

bool kn_beside_write(kn_beside *b, const char *path)
{
    struct stat there;
    const bool exists = lstat(path, &there) == 0;
    const bool own = !exists || (S_ISREG(there.st_mode) && there.st_nlink == 1 && there.st_uid == geteuid() &&
                                 there.st_gid == getegid() && access(path, W_OK) == 0);
    const mode_t mode = exists ? there.st_mode & 07777 : usual_mode();
    if (name(b, path) && own && (create_unnamed(b, mode) || create(b, mode))) return true;
    *b->tmp = '\0';
    b->file = fopen(path, "we");
    return b->file;
}

bool kn_beside_keep(kn_beside *b, char *error, size_t error_size)
{
    // Check both the writes and the close, because a full disk may cause an error only at the close.
    const bool written = fflush(b->file) == 0 && !ferror(b->file) && (!b->unnamed || give_name(b));
    const int why = errno;
    const bool closed = fclose(b->file) == 0;
    if (!written) errno = why;
    b->file = NULL;
    if (written && closed && (!*b->tmp || rename(b->tmp, b->path) == 0)) return true;
    snprintf(error, error_size, "%s: %s", b->path, strerror(errno));
    kn_beside_drop(b);
    return false;
}

void kn_beside_drop(kn_beside *b)
{
    if (b->file) fclose(b->file);
    b->file = NULL;
    if (*b->tmp && !b->unnamed) unlink(b->tmp);
}
