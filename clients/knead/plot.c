#include "clients/knead/plot.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static void (*before)(int); // of SIGPIPE, while a plot is open: one at a time

FILE *kn_plot_open(const char *subcommand, const char *path, int *code)
{
    *code = KN_EXIT_DEVICE;
    if (system("command -v gnuplot >/dev/null 2>&1") != 0) {
        kn_complain(subcommand, KN_EXIT_DEVICE, "%s: not drawn, gnuplot is not installed; --csv writes the numbers",
                    path);
        return NULL;
    }
    fflush(stdout);
    int image = open(path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666), terminal = dup(STDOUT_FILENO);
    if (image < 0 || terminal < 0) {
        kn_complain(subcommand, KN_EXIT_DEVICE, "%s: %s, expected a file that can be written", path, strerror(errno));
        return NULL;
    }
    before = signal(SIGPIPE, SIG_IGN);
    dup2(image, STDOUT_FILENO);
    FILE *f = popen("gnuplot 2>/dev/null", "w");
    dup2(terminal, STDOUT_FILENO);
    close(image);
    close(terminal);
    if (!f) kn_plot_close(f, subcommand, path);
    return f;
}

int kn_plot_close(FILE *f, const char *subcommand, const char *path)
{
    int code = f ? pclose(f) : -1;
    signal(SIGPIPE, before);
    return code == 0 ? KN_EXIT_OK : kn_complain(subcommand, KN_EXIT_DEVICE, "%s: gnuplot could not draw it", path);
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
