#include "clients/cli/plot.h"
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "clients/cli/output.h"
#include <errno.h>
#include <limits.h>
#include <signal.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

extern const char plot_gp[]; // the file plot.gp of the source tree, embedded in the program
__asm__(".section .rodata\nplot_gp: .incbin \"" KN_CLIENTS_DIR "/cli/plot.gp\"\n.byte 0\n.previous\n");

const char *const kn_plot_colour[KN_PLOT_COLOURS] = {"0072b2", "d55e00", "000000", "009e73",
                                                     "e69f00", "cc79a7", "56b4e9", "777777"};

static void (*before)(int); // handler of SIGPIPE before the plot was opened; one plot is open at a time
static int said = -1;       // memory file with gnuplot's standard error: warnings, and the reason why gnuplot ended
static int drawn = -1;      // memory file with the image; gnuplot itself does not report failed writes

static int find_gnuplot(const char *subcommand, const char *path)
{
    if (system("command -v gnuplot >/dev/null 2>&1") == 0) return KN_EXIT_OK;
    return kn_complain(subcommand, KN_EXIT_DEVICE, "%s: not drawn, gnuplot is not installed; --csv writes the numbers",
                       path);
}

int kn_plot_try(const char *subcommand, const char *path)
{
    int code = find_gnuplot(subcommand, path);
    return code == KN_EXIT_OK ? kn_output_try(subcommand, path) : code;
}

FILE *kn_plot_open(const char *subcommand, const char *path, int wide, int high, int *code)
{
    if ((*code = find_gnuplot(subcommand, path)) != KN_EXIT_OK) return NULL;
    // Flush stdout before gnuplot starts, so that gnuplot's output does not mix with buffered text.
    fflush(stdout);
    if ((*code = kn_output_try(subcommand, path)) != KN_EXIT_OK) return NULL;
    *code = KN_EXIT_DEVICE;
    // Save this program's standard output and standard error. Both are replaced while gnuplot starts, because gnuplot
    // inherits them.
    int terminal = dup(STDOUT_FILENO), errors = dup(STDERR_FILENO);
    said = memfd_create("gnuplot", MFD_CLOEXEC);
    drawn = memfd_create("picture", MFD_CLOEXEC);
    if (terminal < 0 || errors < 0 || said < 0 || drawn < 0) {
        kn_complain(subcommand, KN_EXIT_DEVICE, "%s: %s, expected a file that can be written", path, strerror(errno));
        return NULL;
    }
    // gnuplot may end early. Writing to its pipe must then fail instead of killing this process.
    before = signal(SIGPIPE, SIG_IGN);
    dup2(drawn, STDOUT_FILENO);
    dup2(said, STDERR_FILENO);
    FILE *f = popen("exec gnuplot", "w");
    dup2(terminal, STDOUT_FILENO);
    dup2(errors, STDERR_FILENO);
    close(terminal);
    close(errors);
    if (!f) kn_plot_close(f, subcommand, path);
    else fprintf(f, "wide = %d\nhigh = %d\n%s", wide, high, plot_gp);
    return f;
}

enum { WORDS = 300 }; // size of the text that explains why gnuplot failed

// Describe how gnuplot ended, with the last line of its standard error.
static void explain(int status, char *text, size_t size)
{
    char words[4096] = "";
    ssize_t n = pread(said, words, sizeof words - 1, 0);
    const char *last = "nothing";
    for (char *line = n > 0 ? strtok(words, "\n") : NULL; line; line = strtok(NULL, "\n"))
        // Skip empty lines, and lines that contain only a '^' under the column of an error.
        if (line[strspn(line, " \t^")]) last = line + strspn(line, " \t");
    if (status >= 0 && WIFSIGNALED(status))
        snprintf(text, size, "ended by signal %d, said: %s", WTERMSIG(status), last);
    else snprintf(text, size, "exit %d, said: %s", status < 0 ? -1 : WEXITSTATUS(status), last);
}

// Copy the image from memory into its file. On failure return false with the reason in `error`.
static bool deliver(const char *path, char *error, size_t error_size)
{
    kn_beside out;
    const size_t size = (size_t)lseek(drawn, 0, SEEK_END);
    errno = ENODATA; // reason to report if gnuplot drew nothing
    void *image = size > 0 ? mmap(NULL, size, PROT_READ, MAP_SHARED, drawn, 0) : MAP_FAILED;
    const bool ready = image != MAP_FAILED && kn_beside_write(&out, path);
    if (ready) fwrite(image, 1, size, out.file);
    else snprintf(error, error_size, "%s: %s", path, strerror(errno));
    if (image != MAP_FAILED) munmap(image, size);
    return ready && kn_beside_keep(&out, error, error_size);
}

int kn_plot_close(FILE *f, const char *subcommand, const char *path)
{
    char why[PATH_MAX] = "";
    int status = f ? pclose(f) : -1;
    if (status != 0) explain(status, why, WORDS);
    const bool ok = status == 0 && deliver(path, why, sizeof why);
    signal(SIGPIPE, before);
    close(drawn);
    close(said);
    drawn = said = -1;
    if (status != 0) return kn_complain(subcommand, KN_EXIT_DEVICE, "%s: gnuplot could not draw it: %s", path, why);
    return ok ? KN_EXIT_OK : kn_complain(subcommand, KN_EXIT_DEVICE, "%s, nothing drawn", why);
}

void kn_plot_quote(FILE *f, const char *text)
{
    fputc('\'', f);
    for (; *text; text++) {
        if (*text == '\'') fputs("\u2032", f);
        else fputc(*text, f);
    }
    fputc('\'', f);
}

void kn_plot_label(FILE *f, const char *what, const char *text)
{
    fprintf(f, "set %s ", what);
    kn_plot_quote(f, text ? text : "");
    fputc('\n', f);
}

void kn_plot_panels(FILE *f, const char *title)
{
    fputs("set multiplot title ", f);
    kn_plot_quote(f, title);
    fputs(" font 'sans,13'\n", f);
}

void kn_plot_legend(FILE *f, bool objects, int rows, int high)
{
    fprintf(f,
            "unset title\nunset xlabel\nunset ylabel\nunset border\nunset tics\nunset grid\nunset logscale\n%s"
            "set lmargin 0\nset rmargin 0\nset tmargin 0\nset bmargin 0\nset origin 0,0\nset size 1,%g\n"
            "set xrange [0:1]\nset yrange [0:1]\nset key noopaque inside center center maxrows %d\nplot ",
            objects ? "unset object\n" : "", (double)(KN_PLOT_ROW * rows + 8) / high, rows);
}
