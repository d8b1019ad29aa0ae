#include "server/console.h"
#include "tests/check.h"
#include <fcntl.h>
#include <poll.h>
#include <string.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

// A child process writes to stderr or stdout. The other end is a pipe or a terminal with a reader in the test.
typedef struct listener {
    int reads, writes;
} listener;

static listener by_pipe(void)
{
    int ends[2];
    CHECK(pipe(ends) == 0);
    return (listener){ends[0], ends[1]};
}

static listener by_terminal(void)
{
    int master = posix_openpt(O_RDWR | O_NOCTTY);
    CHECK(master >= 0 && grantpt(master) == 0 && unlockpt(master) == 0);
    return (listener){master, open(ptsname(master), O_RDWR | O_NOCTTY)};
}

static pid_t speak(listener at, int fd, int (*says)(int fd))
{
    fflush(stdout);
    pid_t child = fork();
    if (child == 0) {
        alarm(20); // ends the child if it is held up
        close(at.reads);
        dup2(at.writes, fd);
        kn_console_start();
        _exit(says(fd));
    }
    close(at.writes);
    return child;
}

static int ended(pid_t child)
{
    int status = -1;
    waitpid(child, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

static int says_much(int fd)
{
    (void)fd;
    for (int i = 0; i < 2000; i++) kn_console_err("line %d %0400d", i, 0);
    return kn_console_complete(STDERR_FILENO) ? 1 : 0;
}

static char text[1 << 20];

static void hear(int reads)
{
    ssize_t got;
    size_t size = 0;
    while ((got = read(reads, text + size, sizeof text - 1 - size)) > 0) size += (size_t)got;
    text[size] = '\0';
}

TEST("a pipe and a terminal without a reader do not block the writer, and the lines that arrive are whole")
{
    listener (*const by[])(void) = {by_pipe, by_terminal};
    for (int i = 0; i < 2; i++) {
        listener to = by[i]();
        CHECK(ended(speak(to, STDERR_FILENO, says_much)) == 0);
        hear(to.reads);
        int lines = 0, next = 0, lost, told = 0; // a terminal has room again once its driver has worked
        // whether the previous line was whole; a whole line that lacked only its newline may also be counted as lost
        bool whole = false, counted = false;
        for (char *line = strtok(text, "\n"); line; line = strtok(NULL, "\n")) {
            if (sscanf(line, "kneadd: %d lines", &lost) == 1 && strstr(line, "read them")) {
                next += lost - told; // the previous line lacked only its newline, and is included in the next count
                told = lost;
                counted |= whole;
                whole = false;
                continue;
            }
            // a torn line is one of the lost ones
            if (!strchr(line, ' ') || strspn(strrchr(line, ' ') + 1, "0") != 400) continue;
            int number = atoi(line + 5);
            CHECK((number == next || (counted && number == next - 1)) && ++lines);
            next = number + 1;
            told = 0;
            whole = true;
            counted = false;
        }
        CHECK(lines > 5 && lines < 2000);
        close(to.reads);
    }
}

static int says_again(int fd)
{
    char go;
    for (int i = 0; i < 500; i++) kn_console_err("line %d %0400d", i, 0);
    if (write(STDOUT_FILENO, "!", 1) != 1 || read(STDIN_FILENO, &go, 1) != 1) return 2;
    kn_console_err("read again");
    kn_console_err("and again");
    return kn_console_complete(fd) ? 0 : 1;
}

TEST("dropped lines are counted once, in the line before the next one")
{
    listener to = by_pipe(), go = by_pipe(), done = by_pipe();
    int in = dup(STDIN_FILENO), out = dup(STDOUT_FILENO);
    dup2(go.reads, STDIN_FILENO), dup2(done.writes, STDOUT_FILENO);
    pid_t child = speak(to, STDERR_FILENO, says_again);
    dup2(in, STDIN_FILENO), dup2(out, STDOUT_FILENO);
    char word;
    CHECK(read(done.reads, &word, 1) == 1);
    ssize_t size = read(to.reads, text, sizeof text - 1); // everything written so far
    text[size] = '\0';
    int heard = 0, dropped = 0;
    for (const char *at = text; (at = strstr(at, "line ")); at++) heard++;
    CHECK(write(go.writes, "!", 1) == 1);
    hear(to.reads);
    CHECK(sscanf(text, "kneadd: %d lines before this one were not written", &dropped) == 1);
    CHECK(heard > 0 && heard + dropped == 500);
    CHECK_STR(strchr(text, '\n'), "\nread again\nand again\n");
    CHECK(ended(child) == 0);
    close(in), close(out), close(to.reads), close(go.reads), close(go.writes), close(done.reads), close(done.writes);
}

static int says_to_nobody(int fd)
{
    struct pollfd left = {.fd = fd};
    if (poll(&left, 1, 10000) != 1) return 2; // wait until the reader has gone
    kn_console_out("a line");
    return kn_console_complete(fd) ? 1 : 0;
}

TEST("a reader that has gone does not end the writer, and the loss is reported on request")
{
    listener to = by_pipe();
    pid_t child = speak(to, STDOUT_FILENO, says_to_nobody);
    close(to.reads);
    CHECK(ended(child) == 0);
}

static int says_long(int fd)
{
    char *lines = malloc(10000);
    memset(lines, 'x', 10000);
    strcpy(lines + 8999, "\nsecond\n");
    kn_console_lines(fd, lines);
    kn_console_err("%s", lines); // cut to its maximum length
    return 0;
}

TEST("lines arrive unchanged, even those longer than one write; a formatted line is cut at its maximum")
{
    listener to = by_pipe();
    CHECK(ended(speak(to, STDERR_FILENO, says_long)) == 0);
    hear(to.reads);
    CHECK(strspn(text, "x") == 8999 && strncmp(text + 8999, "\nsecond\n", 8) == 0);
    CHECK(strspn(text + 9007, "x") == KN_CONSOLE_LINE - 1);
    CHECK_STR(text + 9007 + KN_CONSOLE_LINE - 1, "\n");
    close(to.reads);
}

TESTS_MAIN
