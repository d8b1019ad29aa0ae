#include "server/command.h"
#include <ctype.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static const char reset_line[] = "reset", quality_word[] = "quality ";

// Why nothing can be read there as from a pipe, or NULL.
static const char *unusable(int fd)
{
    struct stat what;
    int flags = fcntl(fd, F_GETFL);
    if (flags < 0 || fstat(fd, &what) != 0) return "not open";
    if ((flags & O_ACCMODE) == O_WRONLY) return "not open for reading";
    return S_ISFIFO(what.st_mode) || S_ISSOCK(what.st_mode) ? NULL : "not a pipe";
}

bool kn_command_open(kn_command *c, const char *number, char *error, size_t error_size)
{
    *c = (kn_command){.fd = -1};
    if (!number) return true;
    char *end;
    long fd = isdigit((unsigned char)*number) ? strtol(number, &end, 10) : -1;
    const char *why = fd < 0 || fd > INT_MAX || *end ? "no such number" : unusable((int)fd);
    if (!why)
        c->fd = (int)fd;
    else
        snprintf(error, error_size,
                 "kneadd: --command-fd %s: %s, expected the number of a pipe that is open for reading", number, why);
    return !why;
}

void kn_command_close(kn_command *c)
{
    if (c->fd >= 0) close(c->fd);
    c->fd = -1;
}

static void complain(const kn_command *c, FILE *complaints)
{
    char shown[KN_COMMAND_MAX + 1] = "";
    bool cut = c->length > KN_COMMAND_MAX;
    for (size_t i = 0; i < c->length && i < KN_COMMAND_MAX; i++)
        shown[i] = isprint((unsigned char)c->line[i]) ? c->line[i] : '?';
    fprintf(complaints, "kneadd: command '%s%s': expected reset, or quality and one of %s, and a newline\n",
            shown, cut ? "..." : "", kn_quality_names);
}

// The whole line in orders; false when it is no command.
static bool obey(const kn_command *c, kn_orders *orders)
{
    char line[KN_COMMAND_MAX + 1];
    if (c->length > KN_COMMAND_MAX || memchr(c->line, 0, c->length)) return false;
    memcpy(line, c->line, c->length);
    line[c->length] = '\0';
    if (strcmp(line, reset_line) == 0) return orders->reset = true;
    for (kn_quality q = 0; strncmp(line, quality_word, strlen(quality_word)) == 0 && q < KN_QUALITIES; q++)
        if (strcmp(line + strlen(quality_word), kn_quality_name(q)) == 0) {
            orders->quality = q;
            return orders->take = true;
        }
    return false;
}

kn_orders kn_command_feed(kn_command *c, const char *bytes, size_t size, FILE *complaints)
{
    kn_orders orders = {0};
    for (size_t i = 0; i < size; i++) {
        if (bytes[i] != '\n') {
            if (c->length < KN_COMMAND_MAX) c->line[c->length] = bytes[i];
            if (c->length <= KN_COMMAND_MAX) c->length++;
            continue;
        }
        if (!obey(c, &orders)) complain(c, complaints);
        c->length = 0;
    }
    return orders;
}

kn_orders kn_command_read(kn_command *c)
{
    char bytes[4 * KN_COMMAND_MAX];
    ssize_t size = read(c->fd, bytes, sizeof bytes);
    if (size > 0) return kn_command_feed(c, bytes, (size_t)size, stderr);
    if (size < 0 && (errno == EINTR || errno == EAGAIN)) return (kn_orders){0};
    if (c->length > 0) complain(c, stderr); // cut off: it may have been going to be something else
    kn_command_close(c);
    return (kn_orders){0};
}
