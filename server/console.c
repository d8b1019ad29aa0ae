#include "server/console.h"
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <limits.h>
#include <poll.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

_Static_assert(KN_CONSOLE_LINE <= PIPE_BUF, "a pipe that is ready for writing takes a whole line at once");

// Values for each of stdout and stderr. `own`: descriptor to write to; `dropped`: number of lines dropped since the
// last report; `failed`: true if a write failed; `torn`: true if the last write ended within a line.
static int own[STDERR_FILENO + 1] = {-1, STDOUT_FILENO, STDERR_FILENO};
static _Atomic int64_t dropped[STDERR_FILENO + 1];
static atomic_bool failed[STDERR_FILENO + 1], torn[STDERR_FILENO + 1];

void kn_console_start(void)
{
    signal(SIGPIPE, SIG_IGN);
    // open pipes and terminals again, because O_NONBLOCK on the old descriptor would affect all processes that share it
    for (int fd = STDOUT_FILENO; fd <= STDERR_FILENO; fd++) {
        char name[32];
        struct stat as;
        if (own[fd] != fd || fstat(fd, &as) != 0 || !(S_ISFIFO(as.st_mode) || isatty(fd))) continue;
        snprintf(name, sizeof name, "/proc/self/fd/%d", fd);
        int again = open(name, O_WRONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
        if (again >= 0) own[fd] = again;
    }
}

// Write a line without waiting. Return whether all of it was written.
static bool put(int fd, const char *line, size_t size)
{
    struct pollfd ready = {.fd = own[fd], .events = POLLOUT};
    if (poll(&ready, 1, 0) != 1) return false;
    ssize_t written = write(own[fd], line, size);
    if (written < 0 && errno != EAGAIN && errno != EINTR) atomic_store(&failed[fd], true);
    // only a part of the line may have been written, so remember whether the output now ends within a line
    if (written > 0) atomic_store(&torn[fd], line[written - 1] != '\n');
    return written == (ssize_t)size;
}

// Report how many lines have been dropped. If there is no room for this report either, keep the count for the next
// report and return false.
static bool tell_dropped(int fd)
{
    char line[160];
    int64_t lost = atomic_exchange(&dropped[fd], 0);
    if (lost == 0) return true;
    int size = snprintf(line, sizeof line,
                        "%skneadd: %" PRId64 " lines before this one were not written: nobody read "
                        "them\n",
                        atomic_load(&torn[fd]) ? "\n" : "", lost);
    if (put(fd, line, (size_t)size)) return true;
    atomic_fetch_add(&dropped[fd], lost);
    return false;
}

// Write a line. If lines before it were dropped, first report them, so that the reader sees where the gap is.
static void say(int fd, const char *line, size_t size)
{
    if (!tell_dropped(fd) || !put(fd, line, size)) atomic_fetch_add(&dropped[fd], 1);
}

void kn_console_line(int fd, const char *format, ...)
{
    char line[KN_CONSOLE_LINE];
    va_list arguments;
    va_start(arguments, format);
    int size = vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    if (size < 0) return;
    if (size > KN_CONSOLE_LINE - 1) size = KN_CONSOLE_LINE - 1;
    line[size] = '\n'; // the newline replaces the text's NUL
    say(fd, line, (size_t)size + 1);
}

void kn_console_lines(int fd, const char *text)
{
    for (size_t size; *text; text += size) {
        const char *end = strchr(text, '\n');
        size = end ? (size_t)(end + 1 - text) : strlen(text);
        if (size > KN_CONSOLE_LINE) size = KN_CONSOLE_LINE;
        say(fd, text, size);
    }
}

bool kn_console_complete(int fd) { return !atomic_load(&failed[fd]) && atomic_load(&dropped[fd]) == 0; }

int kn_console_end(const char *program, int code)
{
    // Evaluate both fflush and ferror (hence | and not ||), because fflush alone does not report an earlier error.
    if (!(fflush(stdout) | ferror(stdout)) && kn_console_complete(STDOUT_FILENO)) return code;
    kn_console_err("%s: standard output could not be written completely", program);
    return code ? code : 3;
}

bool kn_refuse(char *error, size_t error_size, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(error, error_size, format, arguments);
    va_end(arguments);
    return false;
}
