#include "clients/cli/output.h"
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

int kn_output_try(const char *subcommand, const char *path)
{
    struct stat there;
    // Do not try to open a pipe, a terminal or /dev/null. The open() of a pipe would wait for its reader. For all three
    // it is sufficient that the permissions allow writing.
    if (stat(path, &there) == 0 && !S_ISREG(there.st_mode) && !S_ISDIR(there.st_mode) && access(path, W_OK) == 0)
        return KN_EXIT_OK;
    // Use lstat instead of stat: a dangling symbolic link exists, so it must not be removed below.
    bool known = lstat(path, &there) == 0;
    int file = open(path, O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0666);
    if (file < 0)
        return kn_complain(subcommand, KN_EXIT_DEVICE, "%s: %s, expected a file that can be written", path,
                           strerror(errno));
    close(file);
    if (!known) unlink(path);
    return KN_EXIT_OK;
}

// Write the path into the buffer `to`, with symbolic links resolved and without a trailing slash. If the folder of the
// path does not exist, copy the path unchanged.
static void resolve(const char *path, char to[2 * PATH_MAX])
{
    char folder[PATH_MAX], known[PATH_MAX];
    // Drop trailing slashes.
    size_t n = strlen(path);
    while (n > 1 && path[n - 1] == '/') n--;
    snprintf(folder, sizeof folder, "%.*s", (int)n, path);
    snprintf(to, 2 * PATH_MAX, "%s", folder);
    // If the path exists, resolve the whole path.
    if (realpath(folder, known)) {
        snprintf(to, 2 * PATH_MAX, "%s", known);
        return;
    }
    // Otherwise resolve the folder and append the name. The folder of "name" is ".", the folder of "/name" is "/".
    char *slash = strrchr(folder, '/');
    const char *name = slash ? slash + 1 : folder;
    if (slash) *slash = 0;
    if (realpath(!slash ? "." : *folder ? folder : "/", known)) snprintf(to, 2 * PATH_MAX, "%s/%s", known, name);
}

bool kn_output_holds(const char *a, const char *b)
{
    char outer[2 * PATH_MAX], inner[2 * PATH_MAX];
    resolve(a, outer);
    resolve(b, inner);
    // Path b lies inside path a if b begins with a, and b either ends there or continues with a slash.
    const size_t n = strlen(outer);
    return kn_output_same(a, b) || (strncmp(outer, inner, n) == 0 && (!inner[n] || inner[n] == '/'));
}

bool kn_output_same(const char *a, const char *b)
{
    struct stat x, y;
    char first[2 * PATH_MAX], second[2 * PATH_MAX];
    if (!a || !b) return false;
    // Two existing files are compared by device and inode, which also finds hard links.
    if (stat(a, &x) == 0 && stat(b, &y) == 0) return x.st_dev == y.st_dev && x.st_ino == y.st_ino;
    resolve(a, first);
    resolve(b, second);
    return strcmp(first, second) == 0;
}

FILE *kn_output_open(kn_beside *out, const char *subcommand, const char *path)
{
    if (kn_beside_write(out, path)) return out->file;
    kn_complain(subcommand, KN_EXIT_DEVICE, "%s: %s, expected a file that can be written", path, strerror(errno));
    return NULL;
}

int kn_output_close(kn_beside *out, const char *subcommand)
{
    char error[PATH_MAX];
    if (kn_beside_keep(out, error, sizeof error)) return KN_EXIT_OK;
    return kn_complain(subcommand, KN_EXIT_DEVICE, "%s: could not be written completely", out->path);
}

// ---- a folder that appears under its name only when it is complete

static bool fail(const char *path, const char *why, char *error, size_t size)
{
    snprintf(error, size, "%.300s: %s", path, why);
    return false;
}

int kn_output_empty(const char *path)
{
    struct stat there;
    if (lstat(path, &there) != 0) return 1;
    DIR *stream = S_ISDIR(there.st_mode) ? opendir(path) : NULL;
    if (!stream) return -1;
    int names = 0;
    for (struct dirent *e; (e = readdir(stream));) names += strcmp(e->d_name, ".") && strcmp(e->d_name, "..");
    closedir(stream);
    return names == 0;
}

bool kn_output_folder_open(kn_output_folder *b, const char *path, bool *taken, char *error, size_t size)
{
    *b = (kn_output_folder){0};
    *taken = kn_output_empty(path) != 1;
    if (*taken)
        return fail(path,
                    kn_output_empty(path) < 0 ? "is not a folder, expected a new folder"
                                              : "is not empty, expected a new folder",
                    error, size);
    // Create the temporary folder in the parent folder of the final path, so that a rename can move it to the final
    // path.
    size_t length = strlen(path);
    while (length > 1 && path[length - 1] == '/') length--; // ignore slashes at the end of the path
    if (length == 0 || length + 8 > sizeof b->folder)
        return fail(path, "expected a path of 1 to 3800 bytes", error, size);
    snprintf(b->path, sizeof b->path, "%.*s", (int)length, path);
    snprintf(b->folder, sizeof b->folder, "%.*s.XXXXXX", (int)length, path);
    if (!mkdtemp(b->folder)) {
        b->folder[0] = 0;
        return fail(path, strerror(errno), error, size);
    }
    mode_t mask = umask(0);
    umask(mask);
    // mkdtemp gives the folder the permissions 0700. Give it the permissions of an ordinary new folder instead.
    chmod(b->folder, 0777 & ~mask);
    return true;
}

bool kn_output_folder_keep(kn_output_folder *b, char *error, size_t size)
{
    if (!b->folder[0]) return true;
    // rename also succeeds if an empty folder exists at the final path: it replaces that folder.
    if (rename(b->folder, b->path) == 0) {
        b->folder[0] = 0;
        return true;
    }
    fail(b->path, strerror(errno), error, size);
    kn_output_folder_drop(b);
    return false;
}

void kn_output_folder_drop(kn_output_folder *b)
{
    DIR *stream = b->folder[0] ? opendir(b->folder) : NULL;
    if (!stream) return;
    // The folder contains plain files only, so no recursion into subfolders is needed.
    for (struct dirent *e; (e = readdir(stream));)
        if (strcmp(e->d_name, ".") && strcmp(e->d_name, "..")) unlinkat(dirfd(stream), e->d_name, 0);
    closedir(stream);
    rmdir(b->folder);
    b->folder[0] = 0;
}
