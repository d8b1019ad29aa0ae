#include "clients/knead/output.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

int kn_output_try(const char *subcommand, const char *path)
{
    struct stat there;
    // to open a pipe is to wait for its reader, and a terminal or /dev/null takes what it is given
    if (stat(path, &there) == 0 && !S_ISREG(there.st_mode) && !S_ISDIR(there.st_mode) && access(path, W_OK) == 0)
        return KN_EXIT_OK;
    bool known = lstat(path, &there) == 0;
    int file = open(path, O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0666);
    if (file < 0)
        return kn_complain(subcommand, KN_EXIT_DEVICE, "%s: %s, expected a file that can be written", path,
                           strerror(errno));
    close(file);
    if (!known) unlink(path);
    return KN_EXIT_OK;
}

bool kn_output_same(const char *a, const char *b)
{
    struct stat x, y;
    return a && b && stat(a, &x) == 0 && stat(b, &y) == 0 && x.st_dev == y.st_dev && x.st_ino == y.st_ino;
}
