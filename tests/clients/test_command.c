#include "clients/cli/command.h"
#include "tests/check.h"
#include <poll.h>
#include <pty.h>
#include <unistd.h>

static char *line(double done, double elapsed_s)
{
    static char text[KN_PROGRESS_LINE];
    kn_progress p = {.what = "film", .total = 200};
    kn_progress_line(&p, done, elapsed_s, text);
    return text;
}

TEST("the bar shows the share that is done, and the remaining time appears once it can be estimated")
{
    CHECK_STR(line(0, 0), "film  [                    ]   0 %");
    CHECK_STR(line(3, 1), "film  [                    ]   1 %");
    CHECK_STR(line(50, 10), "film  [#####               ]  25 %  30 s left");
    CHECK_STR(line(20, 100), "film  [##                  ]  10 %  15 min left");
    CHECK_STR(line(200, 10), "film  [####################] 100 %  0 s left");
    CHECK_STR(line(1e9, 10), "film  [####################] 100 %  0 s left");
}

// Show a thousand steps on this file, and return what can be read at its other end. The kernel delivers output to a
// terminal with a delay: read until nothing arrives for half a second.
static size_t shown(int to, int from, char *text, size_t size)
{
    struct pollfd wait = {.fd = from, .events = POLLIN};
    size_t n = 0;
    int kept = dup(STDERR_FILENO);
    dup2(to, STDERR_FILENO);
    kn_progress p = kn_progress_open("work", 1000);
    for (int i = 0; i <= 1000; i++) kn_progress_step(&p, i);
    kn_progress_close(&p);
    fflush(stderr);
    dup2(kept, STDERR_FILENO);
    close(kept);
    while (n + 1 < size && poll(&wait, 1, 500) > 0) n += (size_t)fmax(0, (double)read(from, text + n, size - 1 - n));
    text[n] = '\0';
    return n;
}

TEST("a terminal shows a few of a thousand steps and a cleared line at the end, and a pipe shows nothing")
{
    int master, slave, pipes[2];
    static char text[4000];
    if (openpty(&master, &slave, NULL, NULL, NULL) != 0) SKIP("no pseudo terminal here");
    size_t n = shown(slave, master, text, sizeof text);
    CHECK(strncmp(text, "\rwork  [", 8) == 0);
    CHECK(n > 72 && text[n - 1] == '\r' && strspn(text + n - 71, " ") == 70);
    CHECK(n < 12 * 71);
    CHECK(pipe(pipes) == 0);
    CHECK(shown(pipes[1], pipes[0], text, sizeof text) == 0);
}

TESTS_MAIN
