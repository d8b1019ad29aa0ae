#include "clients/cli/output_folder.h"
#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static bool fail(const char *path, const char *why, char *error, size_t size)
{
    snprintf(error, size, "%.300s: %s", path, why);
    return false;
}

// Return 1 if nothing exists at `path`, or if it is an empty folder. Return 0 if it is a folder with files, and -1 if
// it is not a folder.
static int empty(const char *path)
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
    *taken = empty(path) != 1;
    if (*taken)
        return fail(path,
                    empty(path) < 0 ? "is not a folder, expected a new folder" : "is not empty, expected a new folder",
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
    // mkdtemp makes the folder private (0700). Give it the permissions of an ordinary new folder instead.
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
