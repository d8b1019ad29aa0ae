#include "server/option_table.h"
#include "tests/check.h"
#include <unistd.h>

typedef struct options {
    bool quick, given, real;
    const char *text, *list[2];
    double number, times_s[3];
    int count, times, listed, style;
} options;

static const char *take_even(void *number, const char *text)
{
    *(int *)number = atoi(text);
    return *(int *)number % 2 ? "an even number" : NULL;
}

#define AT(member) .offset = offsetof(options, member)
static const kn_option rows[] = {
    KN_OPTION("quick", FLAG, AT(quick)),
    KN_OPTION("text", TEXT, AT(text), .given = offsetof(options, given), .letter = 't'),
    KN_OPTION("number", NUMBER, AT(number), KN_RANGE(0, 10), .belongs = "ab"),
    KN_OPTION("depth", QUANTITY, AT(number), .unit = "m", .expected = "a depth"),
    KN_OPTION("times", QUANTITY, AT(times_s), .unit = "s", .items = 3, .count = offsetof(options, times),
              .expected = "3 times"),
    KN_OPTION("list", LIST, AT(list), .count = offsetof(options, listed), .most = 2, .expected = "2 texts"),
    KN_OPTION("style", CHOICE, AT(style), .unit = "lined|solid|wire"),
    KN_OPTION("speed", EITHER, AT(real), .unit = "max|real"),
    KN_OPTION("old", RENAMED, .expected = "--text TEXT"),
    KN_OPTION("even", SPECIAL, AT(count), .take = take_even),
};

// Read a command line of words that are separated by blanks. Return the exit code. said: what is printed on stderr.
static int read_line(options *o, char experiment, const char *line, char said[200])
{
    static char copy[200];
    char *argv[20] = {"program"};
    int argc = 1, kept = dup(STDERR_FILENO);
    FILE *file = tmpfile();
    const kn_option_table table = {KN_OPTION_ROWS(rows), .help = "help\n", .experiment = experiment};
    *o = (options){0};
    snprintf(copy, sizeof copy, "%s", line);
    for (char *word = strtok(copy, " "); word; word = strtok(NULL, " ")) argv[argc++] = word;
    dup2(fileno(file), STDERR_FILENO);
    const int code = kn_options_read(&table, o, argc, argv);
    dup2(kept, STDERR_FILENO);
    close(kept);
    rewind(file);
    said[fread(said, 1, 199, file)] = 0;
    fclose(file);
    return code;
}

TEST("values go where the rows say, and options may be shortened")
{
    options o;
    char said[200];
    CHECK(read_line(&o, 'a', "--q -t word one --num=2.5 --times 1,20ms --list a --list b --sty wire --speed real",
                    said) == KN_OPTIONS_READ);
    CHECK(o.quick && o.given && !strcmp(o.text, "word") && o.number == 2.5 && o.real && o.style == 2);
    CHECK(o.times == 2 && o.times_s[0] == 1 && o.times_s[1] == 0.02 && o.listed == 2 && !strcmp(o.list[1], "b"));
    CHECK(optind == 15 && !*said); // the argument "one" is left
}

TEST("a bad value is one line, and says what was expected; an option of another experiment is unknown")
{
    static const char *const bad[][2] = {{"--number 11", "program: --number 11: expected 0 to 10\n"},
                                         {"--depth 5", "program: --depth 5: expected a depth\n"},
                                         {"--depth 0m", "program: --depth 0m: expected a depth\n"},
                                         {"--times 1,2,3,4", "program: --times 1,2,3,4: expected 3 times\n"},
                                         {"--list a --list b --list c", "program: --list c: expected 2 texts\n"},
                                         {"--style x", "program: --style x: expected lined, solid or wire\n"},
                                         {"--even 3", "program: --even 3: expected an even number\n"},
                                         {"--text", "program: --text: expected a value\n"},
                                         {"-xy", "program: -xy: unknown option; --help lists them\n"},
                                         {"--wood=1", "program: --wood=1: unknown option; --help lists them\n"},
                                         {"--sytle x", "program: --sytle: unknown option; did you mean --style?\n"},
                                         {"--t", "program: --t: could be any of --text, --times\n"},
                                         {"--quick=1", "program: --quick=1: expected no value\n"},
                                         {"--text=", "program: --text '': expected a value\n"},
                                         {"--old 1", "program: --old is now --text TEXT\n"}};
    options o;
    char said[200];
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        CHECK(read_line(&o, 'a', bad[i][0], said) == 2);
        CHECK(!strcmp(said, bad[i][1]));
    }
    CHECK(read_line(&o, 'c', "--number 2", said) == 2 &&
          !strcmp(said, "program: --number: unknown option; --help lists them\n"));
    CHECK(read_line(&o, 'b', "--number 2", said) == KN_OPTIONS_READ);
}

TESTS_MAIN
