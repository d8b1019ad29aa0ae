#ifndef KN_TESTS_CLIENTS_HEARD_H
#define KN_TESTS_CLIENTS_HEARD_H
// Capture the output on stdout and stderr between two calls, call a subcommand, write and read a file.
//
// A program of tests that includes this header works in an empty folder, which is removed at its end.
#include "tests/check.h"
#include <stdarg.h>
#include <stdint.h>
#include <sys/mman.h>
#include <unistd.h>
#include <wordexp.h>

__attribute__((weak)) char kn_folder[32]; // that folder; one for all files of the program

__attribute__((constructor)) static void kn_folder_enter(void)
{
    if (*kn_folder) return;
    strcpy(kn_folder, "/tmp/knead_test.XXXXXX");
    if (!mkdtemp(kn_folder) || chdir(kn_folder) != 0) exit(1);
}

__attribute__((destructor)) static void kn_folder_leave(void)
{
    char command[64];
    snprintf(command, sizeof command, "rm -rf %s", kn_folder);
    if (*kn_folder && system(command) != 0) fprintf(stderr, "%s stays behind\n", kn_folder);
    *kn_folder = '\0';
}

static char kn_heard[2][1 << 16];
static char *const kn_out = kn_heard[0], *const kn_err = kn_heard[1];
static int kn_heard_terminal[2], kn_heard_file[2];

static inline void kn_hear(void)
{
    fflush(NULL);
    for (int i = 0; i < 2; i++) {
        kn_heard_file[i] = memfd_create("heard", 0);
        kn_heard_terminal[i] = dup(i + 1);
        dup2(kn_heard_file[i], i + 1);
    }
}

static inline void kn_hear_end(void)
{
    fflush(NULL);
    for (int i = 0; i < 2; i++) {
        dup2(kn_heard_terminal[i], i + 1);
        close(kn_heard_terminal[i]);
        ssize_t n = pread(kn_heard_file[i], kn_heard[i], sizeof kn_heard[i] - 1, 0);
        kn_heard[i][n > 0 ? n : 0] = '\0';
        close(kn_heard_file[i]);
    }
}

static inline bool kn_said(const char *words) { return strstr(kn_out, words) || strstr(kn_err, words); }

// Return whether the message on stderr is one line that contains these words.
static inline bool kn_refused(const char *words)
{
    const char *end = strchr(kn_err, '\n');
    return strstr(kn_err, words) && end && !end[1];
}

// Call the main function of a subcommand with the words of a line, split and quoted as in a shell. Return its exit code.
static char kn_called[2000];
__attribute__((format(printf, 3, 4))) static inline int kn_call(int (*run)(int, char **), const char *name,
                                                                const char *format, ...)
{
    va_list args;
    va_start(args, format);
    vsnprintf(kn_called, sizeof kn_called, format, args);
    va_end(args);
    wordexp_t words = {.we_offs = 1};
    if (wordexp(kn_called, &words, WRDE_DOOFFS | WRDE_NOCMD) != 0) exit(1);
    words.we_wordv[0] = (char *)(uintptr_t)name;
    kn_hear();
    int code = run((int)words.we_wordc + 1, words.we_wordv);
    kn_hear_end();
    wordfree(&words);
    return code;
}

// Check the exit code of such a call, and that its output contains these words.
#define KN_CALLS(expected, said, run, name, ...)                                                                       \
    do {                                                                                                               \
        const int kn_code = kn_call(run, name, __VA_ARGS__);                                                           \
        if (kn_code != (expected) || !kn_said(said))                                                                   \
            KN_TEST_FAIL("%s %s: exit %d, expected %d and: %s\n%s%s", name, kn_called, kn_code, expected, said,        \
                         kn_out, kn_err);                                                                              \
    } while (0)

// Write a text. A line "@N ROW" stands for N rows, in which START+STEP or START-STEP becomes START + i STEP.
static inline void kn_rows(FILE *out, const char *lines)
{
    for (const char *line = lines, *end; *line; line = end) {
        char *row = (char *)(uintptr_t)line, *sign;
        const long rows = *line == '@' ? strtol(line + 1, &row, 10) : 1;
        end = line + strcspn(line, "\n") + (strchr(line, '\n') != NULL);
        for (long i = 0; i < rows; i++)
            for (const char *at = row + (*line == '@'); at < end;) {
                const bool digit = *line == '@' && *at >= '0' && *at <= '9';
                const double start = digit ? strtod(at, &sign) : 0;
                if (digit && (*sign == '+' || *sign == '-')) {
                    fprintf(out, "%.12g", start + (*sign == '+' ? 1 : -1) * (double)i * strtod(sign + 1, (char **)&at));
                } else if (digit) fprintf(out, "%.*s", (int)(sign - at), at), at = sign;
                else fputc(*at++, out);
            }
    }
}

static inline void kn_write(const char *path, const void *bytes, size_t size)
{
    FILE *out = fopen(path, "w");
    if (!out || fwrite(bytes, 1, size, out) != size || fclose(out) != 0) exit(1);
}

// Read a file up to `size` - 1 bytes, followed by a NUL. Return the number of bytes; 0 if there is no file.
static inline size_t kn_read(const char *path, char *bytes, size_t size)
{
    FILE *in = fopen(path, "r");
    size_t count = in ? fread(bytes, 1, size - 1, in) : 0;
    bytes[count] = '\0';
    if (in) fclose(in);
    return count;
}

#endif
