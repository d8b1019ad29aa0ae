#include "server/command.h"
#include "tests/check.h"
#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#define EXPECTED "expected reset, or quality and one of fast, balanced, accurate or own, and a newline\n"
static char told[4096];     // what the last feed complained
static const char *quality; // the point it asked for, "": none

static bool feed(kn_command *c, const char *bytes, size_t size)
{
    FILE *stream = fmemopen(told, sizeof told, "w");
    kn_orders orders = kn_command_feed(c, bytes, size, stream);
    fputc('\0', stream);
    fclose(stream);
    quality = orders.take ? kn_quality_name(orders.quality) : "";
    return orders.reset;
}

static bool say(kn_command *c, const char *text)
{
    return feed(c, text, strlen(text));
}

static int lines(void)
{
    int n = 0;
    for (const char *at = told; (at = strchr(at, '\n')); at++) n++;
    return n;
}

TEST("reset is a command once its line has ended, however it comes in pieces")
{
    kn_command c = {.fd = -1};
    CHECK(say(&c, "reset\n") && lines() == 0);
    CHECK(!say(&c, "re") && !say(&c, "set") && say(&c, "\n") && lines() == 0);
    CHECK(say(&c, "reset\nreset\nreset\nres") && lines() == 0);
    CHECK(say(&c, "et\n") && lines() == 0);
}

TEST("quality and a name is a command, the last of several counts")
{
    kn_command c = {.fd = -1};
    CHECK(!say(&c, "quality fast\n") && lines() == 0);
    CHECK_STR(quality, "fast");
    CHECK(say(&c, "quality fast\nreset\nquality own\n") && lines() == 0);
    CHECK_STR(quality, "own");
    CHECK(!say(&c, "quality\nquality \nquality  fast\nquality best\nqualityfast\nquality fast \n") && lines() == 6);
    CHECK_STR(quality, "");
}

TEST("every other line is told once, shown as far as it can be, and does nothing")
{
    kn_command c = {.fd = -1};
    CHECK(!say(&c, "resett\n"));
    CHECK_STR(told, "kneadd: command 'resett': " EXPECTED);
    CHECK(!feed(&c, "reset\0\n", 7));
    CHECK_STR(told, "kneadd: command 'reset?': " EXPECTED);
    CHECK(!say(&c, "RESET\n reset\nreset \nreset\r\n\n") && lines() == 5);
    CHECK(say(&c, "stop\nreset\nestop\n") && lines() == 2);
}

TEST("a line of a megabyte is one complaint, and the one after it is heard")
{
    kn_command c = {.fd = -1};
    static char many[1 << 20];
    memset(many, 'x', sizeof many);
    CHECK(!feed(&c, many, sizeof many) && lines() == 0);
    CHECK(say(&c, "\nreset\n") && lines() == 1);
    CHECK(strstr(told, "xxx...': " EXPECTED));
    CHECK(strlen(told) == strlen("kneadd: command '...': " EXPECTED) + KN_COMMAND_MAX); // no more of it than is kept
    memset(many, 'y', KN_COMMAND_MAX); // the longest line that is kept whole
    many[KN_COMMAND_MAX] = '\n';
    CHECK(!feed(&c, many, KN_COMMAND_MAX + 1) && lines() == 1 && strstr(told, "yyy': "));
}

TEST("random bytes are complaints, nothing else")
{
    kn_command c = {.fd = -1};
    unsigned random = 1;
    int resets = 0;
    for (int i = 0; i < 20000; i++) {
        char bytes[40];
        for (size_t k = 0; k < sizeof bytes; k++) bytes[k] = (char)((random = random * 1664525u + 1013904223u) >> 24);
        resets += feed(&c, bytes, (size_t)(random >> 8) % sizeof bytes);
        CHECK(c.length <= KN_COMMAND_MAX + 1);
    }
    CHECK(resets == 0);
    say(&c, "\n");
    CHECK(say(&c, "reset\n"));
}

TEST("a pipe is read without O_NONBLOCK, until its end, which is no error")
{
    int ends[2];
    char number[16], error[256] = "";
    kn_command c;
    CHECK(pipe(ends) == 0);
    snprintf(number, sizeof number, "%d", ends[0]);
    CHECK(kn_command_open(&c, number, error, sizeof error) && c.fd == ends[0]);
    CHECK(!(fcntl(ends[0], F_GETFL) & O_NONBLOCK));
    CHECK(write(ends[1], "reset\nreset\n", 12) == 12);
    CHECK(poll(&(struct pollfd){.fd = c.fd, .events = POLLIN}, 1, 0) == 1 && kn_command_read(&c).reset);
    CHECK(poll(&(struct pollfd){.fd = c.fd, .events = POLLIN}, 1, 0) == 0);
    close(ends[1]);
    CHECK(!kn_command_read(&c).reset && c.fd == -1);
}

static void refused(const char *number, const char *why)
{
    char error[256] = "", expected[256];
    kn_command c;
    snprintf(expected, sizeof expected,
             "kneadd: --command-fd %s: %s, expected the number of a pipe that is open for reading", number, why);
    CHECK(!kn_command_open(&c, number, error, sizeof error) && c.fd == -1);
    CHECK_STR(error, expected);
}

TEST("what is not a pipe that can be read is refused in one line")
{
    int ends[2];
    char number[16];
    CHECK(pipe(ends) == 0);
    snprintf(number, sizeof number, "%d", ends[1]);
    refused(number, "not open for reading");
    close(ends[0]), close(ends[1]);
    refused(number, "not open");
    int file = open("/dev/null", O_RDONLY);
    snprintf(number, sizeof number, "%d", file);
    refused(number, "not a pipe");
    close(file);
    static const char *const none[] = {"", "x", "-1", "+1", " 1", "1x", "99999999999", "99999999999999999999999"};
    for (size_t i = 0; i < sizeof none / sizeof *none; i++) refused(none[i], "no such number");
    kn_command c;
    CHECK(kn_command_open(&c, NULL, number, sizeof number) && c.fd == -1);
}

TESTS_MAIN
