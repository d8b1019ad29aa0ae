#include "clients/cli/output.h"
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

int kn_output_try(const char *subcommand, const char *path)
{
    struct stat there;
    // Do not open a pipe, because open() would wait for its reader. A terminal or /dev/null accepts any output.
    if (stat(path, &there) == 0 && !S_ISREG(there.st_mode) && !S_ISDIR(there.st_mode) && access(path, W_OK) == 0)
        return KN_EXIT_OK;
    // lstat, not stat: a dangling link exists and must not be removed below.
    bool known = lstat(path, &there) == 0;
    int file = open(path, O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0666);
    if (file < 0)
        return kn_complain(subcommand, KN_EXIT_DEVICE, "%s: %s, expected a file that can be written", path,
                           strerror(errno));
    close(file);
    if (!known) unlink(path);
    return KN_EXIT_OK;
}

// Write the path without links and without a trailing slash to `to`. A path whose folder does not exist is copied as
// written.
static void resolve(const char *path, char to[2 * PATH_MAX])
{
    char folder[PATH_MAX], known[PATH_MAX];
    // Drop trailing slashes.
    size_t n = strlen(path);
    while (n > 1 && path[n - 1] == '/') n--;
    snprintf(folder, sizeof folder, "%.*s", (int)n, path);
    snprintf(to, 2 * PATH_MAX, "%s", folder);
    // An existing path is resolved as a whole.
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
    // Path b lies inside path a if a is a prefix of b and ends at the end of b or before a slash of b.
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
    return kn_complain(subcommand, KN_EXIT_DEVICE, "%s: could not be written to its end", out->path);
}
